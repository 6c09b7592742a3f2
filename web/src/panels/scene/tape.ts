// Marks of a heading tape, which goes on past north.
import { wrap180, wrap360 } from "./frames";

export interface Mark {
  /** Degrees right of the middle. */
  at: number;
  /** Compass heading, whole degrees from 0 to 359. */
  heading: number;
  /** What stands at it; empty at small marks. */
  label: string;
}

const POINTS = ["N", "NE", "E", "SE", "S", "SW", "W", "NW"];

/** A point of the compass, or tens of degrees in three digits. */
export function headingLabel(heading: number): string {
  return heading % 45 === 0 ? POINTS[heading / 45]! : String(heading).padStart(3, "0");
}

/** Marks every `step` degrees over `span` degrees about a heading, with a label every `labelled`. */
export function tapeMarks(heading: number, span: number, step: number, labelled: number): Mark[] {
  const marks: Mark[] = [];
  for (let k = Math.ceil((heading - span / 2) / step); k * step <= heading + span / 2; k++) {
    const mark = Math.round(wrap360(k * step)) % 360;
    marks.push({ at: k * step - heading, heading: mark, label: mark % labelled === 0 || mark % 45 === 0 ? headingLabel(mark) : "" });
  }
  return marks;
}

/** Where another heading stands on a tape, degrees right of its middle. */
export const onTape = (heading: number, middle: number): number => wrap180(heading - middle);
