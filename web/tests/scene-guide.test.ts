import { describe, expect, test } from "vitest";

import { cellOf, filledIn, regionOf, standingOf, stepOf } from "../src/panels/scene/cells";
import { dot, unit, type Vec } from "../src/panels/scene/frames";
import { SCENE_ZH } from "../src/words-scene";

// Faces and edges of a cube, in the order of plumbob.calibration.predicted.REGIONS.
const FACES: Vec[] = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]];
const EDGES: Vec[] = ([[0, 1], [0, 2], [1, 2]] as const).flatMap(([i, j]) =>
  ([[1, 1], [1, -1], [-1, 1], [-1, -1]] as const).map(([a, b]) => {
    const edge: Vec = [0, 0, 0];
    edge[i] = a;
    edge[j] = b;
    return unit(edge)!;
  }),
);
const REGIONS = [...FACES, ...EDGES];

/** Directions spread evenly over the sphere. */
const SPREAD: Vec[] = Array.from({ length: 2000 }, (_, k) => {
  const z = 1 - (2 * k + 1) / 2000;
  const angle = k * Math.PI * (3 - Math.sqrt(5));
  const level = Math.sqrt(1 - z * z);
  return [level * Math.cos(angle), level * Math.sin(angle), z];
});

describe("regions of the sphere", () => {
  test("each direction is in its own region", () => {
    REGIONS.forEach((region, k) => expect(regionOf(region, REGIONS)).toBe(k));
  });

  test("the border between a face and an edge lies 22.5° from both", () => {
    const at = (degrees: number): Vec => [Math.cos((degrees * Math.PI) / 180), Math.sin((degrees * Math.PI) / 180), 0];
    expect(regionOf(at(22.4), REGIONS)).toBe(0);
    expect(regionOf(at(22.6), REGIONS)).toBe(6);
  });

  test("corners of a cell are as near to others as to its own", () => {
    REGIONS.forEach((region, k) => {
      for (const point of cellOf(k, REGIONS)) {
        const others = REGIONS.filter((_, j) => j !== k).map((other) => dot(point, other));
        expect(dot(point, region) - Math.max(...others)).toBeCloseTo(0, 9);
      }
    });
  });

  test("the cells of all regions cover the sphere once", () => {
    // A point is inside a convex outline where it is on the inner side of every edge.
    const cells = REGIONS.map((_, k) => cellOf(k, REGIONS));
    const inside = (point: Vec, outline: Vec[]): boolean =>
      outline.every((corner, i) => {
        const next = outline[(i + 1) % outline.length]!;
        const side: Vec = [corner[1] * next[2] - corner[2] * next[1], corner[2] * next[0] - corner[0] * next[2], corner[0] * next[1] - corner[1] * next[0]];
        return dot(side, point) > 0;
      });
    for (const point of SPREAD) {
      const found = cells.flatMap((outline, k) => (inside(point, outline) ? [k] : []));
      expect(found).toEqual([regionOf(point, REGIONS)]);
    }
  });
});

test("a region is the goal before all else, then here, seen or missing", () => {
  const filled = [true, false, true];
  expect(standingOf(0, filled, 0, 0)).toBe("goal");
  expect(standingOf(0, filled, 0, 1)).toBe("here");
  expect(standingOf(2, filled, 0, 1)).toBe("seen");
  expect(standingOf(1, filled, 0, 2)).toBe("missing");
  expect(standingOf(1, null, null, null)).toBe("missing");
});

describe("words of the next step", () => {
  // Sentences of plumbob.live.guide.
  const SENTENCES: [string, string][] = [
    ["turn it about its x axis by about 115°, z towards y, to +x−y", "Turn about its x axis by 115°, z towards y"],
    ["tilt it: turn it about its z axis by about 90°, x towards y, then slowly through all attitudes", "Turn about its z axis by 90°, x towards y"],
    ["hold it with its x axis up, and keep it still until it counts, about 2 s", "Hold it with its x axis up, still for 2 s"],
    ["hold it with its z axis down, and keep it still until it counts, about 2 s", "Hold it with its z axis down, still for 2 s"],
    ["hold it with its x axis 45° up and its y axis 45° down, and keep it still until it counts, about 2 s", "Hold it with ↑x and ↓y at 45°, still for 2 s"],
    ["leave the unit untouched: 7.4 of 20 s", "Leave the unit untouched: 7.4 of 20 s"],
    ["done", "Done: finish to make the card"],
    ["let go of it, or hold it still", "Let go of it, or hold it still"],
  ];

  test.each(SENTENCES)("%s", (sentence, expected) => {
    const { label, parts } = stepOf(sentence);
    expect(filledIn(label, parts)).toBe(expected);
    expect(SCENE_ZH[label]).toBeTruthy();
    expect(SCENE_ZH[label]!.split("#")).toHaveLength(label.split("#").length);
  });

  test("a sentence that is not known stays as it is", () => {
    expect(stepOf("do something else")).toEqual({ label: "do something else", parts: [] });
  });
});
