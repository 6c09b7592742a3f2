// The device's output lines, as they are written to a text file.
import { button, h, put, say, set } from "../dom";
import type { Own } from "../shell";

const MOST = 400;

export const terminal: Own = (shell) => {
  const output = h("pre", { class: "terminal live", attributes: { tabindex: "0", role: "log", "aria-live": "off" }, aria: "Output lines of the device" });
  const holder = button({ class: "chip", say: "Pause" }, () => {
    paused = !paused;
    set(holder, "aria-pressed", String(paused));
    say(holder, paused ? "Paused" : "Pause");
    if (!paused) show();
  });
  const copier = button({ class: "chip", say: "Copy" }, () => void copy());
  const note = h("span", { class: "readout", attributes: { role: "status" } });
  const element = h("div", {}, h("div", { class: "tools" }, holder, copier, note), output);
  let lines: string[] = [];
  let paused = false;
  let dirty = false;

  function show(): void {
    const last = output.scrollHeight - output.scrollTop - output.clientHeight < 30;
    put(output, lines.join("\n"));
    if (last) output.scrollTop = output.scrollHeight;
    dirty = false;
  }

  async function copy(): Promise<void> {
    try {
      await navigator.clipboard.writeText(output.textContent ?? "");
      put(note, shell.t("copied"));
    } catch {
      // Without a secure address, a browser lends no clipboard: the lines are selected instead.
      getSelection()?.selectAllChildren(output);
      put(note, shell.t("selected: copy with Ctrl C"));
    }
    setTimeout(() => put(note, ""), 3000);
  }

  return {
    element,
    lines(more) {
      lines = [...lines, ...more.lines.map((line) => line.replace(/\n$/, ""))].slice(-MOST);
      dirty = true;
    },
    clear() {
      lines = [];
      dirty = true;
    },
    frame() {
      if (dirty && !paused) show();
    },
  };
};
