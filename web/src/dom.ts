// Elements of the page. Text that is said in a language keeps its English, so that the language can change.
import { t } from "./i18n";

type Value = string | number;
type Said = "say" | "hint" | "aria" | "place";
export interface Look {
  class?: string;
  /** Label in English. */
  say?: string;
  values?: Value[];
  /** Text that is nobody's label: a name, a number. */
  text?: string;
  /** Title in English, shown by the mouse. */
  hint?: string;
  hintValues?: Value[];
  /** Label for who listens, in English. */
  aria?: string;
  attributes?: Record<string, string>;
}

/** An element with what is in it. */
export function h<K extends keyof HTMLElementTagNameMap>(tag: K, look: Look = {}, ...inside: (Node | null)[]): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  if (look.class) element.className = look.class;
  if (look.text !== undefined) element.textContent = look.text;
  if (look.say !== undefined) say(element, look.say, ...(look.values ?? []));
  if (look.hint !== undefined) hint(element, look.hint, ...(look.hintValues ?? []));
  if (look.aria !== undefined) aria(element, look.aria);
  for (const [name, value] of Object.entries(look.attributes ?? {})) element.setAttribute(name, value);
  for (const node of inside) if (node) element.append(node);
  return element;
}

/** A button; the function is called when it is pressed. */
export function button(look: Look, pressed: (event: MouseEvent) => void): HTMLButtonElement {
  const element = h("button", look);
  element.type = "button";
  element.addEventListener("click", pressed);
  return element;
}

/** Set a text, where it is another one. */
export function put(element: Element, text: string): void {
  if (element.textContent !== text) element.textContent = text;
}

/** Set an attribute, where it is another one. */
export function set(element: Element, name: string, value: string): void {
  if (element.getAttribute(name) !== value) element.setAttribute(name, value);
}

function kept(element: HTMLElement, key: Said, english: string, values: Value[]): string {
  element.dataset[key] = JSON.stringify([english, ...values]);
  return t(english, ...values);
}

/** Say a label, in whichever language is shown from now on. */
export function say(element: HTMLElement, english: string, ...values: Value[]): void {
  put(element, kept(element, "say", english, values));
}

/** Say no label any more. */
export function unsay(element: HTMLElement, text: string): void {
  delete element.dataset["say"];
  put(element, text);
}

/** Say a title. */
export function hint(element: HTMLElement, english: string, ...values: Value[]): void {
  set(element, "title", kept(element, "hint", english, values));
}

/** Say a label to who listens. */
export function aria(element: HTMLElement, english: string, ...values: Value[]): void {
  set(element, "aria-label", kept(element, "aria", english, values));
}

/** Say what stands in an empty field. */
export function place(element: HTMLInputElement, english: string): void {
  set(element, "placeholder", kept(element, "place", english, []));
}

/** Say everything again, for the language has changed. */
export function sayAgain(root: ParentNode): void {
  const again = (key: Said, done: (element: HTMLElement, text: string) => void) => {
    for (const element of root.querySelectorAll<HTMLElement>(`[data-${key}]`)) {
      const [english, ...values] = JSON.parse(element.dataset[key] ?? '[""]') as [string, ...Value[]];
      done(element, t(english, ...values));
    }
  };
  again("say", put);
  again("hint", (element, text) => element.setAttribute("title", text));
  again("place", (element, text) => element.setAttribute("placeholder", text));
  again("aria", (element, text) => element.setAttribute("aria-label", text));
}
