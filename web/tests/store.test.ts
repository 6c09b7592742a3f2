import { expect, test } from "vitest";
import type { Column } from "../src/messages";
import type { Rows } from "../src/panel";
import { placeOf, SPAN, Store } from "../src/store";

const column = (key: string): Column => ({ key, chart: "rate", label: key, unit: "°/s", digits: 1, source: "gyr" });

function rows(from: number, n: number, step: number, epoch = 0, columns = 1): Rows {
  const t = Float64Array.from({ length: n }, (_, i) => from + i * step);
  return { epoch, t, flags: new Uint32Array(n).fill(1), values: Array.from({ length: columns }, (_, k) => Float32Array.from(t, (time) => time + 1000 * k)) };
}

function storeOf(...keys: string[]): Store {
  const store = new Store();
  store.setColumns(keys.map(column));
  return store;
}

/** Of ten columns, with room for as many rows. */
function smallStore(most: number): Store {
  const store = new Store(most * 52);
  store.setColumns(Array.from({ length: 10 }, (_, i) => column(`c${i}`)));
  return store;
}

test("the store keeps ten minutes, in the order of time, however long it runs", () => {
  const store = storeOf("a", "b");
  for (let i = 0; i < 400; i++) store.add(rows(i * 5, 50, 0.1, 0, 2));
  expect(store.newest).toBeCloseTo(1999.9, 9);
  expect(store.newest! - store.oldest!).toBeCloseTo(SPAN, 6);
  expect(store.length).toBe(6001);
  for (const i of [store.first, store.first + 3107, store.end - 1]) {
    expect(store.values[0]![i]).toBeCloseTo(store.t[i]!, 2);
    expect(store.values[1]![i]! - store.t[i]!).toBeCloseTo(1000, 2);
  }
  for (let i = store.first + 1; i < store.end; i++) if (!(store.t[i]! > store.t[i - 1]!)) throw new Error(`not in order at ${i}`);
});

test("its memory has an end: fast rows lose the oldest first", () => {
  const store = smallStore(10_000);
  for (let i = 0; i < 25; i++) store.add(rows(i, 1000, 0.001, 0, 10));
  expect(store.t.length).toBeLessThanOrEqual(10_000);
  expect(store.length).toBeGreaterThan(5000);
  expect(store.newest).toBeCloseTo(24.999, 9);
  expect(store.values[9]![store.first]! - store.t[store.first]!).toBeCloseTo(9000, 2);
});

test("a message of more rows than there is room keeps the newest", () => {
  const store = smallStore(10_000);
  store.add(rows(0, 20_000, 0.001, 0, 10));
  expect(store.newest).toBeCloseTo(19.999, 9);
  expect(store.t[store.end - 2]).toBeCloseTo(19.998, 9);
  expect(store.length).toBe(10_000);
});

test("rows that are there already are left out, and only the new ones are handed on", () => {
  const store = storeOf("a");
  store.add(rows(0, 100, 0.1));
  expect(store.add(rows(0, 100, 0.1))).toBeNull();
  const fresh = store.add(rows(5, 100, 0.1));
  expect(store.length).toBe(150);
  expect(fresh!.t.length).toBe(50);
  expect(fresh!.values[0]![0]).toBeCloseTo(10, 5);
});

test("a new epoch begins again", () => {
  const store = storeOf("a");
  store.add(rows(100, 50, 0.1));
  store.add(rows(3, 10, 0.1, 1));
  expect([store.length, store.oldest]).toEqual([10, 3]);
});

test("other columns keep what they had, and rows of other columns are not taken", () => {
  const store = storeOf("a", "b");
  store.add(rows(0, 3, 1, 0, 2));
  store.setColumns([column("b"), column("new")]);
  expect([...store.values[0]!.slice(store.first, store.end)]).toEqual([1000, 1001, 1002]);
  expect([...store.values[1]!.slice(store.first, store.end)]).toEqual([NaN, NaN, NaN]);
  expect(store.add(rows(9, 3, 1, 0, 3))).toBeNull();
});

test("places are found by time", () => {
  const t = Float64Array.of(1, 2, 3, 4);
  expect([0, 1, 2.5, 4, 5].map((time) => placeOf(t, 0, 4, time))).toEqual([0, 0, 2, 3, 4]);
});
