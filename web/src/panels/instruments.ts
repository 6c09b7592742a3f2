// Artificial horizon, compass and the numbers beside them.
import "./scene.css";

import { fixed } from "../format";
import type { Attitude, Hello, State } from "../messages";
import { othersOf, primaryOf } from "../names";
import type { Context, Panel, PanelFactory } from "../panel";
import { type Course, drawRose, drawTape, rateScale } from "./scene/compass";
import { make, oncePerFrame, put, sheet, watched, Words } from "./scene/dom";
import { compassOf, outside, type Outside, type Quat, quat, quatOf, sceneAttitude, senseOf, turnRate, wrap360 } from "./scene/frames";
import { drawHorizon } from "./scene/horizon";

const NORTHS: Record<string, string> = { true: "from true north", magnetic: "from magnetic north", free: "from an arbitrary zero" };
const SMOOTH = 0.3; // s that a rate of turn is taken over

/** A cell with a name, a number, and what stands under it. */
class Cell {
  readonly element = make("div", "cell");
  readonly name = make("span", "cell-name");
  private readonly value = make("strong", "cell-value", "—");
  private readonly under = make("span", "cell-under");

  constructor() {
    this.element.append(this.name, this.value, this.under);
  }

  show(value: string, under = ""): void {
    put(this.value, value);
    put(this.under, under);
  }
}

class Instruments implements Panel {
  readonly element = make("section", "instruments-panel");
  private readonly words: Words;
  private readonly tape = make("canvas", "tape");
  private readonly dials = make("canvas", "dials");
  private readonly cells = { heading: new Cell(), yaw: new Cell(), pitch: new Cell(), roll: new Cell(), turn: new Cell() };
  private readonly badge = make("p", "stale-badge");
  private readonly ask: () => void;
  private readonly isSeen: () => boolean;
  private told: Hello | null = null;
  private newest: State | null = null;
  private before: { t: number; q: Quat } | null = null;
  private rate: number | null = null;

  constructor(private readonly context: Context) {
    this.words = new Words(context);
    this.ask = oncePerFrame(() => this.draw());
    const { words, cells } = this;
    words.attribute(this.element, "aria-label", "Instruments");
    for (const [canvas, english] of [[this.tape, "Heading tape"], [this.dials, "Artificial horizon and compass; the numbers are below"]] as const) {
      canvas.setAttribute("role", "img");
      words.attribute(canvas, "aria-label", english);
    }
    words.text(cells.pitch.name, "Pitch");
    words.text(cells.roll.name, "Roll");
    words.text(cells.turn.name, "Rate of turn");
    words.text(this.badge, "No new samples");
    const row = make("div", "cells");
    row.append(...Object.values(cells).map(({ element }) => element));
    this.element.append(this.tape, this.dials, row, this.badge);
    this.isSeen = watched(this.dials, this.ask);
    this.name();
  }

  hello(hello: Hello): void {
    this.told = hello;
    this.clear();
    this.name();
  }

  state(state: State): void {
    if (state.tared !== this.newest?.tared) {
      this.newest = state;
      this.name();
    }
    this.newest = state;
    this.turnOf(state);
    this.ask();
  }

  clear(): void {
    this.before = null;
    this.rate = null;
    this.ask();
  }

  stale(stale: boolean): void {
    this.element.classList.toggle("stale", stale);
  }

  restyle(): void {
    this.words.again();
    this.name();
    this.ask();
  }

  private name(): void {
    const { t } = this.context;
    const frame = this.told?.frame ?? null;
    const isTared = this.newest?.tared ?? false;
    put(this.cells.heading.name, t(isTared ? "Turned since the tare" : "Heading"));
    put(this.cells.yaw.name, frame ? `${t("Yaw")} (${frame})` : t("Yaw"));
  }

  private primary(): Attitude | null {
    const name = primaryOf(this.told)?.name;
    return (name !== undefined && this.newest?.attitudes[name]) || null;
  }

