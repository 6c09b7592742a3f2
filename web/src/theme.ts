// Colours: light, dark, as the system has it, and one of high contrast for a telephone in the sun.
import { remember, remembered } from "./memory";
import type { Colours } from "./panel";

export const THEMES = ["auto", "light", "dark", "sun"] as const;
export type Theme = (typeof THEMES)[number];
const NAMES = ["paper", "ink", "muted", "soft", "grid", "shade", "band", "blue", "red", "green", "pink", "amber", "sky", "olive"] as const;
const SERIES = ["blue", "red", "green", "pink", "amber", "sky", "olive"] as const;
let chosen: Theme = "auto";
let found: Colours | null = null;

export function theme(): Theme {
  return chosen;
}

export function chooseTheme(query: URLSearchParams): void {
  const asked = query.get("theme") ?? remembered("theme");
  setTheme(THEMES.find((name) => name === asked) ?? "auto", query.has("theme"));
}

export function setTheme(name: Theme, kept = true): void {
  chosen = name;
  found = null;
  const dark = name === "dark" || (name === "auto" && matchMedia("(prefers-color-scheme: dark)").matches);
  document.documentElement.dataset["theme"] = name === "sun" ? "sun" : dark ? "dark" : "light";
  if (kept) remember("theme", name);
}

/** Call when the system turns dark or light, and the page with it. */
export function onSystemTheme(changed: () => void): void {
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    if (chosen !== "auto") return;
    setTheme("auto", false);
    changed();
  });
}

/** Colours of the theme that is shown. */
export function colours(): Colours {
  if (found === null) {
    const style = getComputedStyle(document.documentElement);
    found = Object.fromEntries(NAMES.map((name) => [name, style.getPropertyValue(`--${name}`).trim()])) as unknown as Colours;
  }
  return found;
}

/** A colour for the k-th series. */
export function series(k: number): string {
  return colours()[SERIES[((k % SERIES.length) + SERIES.length) % SERIES.length]!];
}
