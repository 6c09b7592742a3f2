// Charts of one recording: they share their time, their zoom and their cursor.

import uPlot from "uplot";
import { Values, type Chart, type Line, type Subject, type Words } from "./data";
import { cut, thin, type Column, type Drawn } from "./thin";

const HEIGHT = { time: 170, points: 190, spectrum: 280, flags: 0 };
const FONT = '12px system-ui, -apple-system, "Segoe UI", Roboto, "Noto Sans", "Noto Sans CJK SC", sans-serif';
const LONG = 10800; // a longer recording has hours on its time axis, s
const CLOCK = [0.001, 0.01, 0.1, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1200, 1800, 3600, 7200, 10800, 21600, 43200, 86400, 172800, 604800];
const ROW = 20; // height of a row of flags, px

export function colour(name: string, alpha = ""): string {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim() + alpha;
}

export class Group {
  readonly values: Values;
  private readonly plots: Plot[] = [];
  private range: [number, number];
  private chosen = false;

  constructor(
    readonly subject: Subject,
    readonly words: Words,
    readonly key: string,
  ) {
    this.values = new Values(subject);
    this.range = this.whole;
  }

  get whole(): [number, number] {
    const end = this.subject.end > this.subject.begin ? this.subject.end : this.subject.begin + 1;
    return [this.subject.begin, end];
  }

  get shown(): [number, number] {
    return this.range;
  }

  add(chart: Chart, figure: HTMLElement): void {
    this.plots.push(new Plot(this, chart, figure));
  }

  /** Show a stretch of time in all charts. */
  show(begin: number, end: number): void {
    const [low, high] = this.whole;
    const least = Math.max((high - low) * 1e-7, 1e-6);
    if (end - begin < least) return;
    const length = Math.min(end - begin, high - low);
    const start = Math.max(low, Math.min(begin, high - length));
    this.range = [start, start + length];
    for (const plot of this.plots) plot.refresh();
  }

  /** Show what was dragged over; the charts that follow the cursor say the same, and are not heard. */
  choose(begin: number, end: number): void {
    if (this.chosen) return;
    this.chosen = true;
    setTimeout(() => (this.chosen = false));
    this.show(begin, end);
  }

  reset(): void {
    this.show(...this.whole);
  }

  resize(width?: number): void {
    for (const plot of this.plots) plot.resize(width);
  }

  redraw(): void {
    for (const plot of this.plots) plot.redraw();
  }
}

class Plot {
  private readonly plot: uPlot;
  private readonly place: HTMLElement;
  private readonly readouts: HTMLElement[];
  private readonly epoch: number;

  constructor(
    private readonly group: Group,
    private readonly chart: Chart,
    figure: HTMLElement,
  ) {
    this.place = figure.querySelector<HTMLElement>(".plot") as HTMLElement;
    this.readouts = [...figure.querySelectorAll<HTMLElement>("[data-line]")];
    this.epoch = this.timed ? (group.subject.epoch ?? 0) : 0;
    this.plot = new uPlot(this.options(), this.data() as uPlot.AlignedData, this.place);
    this.place.addEventListener("keydown", (event) => this.onKey(event));
    new ResizeObserver(() => this.resize()).observe(this.place);
  }

  private get timed(): boolean {
    return this.chart.kind !== "spectrum";
  }

  refresh(): void {
    if (!this.timed) return;
    const [begin, end] = this.group.shown;
    this.place.dataset.shown = `${begin} ${end}`;
    this.plot.batch(() => {
      this.plot.setData(this.data() as uPlot.AlignedData, false);
      this.plot.setScale("x", { min: this.epoch + begin, max: this.epoch + end });
    });
  }

  resize(width = this.place.clientWidth): void {
    if (width > 0 && Math.abs(width - this.plot.width) > 0.5) {
      this.plot.setSize({ width, height: this.height });
      this.refresh();
    }
  }

  redraw(): void {
    this.plot.redraw(false, true);
  }

  private get height(): number {
    return this.chart.kind === "flags" ? 56 + ROW * (this.chart.rows ?? []).length : HEIGHT[this.chart.kind];
  }