  /** Rate about the vertical of the estimated attitude, smoothed. */
  private turnOf(state: State): void {
    const q_nb = quat(this.primary()?.q_nb);
    if (!q_nb || !this.told || state.t === null) return;
    const q = sceneAttitude(q_nb, this.told.frame, this.told.axes);
    const passed = this.before ? state.t - this.before.t : 0;
    if (this.before && passed > 0) {
      const rate = turnRate(this.before.q, q, passed);
      const share = 1 - Math.exp(-passed / SMOOTH);
      this.rate = this.rate === null ? rate : this.rate + share * (rate - this.rate);
    }
    if (!this.before || passed !== 0) this.before = { t: state.t, q };
  }

  /** What an attitude shows: after a tare by its angles, which count from there, else as it is. */
  private seen(attitude: Attitude): Outside | null {
    const { frame, axes } = this.told!;
    if (this.newest?.tared) return outside(quatOf(attitude.yaw, attitude.pitch, attitude.roll), frame, frame === "NED" ? "FRD" : "FLU");
    const q = quat(attitude.q_nb);
    return q && outside(q, frame, axes);
  }

  private heading(attitude: Attitude): number {
    const frame = this.told?.frame ?? null;
    return this.newest?.tared ? wrap360(senseOf(frame) * attitude.yaw) : compassOf(attitude.yaw, frame);
  }

  private others(): { attitude: Attitude; colour: string }[] {
    const attitudes = this.newest?.attitudes ?? {};
    return othersOf(this.told, this.context).flatMap(({ name, colour }) => (attitudes[name] ? [{ attitude: attitudes[name], colour }] : []));
  }

  private draw(): void {
    if (!this.isSeen()) return;
    const colours = this.context.colours();
    const attitude = this.primary();
    const others = attitude ? this.others() : [];
    const course: Course = {
      heading: attitude && this.heading(attitude),
      sd: attitude?.sd?.[2] ?? null,
      others: others.map((other) => ({ heading: this.heading(other.attitude), colour: other.colour })),
      rate: this.rate,
      isFree: this.told?.north === "free" || (this.newest?.tared ?? false),
    };
    const strip = sheet(this.tape);
    if (strip) drawTape(strip.ctx, strip.width, strip.height, course, colours);
    const page = sheet(this.dials);
    if (page) {
      const { ctx, width, height } = page;
      const radius = Math.max(10, Math.min(width / 4, height / 2) - 4);
      const seen = attitude && this.seen(attitude);
      if (seen) {
        const sd = attitude.sd ? ([attitude.sd[0] ?? 0, attitude.sd[1] ?? 0] as [number, number]) : null;
        const apart = others.flatMap((other) => {
          const found = this.seen(other.attitude);
          return found ? [{ seen: found, colour: other.colour }] : [];
        });
        drawHorizon(ctx, width / 4, height / 2, radius, { seen, sd, others: apart, isLarge: radius > 105 }, colours.ink);
      }
      drawRose(ctx, (3 * width) / 4, height / 2, radius, course, colours);
    }
    this.tell(attitude, course);
  }

  private tell(attitude: Attitude | null, course: Course): void {
    const { cells } = this;
    const { t } = this.context;
    if (!attitude) {
      const why = this.told?.frame === null ? t("not estimated") : "";
      for (const cell of Object.values(cells)) cell.show("—", why);
      return;
    }
    const sd = (k: number): string => (attitude.sd ? `±${fixed(attitude.sd[k], 2)}° (1 σ)` : "");
    const isTared = this.newest?.tared ?? false;
    cells.heading.show(degrees(course.heading ?? NaN).replace("360.00", "0.00"), t(isTared ? "clockwise from above" : (NORTHS[this.told?.north ?? ""] ?? "")));
    cells.yaw.show(degrees(attitude.yaw), sd(2));
    cells.pitch.show(degrees(attitude.pitch), sd(1));
    cells.roll.show(degrees(attitude.roll), sd(0));
    const rate = course.rate;
    cells.turn.show(rate === null ? "—" : `${fixed(rate, 1)}°/s`, rate === null ? "" : `${t("scale")} ±${rateScale(rate)}°/s`);
  }
}

function degrees(value: number): string {
  return Number.isFinite(value) ? `${fixed(value, 2)}°` : "—";
}

export const instruments: PanelFactory = (context) => new Instruments(context);
