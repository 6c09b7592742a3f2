// What is drawn of many samples: the smallest and largest of each column of pixels. A line breaks where the value is
// missing, where time has a gap, and where an angle passes from one end of its circle to the other.

/** Points of a line that grow; NaN in y ends a piece. */
export class Points {
  x = new Float64Array(1024);
  y = new Float64Array(1024);
  n = 0;
  low = Infinity;
  high = -Infinity;

  clear(): void {
    this.n = 0;
    this.low = Infinity;
    this.high = -Infinity;
  }

  add(x: number, y: number): void {
    if (this.n === this.x.length) {
      const grown = (part: Float64Array) => {
        const bigger = new Float64Array(2 * part.length);
        bigger.set(part);
        return bigger;
      };
      this.x = grown(this.x);
      this.y = grown(this.y);
    }
    this.x[this.n] = x;
    this.y[this.n++] = y;
    if (y < this.low) this.low = y;
    if (y > this.high) this.high = y;
  }

  /** End a piece. */
  break(): void {
    if (this.n && !Number.isNaN(this.y[this.n - 1]!)) this.add(this.x[this.n - 1]!, NaN);
  }
}

export interface Breaks {
  /** Longest time between two samples of a piece, s. */
  gap: number;
  /** Largest step between two samples of a piece; an angle's is 180. */
  step: number;
}

/** Usual time between two values: a sensor that is slower than the rows has none in most of them. */
function spacing(t: Float64Array, values: Float32Array | Float64Array, from: number, to: number): number {
  let absent = 0;
  for (let i = from; i < to; i++) if (values[i]! !== values[i]!) absent++;
  if (absent === 0 || absent === to - from) return 0;
  return (t[to - 1]! - t[from]!) / (to - from - absent);
}

/** Take samples from one place to another, at most two for each `width` of time and piece. */
export function envelope(
  t: Float64Array, values: Float32Array | Float64Array, from: number, to: number, width: number, breaks: Breaks, points: Points,
): void {
  points.clear();
  const gap = Math.max(breaks.gap, 3.5 * spacing(t, values, from, to));
  let column = NaN;
  let before = NaN;
  let last = NaN;
  let low = 0, high = 0, lowAt = 0, highAt = 0;
  let open = false;
  const flush = () => {
    if (!open) return;
    open = false;
    if (lowAt === highAt) return points.add(lowAt, low);
    if (lowAt < highAt) {
      points.add(lowAt, low);
      points.add(highAt, high);
    } else {
      points.add(highAt, high);
      points.add(lowAt, low);
    }
  };
  for (let i = from; i < to; i++) {
    const value = values[i]!;
    const time = t[i]!;
    if (value !== value) {
      continue;
    }
    const broken = time - last > gap || Math.abs(value - before) > breaks.step;
    const here = Math.floor(time / width);
    if (broken || here !== column) {
      flush();
      if (broken) points.break();
      column = here;
    }
    if (!open) {
      open = true;
      low = high = value;
      lowAt = highAt = time;
    } else if (value < low) {
      low = value;
      lowAt = time;
    } else if (value > high) {
      high = value;
      highAt = time;
    }
    before = value;
    last = time;
  }
  flush();
}

/** Runs of time in which a flag was set: pairs of start and end, for each bit that occurs. */
export function runs(
  t: Float64Array, flags: Uint32Array, from: number, to: number, width: number, gap: number,
): Map<number, number[]> {
  const found = new Map<number, number[]>();
  for (let i = from; i < to; i++) {
    const word = flags[i]!;
    if (word === 0) continue;
    const start = t[i]!;
    const next = i + 1 < to ? t[i + 1]! : start;
    const stop = next - start > gap ? start : next;
    for (let left = word; left !== 0; left &= left - 1) {
      const bit = left & -left;
      let run = found.get(bit);
      if (run === undefined) found.set(bit, (run = []));
      if (run.length && start - run[run.length - 1]! <= width) run[run.length - 1] = Math.max(stop, run[run.length - 1]!);
      else run.push(start, stop);
    }
  }
  return found;
}

const STEPS = [1, 2, 5, 10];
const TURNS = [15, 30, 45, 90];

/** A step of 1, 2 or 5 times a power of ten that is at least so large; of angles, of parts of a turn above 10°. */
export function niceStep(least: number, angle = false): number {
  if (angle && least > 10) return TURNS.find((step) => step >= least * 0.999999) ?? 90;
  const power = 10 ** Math.floor(Math.log10(least));
  return power * (STEPS.find((step) => step * power >= least * 0.999999) ?? 10);
}

/** Limits of an axis for values, on steps that change seldom, and never closer together than `least`. */
export function limits(low: number, high: number, least: number, angle = false): [number, number] {
  if (!(low <= high)) return [0, Math.max(least, 1)];
  const middle = (low + high) / 2;
  const half = Math.max((high - low) * 0.52, least / 2);
  const step = niceStep(half / 4, angle);
  const found: [number, number] = [Math.floor((middle - half) / step) * step, Math.ceil((middle + half) / step) * step];
  // A circle ends where it ends.
  if (angle && high - low > 180) {
    const [first, last] = low < 0 ? [-180, 180] : [0, 360];
    if (low >= first && found[0] < first) found[0] = first;
    if (high <= last && found[1] > last) found[1] = last;
  }
  return found;
}
