"""What goes into the fields of a frame: the simulated sensors' values as a chip's registers hold them."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from plumbob.check import Floats
from plumbob.rotations import Frame, euler_zyx_from_quat
from plumbob.sensors.field import Field
from plumbob.sensors.format import Message
from plumbob.sensors.triads import columns_of
from plumbob.sim import Simulation
from plumbob.units import unit

Column = Floats | NDArray[np.int64]
_JUST_BELOW = 1.0 - 1e-9  # a value at the end of its range stays there whatever it is rounded by


def columns_for(
    message: Message, units: Mapping[str, Simulation], device_ns: NDArray[np.int64], counter: NDArray[np.int64]
) -> dict[str, Column]:
    """Columns for `plumbob.sensors.encode.encode`.

    Parameters
    ----------
    message : Message
        What is sent; bound.
    units : mapping of str to Simulation
        By prefix.
    device_ns : ndarray (N,) of int64
        The device's own clock at each frame, ns.
    counter : ndarray (N,) of int64
        Number of each frame.
    """
    fields = {one.name: one for one in message.fields}
    measured: dict[str, Floats] = {}
    for prefix, simulation in units.items():
        measured |= columns_of(simulation.imu, message, prefix) | _angles(simulation, fields, prefix)
    if not measured:
        return {}
    found: dict[str, Column] = {name: _in_register(fields[name], values) for name, values in measured.items()}
    for one in message.fields:
        if one.role == "counter":
            found[one.name] = counter
        elif one.role == "clock":
            found[one.name] = np.rint(device_ns / (1e9 * unit(one.unit).factor)).astype(np.int64)
        elif one.role == "status" and not one.derived and "absent" in one.says.values():
            found[one.name] = _presence(one, measured, device_ns.size)
    return found


def _in_register(one: Field, values: Floats) -> Floats:
    """Hold the last value where there is none, and run into the rail where the sensor is at the end of its range."""
    there = ~np.isnan(values)
    last = np.maximum.accumulate(np.where(there, np.arange(values.size), -1))
    held = np.where(last >= 0, values[last], 0.0)
    if not one.triad or one.type[0] == "f":
        return held
    beyond = np.abs(held) >= one.full_scale * _JUST_BELOW
    return np.where(beyond, np.nan if one.overflow else np.copysign(np.inf, held), held)


def _angles(simulation: Simulation, fields: Mapping[str, Field], prefix: str) -> dict[str, Floats]:
    """True roll, pitch and heading, for devices that say them; heading from true North."""
    names = {name: f"{prefix}.{name}" if prefix else name for name in ("heading", "pitch", "roll")}
    if not any(name in fields for name in names.values()):
        return {}
    angles = euler_zyx_from_quat(simulation.kinematics.in_frame(Frame.NED).q_nb)
    return {names[key]: angles[:, i] for i, key in enumerate(names) if names[key] in fields}


def _presence(one: Field, measured: Mapping[str, Floats], count: int) -> NDArray[np.int64]:
    """Counts of a status that says whether its triads or fields have a new value; what is not simulated has none."""
    there = np.zeros(count, dtype=bool)
    for name, values in measured.items():
        if name in one.of or name.rpartition(".")[0] in one.of:
            there |= ~np.isnan(values)
    absent = next(code for code, word in one.says.items() if word == "absent")
    present = one.value if one.value not in one.says else min(set(range(len(one.says) + 1)) - set(one.says))
    return np.where(there, present, absent)
