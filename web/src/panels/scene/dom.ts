// Small pieces that the panels share: elements, words that change with the language, what is kept in the browser.
import type { Context } from "../../panel";

/** An element with a class and a text. */
export function make<K extends keyof HTMLElementTagNameMap>(tag: K, name = "", text = ""): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  if (name) element.className = name;
  if (text) element.textContent = text;
  return element;
}

/** A push button. */
export function button(name: string, act: () => void): HTMLButtonElement {
  const element = make("button", name);
  element.type = "button";
  element.addEventListener("click", act);
  return element;
}

/** Words on elements, which are said again when the language changes. */
export class Words {
  private readonly said: (() => void)[] = [];

  constructor(private readonly context: Context) {}

  text<T extends HTMLElement>(element: T, english: string): T {
    return this.keep(element, () => put(element, this.context.t(english)));
  }

  attribute<T extends HTMLElement>(element: T, name: string, english: string): T {
    return this.keep(element, () => element.setAttribute(name, this.context.t(english)));
  }

  again(): void {
    for (const say of this.said) say();
  }

  private keep<T>(element: T, say: () => void): T {
    this.said.push(say);
    say();
    return element;
  }
}

/** Set a text where it differs: what does not change costs nothing. */
export function put(element: HTMLElement, text: string): void {
  if (element.textContent !== text) element.textContent = text;
}

const painted = new WeakMap<HTMLElement, string>();

/** Set a colour where it differs; the browser keeps it in another form, so that asking it does not tell. */
export function paint(element: HTMLElement, colour: string): void {
  if (painted.get(element) === colour) return;
  painted.set(element, colour);
  element.style.color = colour;
}

/** Pressed or not, for buttons of which one is on. */
export function press(element: HTMLElement, on: boolean): void {
  element.setAttribute("aria-pressed", String(on));
}

/** What was chosen before; a browser that keeps nothing gives the default. */
export function kept(key: string, otherwise: string): string {
  try {
    return localStorage.getItem(`plumbob.${key}`) ?? otherwise;
  } catch {
    return otherwise;
  }
}

export function keep(key: string, value: string): void {
  try {
    localStorage.setItem(`plumbob.${key}`, value);
  } catch {
    // A browser that keeps nothing shows the default next time.
  }
}

/** Call when an element comes into view or its size changes, and say whether it is seen. */
export function watched(element: HTMLElement, changed: () => void): () => boolean {
  let inView = true;
  if (typeof IntersectionObserver === "function") {
    new IntersectionObserver((entries) => {
      inView = entries.at(-1)!.isIntersecting;
      if (inView) changed();
    }).observe(element);
  }
  if (typeof ResizeObserver === "function") new ResizeObserver(changed).observe(element);
  document.addEventListener("visibilitychange", changed);
  return () => inView && !document.hidden && element.clientWidth > 0;
}

/** Whether the reader asked for less motion. */
export const calm = (): boolean => typeof matchMedia === "function" && matchMedia("(prefers-reduced-motion: reduce)").matches;

/** Draw once in the next frame, however often it is asked for. */
export function oncePerFrame(draw: (now: number) => void): () => void {
  let asked = false;
  return () => {
    if (asked) return;
    asked = true;
    requestAnimationFrame((now) => {
      asked = false;
      draw(now);
    });
  };
}

/** A canvas cleared and scaled to its size on the page; null where it has none. */
export function sheet(canvas: HTMLCanvasElement): { ctx: CanvasRenderingContext2D; width: number; height: number } | null {
  const width = canvas.clientWidth;
  const height = canvas.clientHeight;
  const ctx = canvas.getContext("2d");
  if (!ctx || width === 0 || height === 0) return null;
  const ratio = Math.min(2, window.devicePixelRatio || 1);
  const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== w || canvas.height !== h) [canvas.width, canvas.height] = [w, h];
  ctx.setTransform(w / width, 0, 0, h / height, 0, 0);
  ctx.clearRect(0, 0, width, height);
  return { ctx, width, height };
}
