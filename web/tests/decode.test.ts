// The binary layout of src/plumbob/viewer/messages.py, its bytes written by hand.
import { expect, test } from "vitest";
import { decodeBinary, decodeText } from "../src/decode";

function hex(text: string): ArrayBuffer {
  return new Uint8Array((text.replace(/[^0-9a-f]/g, "").match(/../g) ?? []).map((byte) => parseInt(byte, 16))).buffer;
}

// Numbers of IEEE 754: 0.5 s and 1.5 s as f64; 1, −2, NaN and 0.25 as f32.
const HISTORY = `
  02000000 00000000 02000000 02000000 07000000 00000000
  000000000000e03f 000000000000f83f
  00020000 00000001
  0000803f 000000c0
  0000c07f 0000803e`;
// {"t":2.5} has nine bytes and seven spaces behind.
const TICK = `
  01000000 10000000 01000000 01000000 03000000 00000000
  7b2274223a322e357d 20202020202020
  0000000000000440
  00000000
  00004841`;

test("a history has times, flags and columns, and no state", () => {
  const { kind, state, rows } = decodeBinary(hex(HISTORY));
  expect([kind, state, rows.epoch]).toEqual([2, null, 7]);
  expect([...rows.t]).toEqual([0.5, 1.5]);
  expect([...rows.flags]).toEqual([1 << 9, 1 << 24]);
  expect(rows.values.map((column) => [...column])).toEqual([[1, -2], [NaN, 0.25]]);
});

test("a tick has its state before its rows", () => {
  const { kind, state, rows } = decodeBinary(hex(TICK));
  expect([kind, state?.t, rows.epoch]).toEqual([1, 2.5, 3]);
  expect([[...rows.t], [...rows.flags], rows.values.map((column) => [...column])]).toEqual([[2.5], [0], [[12.5]]]);
});

test("a message that is cut short, too long or of another kind is refused", () => {
  const whole = new Uint8Array(hex(TICK));
  for (const length of [0, 23, 24, whole.length - 1]) expect(() => decodeBinary(whole.slice(0, length).buffer), String(length)).toThrow(RangeError);
  expect(() => decodeBinary(new Uint8Array([...whole, 0]).buffer)).toThrow(RangeError);
  whole[0] = 9;
  expect(() => decodeBinary(whole.buffer)).toThrow("kind 9");
});

test("text of no known shape is left alone", () => {
  expect(decodeText("null")).toBeNull();
  expect(decodeText('{"a":1}')).toBeNull();
  expect(decodeText('{"type":"answer","id":1,"ok":true,"text":""}')).toMatchObject({ type: "answer", id: 1 });
});
