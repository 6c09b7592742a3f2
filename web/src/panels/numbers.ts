// Numbers: the attitude, large; all channels with their raw counts; flags in words.
import { h, put, say, set } from "../dom";
import { flagNamed } from "../flags";
import { fixed, NONE, signed, wrapped } from "../format";
import type { Attitude, Column, Hello, State } from "../messages";
import { ANGLE_NAMES, compass, headed, primaryOf, REFERENCE, SHORT } from "../names";
import type { Own, OwnPanel, Shell } from "../shell";

const ANGLES = ["roll", "pitch", "yaw"] as const;
const EVERY = 95;

/** Write at most every tenth of a second: faster, nobody can read. */
function calm(write: (state: State) => void): Pick<OwnPanel, "state" | "frame"> {
  let newest: State | null = null;
  let last = 0;
  return {
    state(state) {
      newest = state;
    },
    frame(now) {
      if (newest === null || now - last < EVERY) return;
      last = now;
      write(newest);
      newest = null;
    },
  };
}

function digitsOf(hello: Hello, name: string, angle: string): number {
  return hello.columns.find((column) => column.key === `${name}.${angle}`)?.digits ?? 2;
}

function calledOf(hello: Hello, tared: boolean, angle: string): string {
  return ANGLE_NAMES[angle === "yaw" && headed(hello, tared) ? "heading" : angle] ?? angle;
}

