// @vitest-environment jsdom
import { expect, test } from "vitest";

import type { Hello, State } from "../src/messages";
import { playback } from "../src/panels/playback";
import type { Shell } from "../src/shell";

const HELLO = { control: true, live: false, duration: 10, started_utc: null } as unknown as Hello;
const at = (position: number, playing: boolean): State => ({ playback: { position, speed: 1, playing } }) as unknown as State;

test("the button asks for what it says, where the newest state is ahead of what was drawn", () => {
  const asked: string[] = [];
  let latest = at(9.9, true);
  const shell = {
    latest: () => latest,
    hello: () => HELLO,
    ask: (command: { verb: string }) => (asked.push(command.verb), Promise.resolve(true)),
  } as unknown as Shell;
  const panel = playback(shell);
  panel.state!(latest);
  const button = [...panel.element.querySelectorAll("button")].find(({ textContent }) => textContent === "Pause")!;
  latest = at(10, false); // it came to its end, and the page has not drawn that yet
  button.click();
  expect(asked).toEqual(["pause"]);
  panel.state!(latest);
  expect(button.textContent).toBe("Play");
  button.click();
  expect(asked).toEqual(["pause", "play"]);
});
