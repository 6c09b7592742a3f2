// How the stream does, and whether that is well: in words, and in colour.
import { h, hint, put, say, set, unsay } from "../dom";
import { brief, count, fixed, NONE, signed } from "../format";
import type { Hello, Link, State } from "../messages";
import type { Own } from "../shell";

type Health = "well" | "watch" | "wrong" | "unknown";
interface Judgement {
  health: Health;
  words: string;
  values?: (string | number)[];
}

/** The lights: what is judged, and how. */
export function judged(link: Link, hello: Hello, silent: number | null): Record<string, Judgement> {
  const share = link.lost / Math.max(1, link.samples + link.lost);
  const bad = link.rejected + link.junk;
  const slow = hello.rate !== null && link.rate !== null && link.rate < 0.9 * hello.rate;
  return {
    Stream:
      silent !== null
        ? { health: "wrong", words: "silent {} s", values: [fixed(silent, 1)] }
        : slow ? { health: "watch", words: "slower than {} Hz", values: [fixed(hello.rate, 0)] } : { health: "well", words: "flowing" },
    Frames:
      link.lost === 0 ? { health: "well", words: "none lost" }
      : { health: share > 0.01 ? "wrong" : "watch", words: "{} % lost", values: [fixed(100 * share, share < 0.001 ? 3 : 2)] },
    Bytes: bad === 0 ? { health: "well", words: "clean" } : { health: link.rejected > 0.001 * link.samples ? "wrong" : "watch", words: "{} damaged", values: [count(bad)] },
    Clock:
      link.drift_ppm === null ? { health: "unknown", words: "not measured" }
      : { health: Math.abs(link.drift_ppm) > 1000 ? "wrong" : Math.abs(link.drift_ppm) > 200 ? "watch" : "well", words: "{} ppm", values: [signed(link.drift_ppm, 1)] },
    Delay:
      link.latency === null ? { health: "unknown", words: "not measured" }
      : { health: link.latency > 0.5 ? "wrong" : link.latency > 0.1 ? "watch" : "well", words: "{}", values: [brief(link.latency)] },
    Server: link.skipped === 0 ? { health: "well", words: "keeps up" } : { health: "watch", words: "{} skipped", values: [count(link.skipped)] },
  };
}

const MARKS: Record<Health, string> = { well: "✓", watch: "!", wrong: "✕", unknown: "–" };
export const COUNTS: [keyof Link, string, string][] = [
  ["samples", "samples", "Samples since the start"],
  ["lost", "lost frames", "Frames that are missing in the stream"],
  ["gaps", "gaps", "How many times frames were missing"],
  ["rejected", "rejected", "Frames whose check failed"],
  ["junk", "junk bytes", "Bytes that belong to no frame"],
  ["unusable", "unusable", "Frames that were repeated or late"],
  ["skipped", "skipped", "Batches that the server did not get, because it was too slow"],
];

export const link: Own = (shell) => {
  const lights = h("ul", { class: "lights" });
  const facts = h("dl", { class: "facts" });
  const element = h("div", { class: "link" }, lights, facts);
  const lamps = new Map<string, HTMLElement>();
  const cells = new Map<string, HTMLElement>();
  let silent = false;
  let last = 0;

  function fact(key: string, english: string, why: string): void {
    const value = h("dd", { class: "live", text: NONE });
    const name = h("dt", { say: english });
    hint(name, why);
    cells.set(key, value);
    facts.append(h("div", {}, name, value));
  }
  fact("rate", "rate", "Samples per second over the last seconds");
  fact("latency", "latency", "From the arrival of the newest sample to the sending of the message");
  fact("age", "age", "Since the newest sample arrived");
  fact("drift_ppm", "clock drift", "Of the device's clock against this host's");
  fact("clock", "time from", "What tells the time of a sample");
  for (const [key, english, why] of COUNTS) fact(key, english, why);

  function write(state: State, hello: Hello): void {
    const { link: now } = state;
    const still = silent ? (now.age ?? 0) + Math.max(0, Date.now() / 1000 - state.sent) : null;
    for (const [name, judgement] of Object.entries(judged(now, hello, still))) {
      let lamp = lamps.get(name);
      if (!lamp) {
        lamp = h("li", {}, h("i", { attributes: { "aria-hidden": "true" } }), h("b", { say: name }), h("span"));
        lamps.set(name, lamp);
        lights.append(lamp);
      }
      set(lamp, "class", judgement.health);
      put(lamp.children[0]!, MARKS[judgement.health]);
      say(lamp.children[2] as HTMLElement, judgement.words, ...(judgement.values ?? []));
    }
    const text: Record<string, string> = {
      rate: `${fixed(now.rate, 1)} Hz`, latency: brief(now.latency), age: brief(now.age), drift_ppm: `${signed(now.drift_ppm, 1)} ppm`,
    };
    for (const [key, value] of Object.entries(text)) put(cells.get(key)!, value.startsWith(NONE) ? NONE : value);
    if (now.clock) say(cells.get("clock")!, now.clock);
    else unsay(cells.get("clock")!, NONE);
    for (const [key] of COUNTS) put(cells.get(key)!, count(now[key] as number));
  }

  return {
    element,
    stale(stale) {
      silent = stale;
    },
    frame(now) {
      const state = shell.latest();
      const hello = shell.hello();
      if (now - last < 200 || state === null || hello === null) return;
      last = now;
      write(state, hello);
    },
  };
};
