import { expect, test } from "vitest";

import { SCENE_ZH } from "../src/words-scene";

const FILES = import.meta.glob<string>(["../src/panels/{scene,instruments,guide,allan}.ts", "../src/panels/scene/*.ts"], {
  query: "?raw",
  import: "default",
  eager: true,
});
const source = Object.values(FILES).join("\n");

test("every sentence in the panels has its Chinese", () => {
  const said = [...source.matchAll(/\bt\("([^"]+)"\)|(?:text|attribute)\([^\n]*"([^"]+)"\)|ModelError\("([^"]+)"\)|say\("([^"]+)"\)/g)];
  const others = new Set(["span", "dt", "option", "2d", "webgl2"]); // names of elements and of a canvas's contexts
  const labels = said.flatMap(([, ...groups]) => groups.filter((group) => group !== undefined && !others.has(group)));
  expect(labels.length).toBeGreaterThan(50);
  expect(labels.filter((label) => !(label! in SCENE_ZH))).toEqual([]);
});

test("every Chinese label is used", () => {
  const isSaid = (label: string): boolean => {
    if (label.includes("axis up") || label.includes("axis down")) return source.includes("Hold it with its # axis ${pose[3]!}");
    return source.includes(`"${label}"`) || /^(too fast|the field|no |mag |acc |gyr )/.test(label) || /\b(heading|tilt)\b/.test(label);
  };
  expect(Object.keys(SCENE_ZH).filter((label) => !isSaid(label))).toEqual([]);
});
