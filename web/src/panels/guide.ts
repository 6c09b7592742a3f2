// Guided calibration: what was seen, what to do next, when it is enough.
import "./scene.css";

import type { Answer, Guidance, Hello, State, Verb } from "../messages";
import type { Context, Panel, PanelFactory } from "../panel";
import { filledIn, stepOf } from "./scene/cells";
import { button, calm, keep, kept, make, oncePerFrame, press, put, sheet, watched, Words } from "./scene/dom";
import { units, type Vec } from "./scene/frames";
import { turnable } from "./scene/orbit";
import { type Coverage, drawSphere, Eye } from "./scene/sphere";
import { drawTurning } from "./scene/turning";

const KINDS: Record<string, string> = { mag: "Magnetometer", accel: "Accelerometer", gyro: "Gyroscope" };
const GRADES: Record<string, string> = { good: "Good", fair: "Fair", poor: "Poor" };
const ROUND = 2600; // ms of a turn that is shown

class Guide implements Panel {
  readonly element = make("section", "guide-panel");
  private readonly words: Words;
  private readonly kinds = make("div", "segments");
  private readonly start: HTMLButtonElement;
  private readonly finish: HTMLButtonElement;
  private readonly cancel: HTMLButtonElement;
  private readonly front: HTMLButtonElement;
  private readonly beep = make("input");
  private readonly closed = make("p", "guide-closed");
  private readonly answer = make("p", "guide-answer");
  private readonly work = make("div", "guide-work");
  private readonly sphere = make("canvas", "guide-sphere");
  private readonly turning = make("canvas", "guide-turning");
  private readonly step = make("p", "guide-step");
  private readonly amount = make("p", "guide-amount");
  private readonly bar = make("progress", "guide-share");
  private readonly facts = make("dl", "guide-facts");
  private readonly values = new Map<string, HTMLElement>();
  private readonly warnings = make("div", "guide-warnings");
  private readonly warned = make("ul");
  private readonly result = make("div", "guide-result");
  private readonly eye = new Eye();
  private readonly ask: () => void;
  private readonly isSeen: () => boolean;
  private told: Hello | null = null;
  private guidance: Guidance | null = null;
  private running: string | null = null;
  private kind = "";
  private regions: Vec[] = [];
  private byHand = false;
  private sound: AudioContext | null = null;

  constructor(private readonly context: Context) {
    this.words = new Words(context);
    this.ask = oncePerFrame((now) => this.draw(now));
    const { words } = this;
    this.start = words.text(button("primary", () => void this.command("calibrate", this.kind)), "Start");
    this.finish = words.text(button("primary", () => void this.command("calibrate-end")), "Finish");
    this.cancel = words.text(button("", () => void this.command("calibrate-cancel")), "Cancel");
    this.front = words.text(button("", () => this.follow()), "Show the goal");
    this.front.hidden = true;
    this.build();
    this.isSeen = watched(this.element, this.ask);
    this.show();
  }

  hello(hello: Hello): void {
    this.told = hello;
    this.regions = units(hello.regions);
    if (!hello.guides.includes(this.kind)) this.kind = hello.guides[0] ?? "";
    this.listKinds();
    this.show();
  }

  state(state: State): void {
    if (state.guide === this.running) return;
    this.running = state.guide;
    if (state.guide !== null) {
      this.kind = state.guide;
      if (this.guidance && (this.guidance.kind !== state.guide || this.guidance.card || this.guidance.refused?.length)) this.guidance = null;
    }
    this.show();
  }

  guide(guidance: Guidance): void {
    this.sing(this.guidance, guidance);
    this.guidance = guidance;
    this.show();
  }

  stale(stale: boolean): void {
    this.element.classList.toggle("stale", stale);
  }

  restyle(): void {
    this.words.again();
    this.listKinds();
    this.show();
  }

