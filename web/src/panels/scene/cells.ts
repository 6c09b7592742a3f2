// The sphere of directions of a guided calibration: cells of what is nearest, and what each of them is now.
import { added, cross, dot, scaled, unit, type Vec } from "./frames";

export type Standing = "seen" | "missing" | "here" | "goal";

/** Region that a direction is nearest to; −1 without any. */
export function regionOf(direction: Vec, regions: readonly Vec[]): number {
  let best = -1;
  let most = -Infinity;
  regions.forEach((region, k) => {
    const along = dot(direction, region);
    if (along > most) [best, most] = [k, along];
  });
  return best;
}

/** What a region is: the goal before all, then where the unit is, then whether it was seen. */
export function standingOf(k: number, filled: readonly boolean[] | null, here: number | null, goal: number | null): Standing {
  if (k === goal) return "goal";
  if (k === here) return "here";
  return filled?.[k] ? "seen" : "missing";
}

const WIDE = 4; // of the tangent plane, in which a cell is cut out
const PIECES = 6;

/** Outline on the unit sphere of all that is nearer to a region than to any other. */
export function cellOf(k: number, regions: readonly Vec[]): Vec[] {
  const centre = regions[k]!;
  const east = unit(cross(Math.abs(centre[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0], centre))!;
  const north = cross(centre, east);
  let outline: [number, number][] = [[-WIDE, -WIDE], [WIDE, -WIDE], [WIDE, WIDE], [-WIDE, WIDE]];
  regions.forEach((other, j) => {
    if (j === k) return;
    // Nearer to the centre than to the other: (centre − other) · (centre + a east + b north) ≥ 0.
    const apart = added(centre, scaled(other, -1));
    outline = cut(outline, dot(apart, centre), dot(apart, east), dot(apart, north));
  });
  const corners = outline.map(([a, b]) => unit(added(centre, added(scaled(east, a), scaled(north, b))))!);
  return corners.flatMap((corner, i) => {
    const next = corners[(i + 1) % corners.length]!;
    return Array.from({ length: PIECES }, (_, n) => unit(added(scaled(corner, 1 - n / PIECES), scaled(next, n / PIECES)))!);
  });
}

function cut(outline: [number, number][], c: number, a: number, b: number): [number, number][] {
  const kept: [number, number][] = [];
  outline.forEach((point, i) => {
    const next = outline[(i + 1) % outline.length]!;
    const [here, there] = [c + a * point[0] + b * point[1], c + a * next[0] + b * next[1]];
    if (here >= 0) kept.push(point);
    if (here >= 0 !== there >= 0) {
      const share = here / (here - there);
      kept.push([point[0] + share * (next[0] - point[0]), point[1] + share * (next[1] - point[1])]);
    }
  });
  return kept;
}

/** How a step of a guide is put: a label with # for what varies, and what varies. */
export interface Step {
  label: string;
  parts: string[];
}

const TURN = /^turn it about its ([xyz]) axis by about (\d+)°, ([xyz]) towards ([xyz])/;
const POSE = /^hold it with its ([xyz]) axis (45° )?(up|down)(?: and its ([xyz]) axis 45° (up|down))?, and keep it still/;
const LEAVE = /^leave the unit untouched: ([\d.]+) of (\d+) s$/;

/** Words of a guide's next step in parts, so that they can be said in another language. */
export function stepOf(words: string): Step {
  const turn = TURN.exec(words.replace(/^tilt it: /, ""));
  if (turn) return { label: "Turn about its # axis by #°, # towards #", parts: turn.slice(1, 5) };
  const pose = POSE.exec(words);
  if (pose?.[4]) return { label: "Hold it with # and # at 45°, still for 2 s", parts: [`${arrow(pose[3]!)}${pose[1]!}`, `${arrow(pose[5]!)}${pose[4]}`] };
  if (pose) return { label: `Hold it with its # axis ${pose[3]!}, still for 2 s`, parts: [pose[1]!] };
  const leave = LEAVE.exec(words);
  if (leave) return { label: "Leave the unit untouched: # of # s", parts: leave.slice(1, 3) };
  return { label: KNOWN[words] ?? words, parts: [] };
}

const arrow = (way: string): string => (way === "up" ? "↑" : "↓");

const KNOWN: Record<string, string> = {
  "turn it slowly about all its axes": "Turn it slowly about all its axes",
  "turn it slowly": "Turn it slowly",
  "hold the unit still in another pose": "Hold the unit still in another pose",
  "wait for the accelerometer": "Wait for the accelerometer",
  "keep it still until it counts, about 2 s": "Keep it still until it counts, about 2 s",
  "let go of it, or hold it still": "Let go of it, or hold it still",
  "done": "Done: finish to make the card",
};

/** A label whose # are filled in their order. */
export function filledIn(label: string, parts: readonly (string | number)[]): string {
  let k = 0;
  return label.replace(/#/g, () => String(parts[k++] ?? "#"));
}
