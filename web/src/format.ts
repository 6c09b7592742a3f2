// Numbers as they are shown: to the digit, with a minus that is as wide as a plus, and a dash for none.

export const NONE = "–";

/** A number with so many digits behind the point. */
export function fixed(value: number | null | undefined, digits: number): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return NONE;
  const text = value.toFixed(digits);
  return Number(text) === 0 ? text.replace("-", "") : text.replace("-", "−");
}

/** A number with its sign, also where it is positive. */
export function signed(value: number | null | undefined, digits: number): string {
  const text = fixed(value, digits);
  return text === NONE || text.startsWith("−") || Number(text) === 0 ? text : `+${text}`;
}

/** A count with its thousands set apart. */
export function count(value: number | null | undefined): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return NONE;
  return Math.round(value).toString().replace("-", "−").replace(/\B(?=(\d{3})+$)/g, "\u202f");
}

/** An angle brought to ±180°. */
export function wrapped(degrees: number): number {
  return ((((degrees + 180) % 360) + 360) % 360) - 180;
}

/** Time as 12.3 s, 2:03.4 or 1:02:03. */
export function clock(seconds: number | null | undefined, digits = 1): string {
  if (seconds === null || seconds === undefined || !Number.isFinite(seconds)) return NONE;
  const unit = 10 ** digits;
  const all = Math.round(Math.abs(seconds) * unit);
  const minus = seconds < 0 && all > 0 ? "−" : "";
  const rest = (all / unit) % 60;
  const minutes = Math.floor(all / unit / 60);
  if (minutes === 0) return `${minus}${rest.toFixed(digits)} s`;
  const tail = rest.toFixed(digits).padStart(digits ? digits + 3 : 2, "0");
  if (minutes < 60) return `${minus}${minutes}:${tail}`;
  return `${minus}${Math.floor(minutes / 60)}:${String(minutes % 60).padStart(2, "0")}:${tail}`;
}

/** Time of day in UTC. */
export function utc(seconds: number, digits = 0): string {
  const text = new Date(seconds * 1000).toISOString();
  return `${text.slice(11, digits ? 20 + digits : 19)} UTC`;
}

/** A short time: ms below a tenth of a second. */
export function brief(seconds: number | null | undefined): string {
  if (seconds === null || seconds === undefined || !Number.isFinite(seconds)) return NONE;
  return Math.abs(seconds) < 0.1 ? `${fixed(seconds * 1000, 1)} ms` : seconds < 120 ? `${fixed(seconds, 1)} s` : clock(seconds, 0);
}
