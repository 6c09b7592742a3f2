// Strip charts: all columns over the same time, with one cursor.
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { aria, button, h, hint, put, say, set } from "../dom";
import { envelope, limits, Points, runs } from "../envelope";
import { FLAGS } from "../flags";
import { clock, fixed, utc } from "../format";
import { rememberedNames, rememberNames } from "../memory";
import type { Column, Happened, Hello } from "../messages";
import type { Rows } from "../panel";
import type { OwnPanel, Shell } from "../shell";
import { theme } from "../theme";
import { placeOf } from "../store";
import { ANGLE_NAMES, NAMES, primaryOf, REFERENCE, SHORT } from "../names";

export const WINDOWS = [5, 10, 20, 30, 60, 120, 180, 300, 600];
const ORDER = ["attitude", "joint", "error", "rate", "force", "field", "flags", "residual", "sd", "bias", "temperature"];
const QUIET = new Set(["sd", "joint_sd", "bias", "temperature"]);
const EVERY = 48;
const BUDGET = 6;
const PLOT = 84;
const LANE = 15;
const AXIS = 54;
const RULER = 18;
const DEGREES = [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 45, 90, 180];
const INCREMENTS = [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600];

interface Line {
  column: number;
  of: Column;
  axis: number;
  shown: boolean;
  points: Points;
  value: HTMLElement;
}

interface Span {
  from: number;
  to: number;
}

/** Columns that are drawn in one strip. */
export interface Group {
  chart: string;
  label: string;
  columns: number[];
}

/** One strip for each chart; where several sources have several values each, or units differ, one for each of these. */
export function groups(columns: readonly Column[]): Group[] {
  const found: Group[] = [];
  const charts = [...new Set(columns.map((column) => column.chart))];
  charts.sort((a, b) => (ORDER.indexOf(a) + 1 || 99) - (ORDER.indexOf(b) + 1 || 99));
  for (const chart of charts) {
    const of = columns.map((_, i) => i).filter((i) => columns[i]!.chart === chart);
    const sources = new Set(of.map((i) => columns[i]!.source));
    const labels = [...new Set(of.map((i) => columns[i]!.label))];
    const units = new Set(of.map((i) => columns[i]!.unit));
    const one = chart === "error" || (chart !== "attitude" && units.size === 1 && (sources.size === 1 || labels.length === 1));
    if (one) found.push({ chart, label: "", columns: of });
    else for (const label of labels) found.push({ chart, label, columns: of.filter((i) => columns[i]!.label === label) });
  }
  return found;
}

