// Flags of samples, as src/plumbob/core/flags.py has them: a test compares them.

/** How much a flag matters: what is wrong, what to know, and what is well. */
export type Weight = "bad" | "warn" | "note";
export interface Flag {
  bit: number;
  name: string;
  meaning: string;
  weight: Weight;
}

const LIST: [number, string, Weight, string][] = [
  [0, "gyr-absent", "bad", "no gyroscope value in this sample"],
  [1, "acc-absent", "bad", "no accelerometer value in this sample"],
  [2, "mag-absent", "note", "no magnetometer value in this sample"],
  [3, "gyr-clipped", "bad", "a gyroscope axis is at the end of its range"],
  [4, "acc-clipped", "bad", "an accelerometer axis is at the end of its range"],
  [5, "mag-clipped", "bad", "a magnetometer axis is at the end of its range"],
  [6, "gyr-invalid", "bad", "a gyroscope value is infinite or impossible"],
  [7, "acc-invalid", "bad", "an accelerometer value is infinite or impossible"],
  [8, "mag-invalid", "bad", "a magnetometer value is infinite or impossible"],
  [9, "gap", "warn", "samples are missing before this one"],
  [10, "time-fault", "bad", "the time step is zero, negative or not finite; the sample was not used"],
  [11, "acc-gated", "warn", "the filter did not use the accelerometer"],
  [12, "mag-gated", "warn", "the filter did not use the magnetometer"],
  [13, "gyr-held", "warn", "the filter turned on with the last good rate, or with none"],
  [14, "not-converged", "warn", "nothing has shown yet, or not yet again, that the attitude is right"],
  [15, "heading-free", "warn", "no magnetometer has set the heading; it counts from where it began"],
  [16, "gyr-stuck", "bad", "the gyroscope, or an axis of it, says the same for longer than noise allows"],
  [17, "acc-stuck", "bad", "the accelerometer, or an axis of it, says the same for longer than noise allows"],
  [18, "mag-stuck", "bad", "the magnetometer, or an axis of it, says the same for longer than noise allows"],
  [19, "at-rest", "note", "the filter takes the unit to be at rest"],
  [20, "inconsistent", "bad", "the sensors contradict each other more than their noise explains"],
  [21, "field-unknown", "warn", "the unit has not turned in the field that gives the heading, or none was found"],
  [22, "unit-suspect", "warn", "a unit of the array deviates from the others by more than noise explains"],
  [23, "unit-excluded", "bad", "a unit of the array is left out: it is dead, or it contradicts the others"],
  [24, "cannot-isolate", "bad", "units of the array contradict each other, and nothing says which one is wrong"],
];

export const FLAGS: readonly Flag[] = LIST.map(([bit, name, weight, meaning]) => ({ bit: 1 << bit, name, meaning, weight }));

/** A flag by its name; one that is not known here is a warning. */
export function flagNamed(name: string): Flag {
  return FLAGS.find((flag) => flag.name === name) ?? { bit: 0, name, meaning: "", weight: "warn" };
}
