// What is read off an Allan deviation that still grows: provisional figures.

export interface Reads {
  /** Coefficient of white noise: the line of slope −½ at τ = 1 s; null where the curve shows no such slope. */
  white: number | null;
  /** Lowest point of what is known well enough. */
  lowest: { tau: number; deviation: number } | null;
  /** Whether the curve still falls at its end, so that its lowest point says nothing yet. */
  falling: boolean;
}

const WITHIN = 0.15; // of the slope
const REACH = 0.25; // decades to either side over which it is taken
const FEWEST = 3;
const TIMES = 5; // averages that a point needs to be more than chance

/** Figures of one curve; `duration` is that of the stream. */
export function readOff(tau: readonly number[], deviation: readonly (number | null)[], duration: number): Reads {
  const x: number[] = [];
  const y: number[] = [];
  tau.forEach((time, k) => {
    const value = deviation[k];
    if (value != null && value > 0 && time > 0 && time * TIMES <= duration) {
      x.push(Math.log10(time));
      y.push(Math.log10(value));
    }
  });
  if (x.length === 0) return { white: null, lowest: null, falling: false };
  const least = y.indexOf(Math.min(...y));
  return {
    white: white(x, y),
    lowest: { tau: 10 ** x[least]!, deviation: 10 ** y[least]! },
    falling: least === y.length - 1,
  };
}

function white(x: number[], y: number[]): number | null {
  const fits = x.map((_, k) => Math.abs(slopeAt(x, y, k) + 0.5) <= WITHIN);
  let best: [number, number] = [0, 0];
  for (let k = 0, first = 0; k <= fits.length; k++) {
    if (fits[k]) continue;
    if (k - first > best[1] - best[0]) best = [first, k];
    first = k + 1;
  }
  const [first, stop] = best;
  if (stop - first < FEWEST) return null;
  let sum = 0;
  for (let k = first; k < stop; k++) sum += y[k]! + 0.5 * x[k]!;
  return 10 ** (sum / (stop - first));
}

/** Slope of the straight line through the points about one, in decades a decade; NaN where it is alone. */
export function slopeAt(x: readonly number[], y: readonly number[], k: number): number {
  let [n, sx, sy, sxx, sxy] = [0, 0, 0, 0, 0];
  for (let i = 0; i < x.length; i++) {
    const dx = x[i]! - x[k]!;
    if (Math.abs(dx) > REACH) continue;
    n += 1;
    sx += dx;
    sy += y[i]!;
    sxx += dx * dx;
    sxy += dx * y[i]!;
  }
  const spread = n * sxx - sx * sx;
  return spread > 0 ? (n * sxy - sx * sy) / spread : NaN;
}
