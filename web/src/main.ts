// The live page: it takes what the server sends, and lets each panel draw at most once in a frame.
import "./style.css";
import { Connection } from "./connection";
import { h, put, sayAgain } from "./dom";
import { Header } from "./header";
import { helpDialog } from "./help";
import { chooseLanguage, t } from "./i18n";
import { Layout, type Frame } from "./layout";
import type { Hello, State } from "./messages";
import { colourOf, REFERENCE } from "./names";
import type { PanelFactory, Rows } from "./panel";
import { allan } from "./panels/allan";
import { charts } from "./panels/charts";
import { controls } from "./panels/controls";
import { events } from "./panels/events";
import { guide } from "./panels/guide";
import { instruments } from "./panels/instruments";
import { link } from "./panels/link";
import { attitude, channels, flags } from "./panels/numbers";
import { playback } from "./panels/playback";
import { scene } from "./panels/scene";
import { terminal } from "./panels/terminal";
import type { Shell } from "./shell";
import { Store } from "./store";
import { chooseTheme, colours, onSystemTheme, series } from "./theme";

const query = new URLSearchParams(location.search);
chooseLanguage(query);
chooseTheme(query);

const KEPT_ROWS = 2000;
const store = new Store();
let hello: Hello | null = null;
let state: State | null = null;
let epoch = -1;
/** When the newest sample came, by this page's clock, ms; and its time. */
let cameAt = 0;
let newestT: number | null = null;
let stale = false;
/** Rows since a while ago, by number, for panels that were not seen. */
let recent: { number: number; rows: Rows }[] = [];
let rowNumber = 0;
const fresh = new Map<Frame, Set<"state" | "allan" | "guide">>();
let newestAllan: Parameters<NonNullable<Frame["panel"]["allan"]>>[0] | null = null;
let newestGuide: Parameters<NonNullable<Frame["panel"]["guide"]>>[0] | null = null;

const toasts = h("div", { class: "toasts", attributes: { role: "status", "aria-live": "polite" } });

function toast(text: string, ok: boolean): void {
  const one = h("p", { class: ok ? "ok" : "failed", text });
  toasts.append(one);
  while (toasts.childElementCount > 3) toasts.firstElementChild?.remove();
  setTimeout(() => one.remove(), ok ? 4000 : 9000);
}

const shell: Shell = {
  store,
  t,
  colours,
  series,
  hello: () => hello,
  latest: () => state,
  send: (command) => connection.send(command),
  async ask(command) {
    const answer = await connection.send(command);
    toast(t(answer.text) || t(answer.ok ? "done" : "not done"), answer.ok);
    return answer.ok;
  },
  colourOf: (source) => colourOf(source, hello, shell),
  nameOf: (source) => (source === REFERENCE ? t("reference") : source),
  gap: () => 3.5 * Math.max(1 / (hello?.rate ?? 60), (state?.playback?.speed ?? 1) / 60),
};

const foreign = (factory: PanelFactory) => factory(shell);
const charting = charts(shell);
const player = playback(shell);
const controlling = controls(shell);
const layout = new Layout(
  [
    { name: "playback", title: "Playback", panel: player, wide: 1, medium: 1, phone: 3 },
    { name: "attitude", title: "Attitude", panel: attitude(shell), wide: 0, medium: 0, phone: 0 },
    { name: "instruments", title: "Instruments", panel: foreign(instruments), wide: 2, medium: 0, phone: 1 },
    { name: "controls", title: "Recording and control", panel: controlling, wide: 0, medium: 0, phone: 2 },
    { name: "scene", title: "Body", panel: foreign(scene), wide: 2, medium: 1, phone: 4 },
    { name: "charts", title: "Charts", panel: charting, wide: 1, medium: 1, phone: 6 },
    { name: "flags", title: "Flags", panel: flags(shell), wide: 0, medium: 0, phone: 5 },
    { name: "link", title: "Link", panel: link(shell), wide: 0, medium: 0, phone: 7 },
    { name: "events", title: "Events", panel: events(unseen)(shell), wide: 2, medium: 1, phone: 8 },
    { name: "channels", title: "Channels", panel: channels(shell), wide: 0, medium: 0, phone: 9 },
    { name: "guide", title: "Guided calibration", panel: foreign(guide), wide: 2, medium: 1, phone: 10, folded: true },
    { name: "allan", title: "Allan deviation", panel: foreign(allan), wide: 2, medium: 1, phone: 11, folded: true },
    { name: "terminal", title: "Output lines", panel: terminal(shell), wide: 2, medium: 1, phone: 12, folded: true },
  ],
);
const help = helpDialog();
const header = new Header(restyle, showHelp);

function unseen(n: number): void {
  const { badge } = layout.get("events");
  badge.hidden = n === 0;
  put(badge, t("{} new", n));
}

function showHelp(): void {
  if (help.open) help.close();
  else help.showModal();
}

function restyle(language = false): void {
  if (language) sayAgain(document);
  header.restyle();
  for (const frame of layout.frames) frame.panel.restyle?.();
}

function marked(kind: "state" | "allan" | "guide"): void {
  for (const frame of layout.frames) {
    if (!frame.panel[kind]) continue;
    const waiting = fresh.get(frame);
    if (waiting) waiting.add(kind);
    else fresh.set(frame, new Set([kind]));
  }
}

function begin(now: number): void {
  epoch = now;
  recent = [];
  newestT = null;
  store.clear();
  for (const frame of layout.frames) frame.panel.clear?.();
}

