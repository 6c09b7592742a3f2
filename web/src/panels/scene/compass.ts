// A heading tape, and a compass card that turns under its mark.
import type { Colours } from "../../panel";
import { DEG } from "./frames";
import { headingLabel, onTape, tapeMarks } from "./tape";

export interface Course {
  /** Compass heading, degrees; null where there is none. */
  heading: number | null;
  sd: number | null;
  others: { heading: number; colour: string }[];
  /** °/s, clockwise; null where it is not known. */
  rate: number | null;
  /** The zero is arbitrary: letters of the compass would lie. */
  isFree: boolean;
}

const SPAN = 90; // degrees of the tape

const label = (mark: number, isFree: boolean): string => (isFree ? String(mark).padStart(3, "0") : headingLabel(mark));

export function drawTape(ctx: CanvasRenderingContext2D, width: number, height: number, course: Course, colours: Colours): void {
  const { heading } = course;
  const scale = width / SPAN;
  const [x, foot] = [width / 2, height - 1];
  ctx.fillStyle = colours.band;
  ctx.fillRect(0, 0, width, height);
  if (heading === null) return;
  if (course.sd !== null) {
    const half = Math.max(1, Math.min(SPAN / 2, course.sd) * scale);
    ctx.globalAlpha = 0.35;
    ctx.fillStyle = colours.amber;
    ctx.fillRect(x - half, 0, 2 * half, height);
    ctx.globalAlpha = 1;
  }
  ctx.textAlign = "center";
  ctx.textBaseline = "alphabetic";
  for (const mark of tapeMarks(heading, SPAN, width > 460 ? 2 : 5, 10)) {
    const at = x + mark.at * scale;
    const isLong = mark.heading % 10 === 0;
    ctx.strokeStyle = isLong ? colours.ink : colours.muted;
    ctx.lineWidth = isLong ? 1.8 : 1;
    line(ctx, at, foot, at, foot - (isLong ? 11 : 6));
    const isPoint = mark.heading % 45 === 0;
    if (!mark.label || (!isPoint && (mark.heading % (width > 460 ? 10 : 30) !== 0))) continue;
    ctx.fillStyle = mark.heading === 0 ? colours.red : colours.ink;
    ctx.font = isPoint && !course.isFree ? "700 15px system-ui, sans-serif" : "500 12px system-ui, sans-serif";
    ctx.fillText(label(mark.heading, course.isFree), at, foot - 15);
  }
  for (const other of course.others) {
    const at = Math.max(-SPAN / 2, Math.min(SPAN / 2, onTape(other.heading, heading)));
    triangle(ctx, x + at * scale, foot, 5, -9, other.colour, colours.paper);
  }
  triangle(ctx, x, 0, 8, 11, colours.ink, colours.paper);
  ctx.strokeStyle = colours.ink;
  ctx.lineWidth = 1.5;
  line(ctx, x, foot - 12, x, foot);
}

function line(ctx: CanvasRenderingContext2D, a: number, b: number, c: number, d: number): void {
  ctx.beginPath();
  ctx.moveTo(a, b);
  ctx.lineTo(c, d);
  ctx.stroke();
}

function triangle(ctx: CanvasRenderingContext2D, x: number, y: number, half: number, high: number, colour: string, rim: string): void {
  ctx.beginPath();
  ctx.moveTo(x - half, y);
  ctx.lineTo(x + half, y);
  ctx.lineTo(x, y + high);
  ctx.closePath();
  ctx.fillStyle = colour;
  ctx.fill();
  ctx.strokeStyle = rim;
  ctx.lineWidth = 1;
  ctx.stroke();
}

