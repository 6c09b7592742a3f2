import { expect, test } from "vitest";
import { envelope, limits, niceStep, Points, runs } from "../src/envelope";
import { groups } from "../src/panels/charts";

const NONE = { gap: Infinity, step: Infinity };

function drawn(t: number[], values: number[], width: number, breaks = NONE): (string | [number, number])[] {
  const points = new Points();
  envelope(Float64Array.from(t), Float32Array.from(values), 0, t.length, width, breaks, points);
  return Array.from({ length: points.n }, (_, i) => (Number.isNaN(points.y[i]!) ? "break" : [points.x[i]!, points.y[i]!]));
}

test("few samples are drawn as they are", () => {
  expect(drawn([0.5, 1.5, 2.5], [1, 3, 2], 1)).toEqual([[0.5, 1], [1.5, 3], [2.5, 2]]);
});

test("of many samples each column of pixels has its smallest and largest, in the order in which they came", () => {
  expect(drawn([0.1, 0.2, 0.3, 0.4, 1.1, 1.2, 1.3], [5, 9, 1, 4, 2, 7, 3], 1)).toEqual([[0.2, 9], [0.3, 1], [1.1, 2], [1.2, 7]]);
});

test("a peak of one sample among a million stays", () => {
  const n = 1_000_000;
  const t = Float64Array.from({ length: n }, (_, i) => i / 1000);
  const values = new Float32Array(n);
  values[654_321] = 42;
  const points = new Points();
  envelope(t, values, 0, n, 1, NONE, points);
  expect([points.high, points.n]).toEqual([42, 1001]);
});

test("an angle that passes from 359° to 1° breaks the line, within a column of pixels too", () => {
  const breaks = { gap: Infinity, step: 180 };
  expect(drawn([0, 1, 2, 3], [358, 359, 1, 2], 1, breaks)).toEqual([[0, 358], [1, 359], "break", [2, 1], [3, 2]]);
  expect(drawn([0, 0.1, 0.2, 0.3], [358, 359, 1, 2], 1, breaks)).toEqual([[0, 358], [0.1, 359], "break", [0.2, 1], [0.3, 2]]);
  expect(drawn([0, 1], [0, 180], 1, breaks)).not.toContain("break");
});

test("a gap in time breaks the line, and a lone sample behind it is kept", () => {
  expect(drawn([0, 1, 5, 9], [1, 2, 3, 4], 1, { gap: 2, step: Infinity })).toEqual([[0, 1], [1, 2], "break", [5, 3], "break", [9, 4]]);
});

test("a sensor slower than the rows is one line, and one that stays away breaks it", () => {
  const t = Array.from({ length: 200 }, (_, i) => i / 100);
  const slow = t.map((_, i) => (i % 5 === 0 ? i : NaN));
  expect(drawn(t, slow, 0.001, { gap: 0.035, step: Infinity })).not.toContain("break");
  const away = slow.map((value, i) => (i > 80 && i < 140 ? NaN : value));
  expect(drawn(t, away, 0.001, { gap: 0.035, step: Infinity }).filter((point) => point === "break").length).toBe(1);
});

test("a flag's runs join where they touch, and end at a gap", () => {
  const t = Float64Array.of(0, 1, 2, 3, 10, 11);
  const found = runs(t, Uint32Array.of(1, 1, 0, 5, 1, 0), 0, 6, 0.1, 2);
  expect(Object.fromEntries(found)).toEqual({ 1: [0, 2, 3, 3, 10, 11], 4: [3, 3] });
});

test("limits hold the values, on steps, and never closer than what the digits show", () => {
  expect(limits(-0.9, 0.9, 0.1)).toEqual([-1, 1]);
  const [low, high] = limits(5.0001, 5.0002, 0.08);
  expect(high - low).toBeGreaterThanOrEqual(0.08);
  expect(limits(Infinity, -Infinity, 0.1)).toEqual([0, 1]);
  expect(limits(2, 358, 0.1, true)).toEqual([0, 360]);
  expect(limits(-179, 179, 0.1, true)).toEqual([-180, 180]);
  expect([niceStep(0.3), niceStep(20, true), niceStep(2, true)]).toEqual([0.5, 30, 2]);
});

test("charts have a strip for each angle, one for each unit, and one for all errors", () => {
  const column = (chart: string, source: string, label: string, unit: string) => ({ key: `${source}.${label}`, chart, source, label, unit, digits: 2 });
  const found = groups([
    column("rate", "gyr", "x", "°/s"), column("rate", "gyr", "y", "°/s"),
    column("residual", "acc", "|force| − g", "m/s²"), column("residual", "eskf", "force to up", "°"),
    column("attitude", "eskf", "roll", "°"), column("attitude", "eskf", "yaw", "°"), column("attitude", "reference", "roll", "°"),
    column("error", "eskf", "error", "°"), column("error", "mahony", "inclination", "°"),
  ]);
  expect(found.map(({ chart, label, columns }) => [chart, label, columns])).toEqual([
    ["attitude", "roll", [4, 6]], ["attitude", "yaw", [5]], ["error", "", [7, 8]], ["rate", "", [0, 1]],
    ["residual", "|force| − g", [2]], ["residual", "force to up", [3]],
  ]);
});
