// A unit that shows a turn: about which of its axes, which way, how far.
import type { Colours } from "../../panel";
import { cross, DEG, dot, type Quat, rotate, unit, type Vec } from "./frames";

const BACK = unit([0.8, -0.75, 0.55])!;
const RIGHT = unit(cross([0, 0, 1], BACK))!;
const UP = cross(BACK, RIGHT);
const SIZE: Vec = [0.62, 0.42, 0.16];

const FACES: [Vec, Vec, Vec][] = [0, 1, 2].flatMap((k) =>
  [1, -1].map((sign): [Vec, Vec, Vec] => {
    const [n, a, b]: [Vec, Vec, Vec] = [[0, 0, 0], [0, 0, 0], [0, 0, 0]];
    n[k] = sign;
    a[(k + 1) % 3] = 1;
    b[(k + 2) % 3] = 1;
    return [n, a, b];
  }),
);

/** Draw the unit turned by a share of an angle, degrees, about an axis, with the arrow of its way. */
export function drawTurning(ctx: CanvasRenderingContext2D, width: number, height: number, axis: number | null, angle: number, share: number, colours: Colours): void {
  const scale = Math.min(width, height) * 0.4;
  const see = (v: Vec): [number, number] => [width / 2 + scale * dot(v, RIGHT), height / 2 - scale * dot(v, UP)];
  const half = (axis === null ? 0 : angle * share * DEG) / 2;
  const q: Quat = [Math.cos(half), 0, 0, 0];
  if (axis !== null) q[axis + 1] = Math.sin(half);
  const shades = [colours.red, colours.green, colours.blue];
  const letters = (isFront: boolean): void => {
    for (let k = 0; k < 3; k++) {
      const tip: Vec = [0, 0, 0];
      tip[k] = 1.05;
      const turned = rotate(q, tip);
      if (dot(turned, BACK) >= 0 !== isFront) continue;
      const [x, y] = see(turned);
      ctx.strokeStyle = ctx.fillStyle = shades[k]!;
      ctx.lineWidth = k === axis ? 4 : 2;
      ctx.beginPath();
      ctx.moveTo(...see([0, 0, 0]));
      ctx.lineTo(x, y);
      ctx.stroke();
      ctx.font = `700 ${k === axis ? 18 : 14}px system-ui, sans-serif`;
      ctx.textAlign = "center";
      ctx.textBaseline = "middle";
      const [lx, ly] = see(rotate(q, tip.map((part) => part * 1.16) as Vec));
      ctx.fillText("xyz"[k]!, lx, ly);
    }
  };
  letters(false);
  box(ctx, q, see, colours);
  letters(true);
  if (axis !== null) arc(ctx, axis, angle, see, colours);
}

function box(ctx: CanvasRenderingContext2D, q: Quat, see: (v: Vec) => [number, number], colours: Colours): void {
  for (const [normal, a, b] of FACES) {
    if (dot(rotate(q, normal), BACK) <= 0) continue;
    const corner = (s: number, t: number): [number, number] =>
      see(rotate(q, [0, 1, 2].map((k) => SIZE[k]! * (normal[k]! + s * a[k]! + t * b[k]!)) as Vec));
    ctx.beginPath();
    ctx.moveTo(...corner(1, 1));
    for (const [s, t] of [[1, -1], [-1, -1], [-1, 1]] as const) ctx.lineTo(...corner(s, t));
    ctx.closePath();
    ctx.fillStyle = normal[2] > 0 ? colours.shade : normal[0] > 0 ? colours.grid : colours.soft;
    ctx.fill();
    ctx.strokeStyle = colours.ink;
    ctx.lineWidth = 1.5;
    ctx.stroke();
  }
}

function arc(ctx: CanvasRenderingContext2D, axis: number, angle: number, see: (v: Vec) => [number, number], colours: Colours): void {
  const on = (turn: number): [number, number] => {
    const point: Vec = [0, 0, 0];
    point[(axis + 1) % 3] = 0.9 * Math.cos(turn);
    point[(axis + 2) % 3] = 0.9 * Math.sin(turn);
    point[axis] = 0.12;
    return see(point);
  };
  // The arc begins on the near side, where it can be seen.
  const near = Math.atan2(BACK[(axis + 2) % 3]!, BACK[(axis + 1) % 3]!);
  const sweep = Math.sign(angle || 1) * Math.max(40, Math.min(300, Math.abs(angle))) * DEG;
  const start = near - sweep / 2;
  for (const [colour, width] of [[colours.paper, 9], [colours.amber, 5]] as const) {
    ctx.strokeStyle = ctx.fillStyle = colour;
    ctx.lineWidth = width;
    ctx.lineJoin = "round";
    ctx.beginPath();
    for (let k = 0; k <= 40; k++) {
      const at = on(start + (sweep * k) / 40);
      if (k) ctx.lineTo(...at);
      else ctx.moveTo(...at);
    }
    ctx.stroke();
    const [tip, before] = [on(start + sweep + Math.sign(sweep) * 0.22), on(start + sweep - Math.sign(sweep) * 0.02)];
    const [dx, dy] = [tip[0] - before[0], tip[1] - before[1]];
    const size = Math.hypot(dx, dy) || 1;
    const [nx, ny] = [(-dy / size) * 9, (dx / size) * 9];
    ctx.beginPath();
    ctx.moveTo(before[0] + nx, before[1] + ny);
    ctx.lineTo(tip[0], tip[1]);
    ctx.lineTo(before[0] - nx, before[1] - ny);
    ctx.closePath();
    if (width === 9) ctx.stroke();
    ctx.fill();
  }
}