  private data(): Drawn {
    const { kind, lines } = this.chart;
    if (kind === "spectrum" || kind === "points")
      return [(this.chart.x ?? []).map((x) => this.epoch + x), ...lines.map((line) => line.y ?? [])];
    const [begin, end] = this.group.shown;
    if (kind === "flags") return [[this.epoch + begin, this.epoch + end], [null, null]];
    return this.traces(begin, end);
  }

  private traces(begin: number, end: number): Drawn {
    const names = this.chart.lines.map((line) => line.channel as string);
    const columns = Math.max(100, Math.round(this.place.clientWidth || 900));
    const sd = this.chart.lines[0]?.sd;
    const drawn = thin(this.group.values, sd ? [...names, sd] : names, begin, end, columns, this.epoch);
    const found = sd ? banded(drawn) : drawn;
    return this.chart.period ? cut(found, this.chart.period) : found;
  }

  private options(): uPlot.Options {
    const [begin, end] = this.group.shown;
    const time = this.timed && this.group.subject.epoch !== null;
    const sd = this.chart.lines[0]?.sd !== undefined;
    const ys: uPlot.Series[] = this.chart.lines.map((line) => this.series(line));
    if (sd) ys.push({ label: "−", stroke: () => colour("sky", "00"), width: 0 }, { label: "+", stroke: () => colour("sky", "00"), width: 0 });
    if (this.chart.kind === "flags") ys.push({ show: false });
    return {
      width: this.place.clientWidth || 900,
      height: this.height,
      legend: { show: false },
      padding: [8, 14, 0, 0],
      tzDate: (stamp) => uPlot.tzDate(new Date(stamp * 1e3), "Etc/UTC"),
      scales: {
        x: this.timed
          ? { time, auto: false, min: this.epoch + begin, max: this.epoch + end }
          : { time: false, distr: 3 },
        y: this.yScale(),
      },
      axes: [this.xAxis(time), this.yAxis()],
      series: [{}, ...ys],
      bands: sd ? [{ series: [3, 2], fill: () => colour("sky", "66") }] : [],
      cursor: this.cursor(),
      select: { show: true, left: 0, top: 0, width: 0, height: 0 },
      hooks: { setSelect: [(plot) => this.onSelect(plot)], setCursor: [(plot) => this.onCursor(plot)], draw: [(plot) => this.onDraw(plot)] },
    };
  }

  private series(line: Line): uPlot.Series {
    const points = this.chart.kind === "points";
    return {
      label: line.label,
      stroke: () => colour(line.colour),
      width: points ? 1.5 : 1,
      dash: line.dash ? [5, 4] : undefined,
      points: { show: points, size: 5, fill: () => colour(line.colour) },
    };
  }

  private yScale(): uPlot.Scale {
    if (this.chart.kind === "spectrum") return { distr: 3 };
    if (this.chart.kind === "flags") return { auto: false, min: 0, max: 1 };
    const period = this.chart.period;
    const floor = this.chart.floor;
    return {
      range: (_plot, min, max) => {
        if (min === null || max === null || !Number.isFinite(min)) return period ?? [0, 1];
        if (period && max - min > 0.5 * (period[1] - period[0])) return period;
        if (max - min < 1e-9 * Math.max(1, Math.abs(max))) return [min - 1, max + 1];
        const [low, high] = uPlot.rangeNum(min, max, 0.08, false);
        return [floor === undefined ? (low ?? min) : floor, high ?? max];
      },
    };
  }

  private xAxis(time: boolean): uPlot.Axis {
    const axis = this.axis();
    if (!this.timed) return { ...axis, label: this.chart.xlabel ?? "", labelSize: 18, labelFont: FONT, labelGap: 0, size: 34, values: (_p, splits) => splits.map(power), ...decades };
    if (time)
      return { ...axis, size: 34, space: 76, label: this.group.words.utc, labelSize: 16, labelFont: FONT, labelGap: 0, incrs: CLOCK, values: (_p, splits) => splits.map(utc) };
    const [begin, end] = this.group.whole;
    const long = end - begin > LONG;
    return {
      ...axis,
      size: 34,
      label: long ? this.group.words.clock : this.group.words.time,
      labelSize: 16,
      labelFont: FONT,
      labelGap: 0,
      values: (_p, splits) => splits.map((value) => (long ? clock(value) : signed(value))),
      ...(long ? { incrs: CLOCK, space: 64 } : {}),
    };
  }