  private build(): void {
    const { words } = this;
    words.attribute(this.element, "aria-label", "Guided calibration");
    words.attribute(this.kinds, "aria-label", "What is calibrated");
    this.kinds.setAttribute("role", "group");
    this.beep.type = "checkbox";
    this.beep.checked = kept("beep", "0") === "1";
    this.beep.addEventListener("change", () => {
      keep("beep", this.beep.checked ? "1" : "0");
      if (this.beep.checked) this.tone([[880, 0]]);
    });
    const sound = make("label", "check");
    sound.append(this.beep, words.text(make("span"), "Beep"));
    const bar = make("div", "guide-bar");
    bar.append(this.kinds, this.start, this.finish, this.cancel, sound);
    this.sphere.setAttribute("role", "img");
    this.turning.setAttribute("aria-hidden", "true"); // the words beside it say the same
    this.warnings.append(this.warned);
    this.sphere.tabIndex = 0;
    words.attribute(this.sphere, "aria-label", "Directions that were seen; arrow keys turn the sphere");
    turnable(this.sphere, {
      turn: (right, up) => {
        this.byHand = true;
        this.front.hidden = false;
        this.eye.turn(right, up);
        this.ask();
      },
      zoom: () => undefined,
    });
    const key = make("p", "guide-key");
    for (const [name, english] of [["seen", "seen"], ["missing", "missing"], ["here", "here"], ["goal", "goal"]] as const) {
      const one = make("span");
      one.append(make("i", name), words.text(make("span"), english));
      key.append(one);
    }
    const left = make("div", "guide-left");
    left.append(this.sphere, this.front, key);
    this.step.setAttribute("role", "status");
    this.warnings.setAttribute("role", "alert");
    this.result.setAttribute("role", "status");
    this.answer.setAttribute("role", "alert");
    this.bar.max = 1;
    words.attribute(this.bar, "aria-label", "Share that is done");
    for (const english of ["Seen", "At rest", "Predicted", "Grade", "Elapsed"]) {
      const row = make("div");
      const value = make("dd");
      this.values.set(english, value);
      row.append(words.text(make("dt"), english), value);
      this.facts.append(row);
    }
    const right = make("div", "guide-right");
    const now = make("div", "guide-now");
    const said = make("div");
    said.append(this.amount, this.step);
    now.append(this.turning, said);
    right.append(now, this.warnings, this.result, this.bar, this.facts);
    this.work.append(left, right);
    this.element.append(this.closed, bar, this.answer, this.work);
  }

  private listKinds(): void {
    this.kinds.replaceChildren(
      ...(this.told?.guides ?? []).map((kind) => {
        const one = button("", () => {
          this.kind = kind;
          this.show();
        });
        one.dataset.kind = kind;
        put(one, this.context.t(KINDS[kind] ?? kind));
        return one;
      }),
    );
  }

  private follow(): void {
    this.byHand = false;
    this.front.hidden = true;
    this.ask();
  }

  private async command(verb: Verb, name = ""): Promise<void> {
    put(this.answer, "");
    let answer: Answer;
    try {
      answer = await this.context.send({ verb, name });
    } catch {
      put(this.answer, this.context.t("The command was not sent: there is no connection."));
      return;
    }
    put(this.answer, answer.ok ? "" : answer.text);
    if (answer.ok && verb === "calibrate") this.guidance = null;
    if (answer.ok && verb === "calibrate-cancel") this.guidance = null;
    this.show();
  }

  private why(): string {
    const { t } = this.context;
    if (!this.told) return t("Waiting for the stream");
    if (this.told.guides.length === 0) return t("Nothing can be calibrated here: a guide needs live samples, uncalibrated.");
    if (!this.told.control) return t("This page only looks: start Plumbob with --control to calibrate from here.");
    return "";
  }

  private show(): void {
    const { t } = this.context;
    const { guidance, running } = this;
    const why = this.why();
    const isOn = this.told?.control === true && this.told.guides.length > 0;
    put(this.closed, why);
    this.closed.hidden = why === "";
    this.start.hidden = !isOn || running !== null;
    this.finish.hidden = this.cancel.hidden = !isOn || running === null;
    this.finish.classList.toggle("ready", guidance?.done ?? false);
    this.kinds.hidden = !this.told?.guides.length;
    for (const one of this.kinds.querySelectorAll("button")) {
      press(one, one.dataset.kind === this.kind);
      one.disabled = running !== null || !isOn;
    }
    this.work.hidden = !this.told || this.told.guides.length === 0;
    this.work.classList.toggle("flat", this.kind === "gyro");
    const seen = guidance?.filled?.filter(Boolean).length ?? 0;
    const isRest = this.kind === "gyro"; // which has neither directions nor a prediction
    this.fact("Seen", isRest ? "" : `${seen} / ${this.regions.length}`);
    this.fact("At rest", guidance ? `${guidance.still_for.toFixed(1)} s` : "—");
    this.fact("Predicted", isRest ? "" : this.predicted(guidance?.predicted || "—"));
    this.fact("Grade", isRest ? "" : guidance?.grade ? t(GRADES[guidance.grade] ?? guidance.grade) : "—");
    this.fact("Elapsed", guidance ? `${guidance.elapsed.toFixed(0)} s` : "—");
    this.values.get("Grade")!.dataset.grade = guidance?.grade ?? "";
    this.bar.value = guidance?.share ?? 0;
    this.say();
    this.outcome();
    this.ask();
  }

  private fact(name: string, text: string): void {
    const value = this.values.get(name)!;
    put(value, text);
    value.parentElement!.hidden = text === "";
  }

