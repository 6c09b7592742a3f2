// An artificial horizon: the globe of directions about the body, seen along its nose. It has no pole at ±90° of pitch.
import { DEG, noseAndBank, type Outside, type Vec } from "./frames";

export interface Look {
  seen: Outside;
  /** Claimed 1 σ of bank and of the nose above the horizon, degrees. */
  sd: [number, number] | null;
  others: { seen: Outside; colour: string }[];
  /** Shown large: without it the numerals are left out. */
  isLarge: boolean;
}

export const VIEW = 55; // degrees from the middle to the rim
const SKY = "#1b6fae";
const EARTH = "#7a4d1a";
const WHITE = "#ffffff";
const DARK = "#10151a";
const WING = "#ffd23f";

/** Place on the dial, in its radius, of a direction with parts forward, right and up; null where it is not shown. */
export function onDial([forward, right, up]: Vec, view = VIEW): [number, number] | null {
  const angle = Math.atan2(Math.hypot(right, up), forward) / DEG;
  if (angle > view) return null;
  const side = Math.hypot(right, up) || 1;
  return [((angle / view) * right) / side, (-(angle / view) * up) / side];
}

/** How far from the middle, in degrees, the horizon lies along a ray; beyond 90 it is behind. */
export function horizonAlong(seen: Outside, angle: number): number {
  const [forward, right, up] = seen.up;
  const rises = right * Math.sin(angle) + up * Math.cos(angle);
  return Math.abs(Math.atan2(forward, -rises)) / DEG;
}

/** Direction of an elevation and a heading, as the body sees it; rad. */
export function direction(seen: Outside, elevation: number, heading: number): Vec {
  const [level, high] = [Math.cos(elevation), Math.sin(elevation)];
  const [n, e] = [level * Math.cos(heading), level * Math.sin(heading)];
  return [0, 1, 2].map((k) => high * seen.up[k]! + n * seen.north[k]! + e * seen.east[k]!) as Vec;
}

export function drawHorizon(ctx: CanvasRenderingContext2D, x: number, y: number, radius: number, look: Look, ink: string): void {
  const { seen } = look;
  const face = radius * 0.86;
  const { nose, bank } = noseAndBank(seen);
  ctx.save();
  ctx.translate(x, y);
  ctx.save();
  ctx.beginPath();
  ctx.arc(0, 0, face, 0, 2 * Math.PI);
  ctx.clip();
  earth(ctx, seen, face);
  globe(ctx, seen, face);
  ladder(ctx, look, face);
  for (const other of look.others) horizonEnds(ctx, other.seen, other.colour, face);
  if (look.sd) sigma(ctx, seen, look.sd[1], face);
  ctx.restore();
  symbol(ctx, face);
  bankScale(ctx, radius, face, ink);
  if (Math.abs(nose) < 85) {
    for (const other of look.others) bankMark(ctx, noseAndBank(other.seen).bank, other.colour, face, 5);
    if (look.sd) bankBand(ctx, bank, look.sd[0], face);
    bankMark(ctx, bank, WING, face, 9);
  }
  ctx.restore();
}

function earth(ctx: CanvasRenderingContext2D, seen: Outside, face: number): void {
  const isAbove = seen.up[0] >= 0; // the middle of the dial is sky
  ctx.fillStyle = isAbove ? SKY : EARTH;
  ctx.fillRect(-face, -face, 2 * face, 2 * face);
  const flipped: Outside = isAbove ? seen : { ...seen, up: seen.up.map((part) => -part) as Vec };
  const steps = 120;
  const edge: [number, number][] = [];
  for (let k = 0; k <= steps; k++) {
    const angle = (2 * Math.PI * k) / steps;
    const far = Math.min(VIEW + 3, rising(flipped, angle) ? 180 : horizonAlong(flipped, angle));
    edge.push([(far / VIEW) * face * Math.sin(angle), -(far / VIEW) * face * Math.cos(angle)]);
  }
  ctx.beginPath();
  edge.forEach(([a, b], k) => (k ? ctx.lineTo(a, b) : ctx.moveTo(a, b)));
  const out = ((VIEW + 3) / VIEW) * face;
  ctx.moveTo(out, 0);
  ctx.arc(0, 0, out, 0, 2 * Math.PI, true);
  ctx.fillStyle = isAbove ? EARTH : SKY;
  ctx.fill("evenodd");
  stroke(ctx, horizonLine(seen), face, WHITE, 2.5);
}

