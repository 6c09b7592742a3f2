import { expect, test } from "vitest";

import { rateScale } from "../src/panels/scene/compass";
import { outside, quatOf } from "../src/panels/scene/frames";
import { direction, horizonAlong, onDial, VIEW } from "../src/panels/scene/horizon";
import { headingLabel, onTape, tapeMarks } from "../src/panels/scene/tape";

test("a tape at 358° goes on past north", () => {
  const marks = tapeMarks(358, 20, 5, 10);
  expect(marks.map(({ heading }) => heading)).toEqual([350, 355, 0, 5]);
  expect(marks.map(({ at }) => at)).toEqual([-8, -3, 2, 7]);
  expect(marks.map(({ label }) => label)).toEqual(["350", "", "N", ""]);
});

test("a tape at 2° goes back past north", () => {
  const marks = tapeMarks(2, 20, 5, 10);
  expect(marks.map(({ heading }) => heading)).toEqual([355, 0, 5, 10]);
  expect(marks.map(({ at }) => at)).toEqual([-7, -2, 3, 8]);
});

test("every heading has the same number of marks, each once", () => {
  for (let heading = 0.25; heading < 360; heading += 7.5) {
    const marks = tapeMarks(heading, 90, 5, 10);
    expect(marks).toHaveLength(18);
    expect(new Set(marks.map((mark) => mark.heading)).size).toBe(18);
    for (const mark of marks) expect(Math.abs(onTape(mark.heading, heading) - mark.at)).toBeLessThan(1e-9);
  }
});

test("points of the compass stand at their headings", () => {
  expect([0, 45, 90, 135, 180, 225, 270, 315, 30, 5].map(headingLabel)).toEqual(["N", "NE", "E", "SE", "S", "SW", "W", "NW", "030", "005"]);
});

test("another heading stands on the tape by the shorter way", () => {
  expect(onTape(3, 357)).toBe(6);
  expect(onTape(357, 3)).toBe(-6);
  expect(onTape(10, 10)).toBe(0);
});

test("the scale of the rate of turn holds the rate", () => {
  expect([0, 2.9, 3, 3.1, -29, 250, 5000].map(rateScale)).toEqual([3, 3, 3, 10, 30, 300, 1000]);
});

test("nose up 20° puts the horizon 20° below the middle, and bank turns it", () => {
  const level = outside(quatOf(0, 20, 0), "NED", "FRD");
  expect(horizonAlong(level, Math.PI)).toBeCloseTo(20, 9);
  const [x, y] = onDial(direction(level, 0, 0))!;
  expect(x).toBeCloseTo(0, 12);
  expect(y).toBeCloseTo(20 / VIEW, 12); // down is positive on a canvas
  // Right side down: the horizon rises on the right.
  const banked = outside(quatOf(0, 0, 30), "NED", "FRD");
  const right = onDial(direction(banked, 0, (30 * Math.PI) / 180))!;
  expect(right[0]).toBeGreaterThan(0);
  expect(right[1] / right[0]).toBeCloseTo(-Math.tan((30 * Math.PI) / 180), 9);
});

test("nothing on the dial jumps where the nose goes through the vertical", () => {
  // Euler angles jump by half a turn in yaw and roll here; the place of the zenith must not.
  const before = onDial(outside(quatOf(40, 89.9, 0), "NED", "FRD").up)!;
  const after = onDial(outside(quatOf(220, 89.9, 180), "NED", "FRD").up)!;
  expect(Math.hypot(before[0] - after[0], before[1] - after[1])).toBeLessThan(0.3 / VIEW);
  const north = onDial(direction(outside(quatOf(40, 89.9, 0), "NED", "FRD"), 0.9, 0))!;
  const later = onDial(direction(outside(quatOf(220, 89.9, 180), "NED", "FRD"), 0.9, 0))!;
  expect(Math.hypot(north[0] - later[0], north[1] - later[1])).toBeLessThan(0.3 / VIEW);
});

test("what is behind is not on the dial", () => {
  expect(onDial([-1, 0, 0])).toBeNull();
  expect(onDial([Math.cos(1.2), Math.sin(1.2), 0])).toBeNull();
});
