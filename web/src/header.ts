// The head of the page: what is measured, how the connection stands, and whether it is recorded.
import type { Standing } from "./connection";
import { aria, button, h, hint, put, say, set, unsay } from "./dom";
import { brief, clock, fixed } from "./format";
import { lang, setLanguage } from "./i18n";
import type { Hello, State } from "./messages";
import { PROTOCOL } from "./messages";
import { setTheme, theme, THEMES, type Theme } from "./theme";

export const STANDINGS: Record<Standing, string> = {
  connecting: "connecting", connected: "connected", waiting: "connection lost: trying again", refused: "refused", version: "another version",
};
export const THEME_WORDS: Record<Theme, string> = { auto: "Auto", light: "Light", dark: "Dark", sun: "Sun" };
export const NORTHS: Record<string, string> = { true: "true north", magnetic: "magnetic north", free: "free heading" };

export class Header {
  readonly element: HTMLElement;
  private readonly session = h("h1", { text: "Plumbob" });
  private readonly device = h("span", { class: "device" });
  private readonly calibration = h("span", { class: "calibration" });
  private readonly frame = h("span");
  private readonly link = h("span", { class: "pill", attributes: { role: "status" } });
  private readonly rate = h("span", { class: "figure live" });
  private readonly age = h("span", { class: "figure" });
  private readonly recording = h("span", { class: "recording" });
  private readonly themes: HTMLSelectElement;
  private readonly language: HTMLButtonElement;
  readonly notice = h("p", { class: "notice", attributes: { role: "alert" } });
  private hello: Hello | null = null;

  constructor(restyle: (language: boolean) => void, help: () => void) {
    this.themes = h("select", { aria: "Colours" }, ...THEMES.map((name) => h("option", { say: THEME_WORDS[name], attributes: { value: name } })));
    this.themes.value = theme();
    this.themes.addEventListener("change", () => {
      setTheme(this.themes.value as Theme);
      restyle(false);
    });
    this.language = button({ class: "plain" }, () => {
      setLanguage(lang() === "en" ? "zh" : "en");
      this.otherLanguage();
      restyle(true);
    });
    this.otherLanguage();
    const helper = button({ class: "plain", text: "?", hint: "Keys and help (key ?)" }, help);
    aria(helper, "Help");
    this.notice.hidden = true;
    this.element = h(
      "header", { class: "page" },
      h("div", { class: "who" }, this.session, this.device),
      h("div", { class: "how" }, this.calibration, this.frame),
      h("div", { class: "now" }, this.recording, this.rate, this.age, this.link),
      h("div", { class: "means" }, this.themes, this.language, helper),
    );
    this.standing("connecting", "");
  }

  private otherLanguage(): void {
    const zh = lang() === "en";
    put(this.language, zh ? "中文" : "English");
    set(this.language, "lang", zh ? "zh-CN" : "en");
  }

  greet(hello: Hello): void {
    this.hello = hello;
    put(this.session, hello.session || "Plumbob");
    document.title = `${hello.session || hello.device} · Plumbob`;
    put(this.device, [hello.device, hello.format].filter(Boolean).join(" · "));
    hint(this.device, "Plumbob {}; noise: {}", hello.version, hello.noise || "–");
    const none = hello.calibration === "uncalibrated" || hello.calibration === "";
    set(this.calibration, "data-none", String(none));
    if (none) say(this.calibration, "UNCALIBRATED");
    else say(this.calibration, "calibration {}", hello.calibration);
    if (none) hint(this.calibration, "The values are as the sensor gives them: no card of a calibration is used.");
    else hint(this.calibration, "Card of the calibration that is used: {}", hello.calibration);
    if (hello.frame === null) unsay(this.frame, hello.axes);
    else say(this.frame, NORTHS[hello.north ?? ""] ?? "no north");
    if (hello.frame !== null) put(this.frame, `${hello.frame} · ${hello.axes} · ${this.frame.textContent}`);
  }

  standing(standing: Standing, why: string): void {
    set(this.link, "data-standing", standing);
    say(this.link, STANDINGS[standing]);
    const text = why && standing === "waiting" ? why : "";
    this.link.title = text;
    this.notice.hidden = standing !== "refused" && standing !== "version";
    if (standing === "refused") say(this.notice, "The server does not let this page in (401). Ask for the address with its token, which plumbob view prints when it starts.");
    if (standing === "version") say(this.notice, "This page speaks version {} of the protocol, the server version {}. Reload the page.", PROTOCOL, why);
  }

  /** Write the figures; `silent` is how long no sample has come, s, where that is too long. */
  write(state: State | null, silent: number | null): void {
    const recording = state?.recording ?? null;
    const hello = this.hello;
    set(this.recording, "data-on", String(recording !== null));
    if (recording) say(this.recording, "recording");
    else if (hello && !hello.live) say(this.recording, state?.playback && !state.playback.playing ? "paused recording" : "played recording");
    else say(this.recording, "not recorded");
    put(this.rate, state?.link.rate === null || state === null ? "– Hz" : `${fixed(state.link.rate, 1)} Hz`);
    set(this.age, "data-late", String(silent !== null));
    if (silent !== null) say(this.age, "no data for {}", silent < 100 ? `${fixed(silent, 1)} s` : clock(silent, 0));
    else if (state === null) say(this.age, "no data yet");
    else if (state.link.age === null) unsay(this.age, "");
    else say(this.age, "age {}", brief(state.link.age));
  }

  restyle(): void {
    this.otherLanguage();
    if (this.hello) this.greet(this.hello);
  }
}