  private say(): void {
    const { t } = this.context;
    const { guidance } = this;
    const isRunning = this.running !== null;
    if (!guidance || !isRunning) {
      put(this.step, t(this.idleWords(isRunning)));
      put(this.amount, "");
    } else {
      const { label, parts } = stepOf(guidance.next_step);
      put(this.step, filledIn(t(label), parts));
      const isTurn = guidance.axis !== null && guidance.angle !== null && !guidance.done;
      put(this.amount, isTurn ? `${guidance.angle! < 0 ? "↻" : "↺"} ${"xyz"[guidance.axis!] ?? ""} ${Math.abs(guidance.angle!).toFixed(0)}°` : "");
    }
    this.amount.hidden = this.amount.textContent === "";
    this.turning.hidden = this.amount.hidden;
    this.step.classList.toggle("done", guidance?.done ?? false);
    const warnings = isRunning ? (guidance?.warnings ?? []) : [];
    const words = warnings.map((text) => t(text));
    if (words.join("\n") !== [...this.warned.children].map(({ textContent }) => textContent).join("\n")) {
      this.warned.replaceChildren(...words.map((text) => make("li", "", text)));
    }
    this.warnings.hidden = warnings.length === 0;
  }

  private idleWords(isRunning: boolean): string {
    if (isRunning) return "Waiting for samples";
    if (this.guidance?.card) return "Done";
    if (this.guidance?.refused?.length) return "Not enough yet: start again";
    return this.told?.control ? "Choose a sensor and start" : "No calibration is running";
  }

  /** A figure such as "heading ±0.6° (1 sd)", whose first word alone differs between languages. */
  private predicted(words: string): string {
    return words.replace(/^(heading|tilt)(?= )/, (word) => this.context.t(word));
  }

  private outcome(): void {
    const { t } = this.context;
    const card = this.guidance?.card;
    const refused = this.guidance?.refused ?? [];
    const lines: HTMLElement[] = [];
    if (card) lines.push(make("strong", "", t("Card written")), make("code", "", card));
    if (refused.length > 0) lines.push(make("strong", "refused", t("No card was made")), ...refused.map((text) => make("p", "", t(text))));
    if (lines.map(({ textContent }) => textContent).join() !== [...this.result.children].map(({ textContent }) => textContent).join()) {
      this.result.replaceChildren(...lines);
    }
    this.result.hidden = lines.length === 0;
  }

  private draw(now: number): void {
    if (!this.isSeen() || this.work.hidden) return;
    const { guidance } = this;
    const colours = this.context.colours();
    const isLive = guidance !== null && this.running !== null && !guidance.done;
    const goal = guidance?.goal ?? null;
    const page = this.kind === "gyro" ? null : sheet(this.sphere);
    let moves = isLive && !calm() && (goal !== null || guidance?.axis != null);
    if (page) {
      const region = goal === null ? undefined : this.regions[goal];
      if (region && !this.byHand) moves = this.eye.follow(region, calm() ? 1 : 0.08) || moves;
      const coverage: Coverage = {
        regions: this.regions,
        names: this.told?.regions_names ?? [],
        filled: guidance?.filled ?? null,
        here: guidance?.direction ?? null,
        goal,
        cloud: units(guidance?.cloud ?? []),
      };
      const pulse = moves ? 0.5 + 0.5 * Math.sin(now / 260) : 0.6;
      drawSphere(page.ctx, page.width, page.height, coverage, this.eye, pulse, colours);
    }
    const arrow = this.turning.hidden ? null : sheet(this.turning);
    if (arrow && guidance) {
      const share = calm() ? 0 : Math.min(1, ((now % ROUND) / ROUND) * 1.5);
      drawTurning(arrow.ctx, arrow.width, arrow.height, guidance.axis, guidance.angle ?? 0, 0.5 - 0.5 * Math.cos(Math.PI * share), colours);
    }
    if (moves) this.ask();
  }

  /** A short tone at each new direction, two at the end, a low one at a warning. */
  private sing(before: Guidance | null, now: Guidance): void {
    if (!this.beep.checked) return;
    const count = (guidance: Guidance | null): number => guidance?.filled?.filter(Boolean).length ?? 0;
    if (now.done && !before?.done) this.tone([[880, 0], [1320, 0.16]]);
    else if (count(now) > count(before)) this.tone([[880, 0]]);
    else if (now.warnings.length > (before?.warnings.length ?? 0)) this.tone([[220, 0]]);
  }

  private tone(notes: [number, number][]): void {
    if (typeof AudioContext !== "function") return;
    this.sound ??= new AudioContext();
    const { sound } = this;
    for (const [pitch, later] of notes) {
      const [source, volume] = [sound.createOscillator(), sound.createGain()];
      const start = sound.currentTime + later;
      source.frequency.value = pitch;
      volume.gain.setValueAtTime(0.12, start);
      volume.gain.exponentialRampToValueAtTime(0.001, start + 0.14);
      source.connect(volume).connect(sound.destination);
      source.start(start);
      source.stop(start + 0.15);
    }
  }
}

export const guide: PanelFactory = (context) => new Guide(context);
