// What the page's own panels get beside what every panel gets.
import type { Hello, State } from "./messages";
import type { Context, Panel } from "./panel";
import type { Store } from "./store";

export interface Shell extends Context {
  store: Store;
  /** Newest state; null before the first. */
  latest(): State | null;
  /** Do a command, and show its answer. */
  ask(command: Parameters<Context["send"]>[0]): Promise<boolean>;
  /** Colour of what an estimator, or the reference, says. */
  colourOf(source: string): string;
  /** Name of a source as it is shown. */
  nameOf(source: string): string;
  /** Time between rows beyond which a line breaks, s. */
  gap(): number;
}

/** A panel of the page's own: it may draw in every frame, and take keys. */
export interface OwnPanel extends Panel {
  frame?(now: number): void;
  /** True where the key was taken. */
  key?(key: string, event: KeyboardEvent): boolean;
}

export type Own = (shell: Shell) => OwnPanel;

/** Why commands are not taken; empty where they are. */
export function refusal(hello: Hello | null): string {
  if (hello === null) return "There is no connection yet.";
  return hello.control ? "" : "Commands are not taken: plumbob view was started without --control.";
}
