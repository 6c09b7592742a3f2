// Where the panels are: in one, two or three columns, and folded where the reader wishes.
import { button, h, hint, set } from "./dom";
import { rememberedNames, rememberNames } from "./memory";
import type { OwnPanel } from "./shell";

export interface Place {
  name: string;
  title: string;
  panel: OwnPanel;
  /** Column of the wide and of the medium page, and place on a telephone. */
  wide: number;
  medium: number;
  phone: number;
  folded?: boolean;
}

export interface Frame extends Place {
  element: HTMLElement;
  badge: HTMLElement;
  visible: boolean;
  folds: boolean;
  /** Rows that it has seen, by their number. */
  rowsSeen: number;
}

const WIDE = matchMedia("(min-width: 1180px)");
const MEDIUM = matchMedia("(min-width: 720px)");

export class Layout {
  readonly frames: Frame[];
  readonly element = h("main", { class: "columns", attributes: { id: "panels" } });
  private readonly folded = rememberedNames("folded");
  private readonly unfolded = rememberedNames("unfolded");

  constructor(places: Place[]) {
    this.frames = places.map((place) => this.frame(place));
    const seen = new IntersectionObserver((entries) => {
      for (const entry of entries) {
        const frame = this.frames.find((one) => one.element === entry.target);
        if (frame) frame.visible = entry.isIntersecting;
      }
    }, { rootMargin: "120px" });
    for (const frame of this.frames) seen.observe(frame.element);
    WIDE.addEventListener("change", () => this.arrange());
    MEDIUM.addEventListener("change", () => this.arrange());
    this.arrange();
  }

  get(name: string): Frame {
    return this.frames.find((frame) => frame.name === name)!;
  }

  /** Show a panel only where there is something for it. */
  show(name: string, shown: boolean): void {
    this.get(name).element.hidden = !shown;
  }

  private frame(place: Place): Frame {
    const badge = h("span", { class: "badge" });
    badge.hidden = true;
    const folder = button({ class: "fold", attributes: { "aria-controls": `panel-${place.name}` } }, () => this.fold(frame, !frame.folds));
    hint(folder, "Fold or unfold");
    folder.append(h("i", { attributes: { "aria-hidden": "true" } }), h("span", { say: place.title }));
    const body = h("div", { class: "body", attributes: { id: `panel-${place.name}` } }, place.panel.element);
    const element = h("section", { class: `panel panel-${place.name}` }, h("h2", {}, folder, badge), body);
    const frame: Frame = { ...place, element, badge, visible: true, folds: false, rowsSeen: 0 };
    this.fold(frame, place.folded ? !this.unfolded.has(place.name) : this.folded.has(place.name), false);
    return frame;
  }

  private fold(frame: Frame, folds: boolean, kept = true): void {
    frame.folds = folds;
    const folder = frame.element.querySelector(".fold")!;
    set(folder, "aria-expanded", String(!folds));
    frame.element.querySelector<HTMLElement>(".body")!.hidden = folds;
    frame.element.classList.toggle("folded", folds);
    if (!kept) return;
    const [names, key] = frame.folded ? ([this.unfolded, "unfolded"] as const) : ([this.folded, "folded"] as const);
    if (!names.delete(frame.name)) names.add(frame.name);
    rememberNames(key, names);
  }

  private arrange(): void {
    const of = WIDE.matches ? "wide" : MEDIUM.matches ? "medium" : "phone";
    this.element.dataset["layout"] = of;
    const columns: HTMLElement[] = [];
    const sorted = [...this.frames].sort((a, b) => (of === "phone" ? a.phone - b.phone : 0));
    for (const frame of sorted) {
      const k = of === "phone" ? 0 : frame[of];
      while (columns.length <= k) columns.push(h("div", { class: `column column-${columns.length}` }));
      columns[k]!.append(frame.element);
    }
    this.element.replaceChildren(...columns);
  }
}
