// The sphere of directions in the unit's axes, on a flat canvas, turned by hand.
import type { Colours } from "../../panel";
import { cellOf, standingOf } from "./cells";
import { cross, dot, scaled, unit, type Vec } from "./frames";

export interface Coverage {
  regions: Vec[];
  names: readonly string[];
  filled: readonly boolean[] | null;
  here: number | null;
  goal: number | null;
  cloud: Vec[];
}

/** Where the eye is, and what is up and right of it. */
export class Eye {
  back: Vec = unit([0.75, 0.5, 0.45])!;

  /** Axes of the picture: right and up. */
  axes(): { right: Vec; up: Vec } {
    const right = unit(cross([0, 0, 1], this.back)) ?? [0, 1, 0];
    return { right, up: cross(this.back, right) };
  }

  turn(right: number, up: number): void {
    const azimuth = Math.atan2(this.back[1], this.back[0]) - right;
    const elevation = Math.max(-1.5, Math.min(1.5, Math.asin(Math.max(-1, Math.min(1, this.back[2]))) + up));
    this.back = [Math.cos(elevation) * Math.cos(azimuth), Math.cos(elevation) * Math.sin(azimuth), Math.sin(elevation)];
  }

  /** Go a share of the way to look at a direction; true as long as some of it is left. */
  follow(goal: Vec, share: number): boolean {
    const wanted: Vec = unit([goal[0], goal[1], Math.max(-0.99, Math.min(0.99, goal[2]))])!;
    // A little from the side, so that the goal's outline and its way can be seen.
    const off = dot(this.back, wanted);
    if (off > 0.9) return false;
    const step = unit([0, 1, 2].map((k) => (1 - share) * this.back[k]! + share * wanted[k]!));
    this.back = step ?? [wanted[1], wanted[2], wanted[0]];
    return true;
  }
}

export function drawSphere(ctx: CanvasRenderingContext2D, width: number, height: number, coverage: Coverage, eye: Eye, pulse: number, colours: Colours): void {
  const radius = Math.min(width, height) / 2 - 22;
  const { right, up } = eye.axes();
  const see = (v: Vec): [number, number, number] => [width / 2 + radius * dot(v, right), height / 2 - radius * dot(v, up), dot(v, eye.back)];
  dots(ctx, coverage.cloud, see, false, colours);
  axes(ctx, see, false, colours);
  coverage.regions.forEach((_, k) => patch(ctx, k, coverage, see, width, height, radius, pulse, colours));
  ctx.beginPath();
  ctx.arc(width / 2, height / 2, radius, 0, 2 * Math.PI);
  ctx.strokeStyle = colours.muted;
  ctx.lineWidth = 1.5;
  ctx.stroke();
  dots(ctx, coverage.cloud, see, true, colours);
  axes(ctx, see, true, colours);
  names(ctx, coverage, see, radius, colours);
}

type See = (v: Vec) => [number, number, number];

const outlines = new WeakMap<Vec[], Vec[][]>();

function outline(k: number, regions: Vec[]): Vec[] {
  let known = outlines.get(regions);
  if (!known) outlines.set(regions, (known = regions.map((_, j) => cellOf(j, regions))));
  return known[k]!;
}

function patch(ctx: CanvasRenderingContext2D, k: number, coverage: Coverage, see: See, width: number, height: number, radius: number, pulse: number, colours: Colours): void {
  const points = outline(k, coverage.regions).map(see);
  if (points.every(([, , depth]) => depth <= 0)) return;
  ctx.beginPath();
  points.forEach(([x, y, depth], n) => {
    // What lies behind the rim is drawn on it.
    const out = depth >= 0 ? 1 : radius / Math.max(1e-6, Math.hypot(x - width / 2, y - height / 2));
    const at: [number, number] = [width / 2 + (x - width / 2) * out, height / 2 + (y - height / 2) * out];
    if (n) ctx.lineTo(...at);
    else ctx.moveTo(...at);
  });
  ctx.closePath();
  const standing = standingOf(k, coverage.filled, coverage.here, coverage.goal);
  const isSeen = coverage.filled?.[k] ?? false;
  ctx.fillStyle = isSeen ? colours.green : colours.paper;
  ctx.globalAlpha = isSeen ? 0.62 : 0.35;
  ctx.fill();
  if (standing === "goal") {
    ctx.fillStyle = colours.amber;
    ctx.globalAlpha = 0.35 + 0.5 * pulse;
    ctx.fill();
  }
  ctx.globalAlpha = 1;
  const strong = standing === "goal" || standing === "here";
  ctx.strokeStyle = strong ? colours.ink : colours.muted;
  ctx.lineWidth = strong ? 3 : 1;
  ctx.setLineDash(standing === "goal" ? [7, 4] : []);
  ctx.stroke();
  ctx.setLineDash([]);
}

function dots(ctx: CanvasRenderingContext2D, cloud: Vec[], see: See, isFront: boolean, colours: Colours): void {
  ctx.fillStyle = colours.ink;
  ctx.globalAlpha = isFront ? 0.75 : 0.18;
  for (const point of cloud) {
    const [x, y, depth] = see(point);
    if (depth >= 0 === isFront) ctx.fillRect(x - 1, y - 1, 2, 2);
  }
  ctx.globalAlpha = 1;
}

function axes(ctx: CanvasRenderingContext2D, see: See, isFront: boolean, colours: Colours): void {
  const shades = [colours.red, colours.green, colours.blue];
  ctx.textAlign = "center";
  ctx.textBaseline = "middle";
  ctx.font = "700 14px system-ui, sans-serif";
  shades.forEach((shade, k) => {
    const axis: Vec = [0, 0, 0];
    axis[k] = 1;
    const [x, y, depth] = see(axis);
    if (depth >= 0 !== isFront) return;
    const [tx, ty] = see(scaled(axis, 1.1));
    const [lx, ly] = see(scaled(axis, 1.19));
    ctx.strokeStyle = ctx.fillStyle = shade;
    ctx.globalAlpha = isFront ? 1 : 0.5;
    ctx.lineWidth = 3;
    ctx.beginPath();
    ctx.moveTo(x, y);
    ctx.lineTo(tx, ty);
    ctx.stroke();
    ctx.fillText("xyz"[k]!, lx, ly);
    ctx.globalAlpha = 1;
  });
}

/** Marks and names of the directions that are seen from here: not by colour alone. */
function names(ctx: CanvasRenderingContext2D, coverage: Coverage, see: See, radius: number, colours: Colours): void {
  ctx.textAlign = "center";
  ctx.textBaseline = "middle";
  coverage.regions.forEach((region, k) => {
    const [x, y, depth] = see(region);
    if (depth < 0.45) return;
    const standing = standingOf(k, coverage.filled, coverage.here, coverage.goal);
    const isStrong = standing === "goal" || standing === "here";
    ctx.font = `${isStrong ? 700 : 500} ${Math.max(10, radius * (isStrong ? 0.115 : 0.095))}px system-ui, sans-serif`;
    const mark = coverage.filled?.[k] ? " ✓" : "";
    const text = `${standing === "here" ? "● " : standing === "goal" ? "◎ " : ""}${coverage.names[k] ?? ""}${mark}`;
    ctx.lineWidth = 3;
    ctx.strokeStyle = colours.paper;
    ctx.globalAlpha = 0.85;
    ctx.strokeText(text, x, y);
    ctx.globalAlpha = 1;
    ctx.fillStyle = colours.ink;
    ctx.fillText(text, x, y);
  });
}
