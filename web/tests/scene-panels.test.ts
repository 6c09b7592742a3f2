// @vitest-environment jsdom
import { beforeEach, expect, test, vi } from "vitest";

import type { Guidance, Hello, State } from "../src/messages";
import type { Colours, Context } from "../src/panel";
import { allan } from "../src/panels/allan";
import { guide } from "../src/panels/guide";
import { instruments } from "../src/panels/instruments";
import { scene } from "../src/panels/scene";
import { quatOf } from "../src/panels/scene/frames";

// jsdom draws nothing and asks for no media: the panels must do without a canvas all the same.
vi.hoisted(() => {
  HTMLCanvasElement.prototype.getContext = (() => null) as never;
  window.matchMedia = ((media: string) => ({ matches: false, media, addEventListener: () => undefined, removeEventListener: () => undefined })) as never;
});

const COLOURS = Object.fromEntries(
  ["paper", "ink", "muted", "soft", "grid", "shade", "band", "blue", "red", "green", "pink", "amber", "sky", "olive"].map((name) => [name, "#123456"]),
) as unknown as Colours;

let sent: { verb: string; name?: string }[] = [];
let accepted = true;
const context: Context = {
  send: (command) => {
    sent.push({ verb: command.verb, name: command.name });
    return Promise.resolve({ type: "answer", id: 1, ok: accepted, text: accepted ? "" : "Another calibration is running. Finish it first." });
  },
  t: (english) => english,
  colours: () => COLOURS,
  series: () => "#0072b2",
  hello: () => null,
};

beforeEach(() => {
  sent = [];
  accepted = true;
});

function hello(changes: Partial<Hello> = {}): Hello {
  return {
    type: "hello", session: "one", device: "", format: "", calibration: "", noise: "", live: true, frame: "ENU", north: "magnetic", axes: "FLU",
    rate: 100, columns: [], raw: [], estimators: [{ name: "mekf", title: "mekf", primary: true, claims: true }], filters: [], skeleton: null,
    guides: ["mag", "accel", "gyro"], regions: [[1, 0, 0], [-1, 0, 0]], regions_names: ["+x", "−x"], control: true, recording: true,
    duration: null, started_utc: null, gravity: 9.80665, version: "1", protocol: 1, ...changes,
  };
}

function state(yaw: number, pitch: number, roll: number, changes: Partial<State> = {}): State {
  return {
    type: "state", epoch: 0, t: 1, sent: 0, values: [], raw: [], flags: [],
    attitudes: { mekf: { q_nb: quatOf(yaw, pitch, roll), yaw, pitch, roll, sd: [0.125, 0.25, 1.5] } },
    gravity_b: null, field_b: null, points: null, link: {} as State["link"], recording: null, text: null, playback: null, tared: false, guide: null,
    ...changes,
  };
}

function guidance(changes: Partial<Guidance> = {}): Guidance {
  return {
    type: "guide", kind: "mag", elapsed: 12, still_for: 0, filled: [true, false], direction: 0, goal: 1, axis: 2, angle: -90,
    next_step: "turn it about its z axis by about 90°, y towards x, to −x", predicted: "", grade: null, share: 0.5, warnings: [], done: false,
    cloud: [], ...changes,
  };
}

const frame = (): Promise<void> => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done())));
const shown = (element: HTMLElement, words: string): HTMLButtonElement =>
  [...element.querySelectorAll("button")].find(({ textContent }) => textContent === words)!;

/** What a part of the page shows is drawn only where it is seen: jsdom has no layout. */
function seen(element: HTMLElement): void {
  document.body.append(element);
  for (const one of [element, ...element.querySelectorAll<HTMLElement>("*")]) Object.defineProperty(one, "clientWidth", { value: 300 });
}

test("instruments show the numbers of the state at two digits, and the compass heading of a yaw", async () => {
  const panel = instruments(context);
  seen(panel.element);
  panel.hello!(hello());
  panel.state!(state(100.126, -3.004, 0.5));
  await frame();
  const cells = [...panel.element.querySelectorAll(".cell")].map((cell) => [...cell.children].map(({ textContent }) => textContent));
  expect(cells.slice(0, 4)).toEqual([
    ["Heading", "349.87°", "from magnetic north"],
    ["Yaw (ENU)", "100.13°", "±1.50° (1 σ)"],
    ["Pitch", "−3.00°", "±0.25° (1 σ)"],
    ["Roll", "0.50°", "±0.13° (1 σ)"],
  ]);
});

test("after a tare the turn is counted, not a heading", async () => {
  const panel = instruments(context);
  seen(panel.element);
  panel.hello!(hello());
  panel.state!(state(10, 0, 0, { tared: true }));
  await frame();
  const [cell] = panel.element.querySelectorAll(".cell");
  expect(cell!.textContent).toBe("Turned since the tare350.00°clockwise from above");
});

test("instruments without an attitude say why", async () => {
  const panel = instruments(context);
  seen(panel.element);
  panel.hello!(hello({ frame: null, estimators: [] }));
  panel.state!(state(0, 0, 0, { attitudes: {} }));
  await frame();
  expect(panel.element.querySelector(".cell")!.textContent).toBe("Heading—not estimated");
});

