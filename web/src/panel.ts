// What a panel of the page is, and what it gets. A panel draws what it is given and keeps no connection of its own.
import type { AllanCurve, Answer, Command, Guidance, Happened, Hello, Lines, State } from "./messages";

/** Rows of the charts, decoded: times in s, flags, and a column of values for each of `Hello.columns`. */
export interface Rows {
  epoch: number;
  t: Float64Array;
  flags: Uint32Array;
  values: Float32Array[];
}

/** Colours of the theme that is shown, as CSS colours. */
export interface Colours {
  paper: string; ink: string; muted: string; soft: string; grid: string; shade: string; band: string;
  blue: string; red: string; green: string; pink: string; amber: string; sky: string; olive: string;
}

/** What the page lends to its panels. */
export interface Context {
  /** Send a command; the answer says whether it was done. */
  send(command: Omit<Command, "id">): Promise<Answer>;
  /** A label in the language that is shown, by its English. */
  t(english: string, ...values: (string | number)[]): string;
  /** Colours of the theme that is shown. */
  colours(): Colours;
  /** A colour for the k-th series, readable on both themes. */
  series(k: number): string;
  /** Newest hello; null before the first. */
  hello(): Hello | null;
}

/** A part of the page. Every method may be left out; those that draw are called at most once in a frame. */
export interface Panel {
  readonly element: HTMLElement;
  hello?(hello: Hello): void;
  state?(state: State): void;
  rows?(rows: Rows): void;
  event?(event: Happened): void;
  allan?(curve: AllanCurve): void;
  guide?(guidance: Guidance): void;
  lines?(lines: Lines): void;
  /** Time has begun again: forget what was drawn. */
  clear?(): void;
  /** The samples have stopped coming, or come again: grey what is shown. */
  stale?(stale: boolean): void;
  /** Theme or language has changed: draw again. */
  restyle?(): void;
}

export type PanelFactory = (context: Context) => Panel;
