import { expect, test } from "vitest";
import { brief, clock, count, fixed, signed, utc, wrapped } from "../src/format";
import { compass } from "../src/names";
import type { Hello } from "../src/messages";

test("numbers have the digits that are asked for, a true minus, and no zero with a sign", () => {
  expect([fixed(1.005, 1), fixed(-12.344, 2), fixed(-0.001, 2), fixed(3, 0)]).toEqual(["1.0", "−12.34", "0.00", "3"]);
  expect([signed(0.5, 1), signed(-0.5, 1), signed(0.01, 1)]).toEqual(["+0.5", "−0.5", "0.0"]);
});

test("what is not there is a dash, never a zero", () => {
  for (const none of [null, undefined, NaN, Infinity]) expect([fixed(none, 2), signed(none, 2), count(none), clock(none), brief(none)]).toEqual(Array(5).fill("–"));
});

test("counts have their thousands apart", () => {
  expect([count(0), count(999), count(1234567)]).toEqual(["0", "999", "1\u202f234\u202f567"]);
});

test("times are seconds, minutes or hours, and carry when they are rounded", () => {
  expect([clock(0), clock(59.94), clock(59.96), clock(123.4), clock(3723.45, 2), clock(-5), clock(600, 0)]).toEqual([
    "0.0 s", "59.9 s", "1:00.0", "2:03.4", "1:02:03.45", "−5.0 s", "10:00",
  ]);
  expect([brief(0.0123), brief(3.21), brief(150)]).toEqual(["12.3 ms", "3.2 s", "2:30"]);
  expect(utc(1_790_000_000.5, 1)).toBe("14:13:20.5 UTC"); // date -u -d @1790000000 says 14:13:20.
});

test("angles come to ±180°", () => {
  expect([wrapped(190), wrapped(-190), wrapped(540), wrapped(-359)]).toEqual([-170, 170, -180, 1]);
});

test("a heading counts clockwise from north in every frame, and is none after a tare or without a north", () => {
  const of = (frame: string, north: string) => ({ frame, north }) as Hello;
  // East: yaw 0 in ENU, −90° in NWU, 90° in NED.
  expect([compass(of("ENU", "true"), false, 0), compass(of("NWU", "magnetic"), false, -90), compass(of("NED", "true"), false, 90)]).toEqual([90, 90, 90]);
  expect(compass(of("ENU", "true"), false, 100)).toBe(350);
  expect([compass(of("ENU", "free"), false, 0), compass(of("ENU", "true"), true, 0)]).toEqual([null, null]);
});