test("the reference is in ink among the others of a scene, as in the charts, and not in the colour of an estimator", async () => {
  const panel = scene({ ...context, colours: () => ({ ...COLOURS, ink: "#000001" }) });
  seen(panel.element);
  const reference = { name: "reference", title: "truth", primary: false, claims: false };
  const mahony = { name: "mahony", title: "mahony", primary: false, claims: false };
  panel.hello!(hello({ estimators: [...hello().estimators, mahony, reference] }));
  const { attitudes } = state(1, 2, 3);
  panel.state!(state(1, 2, 3, { attitudes: { ...attitudes, mahony: attitudes.mekf!, reference: attitudes.mekf! } }));
  await vi.waitFor(async () => {
    await frame();
    const legend = [...panel.element.querySelectorAll<HTMLElement>(".scene-legend span")].map((one) => [one.textContent, (one.children[0] as HTMLElement).style.color]);
    expect(legend).toContainEqual(["mahony", "rgb(0, 114, 178)"]);
    expect(legend).toContainEqual(["reference", "rgb(0, 0, 1)"]);
  });
});

test("a guide is started by its kind, finished and cancelled", () => {
  const panel = guide(context);
  panel.hello!(hello());
  shown(panel.element, "Accelerometer").click();
  shown(panel.element, "Start").click();
  panel.state!(state(0, 0, 0, { guide: "accel" }));
  expect(shown(panel.element, "Start").hidden).toBe(true);
  shown(panel.element, "Finish").click();
  shown(panel.element, "Cancel").click();
  expect(sent).toEqual([{ verb: "calibrate", name: "accel" }, { verb: "calibrate-end", name: "" }, { verb: "calibrate-cancel", name: "" }]);
});

test("a guide without control shows the reason, and no commands", () => {
  const panel = guide(context);
  panel.hello!(hello({ control: false }));
  expect(["Start", "Finish", "Cancel"].every((words) => shown(panel.element, words).hidden)).toBe(true);
  expect(panel.element.querySelector<HTMLElement>(".guide-closed")!.hidden).toBe(false);
  expect(panel.element.querySelector(".guide-closed")!.textContent).toContain("--control");
});

test("a guide that is refused shows the answer as text, never as markup", async () => {
  accepted = false;
  const panel = guide(context);
  panel.hello!(hello());
  shown(panel.element, "Start").click();
  await Promise.resolve();
  expect(panel.element.querySelector(".guide-answer")!.textContent).toBe("Another calibration is running. Finish it first.");
  panel.guide!(guidance({ card: "<img src=x onerror=alert(1)>" }));
  expect(panel.element.querySelector("img")).toBeNull();
  expect(panel.element.querySelector("code")!.textContent).toBe("<img src=x onerror=alert(1)>");
});

test("a guide shows turn, directions, warnings, and in the end the card or why there is none", () => {
  const panel = guide(context);
  panel.hello!(hello());
  panel.state!(state(0, 0, 0, { guide: "mag" }));
  panel.guide!(guidance({ warnings: ["too fast"] }));
  const words = (name: string): string | null => panel.element.querySelector(name)!.textContent;
  expect(words(".guide-amount")).toBe("↻ z 90°");
  expect(words(".guide-step")).toBe("Turn about its z axis by 90°, y towards x");
  expect(words(".guide-warnings")).toBe("too fast");
  expect(words(".guide-facts dd")).toBe("1 / 2");
  panel.guide!(guidance({ done: true, card: "mag.toml", next_step: "done" }));
  expect(words(".guide-result")).toBe("Card writtenmag.toml");
  panel.guide!(guidance({ refused: ["Only 3 directions were seen."] }));
  expect(words(".guide-result")).toBe("No card was madeOnly 3 directions were seen.");
});

test("the Allan table reads N of white noise for each axis, and waits without a curve", () => {
  const panel = allan(context);
  panel.hello!(hello({ columns: [{ key: "gyr.x", chart: "rate", label: "x", unit: "°/s", digits: 2, source: "gyr" }] }));
  expect(panel.element.querySelector<HTMLElement>(".allan-empty")!.hidden).toBe(false);
  const tau = Array.from({ length: 40 }, (_, k) => 0.01 * 1.25 ** k);
  const white = (n: number): number[] => tau.map((time) => n / Math.sqrt(time));
  panel.allan!({ type: "allan", duration: 1000, tau, deviation: { "gyr.x": white(0.004), "gyr.y": white(0.005), "gyr.z": white(0.006) } });
  const rows = [...panel.element.querySelectorAll("tr")].map((row) => [...row.children].map(({ textContent }) => textContent));
  expect(rows[0]).toEqual(["axis", "N [°/s/√Hz]", "N [°/√h]", "lowest [°/s]", "τ [s]"]);
  expect(rows[1]!.slice(0, 4)).toEqual(["x", "0.004", "0.24", "still falling"]);
  expect(rows[3]!.slice(0, 3)).toEqual(["z", "0.006", "0.36"]);
});

test("a scene without WebGL says so", async () => {
  const panel = scene(context);
  document.body.append(panel.element);
  panel.hello!(hello());
  panel.state!(state(0, 0, 0));
  const note = panel.element.querySelector<HTMLElement>(".scene-note")!;
  for (let k = 0; k < 200 && note.hidden; k++) await new Promise((done) => setTimeout(done, 10));
  expect(note.textContent).toBe("WebGL is not available here: a plain drawing is shown.");
});
