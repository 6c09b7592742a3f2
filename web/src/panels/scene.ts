// The body in its navigation frame, in three dimensions.
import "./scene.css";

import { fixed } from "../format";
import type { Hello, State } from "../messages";
import { othersOf, primaryOf, REFERENCE } from "../names";
import type { Context, Panel, PanelFactory } from "../panel";
import { button, calm, keep, kept, make, oncePerFrame, paint, press, put, watched, Words } from "./scene/dom";
import { between, DEG, dot, frameAxes, length, type Quat, quat, rotate, scaled, sceneAttitude, toModel, toScene, unit, type Vec, vec } from "./scene/frames";
import type { ModelName } from "./scene/models";
import { Orbit, turnable } from "./scene/orbit";
import { Plain } from "./scene/plain";
import type { Drawer, Label, View } from "./scene/view";

type Stage = import("./scene/stage").Stage;
type Preset = "behind" | "side" | "top" | "free";

const MODELS: [ModelName, string][] = [
  ["board", "Board"], ["buoy", "Buoy"], ["fin", "Fish fin"], ["ball", "Trackball"], ["rod", "Rod"], ["arm", "Arm"], ["own", "Own model"],
];
const PRESETS: [Preset, string][] = [["behind", "Behind"], ["side", "Side"], ["top", "Top"], ["free", "Free"]];
const LASTS = 12; // s of a trail
const APART = 3 * DEG; // of points on a trackball's sphere
const FREE = { azimuth: 214 * DEG, elevation: 22 * DEG, distance: 5.2 };
const MIDDLE: Partial<Record<ModelName, number>> = { arm: 0.6, buoy: 0.1 }; // height that a camera looks at

class SceneView implements Panel {
  readonly element = make("section", "scene-panel");
  private readonly words: Words;
  private readonly view = make("div", "scene-view");
  private readonly canvas = make("canvas");
  private readonly labels = make("div", "scene-labels");
  private readonly legend = make("div", "scene-legend");
  private readonly note = make("p", "scene-note");
  private readonly badge = make("p", "stale-badge");
  private readonly models = make("select");
  private readonly file = make("input");
  private readonly opener: HTMLButtonElement;
  private readonly presets = new Map<Preset, HTMLButtonElement>();
  private readonly toggles = { vectors: make("input"), ghosts: make("input") };
  private readonly orbit = new Orbit();
  private readonly ask: () => void;
  private readonly isSeen: () => boolean;
  private drawer: Drawer | null = null;
  private stage: Stage | null = null;
  private model: ModelName;
  private preset: Preset = "free";
  private newest: State | null = null;
  private told: Hello | null = null;
  private trail: { t: number; at: Vec }[] = [];
  private lastTip: Quat | null = null;
  private isStale = false;
  private said = "";
  private began = performance.now();
  private heading: number | null = null;
  /** Frames that were drawn: what a test of speed counts. */
  drawn = 0;

  constructor(private readonly context: Context) {
    this.words = new Words(context);
    this.opener = this.words.text(button("", () => this.file.click()), "Open…");
    this.model = MODELS.some(([name]) => name === kept("model", "")) ? (kept("model", "board") as ModelName) : "board";
    this.ask = oncePerFrame((now) => this.draw(now));
    this.build();
    this.isSeen = watched(this.view, () => this.resized());
    void this.start();
  }

  hello(hello: Hello): void {
    const isOther = this.told?.session !== hello.session;
    this.told = hello;
    const arm = [...this.models.options].find((option) => option.value === "arm")!;
    arm.disabled = hello.skeleton === null;
    if (isOther) this.clear();
    if (hello.skeleton && kept("model", "") === "") this.choose("arm", false);
    if (!hello.skeleton && this.model === "arm") this.choose("board", false);
    this.ask();
  }

  state(state: State): void {
    this.newest = state;
    this.follow(state);
    this.ask();
  }

  clear(): void {
    this.trail = [];
    this.lastTip = null;
    this.ask();
  }

  stale(stale: boolean): void {
    this.isStale = stale;
    this.element.classList.toggle("stale", stale);
    this.ask();
  }

