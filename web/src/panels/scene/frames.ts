// From a navigation frame and body axes to the scene, whose x, y and z are east, north and up, and to a compass.
export type Vec = [number, number, number];
export type Quat = [number, number, number, number];
/** Rows of a matrix: what a vector's parts forward, right and up of the body are, of each of three directions. */
export interface Outside {
  up: Vec;
  north: Vec;
  east: Vec;
}

export const DEG = Math.PI / 180;

/** Product of two quaternions, scalar first. */
export function multiply(a: Quat, b: Quat): Quat {
  const [w, x, y, z] = a;
  const [s, p, q, r] = b;
  return [
    w * s - x * p - y * q - z * r,
    w * p + x * s + y * r - z * q,
    w * q - x * r + y * s + z * p,
    w * r + x * q - y * p + z * s,
  ];
}

export const conjugate = ([w, x, y, z]: Quat): Quat => [w, -x, -y, -z];

/** A vector turned by a unit quaternion. */
export function rotate([w, x, y, z]: Quat, [a, b, c]: Vec): Vec {
  const tx = 2 * (y * c - z * b);
  const ty = 2 * (z * a - x * c);
  const tz = 2 * (x * b - y * a);
  return [a + w * tx + y * tz - z * ty, b + w * ty + z * tx - x * tz, c + w * tz + x * ty - y * tx];
}

export const dot = (a: Vec, b: Vec): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a: Vec, b: Vec): Vec => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];
export const scaled = (a: Vec, s: number): Vec => [a[0] * s, a[1] * s, a[2] * s];
export const added = (a: Vec, b: Vec): Vec => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const length = (a: Vec): number => Math.hypot(a[0], a[1], a[2]);

/** A vector of length 1; null where it has none. */
export function unit(a: readonly number[] | null | undefined): Vec | null {
  const found = vec(a);
  const size = found === null ? 0 : length(found);
  return found === null || size === 0 ? null : scaled(found, 1 / size);
}

/** Directions of length 1 of those that have any. */
export const units = (every: readonly (readonly number[])[]): Vec[] => every.map(unit).filter((one): one is Vec => one !== null);

/** Three finite numbers; null where they are not. */
export function vec(a: readonly number[] | null | undefined): Vec | null {
  return a?.length === 3 && a.every(Number.isFinite) ? [a[0]!, a[1]!, a[2]!] : null;
}

/** A unit quaternion; null where it is none. */
export function quat(a: readonly number[] | null | undefined): Quat | null {
  if (a?.length !== 4 || !a.every(Number.isFinite)) return null;
  const size = Math.hypot(...a);
  return size === 0 ? null : [a[0]! / size, a[1]! / size, a[2]! / size, a[3]! / size];
}

/** Quaternion of yaw, pitch and roll, degrees: about z first, then y, then x. */
export function quatOf(yaw: number, pitch: number, roll: number): Quat {
  const about = (angle: number, axis: number): Quat => {
    const q: Quat = [Math.cos((angle * DEG) / 2), 0, 0, 0];
    q[axis + 1] = Math.sin((angle * DEG) / 2);
    return q;
  };
  return multiply(multiply(about(yaw, 2), about(pitch, 1)), about(roll, 0));
}

const HALF = Math.SQRT1_2;
// Half a turn about (1, 1, 0) changes x with y and turns z over; a quarter turn about z takes north, west to east, north.
const TO_SCENE: Record<string, Quat> = { ENU: [1, 0, 0, 0], NED: [0, HALF, HALF, 0], NWU: [HALF, 0, 0, HALF] };
const TO_FLU: Record<string, Quat> = { FLU: [1, 0, 0, 0], FRD: [0, 1, 0, 0] };

/** Letters of a navigation frame's axes, and where they point in the scene. */
export function frameAxes(frame: string | null): { letter: string; direction: Vec }[] {
  const every: Record<string, Vec> = { E: [1, 0, 0], N: [0, 1, 0], W: [-1, 0, 0], U: [0, 0, 1], D: [0, 0, -1] };
  return [...(frame ?? "")].map((letter) => ({ letter, direction: every[letter] ?? [0, 0, 0] }));
}

/** A vector of a navigation frame in the scene. */
export const toScene = (vector: Vec, frame: string | null): Vec => rotate(TO_SCENE[frame ?? "ENU"] ?? TO_SCENE.ENU!, vector);

/** A vector in body axes, in those of a model: forward, left, up. */
export const toModel = (vector: Vec, axes: string): Vec => rotate(TO_FLU[axes] ?? TO_FLU.FLU!, vector);

/** Attitude in the scene of a model whose axes are forward, left, up. */
export function sceneAttitude(q_nb: Quat, frame: string | null, axes: string): Quat {
  const model = TO_FLU[axes] ?? TO_FLU.FLU!;
  return multiply(multiply(TO_SCENE[frame ?? "ENU"] ?? TO_SCENE.ENU!, q_nb), model);
}

/** Up, north and east as the body sees them: parts forward, right and up. */
export function outside(q_nb: Quat, frame: string | null, axes: string): Outside {
  const back = conjugate(sceneAttitude(q_nb, frame, axes));
  const seen = (v: Vec): Vec => {
    const [forward, left, up] = rotate(back, v);
    return [forward, -left, up];
  };
  return { up: seen([0, 0, 1]), north: seen([0, 1, 0]), east: seen([1, 0, 0]) };
}

/** An angle from 0 to 360°. */
export const wrap360 = (angle: number): number => {
  const turned = angle % 360;
  return turned < 0 ? (turned + 360) % 360 : turned + 0;
};

/** An angle from −180 to 180°, the latter excluded. */
export const wrap180 = (angle: number): number => wrap360(angle + 180) - 180;

/** Compass heading, clockwise from north, of a yaw in a frame; degrees. */
export function compassOf(yaw: number, frame: string | null): number {
  if (frame === "ENU") return wrap360(90 - yaw);
  return wrap360(frame === "NWU" ? -yaw : yaw);
}

/** How much the compass heading rises where yaw does: its sense. */
export const senseOf = (frame: string | null): number => (frame === "NED" ? 1 : -1);

/** Angle of the nose above the horizon, and bank, right side down; degrees. */
export function noseAndBank(seen: Outside): { nose: number; bank: number } {
  const [forward, right, up] = seen.up;
  return { nose: Math.atan2(forward, Math.hypot(right, up)) / DEG, bank: Math.atan2(-right, up) / DEG };
}

/** Rate about the vertical, clockwise seen from above, in °/s, between two attitudes in the scene. */
export function turnRate(before: Quat, after: Quat, seconds: number): number {
  const [w, , , z] = multiply(after, conjugate(before));
  return wrap180((-2 * Math.atan2(z, w)) / DEG) / seconds;
}

/** Between two attitudes, by the shorter way. */
export function between(a: Quat, b: Quat, share: number): Quat {
  const inner = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
  const sign = inner < 0 ? -1 : 1;
  const angle = Math.acos(Math.min(1, Math.abs(inner)));
  const [p, q] = angle < 1e-6 ? [1 - share, share] : [Math.sin((1 - share) * angle) / Math.sin(angle), Math.sin(share * angle) / Math.sin(angle)];
  const sum = a.map((value, k) => p * value + sign * q * b[k]!);
  return quat(sum) ?? b;
}
