// What the page remembers in this browser; a browser that forbids it forgets.

export function remembered(key: string): string | null {
  try {
    return localStorage.getItem(`plumbob.${key}`);
  } catch {
    return null;
  }
}

export function remember(key: string, value: string): void {
  try {
    localStorage.setItem(`plumbob.${key}`, value);
  } catch {
    // Private windows and full disks: the page works without.
  }
}

/** A set of names. */
export function rememberedNames(key: string): Set<string> {
  try {
    const found: unknown = JSON.parse(remembered(key) ?? "[]");
    return new Set(Array.isArray(found) ? found.filter((name) => typeof name === "string") : []);
  } catch {
    return new Set();
  }
}

export function rememberNames(key: string, names: Set<string>): void {
  remember(key, JSON.stringify([...names]));
}