  restyle(): void {
    this.words.again();
    this.say(this.said);
    this.drawer?.restyle(this.context.colours());
    this.ask();
  }

  private build(): void {
    const { words } = this;
    words.attribute(this.element, "aria-label", "Body in the navigation frame");
    const bar = make("div", "scene-bar");
    for (const [name, english] of MODELS) {
      const option = words.text(make("option"), english);
      option.value = name;
      this.models.append(option);
    }
    this.models.value = this.model;
    words.attribute(this.models, "aria-label", "Model");
    this.models.addEventListener("change", () => this.choose(this.models.value as ModelName, true));
    const cameras = make("div", "segments");
    cameras.setAttribute("role", "group");
    words.attribute(cameras, "aria-label", "Camera");
    for (const [preset, english] of PRESETS) {
      const one = words.text(button("", () => this.look(preset)), english);
      this.presets.set(preset, one);
      cameras.append(one);
    }
    const reset = words.text(button("", () => this.reset()), "Reset");
    bar.append(this.models, cameras, reset, this.toggle("vectors", "Vectors"), this.toggle("ghosts", "Others"), this.chooser());
    this.view.tabIndex = 0;
    this.view.setAttribute("role", "img");
    words.attribute(this.view, "aria-label", "Body in three dimensions; arrow keys turn the view, + and − come closer and go away");
    this.labels.setAttribute("aria-hidden", "true");
    this.note.setAttribute("role", "status");
    this.note.hidden = true;
    words.text(this.badge, "No new samples");
    this.view.append(this.canvas, this.labels, this.legend, this.note, this.badge);
    this.element.append(bar, this.file, this.view);
    turnable(this.view, {
      turn: (right, up) => {
        if (this.preset !== "free") this.mark("free");
        this.orbit.turn(right, up);
        this.ask();
      },
      zoom: (factor) => {
        this.orbit.zoom(factor);
        this.ask();
      },
    });
    this.reset();
  }

  private toggle(which: "vectors" | "ghosts", english: string): HTMLLabelElement {
    const box = this.toggles[which];
    box.type = "checkbox";
    box.checked = kept(which, "1") === "1";
    box.addEventListener("change", () => {
      keep(which, box.checked ? "1" : "0");
      this.ask();
    });
    const label = make("label", "check");
    label.append(box, this.words.text(make("span"), english));
    return label;
  }

  private chooser(): HTMLButtonElement {
    this.file.type = "file";
    this.file.accept = ".glb,.gltf,model/gltf-binary,model/gltf+json";
    this.file.hidden = true;
    this.words.attribute(this.opener, "title", "Model file, glTF or GLB; it stays in this browser");
    this.file.addEventListener("change", () => {
      const file = this.file.files?.[0];
      this.file.value = "";
      if (file) void this.open(file);
    });
    this.opener.hidden = this.model !== "own";
    return this.opener;
  }

  /** The part that is large comes after the first paint. */
  private async start(): Promise<void> {
    try {
      const { Stage } = await import("./scene/stage");
      this.stage = Stage.on(this.canvas);
    } catch {
      this.stage = null;
    }
    this.drawer = this.stage ?? this.plain("WebGL is not available here: a plain drawing is shown.");
    this.canvas.addEventListener("webglcontextlost", (event) => {
      event.preventDefault();
      this.say("The graphics card has dropped the drawing; it comes back by itself, or with the page loaded again.");
    });
    this.canvas.addEventListener("webglcontextrestored", () => {
      this.say("");
      this.restyle();
    });
    this.drawer.restyle(this.context.colours());
    if (this.model === "own") this.say("Choose a .glb or .gltf file; it stays in this browser.");
    this.resized();
  }

  private plain(why: string): Drawer {
    this.say(why);
    return new Plain(this.canvas);
  }

  private resized(): void {
    const { clientWidth, clientHeight } = this.view;
    if (this.drawer && clientWidth > 0 && clientHeight > 0) this.drawer.resize(clientWidth, clientHeight);
    this.ask();
  }

  private choose(model: ModelName, isKept: boolean): void {
    this.model = model;
    this.models.value = model;
    this.opener.hidden = model !== "own";
    if (isKept) keep("model", model);
    this.say(model === "own" && this.stage && !this.stage.hasOwn ? "Choose a .glb or .gltf file; it stays in this browser." : "");
    this.clear();
  }

