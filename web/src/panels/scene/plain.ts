// The scene without WebGL: a wire body on a flat canvas, seen from the same camera.
import type { Colours } from "../../panel";
import { added, cross, dot, length, rotate, scaled, type Vec } from "./frames";
import { sheet } from "./dom";
import { type Drawer, figureScale, groundOf, type Label, type Options, RIM, type View } from "./view";

const CORNERS: Vec[] = [[0.75, 0.5, 0.04], [0.75, -0.5, 0.04], [-0.75, -0.5, 0.04], [-0.75, 0.5, 0.04]];
const FIELD = 38; // degrees of view, from top to bottom

export class Plain implements Drawer {
  private colours: Colours | null = null;
  private reach = 0.05;

  constructor(private readonly canvas: HTMLCanvasElement) {}

  resize(): void {
    // Every drawing looks at the canvas's size.
  }

  restyle(colours: Colours): void {
    this.colours = colours;
  }

  draw(view: View, options: Options): Label[] {
    const page = sheet(this.canvas);
    const colours = this.colours;
    if (!page || !colours) return [];
    const { ctx, width, height } = page;
    ctx.fillStyle = colours.band;
    ctx.fillRect(0, 0, width, height);
    const see = camera(options, width, height);
    const ground = groundOf(options.model);
    const line = (points: Vec[], colour: string, wide = 1, closed = false): void => {
      ctx.beginPath();
      points.forEach((point, k) => (k ? ctx.lineTo(...see(point)) : ctx.moveTo(...see(point))));
      if (closed) ctx.closePath();
      ctx.strokeStyle = colour;
      ctx.lineWidth = wide;
      ctx.stroke();
    };
    const rim = Array.from({ length: 72 }, (_, k): Vec => [RIM * Math.sin((k * Math.PI) / 36), RIM * Math.cos((k * Math.PI) / 36), ground]);
    line(rim, colours.soft, 1, true);
    line([[0, -RIM, ground], [0, RIM, ground]], colours.grid);
    line([[-RIM, 0, ground], [RIM, 0, ground]], colours.grid);
    line([[-0.12, RIM, ground], [0, RIM + 0.22, ground], [0.12, RIM, ground]], colours.red, 2, true);
    if (options.model === "arm") this.figure(view, line, colours);
    else {
      const body = (q: View["q"], colour: string, wide: number): void => {
        const turned = (v: Vec): Vec => (q ? rotate(q, v) : v);
        const top = CORNERS.map(turned);
        const below = CORNERS.map(([x, y, z]) => turned([x, y, -z]));
        line(top, colour, wide, true);
        line(below, colour, wide, true);
        top.forEach((corner, k) => line([corner, below[k]!], colour, wide));
        line([turned([0.75, 0.18, 0.04]), turned([0.98, 0, 0.04]), turned([0.75, -0.18, 0.04])], colour, wide);
      };
      if (options.ghosts) for (const ghost of view.ghosts) body(ghost.q, ghost.colour, 1.5);
      body(view.q, colours.ink, 2);
      const shades = [colours.red, colours.green, colours.blue];
      view.bodyAxes.forEach(({ direction }, k) => line([[0, 0, 0], scaled(direction, 1.25)], shades[k]!, 2));
      if (options.vectors && view.force) line([[0, 0, 0], scaled(view.force, 1.3)], colours.olive, 4);
      if (options.vectors && view.field) line([[0, 0, 0], scaled(view.field, 1.3)], colours.pink, 4);
    }
    if (options.model === "ball" && options.trail.length > 1) line(options.trail, colours.red, 2);
    const label = (text: string, at: Vec, colour: string, strong = false): Label => {
      const [x, y] = see(at);
      return { text, x, y, colour, strong };
    };
    const shades = [colours.red, colours.green, colours.blue];
    const letters = options.model === "arm" ? [] : view.bodyAxes.map(({ letter, direction }, k) => label(letter, scaled(direction, 1.36), shades[k]!, true));
    return [label(view.free ? "0°" : "N", [0, RIM + 0.36, ground], colours.red, true), ...letters];
  }

  dispose(): void {
    // Nothing is held.
  }

  private figure(view: View, line: (points: Vec[], colour: string, wide?: number) => void, colours: Colours): void {
    this.reach = figureScale(view.points, this.reach);
    const base = view.points.find((point) => point !== null) ?? [0, 0, 0];
    const place = (k: number | undefined): Vec | null => {
      const point = view.points[k ?? -1];
      return point ? scaled(added(point, scaled(base, -1)), 1.7 / this.reach) : null;
    };
    for (const [from, to] of view.lines) {
      const [a, b] = [place(from), place(to)];
      if (a && b) line([a, b], colours.blue, 4);
    }
  }
}

/** Where a point of the scene lies on the picture. */
function camera(options: Options, width: number, height: number): (point: Vec) => [number, number] {
  const back = scaled(options.camera, 1 / length(options.camera));
  const right = cross([0, 0, 1], back);
  const level = scaled(right, 1 / Math.max(1e-9, length(right)));
  const up = cross(back, level);
  const focal = Math.min(height, width) / 2 / Math.tan((FIELD * Math.PI) / 360);
  return (point) => {
    const seen = added(point, [0, 0, -options.middle]);
    const depth = Math.max(0.05, length(options.camera) - dot(seen, back));
    return [width / 2 + (focal * dot(seen, level)) / depth, height / 2 - (focal * dot(seen, up)) / depth];
  };
}