  private yAxis(): uPlot.Axis {
    const axis = this.axis();
    if (this.chart.kind === "flags") return { ...axis, show: true, size: 112, values: () => [], grid: { show: false }, ticks: { show: false } };
    const circle = this.chart.period ? this.chart.period[1] - this.chart.period[0] : 0;
    const wide = (plot: uPlot) => circle > 0 && (plot.scales.y?.max ?? 0) - (plot.scales.y?.min ?? 0) >= 0.75 * circle;
    return {
      ...axis,
      size: 58,
      ...(this.chart.kind === "spectrum" ? decades : {}),
      ...(circle > 0 ? { incrs: (plot: uPlot) => (wide(plot) ? [90, 180] : [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 45, 90]) } : {}),
      values: (_plot, splits) => splits.map((value) => (this.chart.kind === "spectrum" ? power(value) : value === null ? "" : signed(this.chart.compass && this.chart.period?.[0] !== 0 ? ((value % 360) + 360) % 360 : value))),
    };
  }

  private axis(): uPlot.Axis {
    return {
      stroke: () => colour("muted"),
      font: FONT,
      grid: { stroke: () => colour("grid"), width: 1 },
      ticks: { stroke: () => colour("grid"), width: 1, size: 4 },
      gap: 4,
    };
  }

  private cursor(): uPlot.Cursor {
    return {
      y: false,
      points: { show: this.chart.kind !== "time" && this.chart.kind !== "flags" },
      drag: { x: true, y: false, setScale: false },
      bind: {
        dblclick: () => () => {
          if (this.timed) this.group.reset();
          else this.plot.setData(this.data() as uPlot.AlignedData, true);
          return null;
        },
      },
      ...(this.timed ? { sync: { key: this.group.key, scales: ["x", null] as [string, null] } } : {}),
    };
  }

  private onSelect(plot: uPlot): void {
    const { left, width } = plot.select;
    if (width < 4) return;
    const begin = plot.posToVal(left, "x");
    const end = plot.posToVal(left + width, "x");
    plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    if (this.timed) this.group.choose(begin - this.epoch, end - this.epoch);
    else plot.setScale("x", { min: begin, max: end });
  }

  private onCursor(plot: uPlot): void {
    const left = plot.cursor.left ?? -1;
    const at = left < 0 ? null : plot.posToVal(left, "x");
    this.readouts.forEach((place, k) => {
      place.textContent = at === null ? "" : this.readout(k, at, plot);
    });
  }

  private readout(k: number, at: number, plot: uPlot): string {
    const line = this.chart.lines[k];
    if (!line) return "";
    if (line.channel) {
      const value = this.group.values.nearest(line.channel, at - this.epoch);
      const sd = line.sd ? this.group.values.nearest(line.sd, at - this.epoch) : null;
      if (value === null) return "–";
      const digits = sd !== null ? Math.max(1, Math.min(4, 1 - Math.floor(Math.log10(Math.max(sd, 1e-4))))) : 3;
      const shown = this.chart.compass ? ((value % 360) + 360) % 360 : value;
      return `${signed(shown, digits)}${sd === null ? "" : ` ± ${sd.toFixed(digits)}`} ${this.chart.unit}`;
    }
    const value = (line.y ?? [])[plot.cursor.idx ?? -1];
    return value === null || value === undefined ? "" : Number(value.toPrecision(3)).toString().replace("-", "−");
  }

