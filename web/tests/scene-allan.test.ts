import { expect, test } from "vitest";

import { duration } from "../src/panels/allan";
import { readOff, slopeAt } from "../src/panels/scene/reads";

const TAU = Array.from({ length: 60 }, (_, k) => 0.01 * 10 ** (k / 12)); // 0.01 s to 830 s

test("white noise reads off N, and still falls", () => {
  const N = 0.0042;
  const reads = readOff(TAU, TAU.map((tau) => N / Math.sqrt(tau)), 1e6);
  expect(reads.white).toBeCloseTo(N, 12);
  expect(reads.falling).toBe(true);
});

test("white noise and a random walk read off N, and the lowest point where they meet", () => {
  // σ² = N²/τ + K²τ/3 [IEEE Std 952, annex C]: lowest at τ = √3 N/K, where σ² = 2NK/√3.
  const [N, K] = [0.004, 0.0004];
  const reads = readOff(TAU, TAU.map((tau) => Math.sqrt((N * N) / tau + (K * K * tau) / 3)), 1e6);
  expect(Math.abs(reads.white! / N - 1)).toBeLessThan(0.02);
  expect(Math.abs(Math.log10(reads.lowest!.tau / ((Math.sqrt(3) * N) / K)))).toBeLessThan(1 / 24 + 1e-9); // half a step of τ
  expect(reads.lowest!.deviation / Math.sqrt((2 * N * K) / Math.sqrt(3))).toBeCloseTo(1, 2);
  expect(reads.falling).toBe(false);
});

test("a flat curve and a rising one have no N", () => {
  expect(readOff(TAU, TAU.map(() => 0.001), 1e6).white).toBeNull();
  expect(readOff(TAU, TAU.map((tau) => 0.001 * Math.sqrt(tau)), 1e6).white).toBeNull();
});

test("quantization, of slope −1, is not taken for white noise", () => {
  expect(readOff(TAU, TAU.map((tau) => 0.001 / tau), 1e6).white).toBeNull();
});

test("averaging times that the stream holds fewer than five times do not count", () => {
  const deviation = TAU.map((tau) => (tau > 1 ? 1e-9 : 0.004 / Math.sqrt(tau)));
  const reads = readOff(TAU, deviation, 5);
  expect(reads.white).toBeCloseTo(0.004, 12);
  expect(reads.lowest!.tau).toBeLessThanOrEqual(1);
});

test("values that are missing are passed over", () => {
  const deviation = TAU.map((tau, k) => (k % 7 === 3 ? null : 0.004 / Math.sqrt(tau)));
  expect(readOff(TAU, deviation, 1e6).white).toBeCloseTo(0.004, 12);
  expect(readOff(TAU, TAU.map(() => null), 1e6)).toEqual({ white: null, lowest: null, falling: false });
});

test("the slope of a straight line is its own", () => {
  const x = [0, 0.1, 0.2, 0.3];
  expect(slopeAt(x, x.map((value) => 3 - 0.5 * value), 1)).toBeCloseTo(-0.5, 12);
  expect(slopeAt([0], [1], 0)).toBeNaN();
});

test("durations are said in seconds, minutes and hours", () => {
  expect([42, 119.4, 600, 7199, 36000].map(duration)).toEqual(["42 s", "119 s", "10.0 min", "120.0 min", "10.00 h"]);
});