export function drawRose(ctx: CanvasRenderingContext2D, x: number, y: number, radius: number, course: Course, colours: Colours): void {
  const { heading } = course;
  const face = radius * 0.86;
  ctx.save();
  ctx.translate(x, y);
  ctx.beginPath();
  ctx.arc(0, 0, face, 0, 2 * Math.PI);
  ctx.fillStyle = colours.band;
  ctx.fill();
  ctx.strokeStyle = colours.ink;
  ctx.lineWidth = 2;
  ctx.stroke();
  if (heading !== null) {
    if (course.sd !== null) wedge(ctx, face, course.sd, colours.amber);
    card(ctx, face, heading, course.isFree, colours);
    for (const other of course.others) {
      ctx.save();
      ctx.rotate(onTape(other.heading, heading) * DEG);
      triangle(ctx, 0, -face - 1, 5, -9, other.colour, colours.paper);
      ctx.restore();
    }
  }
  turn(ctx, face, course.rate, colours);
  hull(ctx, face, colours);
  triangle(ctx, 0, -radius, radius * 0.06, radius * 0.15, colours.ink, colours.paper);
  ctx.restore();
}

function wedge(ctx: CanvasRenderingContext2D, face: number, sd: number, colour: string): void {
  const half = Math.min(180, Math.max(0.6, sd)) * DEG;
  ctx.beginPath();
  ctx.moveTo(0, 0);
  ctx.arc(0, 0, face, -Math.PI / 2 - half, -Math.PI / 2 + half);
  ctx.closePath();
  ctx.globalAlpha = 0.4;
  ctx.fillStyle = colour;
  ctx.fill();
  ctx.globalAlpha = 1;
}

function card(ctx: CanvasRenderingContext2D, face: number, heading: number, isFree: boolean, colours: Colours): void {
  ctx.textAlign = "center";
  ctx.textBaseline = "middle";
  for (let mark = 0; mark < 360; mark += 5) {
    ctx.save();
    ctx.rotate((mark - heading) * DEG);
    const isLong = mark % 10 === 0;
    ctx.strokeStyle = isLong ? colours.ink : colours.muted;
    ctx.lineWidth = isLong ? 1.6 : 1;
    line(ctx, 0, -face + 1, 0, -face * (isLong ? 0.9 : 0.94));
    if (mark % 30 === 0) {
      const isPoint = mark % 90 === 0 && !isFree;
      ctx.fillStyle = mark === 0 ? colours.red : colours.ink;
      ctx.font = `${isPoint ? 700 : 500} ${Math.max(9, face * (isPoint ? 0.17 : 0.115))}px system-ui, sans-serif`;
      ctx.fillText(isPoint ? headingLabel(mark) : String(mark / 10), 0, -face * 0.77);
    }
    ctx.restore();
  }
}

/** The body from above. */
function hull(ctx: CanvasRenderingContext2D, face: number, colours: Colours): void {
  const s = face * 0.3;
  ctx.beginPath();
  ctx.moveTo(0, -s);
  ctx.quadraticCurveTo(s * 0.5, -s * 0.25, s * 0.42, s * 0.75);
  ctx.lineTo(-s * 0.42, s * 0.75);
  ctx.quadraticCurveTo(-s * 0.5, -s * 0.25, 0, -s);
  ctx.fillStyle = colours.shade;
  ctx.fill();
  ctx.strokeStyle = colours.ink;
  ctx.lineWidth = 1.8;
  ctx.stroke();
}

const RATES = [3, 10, 30, 100, 300, 1000];

/** Smallest scale that holds a rate, °/s. */
export const rateScale = (rate: number): number => RATES.find((full) => Math.abs(rate) <= full) ?? RATES.at(-1)!;

/** Rate of turn: an arc from the mark, a third of the card at the scale's end. */
function turn(ctx: CanvasRenderingContext2D, face: number, rate: number | null, colours: Colours): void {
  if (rate === null) return;
  const share = Math.max(-1, Math.min(1, rate / rateScale(rate)));
  const start = -Math.PI / 2;
  ctx.beginPath();
  ctx.arc(0, 0, face * 0.58, start, start + share * 120 * DEG, share < 0);
  ctx.strokeStyle = colours.blue;
  ctx.lineWidth = Math.max(3, face * 0.05);
  ctx.stroke();
}
