// Allan deviation of the stream so far, which needs a unit at rest.
import "uplot/dist/uPlot.min.css";
import "./scene.css";

import uPlot from "uplot";

import type { AllanCurve, Hello } from "../messages";
import type { Colours, Context, Panel, PanelFactory } from "../panel";
import { button, keep, kept, make, press, put, watched, Words } from "./scene/dom";
import { type Reads, readOff } from "./scene/reads";

type Sensor = "gyr" | "acc";

const SENSORS: [Sensor, string][] = [["gyr", "Gyroscope"], ["acc", "Accelerometer"]];
const AXES = ["x", "y", "z"];
const SLOPES: [number, string][] = [[-0.5, "−½"], [0, "0"], [0.5, "+½"]];
const FEWEST = 3;
const PER_ROOT_HOUR = 60; // from 1/√s to 1/√h

class Allan implements Panel {
  readonly element = make("section", "allan-panel");
  private readonly words: Words;
  private readonly sensors = new Map<Sensor, HTMLButtonElement>();
  private readonly reset: HTMLButtonElement;
  private readonly lasts = make("span", "allan-lasts");
  private readonly answer = make("p", "guide-answer");
  private readonly hint = make("p", "allan-hint");
  private readonly plot = make("div", "allan-plot");
  private readonly empty = make("p", "allan-empty");
  private readonly table = make("table");
  private readonly isSeen: () => boolean;
  private drawn: uPlot | null = null;
  private shape = "";
  private sensor: Sensor;
  private told: Hello | null = null;
  private curve: AllanCurve | null = null;
  private reads: Reads[] = [];

  constructor(private readonly context: Context) {
    this.words = new Words(context);
    const { words } = this;
    this.sensor = kept("allan", "gyr") === "acc" ? "acc" : "gyr";
    words.attribute(this.element, "aria-label", "Allan deviation");
    const bar = make("div", "allan-bar");
    const segments = make("div", "segments");
    segments.setAttribute("role", "group");
    words.attribute(segments, "aria-label", "Sensor");
    for (const [sensor, english] of SENSORS) {
      const one = words.text(button("", () => this.choose(sensor)), english);
      this.sensors.set(sensor, one);
      segments.append(one);
    }
    this.reset = words.text(button("", () => void this.again()), "Start over");
    bar.append(segments, this.lasts, this.reset);
    words.text(this.hint, "The unit must be at rest. Figures are provisional: a data sheet is made from a recording with plumbob noise.");
    this.answer.setAttribute("role", "alert");
    this.plot.setAttribute("role", "img");
    words.attribute(this.plot, "aria-label", "Allan deviation over averaging time, both logarithmic; the figures are in the table");
    this.plot.append(this.empty);
    const scroll = make("div", "allan-table");
    scroll.append(this.table);
    this.element.append(bar, this.answer, this.plot, scroll, this.hint);
    this.isSeen = watched(this.plot, () => this.draw());
    this.choose(this.sensor);
  }

  hello(hello: Hello): void {
    this.told = hello;
    this.shape = "";
    this.draw();
  }

  allan(curve: AllanCurve): void {
    this.curve = curve;
    this.draw();
  }

  clear(): void {
    this.curve = null;
    this.draw();
  }

  stale(stale: boolean): void {
    this.element.classList.toggle("stale", stale);
  }

  restyle(): void {
    this.words.again();
    this.shape = "";
    this.draw();
  }

  private choose(sensor: Sensor): void {
    this.sensor = sensor;
    keep("allan", sensor);
    for (const [name, one] of this.sensors) press(one, name === sensor);
    this.shape = "";
    this.draw();
  }

  private async again(): Promise<void> {
    put(this.answer, "");
    try {
      const answer = await this.context.send({ verb: "allan-reset" });
      if (answer.ok) this.clear();
      else put(this.answer, answer.text);
    } catch {
      put(this.answer, this.context.t("The command was not sent: there is no connection."));
    }
  }

  private unit(): string {
    return this.told?.columns.find(({ key }) => key === `${this.sensor}.x`)?.unit ?? (this.sensor === "gyr" ? "°/s" : "m/s²");
  }

  /** Averaging times and a row of deviations for each axis; only what can be drawn on a logarithmic scale. */
  private data(): (number | null)[][] {
    const { curve } = this;
    const tau = curve?.tau ?? [];
    const rows = AXES.map((axis) => (curve?.deviation[`${this.sensor}.${axis}`] ?? []).map((value) => (value !== null && value > 0 ? value : null)));
    return [[...tau], ...rows.map((row) => tau.map((_, k) => row[k] ?? null))];
  }

