// A camera that goes round a point: by mouse, touch, wheel and keys.
import { DEG, type Vec } from "./frames";

export class Orbit {
  /** Where the camera stands, clockwise from north as seen from the middle, and above the horizon; rad. */
  azimuth = 200 * DEG;
  elevation = 22 * DEG;
  distance = 4.6;

  constructor(private readonly least = 1.6, private readonly most = 14) {}

  /** Place of the camera about the origin. */
  place(): Vec {
    const level = Math.cos(this.elevation) * this.distance;
    return [level * Math.sin(this.azimuth), level * Math.cos(this.azimuth), Math.sin(this.elevation) * this.distance];
  }

  turn(right: number, up: number): void {
    this.azimuth = (this.azimuth + right) % (2 * Math.PI);
    this.elevation = Math.max(-89.9 * DEG, Math.min(89.9 * DEG, this.elevation + up));
  }

  zoom(factor: number): void {
    this.distance = Math.max(this.least, Math.min(this.most, this.distance * factor));
  }
}

/** What a hand does. */
export interface Hand {
  turn(right: number, up: number): void;
  zoom(factor: number): void;
}

const STEP = 6 * DEG;

/** Let an element be turned by hand: a drag over its height is half a turn. */
export function turnable(element: HTMLElement, hand: Hand): void {
  const pointers = new Map<number, [number, number]>();
  let spread = 0;
  element.addEventListener("pointerdown", (event) => {
    element.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, [event.clientX, event.clientY]);
    spread = 0;
  });
  element.addEventListener("pointermove", (event) => {
    const before = pointers.get(event.pointerId);
    if (!before) return;
    pointers.set(event.pointerId, [event.clientX, event.clientY]);
    const speed = Math.PI / Math.max(120, element.clientHeight);
    if (pointers.size === 1) hand.turn((event.clientX - before[0]) * speed, (event.clientY - before[1]) * speed);
    if (pointers.size === 2) {
      const [a, b] = [...pointers.values()] as [[number, number], [number, number]];
      const now = Math.hypot(a[0] - b[0], a[1] - b[1]);
      if (spread > 0 && now > 0) hand.zoom(spread / now);
      spread = now;
    }
  });
  const gone = (event: PointerEvent): void => {
    pointers.delete(event.pointerId);
    spread = 0;
  };
  for (const kind of ["pointerup", "pointercancel", "lostpointercapture"] as const) element.addEventListener(kind, gone);
  element.addEventListener(
    "wheel",
    (event) => {
      if (!event.ctrlKey && document.activeElement !== element) return; // else a page could not be scrolled past it
      event.preventDefault();
      hand.zoom(Math.exp(event.deltaY * 0.001));
    },
    { passive: false },
  );
  element.addEventListener("keydown", (event) => {
    const turns: Record<string, [number, number]> = {
      ArrowLeft: [-STEP, 0], ArrowRight: [STEP, 0], ArrowUp: [0, STEP], ArrowDown: [0, -STEP],
    };
    const turn = turns[event.key];
    if (turn) hand.turn(...turn);
    else if (event.key === "+" || event.key === "=") hand.zoom(0.9);
    else if (event.key === "-") hand.zoom(1 / 0.9);
    else return;
    event.preventDefault();
  });
}