const rising = (seen: Outside, angle: number): boolean => seen.up[1] * Math.sin(angle) + seen.up[2] * Math.cos(angle) >= 0;

function horizonLine(seen: Outside): Vec[] {
  return Array.from({ length: 121 }, (_, k) => direction(seen, 0, (2 * Math.PI * k) / 120));
}

function stroke(ctx: CanvasRenderingContext2D, points: Vec[], face: number, colour: string, width: number): void {
  ctx.beginPath();
  let isDown = false;
  for (const point of points) {
    const at = onDial(point, VIEW + 4);
    if (at) {
      const [a, b] = [(at[0] * (VIEW + 4) * face) / VIEW, (at[1] * (VIEW + 4) * face) / VIEW];
      if (isDown) ctx.lineTo(a, b);
      else ctx.moveTo(a, b);
    }
    isDown = at !== null;
  }
  ctx.strokeStyle = colour;
  ctx.lineWidth = width;
  ctx.stroke();
}

/** Meridians every 30° and the circles of ±30° and ±60°, faint: what makes the ball a ball near the vertical. */
function globe(ctx: CanvasRenderingContext2D, seen: Outside, face: number): void {
  const faint = "rgba(255, 255, 255, 0.22)";
  for (let k = 0; k < 12; k++) {
    const heading = (k * Math.PI) / 6;
    stroke(ctx, Array.from({ length: 33 }, (_, n) => direction(seen, (-80 + 5 * n) * DEG, heading)), face, faint, 1);
  }
  for (const high of [-60, -30, 30, 60]) {
    stroke(ctx, Array.from({ length: 73 }, (_, n) => direction(seen, high * DEG, (n * 5 * Math.PI) / 180)), face, faint, 1);
  }
}

/** Rungs on the vertical circle through the nose, on both sides of zenith and nadir. */
function ladder(ctx: CanvasRenderingContext2D, look: Look, face: number): void {
  const { seen } = look;
  const ahead = Math.atan2(seen.east[0], seen.north[0]);
  ctx.font = `600 ${Math.max(9, face * 0.085)}px system-ui, sans-serif`;
  ctx.textAlign = "center";
  ctx.textBaseline = "middle";
  for (const side of [0, Math.PI]) {
    for (let high = -90; high <= 90; high += 5) {
      if (high === 0 || (side !== 0 && Math.abs(high) === 90)) continue;
      const wide = Math.abs(high) === 90 ? 0 : high % 10 ? 3 : 7.5;
      const middle = onDial(direction(seen, high * DEG, ahead + side));
      if (!middle || (high % 10 !== 0 && !look.isLarge)) continue;
      if (Math.abs(high) === 90) {
        pole(ctx, middle[0] * face, middle[1] * face, face, high > 0);
        continue;
      }
      const across = Math.asin(Math.min(1, Math.sin(wide * DEG) / Math.cos(high * DEG)));
      const rung = [-1, -0.5, 0, 0.5, 1].map((share) => direction(seen, high * DEG, ahead + side + share * across));
      stroke(ctx, rung, face, WHITE, high % 10 ? 1.2 : 1.8);
      if (high % 10 || (!look.isLarge && high % 20)) continue;
      for (const end of [-1, 1]) {
        const at = onDial(direction(seen, high * DEG, ahead + side + end * 1.5 * across));
        if (at) numeral(ctx, String(Math.abs(high)), at[0] * face, at[1] * face, seen);
      }
    }
  }
}

function numeral(ctx: CanvasRenderingContext2D, text: string, x: number, y: number, seen: Outside): void {
  ctx.save();
  ctx.translate(x, y);
  ctx.rotate(Math.hypot(seen.up[1], seen.up[2]) < 0.1 ? 0 : Math.atan2(seen.up[1], seen.up[2]));
  ctx.fillStyle = WHITE;
  ctx.fillText(text, 0, 0);
  ctx.restore();
}

function pole(ctx: CanvasRenderingContext2D, x: number, y: number, face: number, isZenith: boolean): void {
  ctx.beginPath();
  ctx.arc(x, y, face * 0.045, 0, 2 * Math.PI);
  ctx.lineWidth = 2;
  ctx.strokeStyle = ctx.fillStyle = WHITE;
  if (isZenith) ctx.fill();
  else ctx.stroke();
}

