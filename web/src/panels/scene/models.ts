// Bodies of few faces, made here: forward is x, left y, up z, and their size about 1.
import {
  BoxGeometry,
  BufferAttribute,
  BufferGeometry,
  Color,
  ConeGeometry,
  CylinderGeometry,
  DoubleSide,
  EdgesGeometry,
  Euler,
  Group,
  LatheGeometry,
  LineBasicMaterial,
  LineSegments,
  Matrix4,
  Mesh,
  MeshLambertMaterial,
  Quaternion,
  SphereGeometry,
  TorusGeometry,
  Vector2,
  Vector3,
} from "three";

export type ModelName = "board" | "buoy" | "fin" | "ball" | "rod" | "arm" | "own";

/** A body: what is drawn, its outline for ghosts, and what a rate bends. */
export interface Model {
  group: Group;
  outline: BufferGeometry;
  bend?(tip: number): void;
}

type Place = { at?: [number, number, number]; turned?: [number, number, number] };

/** Collects coloured solids in one geometry, which is drawn in one go. */
class Solid {
  private readonly positions: number[] = [];
  private readonly colours: number[] = [];
  private whole = 0;

  /** What is added from here on is left out of the outline. */
  details(): this {
    this.whole = this.positions.length;
    return this;
  }

  add(geometry: BufferGeometry, colour: string, { at = [0, 0, 0], turned = [0, 0, 0] }: Place = {}): this {
    const place = new Matrix4().compose(new Vector3(...at), new Quaternion().setFromEuler(new Euler(...turned)), new Vector3(1, 1, 1));
    const flat = geometry.index ? geometry.toNonIndexed() : geometry;
    const points = flat.getAttribute("position").clone().applyMatrix4(place);
    const { r, g, b } = new Color(colour);
    for (let i = 0; i < points.count; i++) {
      this.positions.push(points.getX(i), points.getY(i), points.getZ(i));
      this.colours.push(r, g, b);
    }
    return this;
  }

  box(size: [number, number, number], colour: string, at: [number, number, number], turned?: [number, number, number]): this {
    return this.add(new BoxGeometry(...size), colour, turned ? { at, turned } : { at });
  }

  /** A flat arrowhead that points forward. */
  arrow(x: number, y: number, z: number, size: number, colour: string): this {
    const corners = [size, 0, 0, -size * 0.6, size * 0.7, 0, -size * 0.6, -size * 0.7, 0];
    const geometry = new BufferGeometry().setAttribute("position", new BufferAttribute(new Float32Array(corners), 3));
    return this.add(geometry, colour, { at: [x, y, z] });
  }

  model(): Model {
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(new Float32Array(this.positions), 3));
    geometry.setAttribute("color", new BufferAttribute(new Float32Array(this.colours), 3));
    geometry.computeVertexNormals();
    const group = new Group();
    group.add(new Mesh(geometry, new MeshLambertMaterial({ vertexColors: true, side: DoubleSide })));
    const main = new BufferGeometry();
    main.setAttribute("position", new BufferAttribute(new Float32Array(this.positions.slice(0, this.whole || undefined)), 3));
    return { group, outline: new EdgesGeometry(main, 24) };
  }
}

const QUARTER = Math.PI / 2;
const alongX: [number, number, number] = [0, 0, -QUARTER];
const alongZ: [number, number, number] = [QUARTER, 0, 0];
const tube = (radius: number, length: number, sides = 12, other = radius): CylinderGeometry =>
  new CylinderGeometry(radius, other, length, sides);

function board(): Model {
  const solid = new Solid().box([1.5, 1.0, 0.07], "#1d6b50", [0, 0, 0]).arrow(0.58, 0, 0.037, 0.1, "#f4f7f9");
  solid.box([0.36, 0.36, 0.09], "#23272d", [0, 0, 0.08]).details().box([0.05, 0.05, 0.01], "#d8dde2", [0.12, 0.12, 0.127]);
  solid.box([0.24, 0.3, 0.12], "#b8c0c8", [-0.68, 0, 0.09]).box([0.03, 0.22, 0.06], "#3a4047", [-0.805, 0, 0.09]);
  for (let k = 0; k < 8; k++) {
    for (const side of [-1, 1]) solid.box([0.07, 0.07, 0.09], "#c9a227", [-0.56 + 0.16 * k, side * 0.43, 0]);
  }
  for (const [x, y] of [[0.3, -0.22], [0.3, 0.22], [-0.3, 0.24], [-0.3, -0.24]] as const) solid.box([0.1, 0.05, 0.04], "#8a6d50", [x, y, 0.05]);
  return solid.model();
}

