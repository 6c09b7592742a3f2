// Labels in English and Chinese. A label is looked up by its English; {} in it stands for a value.
import { remember, remembered } from "./memory";
import { SCENE_ZH } from "./words-scene";
import { ZH } from "./words-zh";

export type Language = "en" | "zh";
export const WORDS: Readonly<Record<string, string>> = { ...SCENE_ZH, ...ZH };
let language: Language = "en";

export function lang(): Language {
  return language;
}

/** Choose the language: as the address says, as it was chosen before, or as the browser is set. */
export function chooseLanguage(query: URLSearchParams): void {
  const asked = query.get("lang") ?? remembered("lang") ?? navigator.language;
  setLanguage(asked.startsWith("zh") ? "zh" : "en", query.has("lang"));
}

export function setLanguage(chosen: Language, kept = true): void {
  language = chosen;
  document.documentElement.lang = chosen === "zh" ? "zh-CN" : "en";
  if (kept) remember("lang", chosen);
}

/** A label in the language that is shown; what is not known stays in English. */
export function t(english: string, ...values: (string | number)[]): string {
  const words = (language === "zh" ? WORDS[english] : undefined) ?? english;
  let next = 0;
  return words.replace(/\{(\d*)\}/g, (whole, place: string) => {
    const value = values[place === "" ? next++ : Number(place)];
    return value === undefined ? whole : String(value);
  });
}
