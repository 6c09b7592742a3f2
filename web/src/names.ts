// Names of charts and channels, in English; what is not here is shown as the server says it.
import type { Hello } from "./messages";

export const NAMES: Readonly<Record<string, string>> = {
  attitude: "Attitude", error: "Error to the reference", sd: "Claimed standard deviation", bias: "Estimated bias", residual: "Residual",
  rate: "Angular rate", force: "Specific force", field: "Magnetic field", temperature: "Temperature", flags: "Flags",
};
export const SHORT: Readonly<Record<string, string>> = { ...NAMES, error: "Error", sd: "Claimed sd", bias: "Bias", rate: "Rate", force: "Force", field: "Field" };
export const ANGLE_NAMES: Readonly<Record<string, string>> = { roll: "Roll", pitch: "Pitch", yaw: "Yaw", heading: "Heading" };

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