function buoy(): Model {
  const profile = [[0, -0.3], [0.42, -0.3], [0.66, -0.12], [0.7, 0.06], [0.66, 0.12]].map(([r, z]) => new Vector2(r!, z!));
  const deck = [[0.66, 0.12], [0.5, 0.24], [0, 0.24]].map(([r, z]) => new Vector2(r!, z!));
  const solid = new Solid()
    .add(new LatheGeometry(profile, 16), "#d9a400", { turned: alongZ })
    .add(new LatheGeometry(deck, 16), "#e8c24a", { turned: alongZ })
    .add(tube(0.035, 0.85, 8), "#5b6570", { at: [0, 0, 0.72], turned: alongZ })
    .details()
    .add(tube(0.14, 0.1), "#4d565f", { at: [0, 0, 0.29], turned: alongZ })
    .add(new SphereGeometry(0.085, 10, 8), "#d55e00", { at: [0, 0, 1.2] })
    .add(tube(0.05, 0.6, 8), "#5b6570", { at: [0, 0, -0.58], turned: alongZ })
    .add(new SphereGeometry(0.17, 10, 8), "#3a4149", { at: [0, 0, -0.95] });
  for (let k = 0; k < 4; k++) {
    const turn = (k + 0.5) * QUARTER;
    const about = new Euler(0, 0.45, turn, "ZYX");
    const q = new Quaternion().setFromEuler(about);
    const out = new Vector3(0.16, 0, 0.62).applyAxisAngle(new Vector3(0, 0, 1), turn);
    const panel = new Euler().setFromQuaternion(q);
    solid.box([0.03, 0.26, 0.34], "#1f3f66", [out.x, out.y, out.z], [panel.x, panel.y, panel.z]);
  }
  return solid.arrow(0.4, 0, 0.262, 0.11, "#1b1f24").model();
}

const SPAN = 11; // columns of the blade, rays of the fin
const CHORD = 8;

function fin(): Model {
  const solid = new Solid()
    .add(tube(0.16, 0.75, 12, 0.05), "#6b7a86", { at: [0.26, 0, 0], turned: [0, 0, -QUARTER] })
    .details()
    .add(tube(0.09, 0.14, 10), "#3a4149", { at: [-0.1, 0, 0], turned: alongX })
    .box([0.2, 0.14, 0.14], "#1d6b50", [0.34, 0, 0.2])
    .arrow(0.34, 0, 0.275, 0.07, "#f4f7f9");
  const root = solid.model();
  const rest: number[] = [];
  const colours: number[] = [];
  const [pale, deep] = [new Color("#4f9fcf"), new Color("#2f7fb3")];
  const at = (i: number, j: number): [number, number] => {
    const v = (2 * i) / SPAN - 1;
    const front = -0.12 - 0.62 * Math.abs(v) ** 1.4;
    const back = -0.62 - 0.42 * Math.abs(v) ** 1.2;
    return [front + (j / CHORD) * (back - front), v * (0.16 + 0.7 * Math.min(1, 0.35 + (0.65 * j) / CHORD))];
  };
  for (let i = 0; i < SPAN; i++) {
    for (let j = 0; j < CHORD; j++) {
      for (const [a, b] of [[0, 0], [1, 0], [1, 1], [0, 0], [1, 1], [0, 1]] as const) {
        const [x, z] = at(i + a, j + b);
        rest.push(x, 0, z);
        const { r, g, b: blue } = i % 2 ? deep : pale;
        colours.push(r, g, blue);
      }
    }
  }
  const blade = new BufferGeometry();
  const positions = new BufferAttribute(new Float32Array(rest), 3);
  blade.setAttribute("position", positions);
  blade.setAttribute("color", new BufferAttribute(new Float32Array(colours), 3));
  blade.computeVertexNormals();
  root.group.add(new Mesh(blade, new MeshLambertMaterial({ vertexColors: true, side: DoubleSide, flatShading: true })));
  const rim: number[] = [];
  const edge = (a: [number, number], b: [number, number]): number => rim.push(a[0], 0, a[1], b[0], 0, b[1]);
  for (let i = 0; i < SPAN; i++) for (const j of [0, CHORD]) edge(at(i, j), at(i + 1, j));
  for (const i of [0, SPAN]) edge(at(i, 0), at(i, CHORD));
  const own = root.outline.getAttribute("position").array;
  const outline = new BufferGeometry().setAttribute("position", new BufferAttribute(new Float32Array([...own, ...rim]), 3));
  return {
    group: root.group,
    outline,
    bend(tip: number): void {
      for (let k = 0; k < positions.count; k++) positions.setY(k, tip * (rest[3 * k]! + 0.1) ** 2);
      positions.needsUpdate = true;
    },
  };
}

