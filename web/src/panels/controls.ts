// What can be asked for: recording, marks, the tare, a text file, estimators.
import { button, h, hint, place, put, say, set } from "../dom";
import { clock, count } from "../format";
import type { Hello, State } from "../messages";
import { REFERENCE } from "../names";
import type { OwnPanel, Shell } from "../shell";
import { refusal } from "../shell";

const NAME = "[A-Za-z0-9_.\\-]+";

function field(label: string, attributes: Record<string, string>): [HTMLLabelElement, HTMLInputElement] {
  const input = h("input", { attributes: { type: "text", autocomplete: "off", spellcheck: "false", ...attributes } });
  return [h("label", {}, h("span", { say: label }), input), input];
}

export function controls(shell: Shell): OwnPanel {
  const why = h("p", { class: "refusal" });
  const [nameLabel, name] = field("Name", { pattern: NAME, maxlength: "64" });
  const record = button({ class: "main record", say: "Record", hint: "plumbob control URL record (key r)" }, () => start());
  const stop = button({ class: "main", say: "Stop", hint: "plumbob control URL stop (keys Shift r)" }, () => void shell.ask({ verb: "stop" }));
  const kept = h("p", { class: "kept" });
  const [markLabel, mark] = field("Mark", { maxlength: "200" });
  const marker = button({ say: "Mark", hint: "plumbob control URL mark (key m, then Enter)" }, () => void note());
  const tare = button({ say: "Tare", hint: "plumbob control URL tare (key t)" }, () => void shell.ask({ verb: "tare" }));
  const untare = button({ say: "Untare", hint: "plumbob control URL untare" }, () => void shell.ask({ verb: "untare" }));
  const [textLabel, text] = field("Text file", { pattern: NAME, maxlength: "64" });
  const write = button({ say: "Write text", hint: "plumbob control URL text" }, () => {
    if (text.reportValidity()) void shell.ask({ verb: "text", name: text.value });
  });
  const end = button({ say: "End text", hint: "plumbob control URL text-stop" }, () => void shell.ask({ verb: "text-stop" }));
  const wrote = h("p", { class: "kept" });
  const filters = h("select", { aria: "Estimator to add" });
  const add = button({ say: "Add", hint: "plumbob control URL add" }, () => void shell.ask({ verb: "add", name: filters.value }));
  const list = h("ul", { class: "estimators" });
  const saving = h("div", { class: "row saving needs" }, nameLabel, record, stop);
  const estimators = h("div", { class: "row needs" }, h("label", {}, h("span", { say: "Estimator" }), filters), add);
  const element = h(
    "form", { class: "controls" }, why,
    saving, kept,
    h("div", { class: "row needs" }, markLabel, marker),
    h("div", { class: "row needs" }, h("span", { class: "name", say: "Zero of the angles" }), tare, untare),
    h("div", { class: "row needs" }, textLabel, write, end), wrote,
    estimators, list,
  );
  element.addEventListener("submit", (event) => event.preventDefault());
  mark.addEventListener("keydown", (event) => {
    if (event.key === "Enter") void note();
    if (event.key === "Escape") mark.blur();
  });
  for (const input of [name, text]) place(input, "by the time");
  const all = [name, record, stop, mark, marker, tare, untare, text, write, end, filters, add];

  function start(): void {
    if (name.reportValidity()) void shell.ask({ verb: "record", name: name.value });
  }

  async function note(): Promise<void> {
    if (await shell.ask({ verb: "mark", text: mark.value })) mark.value = "";
  }

  function show(hello: Hello, state: State | null): void {
    const reason = refusal(hello);
    element.classList.toggle("refused", reason !== "");
    why.hidden = reason === "";
    say(why, reason);
    const recording = state?.recording ?? null;
    const off = new Set<Element>(reason ? all : []);
    if (!hello.recording) for (const one of [name, record, stop]) off.add(one);
    off.add(recording ? record : stop);
    off.add(state?.text ? write : end);
    if (recording) off.add(name);
    saving.hidden = !hello.recording;
    write.hidden = Boolean(state?.text);
    end.hidden = !write.hidden;
    if (state && !state.tared) off.add(untare);
    if (!hello.estimators.length) for (const one of [tare, untare]) off.add(one);
    for (const one of all) one.disabled = off.has(one);
    for (const one of list.querySelectorAll("button")) one.disabled = reason !== "";
    if (recording) {
      const since = Math.max(0, Date.now() / 1000 - recording.since);
      say(kept, "{}: {} rows, {} on disk, {} dropped, {}", recording.path, count(recording.rows), count(recording.acknowledged), count(recording.dropped), clock(since, 0));
      set(kept, "data-lost", String(recording.dropped > 0));
    } else if (hello.recording) say(kept, "Nothing is recorded.");
    else say(kept, "There is nothing that can be recorded here.");
    if (state?.text) say(wrote, "Text goes to {}.", state.text);
    else put(wrote, "");
    wrote.hidden = !state?.text;
  }

  let last = 0;
  return {
    element,
    hello(hello) {
      filters.replaceChildren(...hello.filters.map((filter) => h("option", { text: filter, attributes: { value: filter } })));
      estimators.hidden = hello.filters.length === 0;
      list.replaceChildren(
        ...hello.estimators.filter((one) => one.name !== REFERENCE).map((one) => {
          const swatch = h("i", { class: "swatch" });
          swatch.style.color = shell.colourOf(one.name);
          swatch.dataset["of"] = one.name;
          const remove = button({ say: "Remove" }, () => void shell.ask({ verb: "remove", name: one.name }));
          hint(remove, "plumbob control URL remove");
          remove.setAttribute("aria-description", one.name);
          const title = h("span", { class: "title", text: one.title });
          return h("li", {}, swatch, title, one.primary ? h("span", { class: "none", say: "primary" }) : remove);
        }),
      );
      show(hello, shell.latest());
    },
    frame(now) {
      const hello = shell.hello();
      if (now - last < 200 || hello === null) return;
      last = now;
      show(hello, shell.latest());
    },
    restyle() {
      for (const swatch of list.querySelectorAll<HTMLElement>("i.swatch")) swatch.style.color = shell.colourOf(swatch.dataset["of"] ?? "");
    },
    key(key, event) {
      if (!shell.hello()?.control) return false;
      if (key === "r" && !record.disabled) return start(), true;
      if (key === "R" && event.shiftKey && !stop.disabled) return void shell.ask({ verb: "stop" }), true;
      if (key === "t" && !tare.disabled) return void shell.ask({ verb: "tare" }), true;
      if (key === "m" && !mark.disabled) return mark.focus(), true;
      return false;
    },
  };
}
