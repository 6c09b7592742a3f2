// What the page holds: one object of words and small numbers, and blocks of values beside it.

export interface Channel {
  block: string;
  low: number; // value of code 0
  step: number;
  hold: number; // a longer time without a value breaks the line, s
}

export interface Line {
  label: string;
  colour: string; // name of a variable of the page's style
  channel?: string;
  sd?: string; // channel of its standard deviation
  y?: (number | null)[];
  dash?: boolean;
}

export interface Chart {
  kind: "time" | "points" | "spectrum" | "flags";
  unit: string;
  lines: Line[];
  period?: [number, number]; // both ends of an angle's circle
  compass?: boolean; // an angle that is said from 0 to 360
  limit?: number;
  floor?: number;
  x?: number[];
  xlabel?: string;
  rows?: { label: string; colour: string; runs: [number, number][] }[];
}

export interface Subject {
  rows: number;
  t: { first: number; step: number } | { block: string };
  breaks: number[];
  begin: number;
  end: number;
  epoch: number | null; // unix time of t = 0, s
  channels: Record<string, Channel>;
  charts: Chart[];
}

export interface Words {
  time: string;
  clock: string;
  utc: string;
}

export interface Page {
  subjects: Subject[];
  words: Words;
}

function bytes(id: string): Uint8Array {
  const element = document.getElementById(id);
  const text = element?.textContent ?? "";
  const raw = atob(text);
  const found = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) found[i] = raw.charCodeAt(i);
  element?.remove(); // it is held once
  return found;
}

/** Times and codes of a recording, unpacked when they are asked for. */
export class Values {
  readonly t: Float64Array;
  readonly broken: Uint8Array;
  private readonly codes = new Map<string, Int16Array>();

  constructor(private readonly subject: Subject) {
    if ("block" in subject.t) {
      this.t = new Float64Array(bytes(subject.t.block).buffer);
    } else {
      const { first, step } = subject.t;
      this.t = Float64Array.from({ length: subject.rows }, (_, i) => first + i * step);
    }
    this.broken = new Uint8Array(subject.rows);
    for (const row of subject.breaks) this.broken[row] = 1;
  }

  of(name: string): Int16Array {
    let found = this.codes.get(name);
    if (!found) {
      const channel = this.subject.channels[name];
      found = channel ? new Int16Array(bytes(channel.block).buffer) : new Int16Array(this.subject.rows).fill(NONE);
      this.codes.set(name, found);
    }
    return found;
  }

  channel(name: string): Channel {
    return this.subject.channels[name] ?? { block: "", low: 0, step: 1, hold: Infinity };
  }

  /** First row at or after a time. */
  at(time: number): number {
    let low = 0;
    let high = this.t.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if ((this.t[middle] as number) < time) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /** Value of a channel at the sample nearest to a time; null where it has none nearby. */
  nearest(name: string, time: number): number | null {
    const codes = this.of(name);
    const { low, step, hold } = this.channel(name);
    const after = this.at(time);
    let best = -1;
    for (let reach = 0; reach < 64 && best < 0; reach++) {
      for (const row of [after - 1 - reach, after + reach]) {
        if (row < 0 || row >= codes.length || codes[row] === NONE) continue;
        if (best < 0 || Math.abs((this.t[row] as number) - time) < Math.abs((this.t[best] as number) - time)) best = row;
      }
    }
    if (best < 0 || Math.abs((this.t[best] as number) - time) > hold) return null;
    return low + step * (codes[best] as number);
  }
}

/** Code of a value that is not known. */
export const NONE = -32768;