  private async open(file: File): Promise<void> {
    if (!this.stage) return this.say("A model of your own needs WebGL.");
    this.say("Reading the model…");
    const { ModelError, ownModel } = await import("./scene/own");
    try {
      this.stage.take(await ownModel(file));
      this.say("");
    } catch (error) {
      this.say(error instanceof ModelError ? error.message : "The model cannot be read. Export it again as GLB, without compression.");
    }
    this.ask();
  }

  private say(english: string): void {
    this.said = english;
    put(this.note, english && this.context.t(english));
    this.note.hidden = english === "";
  }

  private mark(preset: Preset): void {
    this.preset = preset;
    for (const [name, one] of this.presets) press(one, name === preset);
  }

  private look(preset: Preset): void {
    this.mark(preset);
    if (preset === "top") Object.assign(this.orbit, { azimuth: Math.PI, elevation: 89.9 * DEG, distance: FREE.distance });
    if (preset === "behind") this.orbit.elevation = 16 * DEG;
    if (preset === "side") this.orbit.elevation = 6 * DEG;
    this.heading = null;
    this.ask();
  }

  private reset(): void {
    Object.assign(this.orbit, FREE);
    this.mark("free");
    this.ask();
  }

  private attitude(name: string | undefined): Quat | null {
    const q = quat(this.newest?.attitudes[name ?? ""]?.q_nb);
    return q && this.told ? sceneAttitude(q, this.told.frame, this.told.axes) : null;
  }

  /** Lengthen the trail: of the nose on the sphere, or of an arm's last point. */
  private follow(state: State): void {
    const t = state.t ?? 0;
    if (this.model === "arm") {
      const last = vec(state.points?.at(-1) ?? null);
      const base = state.points?.map((point) => vec(point)).find((point) => point !== null);
      if (last && base) {
        const [from, to] = [toScene(base, this.told?.frame ?? null), toScene(last, this.told?.frame ?? null)];
        this.trail.push({ t, at: [to[0] - from[0], to[1] - from[1], to[2] - from[2]] });
      }
    } else if (this.model === "ball") {
      const q = this.attitude(primaryOf(this.told)?.name);
      if (q) {
        // Between two states the nose went by an arc, not by a chord.
        const before = this.lastTip ?? q;
        const angle = Math.acos(Math.min(1, Math.max(-1, dot(rotate(before, [1, 0, 0]), rotate(q, [1, 0, 0])))));
        const pieces = Math.max(1, Math.min(30, Math.ceil(angle / APART)));
        for (let k = 1; k <= pieces; k++) this.trail.push({ t, at: scaled(rotate(between(before, q, k / pieces), [1, 0, 0]), 1.004) });
        this.lastTip = q;
      }
    }
    while (this.trail.length > 0 && (this.trail.length > 900 || t - this.trail[0]!.t > LASTS)) this.trail.shift();
  }

  private current(): View {
    const { told, newest, context } = this;
    const frame = told?.frame ?? null;
    const axes = told?.axes ?? "FLU";
    const q = this.attitude(primaryOf(told)?.name);
    const turned = (v: Vec): Vec => (q ? rotate(q, v) : v);
    const force = vec(newest?.gravity_b);
    const ghosts = othersOf(told, context).flatMap(({ name, colour }) => {
      const other = this.attitude(name);
      return other ? [{ name, q: other, colour }] : [];
    });
    const field = unit(newest?.field_b);
    const along = unit(newest?.gravity_b);
    const directions: Vec[] = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
    return {
      q,
      ghosts,
      force: along && turned(toModel(along, axes)),
      forceSize: force ? length(force) / (told?.gravity || 9.81) : 0,
      field: field && turned(toModel(field, axes)),
      frameAxes: frameAxes(frame),
      bodyAxes: directions.map((direction, k) => ({ letter: "xyz"[k]!, direction: turned(toModel(direction, axes)) })),
      points: (newest?.points ?? []).map((point) => {
        const found = vec(point);
        return found && toScene(found, frame);
      }),
      lines: told?.skeleton?.lines ?? [],
      rate: this.rate(axes),
      free: told?.north === "free",
    };
  }