/** Roll, pitch and heading of the primary estimator, and the others beside it. */
export const attitude: Own = (shell) => {
  const big = h("dl", { class: "big" });
  const table = h("tbody");
  const head = h("tr");
  const others = h("div", { class: "scroll", attributes: { tabindex: "0", role: "group" }, aria: "Attitude by estimator" }, h("table", { class: "grid" }, h("thead", {}, head), table));
  const none = h("p", { class: "none", say: "Nothing estimates an attitude here." });
  const joints = h("tbody");
  const chain = h("table", { class: "grid", aria: "Joint angles" }, h("thead", {}, h("tr", {}, ...["Joint", "Angle", "Claimed sd"].map((title) => h("th", { say: title, attributes: { scope: "col" } })))), joints);
  const tared = h("p", { class: "tared", say: "Angles count from the tare; charts do not." });
  tared.hidden = true;
  const element = h("div", { class: "attitude" }, chain, big, tared, others, none);
  let hello: Hello | null = null;
  let cells: { name: HTMLElement; value: HTMLElement; sd: HTMLElement }[] = [];
  let heads: HTMLElement[] = [];
  const yaw = h("small", { class: "live" });
  let rows = new Map<string, HTMLElement[]>();
  let angles: [number, HTMLElement][] = [];

  function build(shell: Shell, now: Hello): void {
    hello = now;
    cells = ANGLES.map((angle) => ({ name: h("span", { say: calledOf(now, false, angle) }), value: h("span", { class: "value live", text: NONE }), sd: h("span", { class: "sd live", text: "" }) }));
    big.replaceChildren(
      ...ANGLES.map((angle, i) =>
        h("div", {}, h("dt", {}, cells[i]!.name, angle === "yaw" ? yaw : null), h("dd", {}, cells[i]!.value, h("span", { class: "degree", text: "°", attributes: { "aria-hidden": "true" } }), cells[i]!.sd)),
      ),
    );
    const erring = now.columns.some((one) => one.chart === "error");
    heads = ANGLES.map((angle) => h("th", { say: calledOf(now, false, angle), attributes: { scope: "col" } }));
    head.replaceChildren(
      h("th", { say: "Estimator", attributes: { scope: "col" } }),
      ...heads,
      ...(erring ? [h("th", { say: "Error", hint: "Angle to the reference", attributes: { scope: "col" } })] : []),
    );
    rows = new Map();
    table.replaceChildren();
    for (const { name, title } of now.estimators) {
      const swatch = h("i", { class: name === REFERENCE ? "swatch dashed" : "swatch" });
      swatch.style.color = shell.colourOf(name);
      const called = name === REFERENCE ? h("span", { say: "reference" }) : h("span", { text: name });
      const titled = h("th", { attributes: { scope: "row" } }, swatch, called);
      if (title !== name) titled.title = title;
      const made = (erring ? [0, 1, 2, 3] : [0, 1, 2]).map(() => h("td", { class: "live" }, h("span"), h("small")));
      rows.set(name, made);
      table.append(h("tr", {}, titled, ...made));
    }
    const empty = !now.estimators.some((one) => one.name !== REFERENCE);
    big.hidden = empty;
    others.hidden = rows.size < 2 && !erring;
    angles = [];
    joints.replaceChildren();
    for (const { key, label } of now.columns.filter(({ chart }) => chart === "joint")) {
      const made = [key, `${key}.sd`].map((name) => [now.columns.findIndex((one) => one.key === name), h("td", { class: "live" })] as [number, HTMLElement]);
      angles.push(...made);
      joints.append(h("tr", {}, h("th", { text: label, attributes: { scope: "row" } }), ...made.map(([, cell]) => cell)));
    }
    chain.hidden = angles.length === 0;
    none.hidden = !empty || !chain.hidden;
  }

  function write(state: State): void {
    if (hello === null) return;
    const primary = primaryOf(hello);
    const main = primary ? state.attitudes[primary.name] : undefined;
    tared.hidden = !state.tared;
    for (const [i, cell] of angles) put(cell, `${hello.columns[i]!.key.endsWith(".sd") ? "± " : ""}${fixed(state.values[i], 2)}°`);
    ANGLES.forEach((angle, i) => {
      const digits = digitsOf(hello!, primary?.name ?? "", angle);
      const turned = angle === "yaw" && main ? compass(hello!, state.tared, main.yaw) : null;
      put(cells[i]!.value, fixed(turned ?? main?.[angle], digits));
      if (angle === "yaw") {
        const called = calledOf(hello!, state.tared, angle);
        say(cells[i]!.name, turned === null ? called : "Heading");
        say(heads[i]!, called);
        if (turned === null || called === "Heading") put(yaw, "");
        else put(yaw, `${shell.t("yaw")} ${fixed(main?.yaw, digits)}°`);
      }
      const sd = main?.sd?.[i];
      put(cells[i]!.sd, sd === undefined || sd === null ? "" : `± ${fixed(sd, Math.max(1, digits))}`);
    });
    for (const [name, made] of rows) row(name, made, state.attitudes[name], name === primary?.name ? undefined : main);
  }

  function row(name: string, made: HTMLElement[], own: Attitude | undefined, main: Attitude | undefined): void {
    ANGLES.forEach((angle, i) => {
      const digits = digitsOf(hello!, name, angle);
      const [value, difference] = made[i]!.children as unknown as [HTMLElement, HTMLElement];
      put(value, fixed(own?.[angle], digits));
      put(difference, own && main ? `Δ ${signed(wrapped(own[angle] - main[angle]), digits)}` : "");
    });
    if (made[3]) put(made[3].children[0]!, name === REFERENCE ? "" : fixed(own?.error, 2));
  }

  return {
    element,
    ...calm(write),
    hello: (now) => build(shell, now),
    restyle() {
      if (hello) build(shell, hello);
      const state = shell.latest();
      if (state) write(state);
    },
  };
};

interface Cells {
  columns: number[];
  cells: HTMLElement[];
}

/** Label of a column without its source: a field's is gyr.x. */
function shortened(column: Column): string {
  return column.source && column.label.startsWith(`${column.source}.`) ? column.label.slice(column.source.length + 1) : column.label;
}

function grouped(columns: readonly Column[], key: (column: Column) => string): [Column, number[]][] {
  const found = new Map<string, number[]>();
  columns.forEach((column, i) => found.set(key(column), [...(found.get(key(column)) ?? []), i]));
  return [...found.values()].map((of) => [columns[of[0]!]!, of]);
}