export function charts(shell: Shell): OwnPanel & { hold(on?: boolean): void; held(): boolean } {
  const hidden = rememberedNames("charts.off");
  const asked = rememberedNames("charts.on");
  let strips: Strip[] = [];
  let reach = WINDOWS[3]!;
  let span: Span | null = null;
  let drawn: Span = { from: 0, to: 1 };
  let cursor: number | null = null;
  let round = 0;
  let queue: Strip[] = [];
  let marks: { t: number; text: string }[] = [];
  let epoch = -1;
  let dirty = true;
  let spent = 0;
  let before = 0;
  let late = 16;
  let share = 1;

  const times = WINDOWS.map((seconds, i) =>
    button(
      {
        class: "chip", text: seconds < 60 ? `${seconds} s` : `${seconds / 60} min`,
        hint: "Show the last {} s (key {})", hintValues: [seconds, i + 1],
      },
      () => follow(seconds),
    ),
  );
  const holder = button({ class: "chip hold", say: "Hold", hint: "Hold the charts, or go back to the latest samples (key h; Esc; a double click on a chart)" }, () => hold());
  const readout = h("output", { class: "readout", attributes: { "aria-live": "off" } });
  const chooser = h("div", { class: "chooser", aria: "Charts that are shown", attributes: { role: "group" } });
  const area = h("div", { class: "strips", attributes: { tabindex: "0", role: "group" } });
  aria(area, "Charts: arrow keys move the cursor, + and − change the span of time, h holds");
  const empty = h("p", { class: "none", say: "No samples yet." });
  const element = h(
    "div", { class: "charts" },
    h("div", { class: "tools" },
      h("div", { class: "chips", aria: "Span of time", attributes: { role: "group" } }, ...times),
      holder,
      readout,
    ),
    chooser, area, empty,
  );

  const seen = new IntersectionObserver((entries) => {
    for (const entry of entries) {
      const strip = strips.find((one) => one.element === entry.target);
      if (strip) strip.visible = entry.isIntersecting;
    }
    dirty = true;
  }, { rootMargin: "80px" });
  function fit(): void {
    const height = tall();
    for (const strip of strips) strip.fit(height);
    dirty = true;
  }
  const sized = new ResizeObserver(fit);
  sized.observe(area);

  /** Height of the plots: what a large screen has room for. */
  function tall(): number {
    const columns = getComputedStyle(area).gridTemplateColumns.split(" ").length;
    const rows = Math.ceil(strips.filter((strip) => !strip.element.hidden).length / columns) || 1;
    return Math.round(Math.min(170, Math.max(PLOT, (innerHeight - 170) / rows - RULER - 24)));
  }

  function follow(seconds = reach): void {
    reach = seconds;
    span = null;
    dirty = true;
    tools();
  }

  function hold(on = span === null): void {
    if (on && shell.store.newest === null) return;
    span = on ? { ...drawn } : null;
    dirty = true;
    tools();
  }

  function zoom(to: Span): void {
    const newest = shell.store.newest;
    const oldest = shell.store.oldest;
    if (newest === null || oldest === null) return;
    const length = Math.min(WINDOWS.at(-1)!, Math.max(0.02, to.to - to.from));
    const end = Math.min(Math.max(to.from + length, oldest + Math.min(length, 0.1)), newest + length * 0.02);
    span = { from: end - length, to: end };
    dirty = true;
    tools();
  }

  function tools(): void {
    times.forEach((one, i) => set(one, "aria-pressed", String(span === null && WINDOWS[i] === reach)));
    set(holder, "aria-pressed", String(span !== null));
    say(holder, span === null ? "Hold" : "Held");
    element.classList.toggle("held", span !== null);
  }

  function shown(chart: string): boolean {
    return QUIET.has(chart) ? asked.has(chart) : !hidden.has(chart);
  }

  function choose(chart: string): void {
    const [names, key] = QUIET.has(chart) ? ([asked, "charts.on"] as const) : ([hidden, "charts.off"] as const);
    if (!names.delete(chart)) names.add(chart);
    rememberNames(key, names);
    arrange();
  }

  function arrange(): void {
    for (const one of chooser.children) set(one, "aria-pressed", String(shown((one as HTMLElement).dataset["chart"] ?? "")));
    for (const strip of strips) strip.element.hidden = !shown(strip.chart);
    fit();
  }

  function build(hello: Hello): void {
    for (const strip of strips) strip.end();
    seen.disconnect();
    queue = [];
    strips = groups(hello.columns).map((group) => new Strip(group, hello));
    const at = strips.findIndex((strip) => ORDER.indexOf(strip.chart) > ORDER.indexOf("flags"));
    strips.splice(at < 0 ? strips.length : at, 0, new Strip({ chart: "flags", label: "", columns: [] }, hello));
    area.replaceChildren(...strips.map((strip) => strip.element));
    for (const strip of strips) seen.observe(strip.element);
    const names = [...new Set(strips.map((strip) => strip.chart))];
    chooser.replaceChildren(
      ...names.map((chart) => button({ class: "chip", say: SHORT[chart] ?? chart, attributes: { "data-chart": chart } }, () => choose(chart))),
    );
    arrange();
    tools();
  }

  /** Colour of a line: an estimator's where there are several, an axis' where there is one. */
  function colour(strip: Strip, line: Line): string {
    if (strip.bySource) return shell.colourOf(line.of.source);
    const { red, green, blue } = shell.colours();
    if (strip.lines.length === 1) return blue;
    return [red, green, blue][line.axis] ?? shell.series(line.axis);
  }

  function point(time: number | null): void {
    cursor = time;
    for (const strip of strips) strip.cursor();
  }

  class Strip {
    readonly element: HTMLElement;
    readonly chart: string;
    readonly bySource: boolean;
    readonly lines: Line[];
    visible = true;
    private readonly plot: uPlot;
    private readonly host = h("div", { class: "plot" });
    private readonly hair = h("div", { class: "hair" });
    private readonly unit: string;
    private readonly least: number;
    private readonly angle: boolean;
    private readonly bands: { line: Line; sd: number; points: Points }[] = [];
    private lanes: number[] = [];
    private spans = new Map<number, number[]>();
    private height = PLOT;

    constructor(readonly group: Group, private readonly hello: Hello) {
      this.chart = group.chart;
      const columns = group.columns.map((i) => hello.columns[i]!);
      this.unit = columns[0]?.unit ?? "";
      this.angle = this.chart === "attitude" && this.unit === "°";
      this.least = 10 ** -(columns[0]?.digits ?? 0) * 8;
      const sources = new Set(columns.map((column) => column.source));
      this.bySource = sources.size > 1 || (columns.length === 1 && hello.estimators.some((one) => sources.has(one.name)));
      this.lines = columns.map((of, k) => ({
        column: group.columns[k]!, of, axis: k, shown: true, points: new Points(), value: h("span", { class: "value live" }),
      }));
      this.element = h("section", { class: "strip" }, this.head(), this.host);
      this.plot = this.make();
      this.plot.over.append(this.hair);
      this.band();
      this.hands();
    }

    private head(): HTMLElement {
      const { label } = this.group;
      const name = h("h3");
      if (this.chart === "attitude") say(name, ANGLE_NAMES[label] ?? label);
      else say(name, NAMES[this.chart] ?? this.chart);
      const legend = h("div", { class: "legend" });
      const labels = new Set(this.lines.map((line) => line.of.label)).size;
      for (const line of this.lines) {
        const swatch = h("i", { class: line.of.source === REFERENCE ? "dashed" : "", attributes: { "data-line": line.of.key } });
        const called = h("span");
        if (this.bySource && line.of.source === REFERENCE) say(called, "reference");
        else if (this.bySource) put(called, line.of.source);
        else say(called, line.of.label);
        const one = button({ class: "key", attributes: { "aria-pressed": "true" } }, () => {
          line.shown = !line.shown;
          set(one, "aria-pressed", String(line.shown));
          this.plot.setSeries(this.lines.indexOf(line) + 1, { show: line.shown });
          dirty = true;
        });
        hint(one, "Show or hide this line");
        one.append(swatch, called, line.value);
        if (this.bySource && labels > 1) called.after(h("span", { class: "label", say: line.of.label }));
        legend.append(one);
      }
      const title = h("div", { class: "title" }, name);
      if (label && this.chart !== "attitude") title.append(h("span", { class: "label", say: label }));
      title.append(h("span", { class: "unit", text: this.unit }));
      return h("header", {}, title, legend);
    }

    /** A band of one claimed standard deviation of the primary estimator. */
    private band(): void {
      if (this.chart !== "attitude") return;
      const primary = primaryOf(this.hello)?.name;
      for (const line of this.lines.filter((one) => one.of.source === primary)) {
        const sd = this.hello.columns.findIndex((one) => one.chart === "sd" && one.source === primary && one.label === line.of.label);
        if (sd >= 0) this.bands.push({ line, sd, points: new Points() });
      }
    }

    private make(): uPlot {
      const { colours } = shell;
      const axis = (more: uPlot.Axis): uPlot.Axis => ({
        stroke: () => colours().muted, font: "11px system-ui, sans-serif", gap: 4,
        grid: { stroke: () => colours().grid, width: 1 }, ticks: { show: false }, ...more,
      });
      const options: uPlot.Options = {
        width: 320, height: this.height + RULER, pxAlign: false, legend: { show: false }, padding: [8, 8, 0, 0],
        cursor: { y: false, x: false, points: { show: false }, drag: { x: true, y: false, setScale: false, dist: 6 } },
        scales: { x: { time: false, auto: false, range: (_, low, high) => [low, high] }, y: { auto: false, range: (_, low, high) => [low, high] } },
        axes: [
          axis({ size: RULER, space: 70, incrs: INCREMENTS, values: (_, at, __, ___, step) => at.map((time) => (time < Math.min(0, shell.store.oldest ?? 0) ? "" : clock(time, step < 1 ? Math.ceil(-Math.log10(step)) : 0))) }),
          axis({
            size: AXIS, space: 24, show: this.chart !== "flags", ...(this.angle ? { incrs: DEGREES } : {}),
            values: (_, at, __, ___, step) => at.map((value) => fixed(value, step < 1 ? Math.ceil(-Math.log10(step) - 0.001) : 0)),
          }),
        ],
        series: [
          {},
          // uPlot scales and strokes axes; lines are drawn here, with joins that cost less.
          ...this.lines.map((): uPlot.Series => ({ points: { show: false }, auto: false, paths: () => null })),
        ],
        hooks: {
          drawAxes: [(plot) => this.under(plot)],
          setSelect: [(plot) => this.selected(plot)],
        },
      };
      if (this.chart === "flags") options.padding = [8, 8, 0, AXIS];
      const data = [[0, 1], ...this.lines.map(() => [0, 0])] as uPlot.AlignedData;
      return new uPlot(options, data, this.host);
    }

    private selected(plot: uPlot): void {
      const { left, width } = plot.select;
      if (width < 6) return;
      zoom({ from: plot.posToVal(left, "x"), to: plot.posToVal(left + width, "x") });
      plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    }

    private hands(): void {
      const over = this.plot.over;
      const timeAt = (x: number) => this.plot.posToVal(x - over.getBoundingClientRect().left, "x");
      over.addEventListener("pointermove", (event) => point(timeAt(event.clientX)));
      over.addEventListener("pointerdown", (event) => point(timeAt(event.clientX)));
      over.addEventListener("pointerleave", (event) => {
        if (event.pointerType === "mouse") point(null);
      });
      over.addEventListener("dblclick", () => follow());
      over.addEventListener(
        "wheel",
        (event) => {
          if (!event.ctrlKey && !event.shiftKey && span === null) return;
          event.preventDefault();
          const at = timeAt(event.clientX);
          const sideways = event.shiftKey && Math.abs(event.deltaX) > Math.abs(event.deltaY);
          if (sideways) return zoom({ from: drawn.from + (event.deltaX / 600) * (drawn.to - drawn.from), to: drawn.to + (event.deltaX / 600) * (drawn.to - drawn.from) });
          const by = Math.exp((event.deltaY || event.deltaX) / 400);
          zoom({ from: at - (at - drawn.from) * by, to: at + (drawn.to - at) * by });
        },
        { passive: false },
      );
    }

    fit(height = this.height): void {
      if (this.chart !== "flags") this.height = height;
      const width = Math.floor(this.host.clientWidth);
      if (width > 80 && (width !== this.plot.width || this.height + RULER !== this.plot.height)) this.plot.setSize({ width, height: this.height + RULER });
    }

    draw(): void {
      const { store } = shell;
      const { from, to } = drawn;
      const width = (to - from) / Math.max(50, this.plot.width - AXIS - 8);
      const start = Math.max(store.first, placeOf(store.t, store.first, store.end, from) - 1);
      const stop = Math.min(store.end, placeOf(store.t, store.first, store.end, to) + 1);
      const gap = shell.gap();
      let low = Infinity, high = -Infinity;
      if (this.chart === "flags") {
        this.spans = runs(store.t, store.flags, start, stop, width, gap);
        const now = FLAGS.filter((flag) => this.spans.has(flag.bit)).map((flag) => flag.bit);
        for (const bit of now) if (!this.lanes.includes(bit)) this.lanes.push(bit);
        this.lanes.sort((a, b) => a - b);
        const height = Math.max(2, this.lanes.length) * LANE + 12;
        if (height !== this.height) {
          this.height = height;
          this.fit();
        }
        [low, high] = [0, 1];
      }
      for (const line of this.lines) {
        if (!line.shown) continue;
        envelope(store.t, store.values[line.column]!, start, stop, width, { gap, step: this.angle ? 180 : Infinity }, line.points);
        low = Math.min(low, line.points.low);
        high = Math.max(high, line.points.high);
      }
      for (const band of this.bands) {
        if (band.line.shown) envelope(store.t, store.values[band.sd]!, start, stop, 4 * width, { gap, step: Infinity }, band.points);
      }
      const [bottom, top] = this.chart === "flags" ? [low, high] : limits(low, high, this.least, this.angle);
      this.plot.batch(() => {
        this.plot.setScale("x", { min: from, max: to });
        this.plot.setScale("y", { min: bottom, max: top });
      });
      this.cursor();
    }

    /** What lies under the lines: the band, lanes of flags, marks. */
    private under(plot: uPlot): void {
      const { ctx, bbox } = plot;
      const { sky, amber } = shell.colours();
      const ratio = devicePixelRatio || 1;
      const x = (time: number) => bbox.left + ((time - drawn.from) / (drawn.to - drawn.from)) * bbox.width;
      ctx.save();
      ctx.beginPath();
      ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
      ctx.clip();
      for (const band of this.bands) if (band.line.shown) this.claim(plot, band.line.points, band.points, sky, x);
      if (this.chart === "flags") this.lanesOf(plot, x, ratio);
      ctx.fillStyle = amber;
      for (const mark of marks) if (mark.t >= drawn.from) ctx.fillRect(x(mark.t) - ratio / 2, bbox.top, ratio, bbox.height);
      const wide = theme() === "sun" ? 2 : 1;
      ctx.lineJoin = "bevel";
      for (const line of [...this.lines].sort((one, other) => this.order(one) - this.order(other))) {
        if (!line.shown) continue;
        ctx.strokeStyle = colour(this, line);
        ctx.lineWidth = ratio * wide * (this.order(line) ? 1.5 : 1);
        ctx.setLineDash(line.of.source === REFERENCE ? [6 * ratio, 4 * ratio] : []);
        ctx.beginPath();
        trace(ctx, plot, line.points);
        ctx.stroke();
      }
      ctx.setLineDash([]);
      ctx.restore();
    }

    /** The primary estimator is drawn over the others, and the reference over it. */
    private order(line: Line): number {
      return !this.bySource ? 0 : line.of.source === REFERENCE ? 2 : line.of.source === primaryOf(this.hello)?.name ? 1 : 0;
    }

    private claim(plot: uPlot, line: Points, sd: Points, fill: string, x: (time: number) => number): void {
      const { ctx, bbox } = plot;
      const { min = 0, max = 1 } = plot.scales["y"]!;
      const y = (value: number) => bbox.top + ((max! - value) / (max! - min!)) * bbox.height;
      ctx.fillStyle = fill;
      ctx.globalAlpha = 0.3;
      let k = 0;
      let start = 0;
      const spread: number[] = [];
      const piece = (stop: number) => {
        if (stop - start > 1) {
          ctx.beginPath();
          for (let i = start; i < stop; i++) ctx.lineTo(x(line.x[i]!), y(line.y[i]! + spread[i]!));
          for (let i = stop - 1; i >= start; i--) ctx.lineTo(x(line.x[i]!), y(line.y[i]! - spread[i]!));
          ctx.fill();
        }
        start = stop + 1;
      };
      for (let i = 0; i < line.n; i++) {
        while (k + 1 < sd.n && sd.x[k + 1]! <= line.x[i]!) k++;
        spread[i] = sd.n ? sd.y[k]! : NaN;
        if (Number.isNaN(line.y[i]!) || Number.isNaN(spread[i]!)) piece(i);
      }
      piece(line.n);
      ctx.globalAlpha = 1;
    }

    private lanesOf(plot: uPlot, x: (time: number) => number, ratio: number): void {
      const { ctx, bbox } = plot;
      const { red, amber, blue, ink, muted, grid, paper } = shell.colours();
      const lane = LANE * ratio;
      ctx.font = `${11 * ratio}px system-ui, sans-serif`;
      ctx.textBaseline = "middle";
      ctx.textAlign = "left";
      if (this.lanes.length === 0) {
        ctx.fillStyle = muted;
        ctx.fillText(shell.t("no flags"), bbox.left + 6 * ratio, bbox.top + lane);
      }
      this.lanes.forEach((bit, k) => {
        const flag = FLAGS.find((one) => one.bit === bit)!;
        const top = bbox.top + (3 + k * LANE) * ratio;
        ctx.fillStyle = grid;
        ctx.fillRect(bbox.left, top + lane - ratio, bbox.width, ratio);
        ctx.fillStyle = { bad: red, warn: amber, note: blue }[flag.weight];
        const pieces = this.spans.get(bit) ?? [];
        for (let i = 0; i < pieces.length; i += 2) {
          const left = x(pieces[i]!);
          ctx.fillRect(left, top + 2 * ratio, Math.max(1.5 * ratio, x(pieces[i + 1]!) - left), lane - 5 * ratio);
        }
        const name = shell.t(flag.name);
        const width = ctx.measureText(name).width;
        ctx.fillStyle = paper;
        ctx.globalAlpha = 0.85;
        ctx.fillRect(bbox.left, top + ratio, width + 8 * ratio, lane - 3 * ratio);
        ctx.globalAlpha = 1;
        ctx.fillStyle = ink;
        ctx.fillText(name, bbox.left + 4 * ratio, top + lane / 2 - 0.5 * ratio);
      });
    }

    cursor(): void {
      const inside = cursor !== null && cursor >= drawn.from && cursor <= drawn.to;
      this.hair.hidden = !inside;
      if (inside) this.hair.style.transform = `translateX(${this.plot.valToPos(cursor!, "x")}px)`;
    }

    /** Values of the legend: at the cursor, or the newest. */
    values(): void {
      const { store } = shell;
      const at = cursor === null ? store.end - 1 : nearest(cursor);
      for (const line of this.lines) put(line.value, at < store.first ? fixed(null, 0) : fixed(store.values[line.column]![at], line.of.digits));
    }

    restyle(): void {
      for (const swatch of this.element.querySelectorAll<HTMLElement>("i[data-line]")) {
        const line = this.lines.find((one) => one.of.key === swatch.dataset["line"]);
        if (line) swatch.style.color = colour(this, line);
      }
    }

    end(): void {
      this.plot.destroy();
    }
  }

  function nearest(time: number): number {
    const { store } = shell;
    const at = Math.min(store.end - 1, placeOf(store.t, store.first, store.end, time));
    return at > store.first && time - store.t[at - 1]! < store.t[at]! - time ? at - 1 : at;
  }

  function trace(ctx: CanvasRenderingContext2D, plot: uPlot, points: Points): void {
    const { left, top, width, height } = plot.bbox;
    const { min, max } = plot.scales["y"]!;
    const kx = width / (drawn.to - drawn.from);
    const ky = height / (max! - min!);
    let begun = false;
    for (let i = 0; i < points.n; i++) {
      const value = points.y[i]!;
      if (value !== value) {
        begun = false;
        continue;
      }
      const x = left + (points.x[i]! - drawn.from) * kx;
      const y = top + (max! - value) * ky;
      if (begun) ctx.lineTo(x, y);
      else {
        ctx.moveTo(x, y);
        // A sample that stands alone is a dot.
        if (i + 1 >= points.n || Number.isNaN(points.y[i + 1]!)) ctx.lineTo(x + 0.5, y);
        begun = true;
      }
    }
  }

  let written = 0;
  function write(now: number): void {
    if (now - written < 100) return;
    written = now;
    for (const strip of strips) if (strip.visible && !strip.element.hidden) strip.values();
    const hello = shell.hello();
    const time = cursor === null ? null : shell.store.length ? shell.store.t[nearest(cursor)]! : null;
    const day = time !== null && hello?.started_utc ? `  ${utc(hello.started_utc + time, 3)}` : "";
    put(readout, time === null ? "" : `${clock(time, 3)}${day}`);
  }

  return {
    element,
    hello(hello) {
      build(hello);
      for (const strip of strips) strip.restyle();
    },
    rows(rows: Rows) {
      if (rows.epoch !== epoch) span = null;
      epoch = rows.epoch;
      dirty ||= span === null;
    },
    event(event: Happened) {
      if ((event.kind === "mark" || event.kind === "remark") && event.t !== null) marks = [...marks.slice(-200), { t: event.t, text: event.text }];
    },
    clear() {
      marks = [];
      follow();
    },
    restyle() {
      const hello = shell.hello();
      if (hello) build(hello);
      for (const strip of strips) strip.restyle();
    },
    frame(now) {
      const newest = shell.store.newest;
      empty.hidden = newest !== null;
      write(now);
      // Where frames come late, the charts are drawn less often: what is painted is not in the time that is spent here.
      late += 0.1 * (Math.min(100, now - before) - late);
      before = now;
      if (queue.length === 0) {
        if (!dirty || newest === null || now - round < Math.max(EVERY * Math.min(3, Math.max(1, late / 18)), 3 * spent)) return;
        round = now;
        dirty = false;
        spent = 0;
        drawn = span ?? { from: newest - reach, to: newest };
        queue = strips.filter((strip) => strip.visible && !strip.element.hidden);
        share = Math.ceil(queue.length / 3);
      }
      const begun = performance.now();
      for (let n = 0; n < share && queue.length && performance.now() - begun < BUDGET; n++) queue.shift()!.draw();
      spent += performance.now() - begun;
    },
    key(key, event) {
      if (/^[1-9]$/.test(key) && !event.ctrlKey && !event.altKey) return follow(WINDOWS[Number(key) - 1]), true;
      if (key === "h") return hold(), true;
      if (key === "Escape" && span !== null) return follow(), true;
      if (!area.contains(document.activeElement)) return false;
      const length = drawn.to - drawn.from;
      const middle = cursor ?? (drawn.from + drawn.to) / 2;
      if (key === "ArrowLeft" || key === "ArrowRight") {
        const by = (event.shiftKey ? 0.1 : 0.01) * (key === "ArrowLeft" ? -length : length);
        point(Math.min(drawn.to, Math.max(drawn.from, (cursor ?? drawn.to) + by)));
        return true;
      }
      if (key === "+" || key === "=") return zoom({ from: middle - (middle - drawn.from) / 1.5, to: middle + (drawn.to - middle) / 1.5 }), true;
      if (key === "-" || key === "−") return zoom({ from: middle - (middle - drawn.from) * 1.5, to: middle + (drawn.to - middle) * 1.5 }), true;
      return false;
    },
    hold,
    held: () => span !== null,
  };
}