const connection = new Connection({
  standing(standing, why) {
    header.standing(standing, why);
    document.documentElement.dataset["connection"] = standing;
  },
  hello(now, first) {
    if (first && hello !== null && !sameStream(hello, now)) begin(-1);
    hello = now;
    recent = [];
    store.setColumns(now.columns);
    header.greet(now);
    layout.show("playback", now.duration !== null || !now.live);
    layout.show("guide", now.guides.length > 0);
    for (const frame of layout.frames) frame.panel.hello?.(now);
    if (state) marked("state");
  },
  rows(rows) {
    if (hello === null || rows.t.length === 0) return;
    if (rows.epoch !== epoch) begin(rows.epoch);
    else if (connectionBegan(rows)) store.clear();
    const added = store.add(rows);
    if (added === null) return;
    arrived(added.t[added.t.length - 1]!);
    recent.push({ number: ++rowNumber, rows: added });
    let kept = recent.reduce((sum, one) => sum + one.rows.t.length, 0);
    while (recent.length > 1 && kept > KEPT_ROWS) kept -= recent.shift()!.rows.t.length;
  },
  state(now) {
    if (now.epoch !== epoch) begin(now.epoch);
    state = now;
    if (now.t !== null) arrived(now.t);
    marked("state");
  },
  other(message) {
    if (message.type === "event") for (const frame of layout.frames) frame.panel.event?.(message);
    else if (message.type === "lines") for (const frame of layout.frames) frame.panel.lines?.(message);
    else if (message.type === "allan") {
      newestAllan = message;
      marked("allan");
    } else if (message.type === "guide") {
      newestGuide = message;
      marked("guide");
    }
  },
});

/** Whether a server that was lost and found again still shows the same stream. */
function sameStream(a: Hello, b: Hello): boolean {
  return a.session === b.session && a.device === b.device && a.started_utc === b.started_utc && a.live === b.live && a.duration === b.duration;
}

/** Whether time has begun again without an epoch: rows that end before what is here. */
function connectionBegan(rows: Rows): boolean {
  const oldest = store.oldest;
  return oldest !== null && rows.t[rows.t.length - 1]! < oldest;
}

function arrived(time: number): void {
  if (newestT !== null && time <= newestT) return;
  newestT = time;
  cameAt = performance.now();
}

/** How long no sample has come, s, where that is too long; null where all is well, or nothing is to come. */
function silence(now: number): number | null {
  if (newestT === null) return null;
  if (state?.playback && !state.playback.playing && connection.standing === "connected") return null;
  const since = (now - cameAt) / 1000;
  return since > Math.max(1, 5 / (hello?.rate ?? 5)) ? since : null;
}

function deliver(frame: Frame): void {
  const { panel } = frame;
  if (panel.rows && frame.rowsSeen < rowNumber) {
    const missing = recent.filter((one) => one.number > frame.rowsSeen).map((one) => one.rows);
    frame.rowsSeen = rowNumber;
    if (missing.length) panel.rows(joined(missing));
  }
  const waiting = fresh.get(frame);
  if (!waiting) return;
  fresh.delete(frame);
  if (waiting.has("state") && state) panel.state?.(state);
  if (waiting.has("allan") && newestAllan) panel.allan?.(newestAllan);
  if (waiting.has("guide") && newestGuide) panel.guide?.(newestGuide);
}

function joined(parts: Rows[]): Rows {
  const first = parts[0]!;
  const same = parts.filter((part) => part.values.length === first.values.length);
  if (same.length === 1) return first;
  const n = same.reduce((sum, part) => sum + part.t.length, 0);
  const together = <T extends Float64Array | Float32Array | Uint32Array>(into: T, of: (part: Rows) => T): T => {
    let at = 0;
    for (const part of same) {
      into.set(of(part), at);
      at += part.t.length;
    }
    return into;
  };
  return {
    epoch: same.at(-1)!.epoch,
    t: together(new Float64Array(n), (part) => part.t),
    flags: together(new Uint32Array(n), (part) => part.flags),
    values: first.values.map((_, i) => together(new Float32Array(n), (part) => part.values[i]!)),
  };
}

let wrote = 0;

function draw(now: number): void {
  requestAnimationFrame(draw);
  if (now - wrote > 100) {
    wrote = now;
    const silent = silence(performance.now());
    if (stale !== (silent !== null)) {
      stale = silent !== null;
      document.documentElement.dataset["stale"] = String(stale);
      for (const frame of layout.frames) frame.panel.stale?.(stale);
    }
    header.write(state, silent);
  }
  for (const frame of layout.frames) {
    if (!frame.visible || frame.folds || frame.element.hidden) continue;
    deliver(frame);
    frame.panel.frame?.(now);
  }
}

document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const target = event.target as HTMLElement;
  const writes = target.matches("input:not([type=range]):not([type=checkbox]), textarea, select, [contenteditable]");
  if (writes) return;
  if (event.key === "?") {
    event.preventDefault();
    return showHelp();
  }
  if (help.open) return;
  // A space presses the button that has the focus, arrows move the slider that has it.
  if (event.key === " " && target.matches("button, summary, a, input")) return;
  for (const panel of [player, controlling, charting]) {
    if (!panel.key?.(event.key, event)) continue;
    return event.preventDefault();
  }
  if (event.key === " ") {
    event.preventDefault();
    charting.hold();
  }
});

const skip = h("a", { class: "skip", say: "To the panels", attributes: { href: "#panels" } });
document.querySelector("#page")!.append(skip, header.element, header.notice, layout.element, toasts, help);
onSystemTheme(() => restyle());
restyle();
connection.start();
requestAnimationFrame(draw);