/** Every channel: its value with its unit, and its counts as they were decoded. */
export const channels: Own = (shell) => {
  const body = h("div", { class: "channels" });
  let physical: Cells[] = [];
  let raw: Cells[] = [];
  let hello: Hello | null = null;

  function line(title: HTMLElement, columns: readonly Column[], of: number[], unit: string): [HTMLElement, Cells] {
    const cells = of.map(() => h("span", { class: "value live", text: NONE }));
    const named = (column: Column) => h("span", { class: "label", say: shortened(column) });
    const values = of.map((i, k) => h("span", { class: "one" }, of.length > 1 ? named(columns[i]!) : null, cells[k]!));
    return [h("div", { class: "line" }, h("div", { class: "title" }, title, h("span", { class: "unit", text: unit === title.textContent ? "" : unit })), h("div", { class: of.length > 1 && of.some((i) => shortened(columns[i]!).length > 2) ? "triad stacked" : "triad" }, ...values)), { columns: of, cells }];
  }

  function build(now: Hello): void {
    hello = now;
    physical = [];
    raw = [];
    const lines: HTMLElement[] = [];
    const shown = now.columns.map((column, i) => ({ column, i })).filter(({ column }) => !["attitude", "error", "joint", "joint_sd"].includes(column.chart));
    for (const [first, places] of grouped(shown.map(({ column }) => column), (column) => `${column.chart} ${column.source} ${column.unit}`)) {
      const title = h("h3", { say: SHORT[first.chart] ?? first.chart });
      const own = now.estimators.some((one) => one.name === first.source);
      const [made, cells] = line(title, now.columns, places.map((place) => shown[place]!.i), first.unit);
      if (own) made.firstElementChild!.append(h("span", { class: "source", text: first.source }));
      physical.push(cells);
      lines.push(made);
    }
    if (now.raw.length) lines.push(h("h3", { class: "divider", say: "Raw, as decoded" }));
    for (const [first, places] of grouped(now.raw, (column) => `${column.source || column.label} ${column.unit}`)) {
      const [made, cells] = line(h("h3", { text: first.source || first.label }), now.raw, places, first.unit);
      raw.push(cells);
      lines.push(made);
    }
    body.replaceChildren(...lines);
  }

  function fill(groups: Cells[], columns: readonly Column[], values: readonly (number | null)[]): void {
    for (const group of groups) group.columns.forEach((i, k) => put(group.cells[k]!, fixed(values[i], columns[i]!.digits)));
  }

  return {
    element: body,
    ...calm((state) => {
      if (hello === null) return;
      fill(physical, hello.columns, state.values);
      fill(raw, hello.raw, state.raw);
    }),
    hello: build,
    restyle() {
      const state = shell.latest();
      if (hello && state) fill(physical, hello.columns, state.values);
    },
  };
};

/** Flags of the newest sample, with what they mean; those that were set before stay, pale. */
export const flags: Own = (shell) => {
  const list = h("ul", { class: "flags" });
  const none = h("p", { class: "none", say: "No flag has been set." });
  const element = h("div", {}, none, list);
  const seen = new Map<string, HTMLElement>();

  function item(name: string): HTMLElement {
    const flag = flagNamed(name);
    const state = h("span", { class: "now" });
    const one = h("li", { class: flag.weight }, h("i", { class: "lamp", attributes: { "aria-hidden": "true" } }), h("b", { say: flag.name }), state, h("span", { class: "meaning", say: flag.meaning }));
    return one;
  }

  function write(state: State): void {
    for (const name of state.flags) {
      if (seen.has(name)) continue;
      seen.set(name, item(name));
      list.replaceChildren(...[...seen].sort(([a], [b]) => flagNamed(a).bit - flagNamed(b).bit).map(([, one]) => one));
    }
    none.hidden = seen.size > 0;
    for (const [name, one] of seen) {
      const on = state.flags.includes(name);
      set(one, "data-on", String(on));
      say(one.querySelector<HTMLElement>(".now")!, on ? "set" : "not set");
    }
  }

  return {
    element,
    ...calm(write),
    clear() {
      seen.clear();
      list.replaceChildren();
    },
    restyle() {
      const state = shell.latest();
      if (state) write(state);
    },
  };
};
