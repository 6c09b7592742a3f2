// Rows of the charts, the last ten minutes of them, in columns that lie in one piece of memory each.
import type { Column } from "./messages";
import type { Rows } from "./panel";

/** How far back the charts reach, s. */
export const SPAN = 600;
const BYTES = 64 << 20;
const FIRST = 4096;

/** The first place in sorted times, from and to places, at which the time is not less. */
export function placeOf(t: Float64Array, from: number, to: number, time: number): number {
  let low = from;
  let high = to;
  while (low < high) {
    const middle = (low + high) >>> 1;
    if (t[middle]! < time) low = middle + 1;
    else high = middle;
  }
  return low;
}

/**
 * A ring of rows. What is kept lies from `first` to `end` in the arrays, in the order of time; when the end of the memory
 * is reached, it moves to the start of it.
 */
export class Store {
  t = new Float64Array(FIRST);
  flags = new Uint32Array(FIRST);
  values: Float32Array[] = [];
  first = 0;
  end = 0;
  epoch = -1;
  columns: readonly Column[] = [];
  private capacity = FIRST;

  /** Keep at most so many bytes. */
  constructor(private readonly bytes = BYTES) {}

  /** Time of the newest row, or null. */
  get newest(): number | null {
    return this.end > this.first ? this.t[this.end - 1]! : null;
  }

  /** Time of the oldest row, or null. */
  get oldest(): number | null {
    return this.end > this.first ? this.t[this.first]! : null;
  }

  get length(): number {
    return this.end - this.first;
  }

  /** Have other columns: those that stay keep their values, new ones have none so far. */
  setColumns(columns: readonly Column[]): void {
    const known = new Map(this.columns.map((column, i) => [column.key, this.values[i]!]));
    this.columns = columns;
    this.values = columns.map((column) => known.get(column.key) ?? new Float32Array(this.capacity).fill(NaN));
  }

  /** Forget all rows. */
  clear(): void {
    this.first = this.end = 0;
  }

  /**
   * Take rows, and return those of them that are new: rows that are here already, as after a connection was lost, are
   * left out. A new epoch forgets what was there.
   */
  add(rows: Rows): Rows | null {
    if (rows.values.length !== this.columns.length) return null;
    if (rows.epoch !== this.epoch) {
      this.clear();
      this.epoch = rows.epoch;
    }
    const newest = this.newest;
    const from = newest === null ? 0 : placeOf(rows.t, 0, rows.t.length, newest + 1e-9);
    const n = rows.t.length - from;
    if (n <= 0) return null;
    const fresh: Rows =
      from === 0
        ? rows
        : { epoch: rows.epoch, t: rows.t.subarray(from), flags: rows.flags.subarray(from), values: rows.values.map((column) => column.subarray(from)) };
    this.room(n);
    const kept = Math.min(n, this.capacity - this.end);
    this.t.set(fresh.t.subarray(n - kept), this.end);
    this.flags.set(fresh.flags.subarray(n - kept), this.end);
    fresh.values.forEach((column, i) => this.values[i]!.set(column.subarray(n - kept), this.end));
    this.end += kept;
    this.first = placeOf(this.t, this.first, this.end, this.t[this.end - 1]! - SPAN);
    return fresh;
  }

  /** Make room for n more rows: grow, up to the memory that there is, then lose the oldest. */
  private room(n: number): void {
    if (this.end + n <= this.capacity) return;
    const most = Math.floor(this.bytes / (12 + 4 * this.values.length));
    const needed = this.length + n;
    let capacity = this.capacity;
    while (capacity < needed * 1.25 && capacity < most) capacity *= 2;
    capacity = Math.max(this.capacity, Math.min(capacity, most));
    // Room for a quarter more, so that moving is rare.
    if (needed > capacity * 0.8 && capacity >= most) this.first = Math.max(this.first, this.end - Math.max(0, Math.floor(capacity * 0.75) - n));
    const { first, end } = this;
    if (capacity === this.capacity) {
      for (const part of [this.t, this.flags, ...this.values]) part.copyWithin(0, first, end);
    } else {
      const grown = <T extends Float64Array | Float32Array | Uint32Array>(part: T, bigger: T): T => {
        bigger.set(part.subarray(first, end));
        return bigger;
      };
      this.t = grown(this.t, new Float64Array(capacity));
      this.flags = grown(this.flags, new Uint32Array(capacity));
      this.values = this.values.map((part) => grown(part, new Float32Array(capacity)));
      this.capacity = capacity;
    }
    this.first = 0;
    this.end = end - first;
  }
}