  private onDraw(plot: uPlot): void {
    const { ctx, bbox } = plot;
    const ratio = devicePixelRatio || 1;
    ctx.save();
    ctx.beginPath();
    ctx.rect(this.chart.kind === "flags" ? 0 : bbox.left, bbox.top, bbox.left + bbox.width, bbox.height);
    ctx.clip();
    if (this.chart.limit !== undefined) {
      const y = plot.valToPos(this.chart.limit, "y", true);
      ctx.strokeStyle = colour("red");
      ctx.lineWidth = ratio;
      ctx.setLineDash([6 * ratio, 4 * ratio]);
      ctx.beginPath();
      ctx.moveTo(bbox.left, y);
      ctx.lineTo(bbox.left + bbox.width, y);
      ctx.stroke();
    }
    (this.chart.rows ?? []).forEach((row, k) => {
      const top = bbox.top + (k * bbox.height) / (this.chart.rows ?? []).length;
      const high = bbox.height / (this.chart.rows ?? []).length;
      ctx.fillStyle = colour("muted");
      ctx.font = FONT.replace("12px", `${12 * ratio}px`);
      ctx.textBaseline = "middle";
      ctx.textAlign = "right";
      ctx.fillText(row.label, bbox.left - 8 * ratio, top + high / 2);
      ctx.fillStyle = colour(row.colour);
      for (const [begin, end] of row.runs) {
        const a = Math.max(bbox.left, plot.valToPos(this.epoch + begin, "x", true));
        const b = Math.min(bbox.left + bbox.width, plot.valToPos(this.epoch + end, "x", true));
        if (b >= bbox.left && a <= bbox.left + bbox.width) ctx.fillRect(a, top + 0.2 * high, Math.max(b - a, ratio), 0.6 * high);
      }
    });
    ctx.restore();
  }

  private onKey(event: KeyboardEvent): void {
    if (!this.timed) return;
    const [begin, end] = this.group.shown;
    const length = end - begin;
    const moves: Record<string, [number, number]> = {
      ArrowLeft: [begin - 0.1 * length, end - 0.1 * length],
      ArrowRight: [begin + 0.1 * length, end + 0.1 * length],
      "+": [begin + 0.25 * length, end - 0.25 * length],
      "=": [begin + 0.25 * length, end - 0.25 * length],
      "-": [begin - 0.5 * length, end + 0.5 * length],
      Home: this.group.whole,
      Escape: this.group.whole,
    };
    const move = moves[event.key];
    if (!move) return;
    event.preventDefault();
    this.group.show(...move);
  }
}

/** Value, and the two edges of the band about it, of value and standard deviation. */
function banded([x, y, sd]: Drawn): Drawn {
  const edge = (sign: number): Column =>
    (y as Column).map((value, i) => {
      const s = (sd as Column)[i];
      return typeof value === "number" && typeof s === "number" ? value + sign * s : null;
    });
  return [x, y as Column, edge(-1), edge(1)];
}

/** Time of day in UTC; at midnight and at the first mark with the day. */
function utc(value: number, place: number): string {
  const text = new Date(value * 1e3).toISOString();
  const seconds = value % 60 === 0 ? "" : Number.isInteger(value) ? text.slice(16, 19) : text.slice(16, 23);
  const clock = text.slice(11, 16) + seconds;
  return place === 0 || value % 86400 === 0 ? `${text.slice(0, 10)} ${clock}` : clock;
}

/** Hours, minutes and, where they are not zero, seconds. */
function clock(value: number): string {
  const whole = Math.round(value * 1000) / 1000;
  const minutes = Math.floor(whole / 60);
  const seconds = whole - 60 * minutes;
  const text = `${Math.floor(minutes / 60)}:${String(minutes % 60).padStart(2, "0")}`;
  return seconds === 0 ? text : `${text}:${Number(seconds.toFixed(3)).toString().padStart(2, "0")}`;
}

function signed(value: number, digits?: number): string {
  const text = digits === undefined ? Number(value.toPrecision(7)).toString() : value.toFixed(digits);
  return text.replace("-", "−");
}

/** Of a logarithmic axis, lines and words at the powers of ten alone. */
const decades: Partial<uPlot.Axis> = {
  filter: (_plot, splits) => splits.map((value) => (power(value) === "" ? null : value)),
  grid: { stroke: () => colour("grid"), width: 1, filter: (_plot: uPlot, splits: number[]) => splits.map((value) => (power(value) === "" ? null : value)) } as uPlot.Axis.Grid,
};

function power(value: number | null): string {
  if (value === null) return "";
  const exponent = Math.round(Math.log10(value));
  if (Math.abs(Math.log10(value) - exponent) > 1e-6) return "";
  if (exponent >= -2 && exponent <= 3) return Number(value.toPrecision(3)).toString();
  return "10" + [...String(exponent)].map((digit) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[Number(digit)] ?? "⁻").join("");
}
