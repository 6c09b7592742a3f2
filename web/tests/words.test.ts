// Every label of the sources has a Chinese word, and flags are those of the library.
// @vitest-environment jsdom
import { expect, test } from "vitest";
import { FLAGS } from "../src/flags";
import { NORTHS, STANDINGS, THEME_WORDS } from "../src/header";
import { KEYS, WAYS } from "../src/help";
import { setLanguage, t, WORDS } from "../src/i18n";
import { ANGLE_NAMES, NAMES, SHORT } from "../src/names";
import { KINDS } from "../src/panels/events";
import { COUNTS } from "../src/panels/link";

import library from "../../src/plumbob/core/flags.py?raw";
import chinese from "../../src/plumbob/reporting/zh.toml?raw";

const SOURCES = import.meta.glob<string>(["../src/**/*.ts", "!../src/report/**", "!../src/words-*", "!../src/messages.ts"], {
  query: "?raw", import: "default", eager: true,
});
const LOOKED_UP = [
  /\b(?:t|say|hint|aria|place|fact)\((?:[\w.!$[\]]+, )?(?:"\w+", )?"((?:[^"\\]|\\.)*)"/g,
  /\b(?:say|hint|aria|title|words): "((?:[^"\\]|\\.)*)"/g,
  /\b(?:t|say)\([^";]*\? "((?:[^"\\]|\\.)*)" : "/g,
  /\b(?:t|say)\([^";]*\? "(?:[^"\\]|\\.)*" : "((?:[^"\\]|\\.)*)"/g,
  /return (?:[\w.]+ \? "" : )?"([A-Z](?:[^"\\]|\\.)* (?:[^"\\]|\\.)*)"/g,
  /text: "(there is no connection|the server has not answered|the connection was lost)"/g,
];

function labels(): string[] {
  return Object.values(SOURCES).flatMap((source) => LOOKED_UP.flatMap((pattern) => [...source.matchAll(pattern)].map((found) => found[1]!)));
}

test("every label in the sources has a Chinese word", () => {
  const tables = [NAMES, SHORT, ANGLE_NAMES, KINDS, NORTHS, STANDINGS, THEME_WORDS].flatMap((table) => Object.values(table));
  const others = [...FLAGS.flatMap((flag) => [flag.name, flag.meaning]), ...KEYS.map(([, what]) => what), ...WAYS, ...COUNTS.flatMap(([, name, why]) => [name, why])];
  const all = [...labels(), ...tables, ...others];
  // What has no words in it, and what is a command.
  const wordy = all.filter((label) => /[A-Za-z]{2}/.test(label) && !/^plumbob control URL [a-z-]+$/.test(label));
  expect(labels().length).toBeGreaterThan(100);
  expect([...new Set(wordy.filter((label) => !(label in WORDS)))]).toEqual([]);
});

test("a Chinese label has the places of its English", () => {
  for (const [english, chinese] of Object.entries(WORDS)) {
    expect(chinese.match(/\{\d*\}/g)?.length ?? 0, english).toBe(english.match(/\{\d*\}/g)?.length ?? 0);
  }
});

test("a label is said in the language that is chosen, with its values", () => {
  setLanguage("zh", false);
  expect(t("silent {} s", "3.2")).toBe("静默 3.2 s");
  expect(t("of no dictionary {}", 1)).toBe("of no dictionary 1");
  setLanguage("en", false);
  expect(t("silent {} s", "3.2")).toBe("silent 3.2 s");
  expect(t("{1} before {0}", "a", "b")).toBe("b before a");
});

test("flags have the bits, names and meanings of the library, in its Chinese", () => {
  const bits = new Map([...library.matchAll(/^(\w+): Final = 1 << (\d+)$/gm)].map((found) => [found[1]!, 1 << Number(found[2])]));
  const listed = [...library.matchAll(/^ {4}(\w+): \("([^"]+)", "([^"]+)"\),$/gm)].map((found) => ({ bit: bits.get(found[1]!), name: found[2], meaning: found[3] }));
  expect(listed.length).toBe(bits.size);
  listed.sort((a, b) => a.bit! - b.bit!);
  expect(FLAGS.map(({ bit, name, meaning }) => ({ bit, name, meaning }))).toEqual(listed);
  for (const { name } of FLAGS) expect(chinese).toContain(`"${name}" = "${WORDS[name]}"`);
});
