import { describe, expect, test } from "vitest";

import {
  compassOf, conjugate, frameAxes, multiply, noseAndBank, outside, type Quat, quatOf, rotate, sceneAttitude, toModel, toScene, turnRate, type Vec, wrap180, wrap360,
} from "../src/panels/scene/frames";

// Axes of the scene are east, north and up; those of a model forward, left and up.
const NOSE: Vec = [1, 0, 0];
const LEFT: Vec = [0, 1, 0];
const TOP: Vec = [0, 0, 1];
const EAST: Vec = [1, 0, 0];
const NORTH: Vec = [0, 1, 0];
const UP: Vec = [0, 0, 1];

function same(found: readonly number[], expected: readonly number[]): void {
  found.forEach((value, k) => expect(value).toBeCloseTo(expected[k]!, 12));
}

const shown = (frame: string, axes: string, yaw: number, pitch: number, roll: number): Quat => sceneAttitude(quatOf(yaw, pitch, roll), frame, axes);

describe("a body that is level and heads north", () => {
  // Yaw counts from north in NED and NWU, and from east in ENU: docs/conventions.md.
  test.each([["NED", "FRD", 0], ["ENU", "FLU", 90], ["NWU", "FLU", 0]])("looks so in %s with %s", (frame, axes, yaw) => {
    const q = shown(frame, axes, yaw, 0, 0);
    same(rotate(q, NOSE), NORTH);
    same(rotate(q, TOP), UP);
    same(rotate(q, LEFT), [-1, 0, 0]);
  });

  test.each([["ENU", "FRD", 90], ["NWU", "FRD", 0], ["NED", "FLU", 0]])("stands on its head in %s with %s, unless it is rolled", (frame, axes, yaw) => {
    same(rotate(shown(frame, axes, yaw, 0, 0), TOP), [0, 0, -1]);
    const righted = shown(frame, axes, yaw, 0, 180);
    same(rotate(righted, NOSE), NORTH);
    same(rotate(righted, TOP), UP);
  });
});

test("heading 90° in NED points east, as yaw 0° in ENU and −90° in NWU", () => {
  same(rotate(shown("NED", "FRD", 90, 0, 0), NOSE), EAST);
  same(rotate(shown("ENU", "FLU", 0, 0, 0), NOSE), EAST);
  same(rotate(shown("NWU", "FLU", -90, 0, 0), NOSE), EAST);
});

test.each([["NED", "FRD", 0], ["ENU", "FLU", 90], ["NWU", "FLU", 0]])("roll +30° puts the right side down in %s with %s", (frame, axes, yaw) => {
  const right = rotate(shown(frame, axes, yaw, 0, 30), [0, -1, 0]);
  same(right, [Math.sqrt(0.75), 0, -0.5]);
});

test("pitch +20° is nose up with axes that point down, and nose down with axes that point up", () => {
  const rise = Math.sin((20 * Math.PI) / 180);
  expect(rotate(shown("NED", "FRD", 0, 20, 0), NOSE)[2]).toBeCloseTo(rise, 12);
  expect(rotate(shown("ENU", "FLU", 90, 20, 0), NOSE)[2]).toBeCloseTo(-rise, 12);
  expect(rotate(shown("NWU", "FLU", 0, 20, 0), NOSE)[2]).toBeCloseTo(-rise, 12);
});

test("vectors of a frame and of the body arrive where they point", () => {
  same(toScene([1, 2, 3], "ENU"), [1, 2, 3]);
  same(toScene([1, 2, 3], "NED"), [2, 1, -3]);
  same(toScene([1, 2, 3], "NWU"), [-2, 1, 3]);
  same(toModel([1, 2, 3], "FRD"), [1, -2, -3]);
  same(toModel([1, 2, 3], "FLU"), [1, 2, 3]);
});

test("letters of the axes point as the frame maps them", () => {
  for (const frame of ["ENU", "NED", "NWU"]) {
    frameAxes(frame).forEach(({ letter, direction }, k) => {
      const axis: Vec = [0, 0, 0];
      axis[k] = 1;
      expect(letter).toBe(frame[k]);
      same(direction, toScene(axis, frame));
    });
  }
});

test("specific force of a level body at rest points up in the scene", () => {
  // docs/conventions.md: z up reads +9.81, z down −9.81.
  same(rotate(shown("NED", "FRD", 37, 0, 0), toModel([0, 0, -9.81], "FRD")), [0, 0, 9.81]);
  same(rotate(shown("ENU", "FLU", 37, 0, 0), toModel([0, 0, 9.81], "FLU")), [0, 0, 9.81]);
});

test("a yaw becomes a compass heading", () => {
  expect([0, 90, 359.5].map((yaw) => compassOf(yaw, "NED"))).toEqual([0, 90, 359.5]);
  expect([90, 0, -90, 180, 91].map((yaw) => compassOf(yaw, "ENU"))).toEqual([0, 90, 180, 270, 359]);
  expect([0, 90, -90, 180].map((yaw) => compassOf(yaw, "NWU"))).toEqual([0, 270, 90, 180]);
});

test("the compass heading is where the nose points", () => {
  for (const [frame, axes] of [["NED", "FRD"], ["ENU", "FLU"], ["NWU", "FLU"]] as const) {
    for (const yaw of [-170, -35, 0, 20, 133]) {
      const nose = rotate(shown(frame, axes, yaw, 25, -40), NOSE);
      expect(wrap180(compassOf(yaw, frame) - (Math.atan2(nose[0], nose[1]) * 180) / Math.PI)).toBeCloseTo(0, 10);
    }
  }
});

test("angles are wrapped to one turn", () => {
  expect([-90, 0, 359.9, 360, 725, -360].map(wrap360)).toEqual([270, 0, 359.9, 0, 5, 0]);
  expect([-180, 179, 180, 190, -190].map(wrap180)).toEqual([-180, 179, -180, -170, 170]);
});

test("nose and bank are those of the angles, right side down and nose up", () => {
  const ned = noseAndBank(outside(quatOf(200, 12, -25), "NED", "FRD"));
  expect(ned.nose).toBeCloseTo(12, 10);
  expect(ned.bank).toBeCloseTo(-25, 10);
  const enu = noseAndBank(outside(quatOf(200, 12, -25), "ENU", "FLU"));
  expect(enu.nose).toBeCloseTo(-12, 10);
  expect(enu.bank).toBeCloseTo(-25, 10);
});

test("a turn of 30° to the right in half a second is 60°/s, in every frame and attitude", () => {
  for (const [frame, axes, sense] of [["NED", "FRD", 1], ["ENU", "FLU", -1], ["NWU", "FLU", -1]] as const) {
    const before = sceneAttitude(quatOf(170, 50, -70), frame, axes);
    const after = sceneAttitude(quatOf(170 + sense * 30, 50, -70), frame, axes);
    expect(turnRate(before, after, 0.5)).toBeCloseTo(60, 9);
    expect(turnRate(after, before, 0.5)).toBeCloseTo(-60, 9);
    expect(turnRate(before, after.map((part) => -part) as Quat, 0.5)).toBeCloseTo(60, 9);
  }
});

test("a product with its conjugate is the identity", () => {
  const q = quatOf(10, 20, 30);
  same(multiply(q, conjugate(q)), [1, 0, 0, 0]);
});