  /** Rate about the body's upward axis, rad/s, which bends a fin; 0 where it is not known. */
  private rate(axes: string): number {
    const k = this.told?.columns.findIndex(({ key }) => key === "gyr.z") ?? -1;
    const value = this.newest?.values[k] ?? 0;
    return calm() ? 0 : (axes === "FRD" ? -1 : 1) * value * DEG;
  }

  private draw(now: number): void {
    if (!this.drawer || !this.isSeen() || this.stage?.isLost) return;
    const view = this.current();
    const isTurning = this.turnCamera(view.q);
    const moves = this.model === "buoy" && !this.isStale && !calm();
    const labels = this.drawer.draw(view, {
      model: this.model,
      vectors: this.toggles.vectors.checked,
      ghosts: this.toggles.ghosts.checked,
      trail: this.trail.map(({ at }) => at),
      camera: this.orbit.place(),
      middle: MIDDLE[this.model] ?? -0.12,
      time: calm() ? 0 : (now - this.began) / 1000,
    });
    this.drawn += 1;
    this.place(labels);
    this.tell(view);
    if (moves || isTurning) this.ask();
  }

  /** Cameras behind and beside a body go round with its heading; true while they are on their way. */
  private turnCamera(q: Quat | null): boolean {
    if (this.preset !== "behind" && this.preset !== "side") return false;
    const nose = q ? rotate(q, [1, 0, 0]) : ([0, 1, 0] as Vec);
    if (Math.hypot(nose[0], nose[1]) > 0.15 || this.heading === null) this.heading = Math.atan2(nose[0], nose[1]);
    const goal = this.heading + (this.preset === "behind" ? Math.PI : Math.PI / 2);
    const left = Math.atan2(Math.sin(goal - this.orbit.azimuth), Math.cos(goal - this.orbit.azimuth));
    const isThere = Math.abs(left) < 0.002 || calm();
    this.orbit.azimuth += isThere ? left : 0.18 * left;
    return !isThere;
  }

  private place(labels: Label[]): void {
    while (this.labels.children.length > labels.length) this.labels.lastChild!.remove();
    while (this.labels.children.length < labels.length) this.labels.append(make("span"));
    labels.forEach(({ text, x, y, colour, strong }, k) => {
      const one = this.labels.children[k] as HTMLElement;
      put(one, text);
      const name = strong ? "strong" : "";
      if (one.className !== name) one.className = name;
      paint(one, colour);
      one.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px) translate(-50%, -50%)`;
    });
  }

  private tell(view: View): void {
    const colours = this.context.colours();
    const lines: [string, string, string][] = [];
    if (this.model !== "arm" && this.toggles.vectors.checked) {
      const force = vec(this.newest?.gravity_b);
      const field = vec(this.newest?.field_b);
      if (force) lines.push([colours.olive, "block", `${this.context.t("Specific force")} ${fixed(length(force), 2)} m/s²`]);
      if (field) lines.push([colours.pink, "block", `${this.context.t("Field")} ${fixed(length(field), 1)} µT`]);
      lines.push([colours.muted, "dashed", this.context.t(view.free ? "Up and 0°" : "Up and north")]);
    }
    if (this.toggles.ghosts.checked && this.model !== "arm") {
      for (const { name, colour } of view.ghosts) lines.push([colour, "thin", name === REFERENCE ? this.context.t("reference") : name]);
    }
    if (this.told && this.told.frame === null) lines.push([colours.muted, "none", this.context.t("No attitude is estimated: the body's own axes")]);
    while (this.legend.children.length > lines.length) this.legend.lastChild!.remove();
    while (this.legend.children.length < lines.length) {
      const line = make("span");
      line.append(make("i"), make("b"));
      this.legend.append(line);
    }
    lines.forEach(([colour, kind, text], k) => {
      const [mark, words] = this.legend.children[k]!.children as unknown as [HTMLElement, HTMLElement];
      if (mark.className !== kind) mark.className = kind;
      paint(mark, colour);
      put(words, text);
    });
  }
}

export const scene: PanelFactory = (context) => new SceneView(context);