  private draw(): void {
    const { t } = this.context;
    const [tau = [], ...rows] = this.data();
    const isThere = rows.filter((row) => row.filter((value) => value !== null).length >= FEWEST).length > 0;
    this.reset.hidden = !(this.told?.control ?? false);
    put(this.lasts, this.curve ? `${duration(this.curve.duration)} ${t("of data")}` : "");
    put(this.empty, isThere ? "" : t("The curve appears after some seconds at rest"));
    this.empty.hidden = isThere;
    this.reads = rows.map((row) => readOff(tau as number[], row, this.curve?.duration ?? 0));
    this.tell();
    if (!isThere) {
      this.drawn?.destroy();
      this.drawn = null;
      this.shape = "";
      return;
    }
    const { clientWidth: width, clientHeight: height } = this.plot;
    if (!this.isSeen() || height === 0) return;
    const data = [tau, ...rows] as unknown as uPlot.AlignedData;
    const shape = `${this.sensor} ${this.unit()}`;
    if (this.drawn && shape === this.shape) {
      if (this.drawn.width !== width || this.drawn.height !== height) this.drawn.setSize({ width, height });
      this.drawn.setData(data);
      return;
    }
    this.drawn?.destroy();
    this.shape = shape;
    this.drawn = new uPlot(this.options(width, height), data, this.plot);
  }

  private options(width: number, height: number): uPlot.Options {
    const colours = this.context.colours();
    const shades = [colours.red, colours.green, colours.blue];
    const { t } = this.context;
    const font = "12px system-ui, sans-serif";
    const axis = { stroke: colours.ink, font, labelFont: font, labelSize: 18, grid: { stroke: colours.grid, width: 1 }, ticks: { stroke: colours.grid, width: 1 } };
    return {
      width,
      height,
      scales: {
        x: { time: false, distr: 3, log: 10, range: decades },
        y: { distr: 3, log: 10, range: decades },
      },
      legend: { show: false },
      cursor: { y: false, points: { size: 7 }, drag: { x: false, y: false } },
      padding: [10, 14, 0, 0],
      axes: [
        { ...axis, label: `${t("averaging time")} τ [s]`, values: (_, splits) => splits.map(tick), space: 34, size: 34 },
        { ...axis, label: `${t("Allan deviation")} [${this.unit()}]`, values: (_, splits) => splits.map(tick), space: 22, size: 52 },
      ],
      series: [
        {},
        ...AXES.map((label, k): uPlot.Series => ({
          label,
          stroke: shades[k]!,
          width: 2,
          dash: [[], [7, 3], [2, 3]][k]!,
          points: { show: (plot) => plot.data[0].length < 60, size: 4, fill: shades[k]!, stroke: shades[k]! },
        })),
      ],
      hooks: {
        drawAxes: [(plot) => this.slopes(plot, colours)],
        draw: [(plot) => this.marks(plot, shades, colours)],
        setCursor: [() => this.tell()],
      },
    };
  }

  /** Faint lines of slopes −½, 0 and +½ through the middle of what was read off. */
  private slopes(plot: uPlot, colours: Colours): void {
    const lowest = this.reads.flatMap(({ lowest }) => lowest ?? []);
    if (lowest.length === 0) return;
    const mean = (values: number[]): number => Math.exp(values.reduce((sum, value) => sum + Math.log(value), 0) / values.length);
    const [tau, deviation] = [mean(lowest.map((one) => one.tau)), mean(lowest.map((one) => one.deviation))];
    const white = this.reads.flatMap(({ white }) => white ?? []);
    const { min = 1, max = 1 } = plot.scales.x!;
    const { ctx, bbox } = plot;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.strokeStyle = ctx.fillStyle = colours.muted;
    ctx.lineWidth = devicePixelRatio;
    ctx.font = `${12 * devicePixelRatio}px system-ui, sans-serif`;
    for (const [slope, text] of SLOPES) {
      const at = (time: number): number => (slope < 0 && white.length > 0 ? mean(white) * time ** slope : deviation * (time / tau) ** slope);
      const [from, to] = [slope > 0 ? tau : min, max];
      const [x0, y0, x1, y1] = [plot.valToPos(from, "x", true), plot.valToPos(at(from), "y", true), plot.valToPos(to, "x", true), plot.valToPos(at(to), "y", true)];
      ctx.globalAlpha = 0.55;
      ctx.setLineDash([2 * devicePixelRatio, 4 * devicePixelRatio]);
      ctx.beginPath();
      ctx.moveTo(x0, y0);
      ctx.lineTo(x1, y1);
      ctx.stroke();
      ctx.globalAlpha = 1;
      ctx.textAlign = "right";
      const right = bbox.left + bbox.width - 4 * devicePixelRatio;
      const y = y1 + (right - x1) * ((y1 - y0) / Math.max(1, x1 - x0)) - 4 * devicePixelRatio;
      ctx.fillText(text, right, Math.max(bbox.top + 14 * devicePixelRatio, Math.min(bbox.top + bbox.height - 6, y)));
    }
    ctx.restore();
  }

