// Events: they queue, the newest first.
import { aria, button, h, place, put, say } from "../dom";
import { clock } from "../format";
import type { Happened } from "../messages";
import type { Own, OwnPanel } from "../shell";

const MOST = 500;
export const KINDS: Readonly<Record<string, string>> = Object.fromEntries(
  [
    "opened", "reopened", "lost", "stalled", "resumed", "late", "gap", "dropped", "damaged", "failed", "flag", "mark", "remark", "note",
    "recording", "text", "command", "view", "calibration", "wall-clock",
  ].map((kind) => [kind, kind]),
);

/** Events by their number; those that come twice, as after a connection was lost, are kept once. */
export class Queue {
  readonly events: Happened[] = [];
  private readonly known = new Map<number, string>();

  /** Whether it is new. A number that comes again with another text is of a server that was started again. */
  add(event: Happened): boolean {
    const key = `${event.t} ${event.kind} ${event.text}`;
    const before = this.known.get(event.id);
    if (before === key) return false;
    if (before !== undefined) this.known.clear();
    this.known.set(event.id, key);
    if (this.known.size > 4 * MOST) this.known.delete(this.known.keys().next().value!);
    this.events.push(event);
    if (this.events.length > MOST) this.events.shift();
    return true;
  }
}

export const events: (onUnseen: (n: number) => void) => Own = (onUnseen) => (): OwnPanel => {
  const queue = new Queue();
  const list = h("ol", { class: "events", attributes: { tabindex: "0" }, aria: "Events, the newest first" });
  const filter = h("input", { attributes: { type: "search" }, aria: "Show events that contain" });
  place(filter, "filter");
  const kinds = h("select", { aria: "Show events of a kind" }, h("option", { say: "all kinds", attributes: { value: "" } }));
  const none = h("p", { class: "none", say: "Nothing has happened yet." });
  const seen = button({ class: "chip", say: "Seen" }, () => look());
  const element = h("div", { class: "eventpanel" }, h("div", { class: "tools" }, kinds, filter, seen), list, none);
  const known = new Set<string>();
  let unseen = 0;

  function look(): void {
    unseen = 0;
    for (const one of list.querySelectorAll(".new")) one.classList.remove("new");
    onUnseen(0);
  }

  function fits(event: Happened): boolean {
    return (!kinds.value || event.kind === kinds.value) && event.text.toLowerCase().includes(filter.value.trim().toLowerCase());
  }

  function item(event: Happened, fresh: boolean): HTMLElement {
    return h(
      "li", { class: fresh ? "new" : "", attributes: { "data-kind": event.kind } },
      h("time", { text: clock(event.t) }), h("b", { say: KINDS[event.kind] ?? event.kind }), h("span", { text: event.text }),
    );
  }

  function show(): void {
    list.replaceChildren(...queue.events.filter(fits).reverse().map((event) => item(event, false)));
    none.hidden = queue.events.length > 0;
  }

  filter.addEventListener("input", show);
  kinds.addEventListener("change", show);
  list.addEventListener("pointerenter", () => setTimeout(look, 1500));
  list.addEventListener("focus", look);

  return {
    element,
    event(event) {
      if (!queue.add(event)) return;
      if (!known.has(event.kind)) {
        known.add(event.kind);
        kinds.append(h("option", { say: KINDS[event.kind] ?? event.kind, attributes: { value: event.kind } }));
      }
      none.hidden = true;
      onUnseen(++unseen);
      if (!fits(event)) return;
      list.prepend(item(event, true));
      while (list.childElementCount > MOST) list.lastElementChild?.remove();
    },
    restyle() {
      aria(list, "Events, the newest first");
      say(none, "Nothing has happened yet.");
      put(list, "");
      show();
    },
  };
};
