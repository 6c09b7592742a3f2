// Names of charts and channels, in English; what is not here is shown as the server says it.
import type { Estimator, Hello } from "./messages";
import type { Context } from "./panel";

export const NAMES: Readonly<Record<string, string>> = {
  attitude: "Attitude", joint: "Joint angles", joint_sd: "Claimed sd of the joint angles", error: "Error to the reference", sd: "Claimed standard deviation", bias: "Estimated bias", residual: "Residual",
  rate: "Angular rate", force: "Specific force", field: "Magnetic field", temperature: "Temperature", flags: "Flags",
};
export const SHORT: Readonly<Record<string, string>> = { ...NAMES, error: "Error", sd: "Claimed sd", bias: "Bias", rate: "Rate", force: "Force", field: "Field" };
export const ANGLE_NAMES: Readonly<Record<string, string>> = { roll: "Roll", pitch: "Pitch", yaw: "Yaw", heading: "Heading" };

/** Name of the reference among the estimators. */
export const REFERENCE = "reference";

/** The session's own estimator, which the body shows. */
export function primaryOf(hello: Hello | null): Estimator | undefined {
  return hello?.estimators.find(({ primary }) => primary) ?? hello?.estimators[0];
}

/** Colour of what an estimator gives, by its place, and ink for the reference. */
export function colourOf(source: string, hello: Hello | null, context: Context): string {
  if (source === REFERENCE) return context.colours().ink;
  const k = hello?.estimators.findIndex(({ name }) => name === source) ?? -1;
  return k < 0 ? context.colours().muted : context.series(k);
}

/** The estimators beside the primary one, each in its colour. */
export function othersOf(hello: Hello | null, context: Context): { name: string; colour: string }[] {
  const primary = primaryOf(hello)?.name;
  const others = hello?.estimators.filter(({ name }) => name !== primary) ?? [];
  return others.map(({ name }) => ({ name, colour: colourOf(name, hello, context) }));
}

/** Whether yaw is a heading as it stands: clockwise from a north. */
export function headed(hello: Hello, tared: boolean): boolean {
  return !tared && hello.frame === "NED" && northed(hello);
}

function northed(hello: Hello): boolean {
  return hello.north === "true" || hello.north === "magnetic";
}

/** Heading of a yaw, clockwise from north, 0 to 360°; null where yaw counts from no north. */
export function compass(hello: Hello, tared: boolean, yaw: number): number | null {
  if (tared || !northed(hello)) return null;
  const turned = hello.frame === "ENU" ? 90 - yaw : hello.frame === "NWU" ? -yaw : yaw;
  return ((turned % 360) + 360) % 360;
}
