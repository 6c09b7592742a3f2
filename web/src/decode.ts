// Messages of the server, decoded; their layout is written in src/plumbob/viewer/messages.py.
import type { FromServer, State } from "./messages";
import { HISTORY, TICK } from "./messages";
import type { Rows } from "./panel";

const HEAD = 24;
const LITTLE = new Uint8Array(new Uint32Array([1]).buffer)[0] === 1;

export interface Binary {
  kind: number;
  state: State | null;
  rows: Rows;
}

/** A binary message: a tick has a state, a history none. RangeError where it is cut short or of another kind. */
export function decodeBinary(buffer: ArrayBuffer): Binary {
  const view = new DataView(buffer);
  if (buffer.byteLength < HEAD) throw new RangeError(`a binary message of ${buffer.byteLength} bytes; its head has ${HEAD}`);
  const [kind, text, n, m, epoch] = [0, 4, 8, 12, 16].map((at) => view.getUint32(at, true)) as [number, number, number, number, number];
  if (kind !== TICK && kind !== HISTORY) throw new RangeError(`a binary message of kind ${kind}`);
  const whole = HEAD + text + n * (12 + 4 * m);
  if (buffer.byteLength !== whole) throw new RangeError(`a binary message of ${buffer.byteLength} bytes; ${whole} were expected`);
  const state = text ? (JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, HEAD, text))) as State) : null;
  let at = HEAD + text;
  const t = new Float64Array(numbers(buffer, at, n, 8));
  at += 8 * n;
  const flags = new Uint32Array(numbers(buffer, at, n, 4));
  at += 4 * n;
  const values = Array.from({ length: m }, (_, i) => new Float32Array(numbers(buffer, at + 4 * n * i, n, 4)));
  return { kind, state, rows: { epoch, t, flags, values } };
}

/** Bytes of n numbers in the order of this machine. */
function numbers(buffer: ArrayBuffer, at: number, n: number, width: number): ArrayBuffer {
  const bytes = new Uint8Array(buffer.slice(at, at + n * width));
  if (!LITTLE) for (let i = 0; i < bytes.length; i += width) bytes.subarray(i, i + width).reverse();
  return bytes.buffer;
}

/** A message of text; null where it is none that this page knows. */
export function decodeText(text: string): FromServer | null {
  const message: unknown = JSON.parse(text);
  return typeof message === "object" && message !== null && "type" in message ? (message as FromServer) : null;
}