  /** Rings at what was read off: N at τ = 1 s, and the lowest points. */
  private marks(plot: uPlot, shades: string[], colours: Colours): void {
    const { ctx } = plot;
    ctx.save();
    this.reads.forEach(({ white, lowest, falling }, k) => {
      const points: [number, number][] = [];
      if (white !== null) points.push([1, white]);
      if (lowest && !falling) points.push([lowest.tau, lowest.deviation]);
      for (const [tau, value] of points) {
        ctx.beginPath();
        ctx.arc(plot.valToPos(tau, "x", true), plot.valToPos(value, "y", true), 5 * devicePixelRatio, 0, 2 * Math.PI);
        ctx.fillStyle = colours.paper;
        ctx.fill();
        ctx.strokeStyle = shades[k]!;
        ctx.lineWidth = 2 * devicePixelRatio;
        ctx.stroke();
      }
    });
    ctx.restore();
  }

  private tell(): void {
    const { t } = this.context;
    const unit = this.unit();
    const k = this.drawn?.cursor.idx ?? null;
    const under = k === null ? null : (this.curve?.tau[k] ?? null);
    const isRate = this.sensor === "gyr";
    const root = unit.replace("/s", "").replace("²", "");
    const head = [t("axis"), `N [${unit}/√Hz]`, isRate ? `N [${root}/√h]` : `N [${root}/s/√h]`, `${t("lowest")} [${unit}]`, `τ [s]`];
    if (under !== null) head.push(`σ(${figure(under)} s)`);
    const colours = this.context.colours();
    const shades = [colours.red, colours.green, colours.blue];
    const rows = AXES.map((axis, n) => {
      const { white, lowest, falling } = this.reads[n] ?? { white: null, lowest: null, falling: false };
      const cells = [
        axis,
        white === null ? "—" : figure(white),
        white === null ? "—" : figure(white * PER_ROOT_HOUR),
        lowest === null ? "—" : falling ? t("still falling") : figure(lowest.deviation),
        lowest === null || falling ? "—" : figure(lowest.tau),
      ];
      if (under !== null) cells.push(figure(this.data()[n + 1]?.[k!] ?? null));
      return cells;
    });
    const all = [head, ...rows];
    const said = JSON.stringify([all, shades]);
    if (this.table.dataset.said === said) return;
    this.table.dataset.said = said;
    this.table.replaceChildren(
      ...all.map((cells, n) => {
        const row = make("tr");
        row.append(...cells.map((text, j) => this.cell(text, n, j, shades)));
        return row;
      }),
    );
  }

  private cell(text: string, row: number, column: number, shades: string[]): HTMLElement {
    const cell = make(row === 0 || column === 0 ? "th" : "td", "", text);
    cell.setAttribute("scope", row === 0 ? "col" : "row");
    if (row > 0 && column === 0) {
      const mark = make("i", ["solid", "dashed", "dotted"][row - 1]);
      mark.style.color = shades[row - 1]!;
      cell.prepend(mark);
    }
    if (cell.tagName === "TD") cell.removeAttribute("scope");
    return cell;
  }
}

/** Three significant digits. */
function figure(value: number | null): string {
  if (value === null || !Number.isFinite(value)) return "—";
  return value !== 0 && (Math.abs(value) < 1e-4 || Math.abs(value) >= 1e5) ? scientific(value) : String(Number(value.toPrecision(3)));
}

function scientific(value: number): string {
  const [digits, exponent] = value.toExponential(2).split("e");
  return `${digits}·10${raised(Number(exponent))}`;
}

const RAISED = "⁰¹²³⁴⁵⁶⁷⁸⁹";
const raised = (exponent: number): string => (exponent < 0 ? "⁻" : "") + [...String(Math.abs(exponent))].map((digit) => RAISED[Number(digit)]).join("");

/** Words at a mark of a logarithmic axis. */
function tick(value: number | null): string {
  if (value === null) return "";
  const exponent = Math.round(Math.log10(value));
  const isSmall = value < 0.9e-4 && Math.abs(value / 10 ** exponent - 1) < 1e-6;
  return isSmall ? `10${raised(exponent)}` : figure(value);
}

/** The data with a margin, and half a decade at least. */
function decades(_: uPlot, low: number, high: number): [number, number] {
  if (!(low > 0) || !(high > 0)) return [0.1, 10];
  const wide = Math.max(0.5, Math.log10(high / low) + 0.3) - Math.log10(high / low);
  return [low * 10 ** (-wide / 2), high * 10 ** (wide / 2)];
}

/** A length of time: seconds, minutes, hours. */
export function duration(seconds: number): string {
  if (seconds < 120) return `${seconds.toFixed(0)} s`;
  return seconds < 7200 ? `${(seconds / 60).toFixed(1)} min` : `${(seconds / 3600).toFixed(2)} h`;
}

export const allan: PanelFactory = (context) => new Allan(context);
