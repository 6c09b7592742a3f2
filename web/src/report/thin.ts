// What is drawn of a stretch of time: every sample where they are few, the smallest and largest of each pixel column where
// they are many. Nothing that sticks out is lost, and a break stays a break.

import { NONE, type Values } from "./data";

export type Column = (number | null | undefined)[]; // null breaks a line, undefined does not
export type Drawn = [number[], ...Column[]];

interface Span {
  from: number;
  to: number;
}

/** Values of lines between two times in at most some four rows for each of so many columns; times count from `epoch`. */
export function thin(values: Values, names: string[], begin: number, end: number, columns: number, epoch = 0): Drawn {
  const from = Math.max(0, values.at(begin) - 1);
  const to = Math.min(values.t.length, values.at(end) + 1);
  const x: number[] = [];
  const ys: Column[] = names.map(() => []);
  const spans = to - from <= 3 * columns ? single(from, to) : even(values, from, to, begin, end, columns);
  const last = names.map(() => -Infinity);
  const codes = names.map((name) => values.of(name));
  const channels = names.map((name) => values.channel(name));
  for (const { from: a, to: b } of spans) {
    if (values.broken[a]) {
      x.push(epoch + (values.t[a] as number));
      for (const y of ys) y.push(null);
      continue;
    }
    const t0 = values.t[a] as number;
    const t1 = values.t[b - 1] as number;
    const one = b - a === 1;
    x.push(epoch + t0);
    if (!one) x.push(epoch + t1);
    for (let k = 0; k < names.length; k++) {
      const y = ys[k] as Column;
      const own = codes[k] as Int16Array;
      const channel = channels[k] as { low: number; step: number; hold: number };
      let low = -1;
      let high = -1;
      for (let i = a; i < b; i++) {
        const code = own[i] as number;
        if (code === NONE) continue;
        if (low < 0 || code < (own[low] as number)) low = i;
        if (high < 0 || code > (own[high] as number)) high = i;
      }
      if (low < 0) {
        y.push(undefined);
        if (!one) y.push(undefined);
        continue;
      }
      if (t0 - (last[k] as number) > channel.hold && y.length && y[y.length - 1] === undefined) y[y.length - 1] = null;
      last[k] = t1;
      const rising = low <= high;
      const first = channel.low + channel.step * (own[rising ? low : high] as number);
      y.push(first);
      if (!one) y.push(channel.low + channel.step * (own[rising ? high : low] as number));
    }
  }
  return [x, ...ys];
}

function* single(from: number, to: number): Generator<Span> {
  for (let i = from; i < to; i++) yield { from: i, to: i + 1 };
}

/** Rows of each column; those that break the line stand alone. */
function* even(values: Values, from: number, to: number, begin: number, end: number, columns: number): Generator<Span> {
  const width = (end - begin) / columns;
  let start = from;
  let edge = begin + width * (Math.floor(((values.t[from] as number) - begin) / width) + 1);
  for (let i = from; i < to; i++) {
    const t = values.t[i] as number;
    if (values.broken[i]) {
      if (i > start) yield { from: start, to: i };
      yield { from: i, to: i + 1 };
      start = i + 1;
    } else if (t >= edge) {
      if (i > start) yield { from: start, to: i };
      start = i;
    }
    while (t >= edge) edge += width;
  }
  if (to > start) yield { from: start, to };
}

/** One line of an angle, cut where it goes from one end of its circle to the other; others beside it are cut there, too. */
export function cut(drawn: Drawn, [low, high]: [number, number]): Drawn {
  const circle = high - low;
  const [x, y, ...others] = drawn as [number[], Column, ...Column[]];
  const found: Drawn = [[], [], ...others.map((): Column => [])];
  const push = (at: number, value: number | null | undefined, beside: (number | null | undefined)[]) => {
    found[0].push(at);
    (found[1] as Column).push(value);
    beside.forEach((one, k) => (found[k + 2] as Column).push(one));
  };
  let before: number | null | undefined = null;
  for (let i = 0; i < x.length; i++) {
    const value = y[i];
    const at = x[i] as number;
    if (typeof value === "number" && typeof before === "number" && Math.abs(value - before) > circle / 2) {
      const middle = 0.5 * (at + (x[i - 1] as number));
      const upwards = value < before;
      const none = others.map(() => null);
      push(middle, upwards ? high : low, none);
      push(middle, null, none);
      push(middle, upwards ? low : high, none);
    }
    push(at, value, others.map((one) => one[i]));
    if (value !== undefined) before = value;
  }
  return found;
}
