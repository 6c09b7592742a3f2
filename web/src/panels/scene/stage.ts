// The scene in WebGL.
import {
  AmbientLight,
  BufferAttribute,
  BufferGeometry,
  Color,
  ConeGeometry,
  CylinderGeometry,
  DirectionalLight,
  DoubleSide,
  DynamicDrawUsage,
  Group,
  HemisphereLight,
  Line,
  LineBasicMaterial,
  LineDashedMaterial,
  LineSegments,
  Mesh,
  MeshBasicMaterial,
  MeshLambertMaterial,
  MeshPhongMaterial,
  type Object3D,
  PerspectiveCamera,
  Quaternion,
  RingGeometry,
  Scene,
  SphereGeometry,
  Vector3,
  WebGLRenderer,
} from "three";

import type { Colours } from "../../panel";
import { type Vec } from "./frames";
import { ghostOf, globe, type Model, type ModelName, modelOf } from "./models";
import { type Drawer, figureScale, groundOf, type Label, type Options, RIM, type View } from "./view";

const UP = new Vector3(0, 1, 0); // of a cylinder
const TRAIL = 900;
const WAVES = 11; // rings
const WATER = 2.3;

/** Whether a browser draws WebGL by its processor alone; null where it has no WebGL. */
function drawnBy(): "card" | "processor" | null {
  const canvas = document.createElement("canvas");
  const gl = canvas.getContext("webgl2");
  if (!gl) return null;
  const about = gl.getExtension("WEBGL_debug_renderer_info");
  const name = String(gl.getParameter(about ? about.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
  gl.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software|basic render/i.test(name) ? "processor" : "card";
}

/** An arrow from the middle, or a thin line with a head. */
class Arrow {
  readonly group = new Group();
  private readonly shaft: Mesh;
  private readonly head: Mesh;
  private readonly material = new MeshBasicMaterial();

  constructor(private readonly radius: number) {
    this.shaft = new Mesh(new CylinderGeometry(radius, radius, 1, 8), this.material);
    this.head = new Mesh(new ConeGeometry(radius * 2.8, radius * 7.5, 12), this.material);
    this.group.add(this.shaft, this.head);
  }

  point(direction: Vec, length: number): void {
    const head = this.radius * 7.5;
    const shaft = Math.max(0.01, length - head);
    this.shaft.scale.y = shaft;
    this.shaft.position.y = shaft / 2;
    this.head.position.y = shaft + head / 2;
    this.group.quaternion.setFromUnitVectors(UP, new Vector3(...direction));
  }

  colour(colour: string): void {
    this.material.color.set(colour);
  }
}

export class Stage implements Drawer {
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly camera = new PerspectiveCamera(38, 1.6, 0.1, 60);
  private readonly body = new Group();
  private readonly ground = new Group();
  private readonly ghosts = new Group();
  private readonly figure = new Group();
  private readonly joints = new Group();
  private readonly links = new Group();
  private readonly arrows = {
    force: new Arrow(0.028),
    field: new Arrow(0.028),
    body: [new Arrow(0.013), new Arrow(0.013), new Arrow(0.013)],
    frame: [new Arrow(0.011), new Arrow(0.011), new Arrow(0.011)],
  };
  private readonly references: Line<BufferGeometry, LineDashedMaterial>[];
  private readonly drop: Line<BufferGeometry, LineDashedMaterial>;
  private readonly trail: Line<BufferGeometry, LineBasicMaterial>;
  private readonly sphere = new LineSegments(globe(), new LineBasicMaterial({ transparent: true, opacity: 0.7 }));
  private readonly water: Mesh<RingGeometry, MeshLambertMaterial | MeshPhongMaterial>;
  private readonly mats = { grid: new LineBasicMaterial(), rim: new LineBasicMaterial(), north: new MeshBasicMaterial({ side: DoubleSide }) };
  private readonly joint = new MeshLambertMaterial();
  private readonly link = new MeshLambertMaterial();
  private model: Model | null = null;
  private name: ModelName | null = null;
  private readonly made = new Map<ModelName, Model>();
  private size = { width: 1, height: 1 };
  private reach = 0.05;
  private bent = 0;
  private colours: Colours | null = null;

  /** None where the browser has no WebGL. */
  static on(canvas: HTMLCanvasElement): Stage | null {
    const by = drawnBy();
    if (by === null) return null;
    try {
      return new Stage(canvas, by === "processor");
    } catch {
      return null;
    }
  }

  private constructor(canvas: HTMLCanvasElement, private readonly isSlow: boolean) {
    this.renderer = new WebGLRenderer({ canvas, antialias: !isSlow, powerPreference: "low-power", stencil: false });
    this.camera.up.set(0, 0, 1);
    const sun = new DirectionalLight(0xffffff, 1.9);
    sun.position.set(-2, -3, 5);
    this.scene.add(sun, new AmbientLight(0xffffff, 0.7), new HemisphereLight(0xffffff, 0x8a8f96, 0.9));
    const dashed = (...points: Vec[]): Line<BufferGeometry, LineDashedMaterial> => {
      const line = new Line(new BufferGeometry(), new LineDashedMaterial({ dashSize: 0.07, gapSize: 0.05 }));
      stretch(line, points);
      return line;
    };
    this.references = [dashed([0, 0, 0], [0, 0, 1.5]), dashed([0, 0, 0], [0, 1.5, 0])];
    this.drop = dashed([0, 0, 0], [0, 1, 0], [0, 0, 0]);
    this.trail = new Line(new BufferGeometry(), new LineBasicMaterial({ vertexColors: true }));
    this.trail.frustumCulled = false;
    this.trail.geometry.setAttribute("position", new BufferAttribute(new Float32Array(3 * TRAIL), 3).setUsage(DynamicDrawUsage));
    this.trail.geometry.setAttribute("color", new BufferAttribute(new Float32Array(3 * TRAIL), 3).setUsage(DynamicDrawUsage));
    const waves = new RingGeometry(0.02, WATER, 40, WAVES);
    const look = { color: "#3f8ab3", transparent: true, opacity: 0.72, flatShading: true, side: DoubleSide, depthWrite: false, forceSinglePass: true };
    // Glitter costs a processor too much.
    this.water = new Mesh(waves, isSlow ? new MeshLambertMaterial(look) : new MeshPhongMaterial({ ...look, specular: "#9fc4d8", shininess: 40 }));
    this.buildGround();
    this.figure.add(this.joints, this.links);
    const { force, field, body, frame } = this.arrows;
    this.scene.add(this.ground, this.water, this.body, this.ghosts, this.figure, this.sphere, this.trail, ...this.references, this.drop);
    for (const arrow of [force, field, ...body, ...frame]) this.scene.add(arrow.group);
  }

  get isLost(): boolean {
    return this.renderer.getContext().isContextLost();
  }

  /** Take the reader's own model. */
  take(model: Model): void {
    const before = this.made.get("own");
    before?.group.traverse((part) => part instanceof Mesh && part.geometry.dispose());
    before?.outline.dispose();
    this.made.set("own", model);
    this.name = null;
  }

  get hasOwn(): boolean {
    return this.made.has("own");
  }

  resize(width: number, height: number): void {
    this.size = { width, height };
    this.renderer.setPixelRatio(this.isSlow ? 1 : Math.min(2, window.devicePixelRatio || 1));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / Math.max(1, height);
    // A narrow picture keeps the width of a square one.
    this.camera.fov = this.camera.aspect >= 1 ? 38 : 2 * (180 / Math.PI) * Math.atan(Math.tan((19 * Math.PI) / 180) / this.camera.aspect);
    this.camera.updateProjectionMatrix();
  }

  restyle(colours: Colours): void {
    this.colours = colours;
    this.scene.background = new Color(colours.band);
    this.mats.grid.color.set(colours.grid);
    this.mats.rim.color.set(colours.soft);
    this.mats.north.color.set(colours.red);
    this.sphere.material.color.set(colours.soft);
    for (const line of this.references) line.material.color.set(colours.muted);
    this.drop.material.color.set(colours.pink);
    const { force, field, body, frame } = this.arrows;
    force.colour(colours.olive);
    field.colour(colours.pink);
    [colours.red, colours.green, colours.blue].forEach((colour, k) => body[k]!.colour(colour));
    for (const arrow of frame) arrow.colour(colours.muted);
    this.joint.color.set(colours.ink);
    this.link.color.set(colours.blue);
  }

  draw(view: View, options: Options): Label[] {
    this.show(options.model);
    const isArm = options.model === "arm";
    const ground = groundOf(options.model);
    this.ground.position.z = ground;
    this.body.visible = !isArm;
    if (view.q) this.body.quaternion.copy(of(view.q));
    else this.body.quaternion.identity();
    this.drawGhosts(view, options);
    this.drawVectors(view, options, ground);
    this.drawFigure(view, isArm);
    this.drawTrail(options, isArm);
    this.drawWater(options);
    if (this.model?.bend) {
      this.bent += 0.35 * (-0.06 * view.rate - this.bent);
      this.model.bend(Math.max(-0.9, Math.min(0.9, this.bent)));
    }
    this.camera.position.set(options.camera[0], options.camera[1], options.camera[2] + options.middle);
    this.camera.lookAt(0, 0, options.middle);
    this.renderer.render(this.scene, this.camera);
    return this.labels(view, options, ground);
  }

  dispose(): void {
    this.renderer.dispose();
  }

  private buildGround(): void {
    const lines: number[] = [];
    const step = RIM / 5;
    for (let k = -5; k <= 5; k++) {
      const half = Math.sqrt(Math.max(0, RIM * RIM - (k * step) ** 2));
      lines.push(-half, k * step, 0, half, k * step, 0, k * step, -half, 0, k * step, half, 0);
    }
    const rim: number[] = [];
    for (let k = 0; k < 72; k++) {
      const [a, b] = [(k * Math.PI) / 36, ((k + 1) * Math.PI) / 36];
      rim.push(RIM * Math.sin(a), RIM * Math.cos(a), 0, RIM * Math.sin(b), RIM * Math.cos(b), 0);
      const inner = RIM - (k % 18 === 0 ? 0.16 : k % 6 === 0 ? 0.11 : k % 2 === 0 ? 0.05 : 0);
      rim.push(RIM * Math.sin(a), RIM * Math.cos(a), 0, inner * Math.sin(a), inner * Math.cos(a), 0);
    }
    const north = new Mesh(geometryOf([-0.09, RIM, 0, 0.09, RIM, 0, 0, RIM + 0.26, 0]), this.mats.north);
    this.ground.add(new LineSegments(geometryOf(lines), this.mats.grid), new LineSegments(geometryOf(rim), this.mats.rim), north);
  }

  private show(name: ModelName): void {
    if (name === this.name) return;
    this.name = name;
    if (this.model) this.body.remove(this.model.group);
    this.model = this.modelOf(name === "own" && !this.hasOwn ? "board" : name);
    if (this.model) this.body.add(this.model.group);
    for (const ghost of this.ghosts.children) (ghost as ReturnType<typeof ghostOf>).material.dispose();
    this.ghosts.clear();
    this.sphere.visible = name === "ball";
    this.water.visible = name === "buoy";
    for (const child of this.ground.children.slice(0, 1)) child.visible = name !== "buoy";
  }

  private modelOf(name: ModelName): Model | null {
    const known = this.made.get(name) ?? modelOf(name);
    if (known) this.made.set(name, known);
    return known;
  }

  private drawGhosts(view: View, options: Options): void {
    const shown = options.ghosts && this.model ? view.ghosts : [];
    while (this.ghosts.children.length > shown.length) this.ghosts.remove(this.ghosts.children.at(-1)!);
    shown.forEach((ghost, k) => {
      let line = this.ghosts.children[k] as ReturnType<typeof ghostOf> | undefined;
      if (!line) this.ghosts.add((line = ghostOf(this.model!.outline)));
      line.material.color.set(ghost.colour);
      line.quaternion.copy(of(ghost.q));
      line.scale.setScalar(1.02 + 0.01 * k); // else it would lie in the body's own faces
    });
  }

  private drawVectors(view: View, options: Options, ground: number): void {
    const { force, field, body, frame } = this.arrows;
    const isArm = options.model === "arm";
    force.group.visible = options.vectors && view.force !== null && !isArm;
    field.group.visible = options.vectors && view.field !== null && !isArm;
    if (view.force) force.point(view.force, 1.3 * Math.max(0.3, Math.min(1.25, view.forceSize)));
    if (view.field) field.point(view.field, 1.3);
    this.drop.visible = field.group.visible;
    if (view.field && this.drop.visible) {
      const tip = view.field.map((part) => 1.3 * part) as Vec;
      stretch(this.drop, [tip, [tip[0], tip[1], 0], [0, 0, 0]]);
    }
    for (const line of this.references) line.visible = options.vectors && !isArm;
    body.forEach((arrow, k) => {
      const axis = view.bodyAxes[k];
      arrow.group.visible = axis !== undefined && !isArm;
      if (axis) arrow.point(axis.direction, AXIS);
    });
    const triad = triadOf(options.model);
    frame.forEach((arrow, k) => {
      const axis = view.frameAxes[k];
      arrow.group.visible = axis !== undefined;
      arrow.group.position.set(...triad, ground);
      if (axis) arrow.point(axis.direction, FRAME);
    });
  }

  private drawFigure(view: View, isArm: boolean): void {
    this.figure.visible = isArm;
    if (!isArm) return;
    this.reach = figureScale(view.points, this.reach);
    const places = this.places(view.points);
    fill(this.joints, places.length, () => new Mesh(new SphereGeometry(0.06, 12, 8), this.joint));
    fill(this.links, view.lines.length, () => new Mesh(new CylinderGeometry(0.034, 0.034, 1, 8), this.link));
    places.forEach((place, k) => {
      const mesh = this.joints.children[k]!;
      mesh.visible = place !== null;
      if (place) mesh.position.set(...place);
    });
    view.lines.forEach(([from, to], k) => {
      const mesh = this.links.children[k]!;
      const [a, b] = [places[from ?? -1], places[to ?? -1]];
      mesh.visible = Boolean(a && b);
      if (!a || !b) return;
      const along = new Vector3(b[0] - a[0], b[1] - a[1], b[2] - a[2]);
      const length = along.length();
      mesh.visible = length > 1e-6;
      mesh.scale.y = length;
      mesh.position.set((a[0] + b[0]) / 2, (a[1] + b[1]) / 2, (a[2] + b[2]) / 2);
      if (length > 1e-6) mesh.quaternion.setFromUnitVectors(UP, along.divideScalar(length));
    });
  }

  /** Points of a stick figure in the scene's size, its first one in the middle. */
  private places(points: readonly (Vec | null)[]): (Vec | null)[] {
    const base = points.find((point) => point !== null) ?? [0, 0, 0];
    const scale = 1.7 / this.reach;
    return points.map((point) => point && [(point[0] - base[0]) * scale, (point[1] - base[1]) * scale, (point[2] - base[2]) * scale]);
  }

  private drawTrail(options: Options, isArm: boolean): void {
    const path = options.trail.length > TRAIL ? options.trail.slice(-TRAIL) : options.trail;
    this.trail.visible = path.length > 1 && (isArm || options.model === "ball");
    if (!this.trail.visible || !this.colours) return;
    const positions = this.trail.geometry.getAttribute("position") as BufferAttribute;
    const shades = this.trail.geometry.getAttribute("color") as BufferAttribute;
    const [from, to] = [new Color(this.colours.band), new Color(this.colours.red)];
    const mixed = new Color();
    const scale = isArm ? 1.7 / this.reach : 1;
    path.forEach((point, k) => {
      positions.setXYZ(k, point[0] * scale, point[1] * scale, point[2] * scale);
      mixed.lerpColors(from, to, 0.35 + (0.65 * (k + 1)) / path.length);
      shades.setXYZ(k, mixed.r, mixed.g, mixed.b);
    });
    positions.needsUpdate = shades.needsUpdate = true;
    this.trail.geometry.setDrawRange(0, path.length);
  }

  private drawWater(options: Options): void {
    if (!this.water.visible) return;
    const points = this.water.geometry.getAttribute("position") as BufferAttribute;
    for (let k = 0; k < points.count; k++) {
      const [x, y] = [points.getX(k), points.getY(k)];
      const t = options.time;
      points.setZ(k, 0.026 * Math.sin(5.1 * x + 1.9 * t) + 0.022 * Math.sin(6.3 * y - 2.3 * t + 1.4 * x) + 0.012 * Math.sin(9.7 * (x - y) + 3.1 * t));
    }
    points.needsUpdate = true;
  }

  private labels(view: View, options: Options, ground: number): Label[] {
    const colours = this.colours;
    if (!colours) return [];
    const found: Label[] = [];
    const put = (text: string, at: Vec, colour: string, strong = false): void => {
      const p = new Vector3(...at).project(this.camera);
      if (p.z > 1) return;
      found.push({ text, x: ((p.x + 1) / 2) * this.size.width, y: ((1 - p.y) / 2) * this.size.height, colour, strong });
    };
    const rim = RIM + 0.38;
    const points: [string, Vec][] = [["N", [0, rim, ground]], ["E", [rim - 0.14, 0, ground]], ["S", [0, 0.14 - rim, ground]], ["W", [0.14 - rim, 0, ground]]];
    for (const [text, at] of points) if (!view.free || text === "N") put(view.free ? "0°" : text, at, text === "N" ? colours.red : colours.muted, text === "N");
    for (const { letter, direction } of view.frameAxes) {
      const [x, y] = triadOf(options.model);
      put(letter, [x + direction[0] * (FRAME + 0.1), y + direction[1] * (FRAME + 0.1), ground + direction[2] * (FRAME + 0.1)], colours.muted);
    }
    const shades = [colours.red, colours.green, colours.blue];
    if (options.model !== "arm") {
      view.bodyAxes.forEach(({ letter, direction }, k) => put(letter, direction.map((part) => part * (AXIS + 0.1)) as Vec, shades[k]!, true));
    }
    return found;
  }
}

const AXIS = 1.25;
const FRAME = 0.55;

/** Where the navigation frame's axes stand on the ground: in its middle, unless something stands there. */
const triadOf = (model: ModelName): [number, number] => (model === "buoy" || model === "arm" ? [-1.05, -1.05] : [0, 0]);

const of = ([w, x, y, z]: readonly [number, number, number, number]): Quaternion => new Quaternion(x, y, z, w);

function geometryOf(points: number[]): BufferGeometry {
  return new BufferGeometry().setAttribute("position", new BufferAttribute(new Float32Array(points), 3));
}

function stretch(line: Line, points: Vec[]): void {
  line.geometry.setFromPoints(points.map((point) => new Vector3(...point)));
  line.computeLineDistances();
}

/** Bring a group to so many children. */
function fill(group: Group, count: number, make: () => Object3D): void {
  while (group.children.length > count) group.remove(group.children.at(-1)!);
  while (group.children.length < count) group.add(make());
}
