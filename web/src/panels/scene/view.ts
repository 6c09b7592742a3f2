// What is drawn of a moment, whichever way it is drawn.
import type { Colours } from "../../panel";
import type { ModelName } from "./models";
import type { Quat, Vec } from "./frames";

export interface Ghost {
  name: string;
  q: Quat;
  colour: string;
}

/** A moment in the scene's axes: east, north, up. */
export interface View {
  q: Quat | null;
  ghosts: Ghost[];
  /** Directions of what is measured, of length 1, and their sizes where they have one. */
  force: Vec | null;
  forceSize: number;
  field: Vec | null;
  /** Letters of the navigation frame and of the body's axes, with where they point. */
  frameAxes: { letter: string; direction: Vec }[];
  bodyAxes: { letter: string; direction: Vec }[];
  /** Stick figure, m. */
  points: (Vec | null)[];
  lines: readonly (readonly number[])[];
  /** Rate about the body's own upward axis, rad/s. */
  rate: number;
  free: boolean;
}

export interface Options {
  model: ModelName;
  vectors: boolean;
  ghosts: boolean;
  trail: Vec[];
  camera: Vec;
  middle: number;
  /** Seconds that have gone by, for water. */
  time: number;
}

/** A label on the picture: what, where in pixels, in which colour. */
export interface Label {
  text: string;
  x: number;
  y: number;
  colour: string;
  strong: boolean;
}

/** What draws a view. */
export interface Drawer {
  draw(view: View, options: Options): Label[];
  resize(width: number, height: number): void;
  restyle(colours: Colours): void;
  dispose(): void;
}

export const RIM = 1.6;
/** Height of the ground under a body, in its size. */
export const GROUND = -0.95;

/** Height of the ground of a model: water and an arm's base stand at 0. */
export const groundOf = (model: ModelName): number => (model === "buoy" || model === "arm" ? 0 : GROUND);

/** A stick figure's points brought to a size of about 2, its base in the middle of the ground. */
export function figureScale(points: readonly (Vec | null)[], before: number): number {
  const base = points.find((point) => point !== null);
  if (!base) return before;
  let reach = before;
  for (const point of points) if (point) reach = Math.max(reach, Math.hypot(point[0] - base[0], point[1] - base[1], point[2] - base[2]));
  return reach;
}
