// Where a recording is, how fast it plays, and whether.
import { button, h, put, say, set } from "../dom";
import { clock, fixed, utc } from "../format";
import type { Hello, State } from "../messages";
import type { OwnPanel, Shell } from "../shell";
import { refusal } from "../shell";

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 5, 10, 20];
const JUMP = 10;

export function playback(shell: Shell): OwnPanel & { toggle(): void } {
  const play = button({ class: "main", say: "Play", hint: "plumbob control URL play" }, () => toggle());
  const back = button({ say: "−10 s", hint: "plumbob control URL seek" }, () => jump(-JUMP));
  const on = button({ say: "+10 s", hint: "plumbob control URL seek" }, () => jump(JUMP));
  const slider = h("input", { attributes: { type: "range", min: "0", step: "0.01", value: "0" }, aria: "Position in the recording" });
  const speed = h("select", { aria: "Speed", hint: "plumbob control URL speed" }, ...SPEEDS.map((value) => h("option", { text: `${value} ×`, attributes: { value: String(value) } })));
  const position = h("span", { class: "value live" });
  const length = h("span", { class: "none" });
  const why = h("p", { class: "none" });
  const element = h("div", { class: "playback" }, h("div", { class: "tools" }, back, play, on, speed, h("span", { class: "readout" }, position, length)), slider, why);
  let held = false;
  let wanted: ReturnType<typeof setTimeout> | null = null;

  // What the button says is what it asks for: the newest state may be a frame ahead of what was drawn.
  let offered: "play" | "pause" = "play";

  function toggle(): void {
    void shell.ask({ verb: offered });
  }

  function seek(to: number): void {
    const end = shell.hello()?.duration ?? to;
    void shell.ask({ verb: "seek", value: Math.round(1000 * Math.min(end, Math.max(0, to))) / 1000 });
  }

  function jump(by: number): void {
    const now = shell.latest()?.playback;
    if (now) seek(now.position + by);
  }

  slider.addEventListener("pointerdown", () => (held = true));
  slider.addEventListener("input", () => {
    held = true;
    at(Number(slider.value));
    if (wanted !== null) clearTimeout(wanted);
    wanted = setTimeout(() => {
      seek(Number(slider.value));
      held = false;
    }, 150);
  });
  slider.addEventListener("pointerup", () => setTimeout(() => (held = false), 300));
  speed.addEventListener("change", () => void shell.ask({ verb: "speed", value: Number(speed.value) }));

  function at(seconds: number): void {
    const hello = shell.hello();
    const end = hello?.duration ?? 0;
    const day = hello?.started_utc ? `  ${utc(hello.started_utc + seconds)}` : "";
    put(position, clock(seconds));
    put(length, ` / ${clock(end)}${day}`);
    set(slider, "aria-valuetext", clock(seconds));
  }

  function show(state: State, hello: Hello): void {
    const now = state.playback;
    element.hidden = now === null;
    if (now === null) return;
    offered = now.playing ? "pause" : "play";
    say(play, now.playing ? "Pause" : "Play");
    set(play, "title", `plumbob control URL ${offered}`);
    set(slider, "max", String(hello.duration ?? 0));
    if (!held) {
      slider.value = String(now.position);
      at(now.position);
    }
    if (document.activeElement !== speed) {
      if (!SPEEDS.includes(now.speed) && ![...speed.options].some((one) => Number(one.value) === now.speed)) {
        speed.append(h("option", { text: `${fixed(now.speed, 2)} ×`, attributes: { value: String(now.speed) } }));
      }
      speed.value = String(now.speed);
    }
  }

  return {
    element,
    hello(hello) {
      const reason = refusal(hello);
      for (const one of [play, back, on, slider, speed]) one.disabled = reason !== "";
      why.hidden = reason === "";
      say(why, reason);
    },
    state(state) {
      const hello = shell.hello();
      if (hello) show(state, hello);
    },
    key(key) {
      if (!shell.latest()?.playback || !shell.hello()?.control) return false;
      if (key === " ") return toggle(), true;
      if (key === ",") return jump(-JUMP), true;
      if (key === ".") return jump(JUMP), true;
      return false;
    },
    toggle,
  };
}
