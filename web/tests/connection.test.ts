import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { Connection, type Sockets } from "../src/connection";
import type { Hello } from "../src/messages";
import { Queue } from "../src/panels/events";

/** A socket whose other end is the test. */
class End {
  readyState = 0;
  binaryType = "";
  sent: string[] = [];
  onopen: (() => void) | null = null;
  onmessage: ((event: { data: string | ArrayBuffer }) => void) | null = null;
  onclose: ((event: { reason: string }) => void) | null = null;
  constructor(readonly since: number | null) {}
  send(text: string): void {
    this.sent.push(text);
  }
  open(): void {
    this.readyState = 1;
    this.onopen?.();
  }
  say(message: object): void {
    this.onmessage?.({ data: JSON.stringify(message) });
  }
  close(reason = ""): void {
    this.readyState = 3;
    this.onclose?.({ reason });
  }
}

let ends: End[];
let heard: string[];
let status: number;
let connection: Connection;
const hello = (protocol = 1) => ({ type: "hello", protocol }) as Hello;

beforeEach(() => {
  vi.useFakeTimers();
  ends = [];
  heard = [];
  status = 200;
  const sockets: Sockets = {
    open(since) {
      ends.push(new End(since));
      return ends.at(-1) as unknown as WebSocket;
    },
    status: () => Promise.resolve(status),
  };
  connection = new Connection(
    {
      standing: (standing, why) => heard.push(`${standing} ${why}`.trim()),
      hello: (_, first) => heard.push(`hello ${first ? "first" : "again"}`),
      rows: () => heard.push("rows"),
      state: () => heard.push("state"),
      other: (message) => heard.push(message.type),
    },
    sockets,
  );
  connection.start();
});

afterEach(() => vi.useRealTimers());

test("a connection that is lost opens again, after half a second and then ever later, up to five", async () => {
  const waits: number[] = [];
  for (let i = 0; i < 6; i++) {
    ends.at(-1)!.close();
    let waited = 0;
    while (ends.length === i + 1) {
      await vi.advanceTimersByTimeAsync(100);
      waited += 100;
      if (waited > 20_000) throw new Error("it has not opened again");
    }
    waits.push(waited);
  }
  expect(waits).toEqual([500, 1000, 2000, 4000, 5000, 5000]);
});

test("the wait is short again after a hello, and every connection's first hello is said to be one", async () => {
  ends[0]!.close();
  await vi.advanceTimersByTimeAsync(500);
  ends[1]!.close();
  await vi.advanceTimersByTimeAsync(1000);
  ends[2]!.open();
  ends[2]!.say(hello());
  ends[2]!.say(hello());
  ends[2]!.close("too slow");
  await vi.advanceTimersByTimeAsync(500);
  expect(ends.length).toBe(4);
  ends[3]!.open();
  ends[3]!.say(hello());
  expect(heard.filter((word) => word.startsWith("hello"))).toEqual(["hello first", "hello again", "hello first"]);
  expect(heard).toContain("waiting too slow");
  expect(connection.standing).toBe("connected");
});

test("a server that refuses is named, and asked again", async () => {
  status = 401;
  ends[0]!.close();
  await vi.advanceTimersByTimeAsync(500);
  expect(heard).toContain("refused");
  expect(ends.length).toBe(2);
});

test("a server of another version is not spoken with", async () => {
  ends[0]!.open();
  ends[0]!.say(hello(2));
  expect(heard.at(-1)).toBe("version 2");
  await vi.advanceTimersByTimeAsync(60_000);
  expect(ends.length).toBe(1);
});

test("a new connection asks for the events since the last one it knows", async () => {
  ends[0]!.open();
  ends[0]!.say(hello());
  ends[0]!.say({ type: "event", id: 41, t: 1, kind: "mark", text: "a" });
  ends[0]!.close();
  await vi.advanceTimersByTimeAsync(500);
  expect(ends.map((end) => end.since)).toEqual([null, 41]);
});

test("an answer finds its command, and a command without one fails", async () => {
  expect(await connection.send({ verb: "tare" })).toMatchObject({ ok: false });
  ends[0]!.open();
  const [first, second, third] = [connection.send({ verb: "mark", text: "x" }), connection.send({ verb: "tare" }), connection.send({ verb: "stop" })];
  const ids = ends[0]!.sent.map((text) => (JSON.parse(text) as { id: number }).id);
  ends[0]!.say({ type: "answer", id: ids[1], ok: true, text: "tared" });
  expect(await second).toMatchObject({ ok: true, text: "tared" });
  await vi.advanceTimersByTimeAsync(10_000);
  expect(await first).toMatchObject({ ok: false, text: "the server has not answered" });
  const last = connection.send({ verb: "mark" });
  ends[0]!.close();
  expect(await last).toMatchObject({ ok: false, text: "the connection was lost" });
  expect(await third).toMatchObject({ ok: false });
});

test("events that come twice are kept once, and a server that was started again begins again", () => {
  const queue = new Queue();
  const event = (id: number, text: string) => ({ type: "event" as const, id, t: id, kind: "mark", text });
  expect([queue.add(event(0, "a")), queue.add(event(1, "b")), queue.add(event(0, "a"))]).toEqual([true, true, false]);
  expect([queue.add(event(0, "other")), queue.add(event(1, "b"))]).toEqual([true, true]);
  expect(queue.events.map(({ text }) => text)).toEqual(["a", "b", "other", "b"]);
});
