// Made by website/view_types.py of src/plumbob/viewer/messages.py: change that, then 'make pages'.
export const PROTOCOL = 1;
export const TICK = 1;
export const HISTORY = 2;

/** A column of the charts' rows. */
export interface Column {
  key: string;
  chart: string;
  label: string;
  unit: string;
  digits: number;
  source: string;
}

/** What gives an attitude. */
export interface Estimator {
  name: string;
  title: string;
  primary: boolean;
  claims: boolean;
}

/** A chain's stick figure: names of its points, and which of them are joined. */
export interface Skeleton {
  points: string[];
  lines: number[][];
}

/** First message of a connection, and again when the stream, its estimators or its columns have changed. */
export interface Hello {
  type: "hello";
  session: string;
  device: string;
  format: string;
  calibration: string;
  noise: string;
  live: boolean;
  frame: string | null;
  north: string | null;
  axes: string;
  rate: number | null;
  columns: Column[];
  raw: Column[];
  estimators: Estimator[];
  filters: string[];
  skeleton: Skeleton | null;
  guides: string[];
  regions: number[][];
  regions_names: string[];
  control: boolean;
  recording: boolean;
  duration: number | null;
  started_utc: number | null;
  gravity: number;
  version: string;
  protocol: number;
}

/** Newest attitude of an estimator; angles in degrees. */
export interface Attitude {
  q_nb: number[];
  roll: number;
  pitch: number;
  yaw: number;
  sd?: number[] | null;
  error?: number | null;
}

/** How the stream does: rates in Hz, times in s. */
export interface Link {
  rate: number | null;
  latency: number | null;
  age: number | null;
  samples: number;
  lost: number;
  gaps: number;
  junk: number;
  rejected: number;
  unusable: number;
  drift_ppm: number | null;
  clock: string;
  skipped: number;
}

/** The recording that is made: rows written, acknowledged by the disk, dropped. */
export interface Recorded {
  path: string;
  rows: number;
  acknowledged: number;
  dropped: number;
  since: number;
}

/** Where a recording is, s; how fast; whether it plays. */
export interface Playback {
  position: number;
  speed: number;
  playing: boolean;
}

/** What is the case now; it supersedes the state before it. */
export interface State {
  type: "state";
  epoch: number;
  t: number | null;
  sent: number;
  values: (number | null)[];
  raw: (number | null)[];
  flags: string[];
  attitudes: { [name: string]: Attitude };
  gravity_b: number[] | null;
  field_b: number[] | null;
  points: (number[] | null)[] | null;
  link: Link;
  recording: Recorded | null;
  text: string | null;
  playback: Playback | null;
  tared: boolean;
  guide: string | null;
}

/** An event, which queues: of the line, the recording, a mark, a flag that rose or fell, a command that was done. */
export interface Happened {
  type: "event";
  id: number;
  t: number | null;
  kind: string;
  text: string;
}

/** Overlapping Allan deviation of the stream so far; it supersedes the one before it. */
export interface AllanCurve {
  type: "allan";
  duration: number;
  tau: number[];
  deviation: { [name: string]: (number | null)[] };
}

/** How a guided calibration stands; it supersedes the one before it. */
export interface Guidance {
  type: "guide";
  kind: string;
  elapsed: number;
  still_for: number;
  filled: boolean[] | null;
  direction: number | null;
  goal: number | null;
  axis: number | null;
  angle: number | null;
  next_step: string;
  predicted: string;
  grade: string | null;
  share: number;
  warnings: string[];
  done: boolean;
  cloud: number[][];
  card?: string | null;
  refused?: string[];
}

/** New lines of the device's output, at 20 Hz of the stream's time: as `plumbob record --text` writes them. */
export interface Lines {
  type: "lines";
  lines: string[];
}

/** Answer to a command: to the page that gave it alone. */
export interface Answer {
  type: "answer";
  id: number;
  ok: boolean;
  text: string;
}

/** What a page asks for. */
export interface Command {
  id: number;
  verb: "record" | "stop" | "mark" | "tare" | "untare" | "text" | "text-stop" | "add" | "remove" | "play" | "pause" | "seek" | "speed" | "calibrate" | "calibrate-end" | "calibrate-cancel" | "allan-reset";
  name?: string;
  text?: string;
  value?: number | null;
}

export type FromServer = Hello | State | Happened | AllanCurve | Guidance | Lines | Answer;
export type Verb = Command["verb"];