function ball(): Model {
  const solid = new Solid();
  for (let k = 0; k < 8; k++) {
    const upper = k < 4;
    const light = (k % 2 === 0) === upper;
    // A sphere's seams run along its y axis, which is laid along z.
    const part = new SphereGeometry(0.72, 8, 8, (k % 4) * QUARTER, QUARTER, upper ? 0 : QUARTER, QUARTER);
    (k === 4 ? solid.details() : solid).add(part, light ? "#d9e2ea" : "#3d7ea6", { turned: alongZ });
  }
  return solid.add(new ConeGeometry(0.07, 0.2, 10), "#d55e00", { at: [0.8, 0, 0], turned: alongX }).model();
}

function rod(): Model {
  const solid = new Solid()
    .box([0.46, 0.26, 0.16], "#e0b400", [0, 0, 0.14])
    .add(tube(0.065, 2.1, 12), "#8b949c", { turned: alongX })
    .add(tube(0.1, 0.5, 12), "#3f7f3a", { at: [0.62, 0, 0], turned: alongX })
    .add(tube(0.1, 0.5, 12), "#3f7f3a", { at: [-0.62, 0, 0], turned: alongX })
    .details()
    .add(new TorusGeometry(0.13, 0.05, 6, 14), "#5b6570", { at: [1.14, 0, 0], turned: [QUARTER, 0, 0] })
    .add(new TorusGeometry(0.13, 0.05, 6, 14), "#5b6570", { at: [-1.14, 0, 0], turned: [QUARTER, 0, 0] })
    .box([0.08, 0.3, 0.27], "#3a4149", [0.12, 0, 0.08])
    .box([0.08, 0.3, 0.27], "#3a4149", [-0.12, 0, 0.08]);
  return solid.arrow(0.02, 0, 0.225, 0.08, "#1b1f24").model();
}

/** A model of a name; an arm is drawn by its points, and has none. */
export function modelOf(name: ModelName): Model | null {
  const makers: Partial<Record<ModelName, () => Model>> = { board, buoy, fin, ball, rod };
  return makers[name]?.() ?? null;
}

/** Lines of a globe of radius 1, every 30°. */
export function globe(): BufferGeometry {
  const points: number[] = [];
  const on = (latitude: number, longitude: number): [number, number, number] => [
    Math.cos(latitude) * Math.cos(longitude), Math.cos(latitude) * Math.sin(longitude), Math.sin(latitude),
  ];
  const pieces = 48;
  for (let k = 0; k < pieces; k++) {
    const [a, b] = [(2 * Math.PI * k) / pieces, (2 * Math.PI * (k + 1)) / pieces];
    for (let n = 0; n < 6; n++) points.push(...on(a, (n * Math.PI) / 6), ...on(b, (n * Math.PI) / 6));
    for (let n = -2; n <= 2; n++) points.push(...on((n * Math.PI) / 6, a), ...on((n * Math.PI) / 6, b));
  }
  return new BufferGeometry().setAttribute("position", new BufferAttribute(new Float32Array(points), 3));
}

/** Outline of a ghost in a colour. */
export function ghostOf(outline: BufferGeometry): LineSegments<BufferGeometry, LineBasicMaterial> {
  return new LineSegments(outline, new LineBasicMaterial({ transparent: true, opacity: 0.9 }));
}
