// Names of charts and channels, in English; what is not here is shown as the server says it.

export const NAMES: Readonly<Record<string, string>> = {
  attitude: "Attitude",
  error: "Error to the reference",
  sd: "Claimed standard deviation",
  bias: "Estimated bias",
  residual: "Residual",
  rate: "Angular rate",
  force: "Specific force",
  field: "Magnetic field",
  temperature: "Temperature",
  flags: "Flags",
};