/** Both ends of another estimator's horizon. */
function horizonEnds(ctx: CanvasRenderingContext2D, seen: Outside, colour: string, face: number): void {
  const isEnd = (point: Vec): boolean => Math.hypot(...(onDial(point, 90) ?? [0, 0])) * 90 > 0.62 * VIEW;
  const points = horizonLine(seen);
  const far = points.map((point) => (isEnd(point) ? point : ([-1, 0, 0] as Vec)));
  stroke(ctx, far, face, DARK, 5);
  stroke(ctx, far, face, colour, 3);
}

/** The claimed 1 σ of the nose above the horizon: a bar beside the middle. */
function sigma(ctx: CanvasRenderingContext2D, seen: Outside, sd: number, face: number): void {
  const half = Math.max(1, (Math.min(sd, VIEW) / VIEW) * face);
  const turn = Math.hypot(seen.up[1], seen.up[2]) < 0.1 ? 0 : Math.atan2(seen.up[1], seen.up[2]);
  ctx.save();
  ctx.rotate(turn);
  ctx.fillStyle = "rgba(255, 210, 63, 0.35)";
  ctx.fillRect(-face * 0.2, -half, face * 0.4, 2 * half);
  ctx.restore();
}

/** The body, which stands still on its dial. */
function symbol(ctx: CanvasRenderingContext2D, face: number): void {
  const [inner, outer, drop] = [face * 0.2, face * 0.46, face * 0.075];
  ctx.lineCap = ctx.lineJoin = "round";
  for (const [colour, width] of [[DARK, face * 0.055 + 2], [WING, face * 0.038]] as const) {
    ctx.beginPath();
    ctx.moveTo(-outer, 0);
    ctx.lineTo(-inner, 0);
    ctx.lineTo(-inner, drop);
    ctx.moveTo(outer, 0);
    ctx.lineTo(inner, 0);
    ctx.lineTo(inner, drop);
    ctx.strokeStyle = colour;
    ctx.lineWidth = width;
    ctx.stroke();
    ctx.beginPath();
    ctx.arc(0, 0, width * 0.6, 0, 2 * Math.PI);
    ctx.fillStyle = colour;
    ctx.fill();
  }
  ctx.lineCap = ctx.lineJoin = "miter" as CanvasLineCap & CanvasLineJoin;
}

function bankScale(ctx: CanvasRenderingContext2D, radius: number, face: number, ink: string): void {
  ctx.strokeStyle = ink;
  ctx.beginPath();
  ctx.arc(0, 0, face, 0, 2 * Math.PI);
  ctx.lineWidth = 2;
  ctx.stroke();
  for (const mark of [-180, -150, -120, -90, -60, -45, -30, -20, -10, 10, 20, 30, 45, 60, 90, 120, 150]) {
    const angle = mark * DEG;
    const long = mark % 30 === 0 ? 0.085 : 0.05;
    ctx.beginPath();
    ctx.moveTo((face + 2) * Math.sin(angle), -(face + 2) * Math.cos(angle));
    ctx.lineTo((face + radius * long) * Math.sin(angle), -(face + radius * long) * Math.cos(angle));
    ctx.lineWidth = mark % 30 === 0 ? 2 : 1.2;
    ctx.stroke();
  }
  ctx.beginPath();
  ctx.moveTo(0, -face - 1);
  ctx.lineTo(-radius * 0.045, -face - radius * 0.1);
  ctx.lineTo(radius * 0.045, -face - radius * 0.1);
  ctx.fillStyle = ink;
  ctx.fill();
}

/** Bank to the right tips the zenith to the left. */
function bankMark(ctx: CanvasRenderingContext2D, bank: number, colour: string, face: number, size: number): void {
  ctx.save();
  ctx.rotate(-bank * DEG);
  ctx.beginPath();
  ctx.moveTo(0, -face + 1);
  ctx.lineTo(-size * 0.8, -face + size * 1.5);
  ctx.lineTo(size * 0.8, -face + size * 1.5);
  ctx.closePath();
  ctx.fillStyle = colour;
  ctx.strokeStyle = DARK;
  ctx.lineWidth = 1.5;
  ctx.fill();
  ctx.stroke();
  ctx.restore();
}

function bankBand(ctx: CanvasRenderingContext2D, bank: number, sd: number, face: number): void {
  const half = Math.min(180, Math.max(0.5, sd)) * DEG;
  const middle = -bank * DEG - Math.PI / 2;
  ctx.beginPath();
  ctx.arc(0, 0, face - 3, middle - half, middle + half);
  ctx.strokeStyle = "rgba(255, 210, 63, 0.75)";
  ctx.lineWidth = 6;
  ctx.stroke();
}
