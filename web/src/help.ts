// The help that lies over the page.
import { button, h } from "./dom";

export const KEYS: [string, string][] = [
  ["Space", "Play or pause a recording; hold the charts of a live stream"],
  ["h", "Hold the charts, or let them go on"],
  ["1 … 9", "Span of the charts: 5 s to 10 min"],
  ["Esc", "Back to the latest samples; close this help"],
  ["← →", "Move the cursor of the charts that have the focus; with Shift, by tenths"],
  ["+ −", "Change the span of time about the cursor"],
  [", .", "10 s back or on in a recording"],
  ["r", "Start a recording"],
  ["Shift r", "Stop the recording"],
  ["m", "Write a mark; Enter sets it"],
  ["t", "Tare: count angles from here"],
  ["?", "This help"],
];
export const WAYS: string[] = [
  "Drag across a chart to look closer; a double click goes back to the latest samples.",
  "The wheel changes the span with Ctrl or Shift, and always while the charts are held.",
  "Press a name above a chart to hide its line or show it again.",
  "Grey numbers are old: no sample has come for a second or more.",
  "Every button's title names the command that does the same: plumbob control URL …",
];

export function helpDialog(): HTMLDialogElement {
  const close = button({ class: "main", say: "Close" }, () => dialog.close());
  const dialog = h(
    "dialog", { class: "help", aria: "Help" },
    h("h2", { say: "Keys" }),
    h("dl", {}, ...KEYS.map(([key, what]) => h("div", {}, h("dt", {}, h("kbd", { text: key })), h("dd", { say: what })))),
    h("h2", { say: "Charts and numbers" }),
    h("ul", {}, ...WAYS.map((way) => h("li", { say: way }))),
    close,
  );
  dialog.addEventListener("click", (event) => {
    if (event.target === dialog) dialog.close();
  });
  return dialog;
}
