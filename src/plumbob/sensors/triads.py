"""Between fields and triads: which columns of a message make ``gyr``, ``acc`` and ``mag`` of a unit, and back."""

from collections.abc import Mapping
from functools import cache

import numpy as np

from plumbob.check import Floats
from plumbob.data import TRIADS, ImuData
from plumbob.errors import ParameterError
from plumbob.sensors.decode import Frames
from plumbob.sensors.format import Message

_AXES = "xyz"


def triads_of(frames: Frames, unit: str = "") -> dict[str, Floats]:
    """Triads (N, 3) that a unit of the message has, in the units used inside; an axis that it lacks is NaN.

    Parameters
    ----------
    frames : Frames
        Decoded frames.
    unit : str
        Prefix of the unit's fields.
    """
    found: dict[str, Floats] = {}
    for triad in TRIADS:
        columns = [frames.columns.get(name) for name in _axes_of(unit, triad)]
        if any(column is not None for column in columns):
            found[triad] = np.empty((len(frames), 3))
            for i, column in enumerate(columns):
                found[triad][:, i] = np.nan if column is None else column
    return found


@cache  # for every part of a stream
def _axes_of(unit: str, triad: str) -> tuple[str, ...]:
    return tuple(_name(unit, triad, axis) for axis in _AXES)


def prefixes_of(message: Message) -> tuple[str, ...]:
    """Prefixes of a message's units with a triad, in the order of their fields; empty for the only one."""
    return tuple(dict.fromkeys(one.triad.rpartition(".")[0] for one in message.fields if one.triad))


def unit_of(message: Message, asked: str) -> str:
    """Prefix of the fields of one of a message's units, by its name or its number from 1.

    Raises
    ------
    ParameterError
        If there is no such unit, or none is asked for where there are several.
    """
    names = prefixes_of(message)
    if asked in names:
        return asked
    if asked.isdecimal() and 1 <= int(asked) <= len(names):
        return names[int(asked) - 1]
    if not names:
        raise ParameterError(
            f"message {message.name} carries no gyr, acc or mag, so there is nothing to estimate from."
        )
    if names == ("",):
        raise ParameterError(
            f"message {message.name} has one unit without a name, but '{asked}' was asked for; leave it out."
        )
    known = ", ".join(f"{name} ({number})" for number, name in enumerate(names, 1))
    got = f"but '{asked}' was asked for" if asked else "and none was named"
    how = f'name one, as --unit {names[0]} or unit = "{names[0]}" in [format]'
    raise ParameterError(f"message {message.name} has the units {known}, {got}; {how}.")


def temperature_of(frames: Frames, unit: str = "") -> Floats | None:
    """Temperature (N,) of a unit, °C; None where the message has none."""
    column = frames.columns.get(_name(unit, "temp_c"))
    return None if column is None else np.asarray(column, dtype=np.float64)


def ranges_of(message: Message, unit: str = "") -> dict[str, Floats]:
    """Full scale (3,) of each triad of a unit, in the units used inside: the greatest value of each axis both ways.

    An axis that the message lacks takes the largest of the others. A triad with an axis of floating point, of which
    the message knows no largest value, is left out.

    Parameters
    ----------
    message : Message
        What carries the fields.
    unit : str
        Prefix of the unit's fields.
    """
    fields = {one.name: one for one in message.fields}
    found: dict[str, Floats] = {}
    for triad in TRIADS:
        axes = [fields.get(name) for name in _axes_of(unit, triad)]
        known = [one for one in axes if one is not None]
        if known and all(one.type[0] != "f" for one in known):
            largest = max(one.full_scale for one in known)
            found[triad] = np.array([largest if one is None else one.full_scale for one in axes])
    return found


def columns_of(imu: ImuData, message: Message, unit: str = "") -> dict[str, Floats]:
    """Values by field of what a recording has and the message carries, for `encode.encode`.

    Parameters
    ----------
    imu : ImuData
        Samples.
    message : Message
        Where they shall go.
    unit : str
        Prefix of the unit's fields.
    """
    values: Mapping[str, Floats | None] = {"temp_c": imu.temp_c} | {
        f"{triad}.{axis}": None if getattr(imu, triad) is None else getattr(imu, triad)[:, i]
        for triad in TRIADS
        for i, axis in enumerate(_AXES)
    }
    wanted = {f.name for f in message.fields if f.physical}
    named = {_name(unit, *name.split(".")): value for name, value in values.items()}
    return {name: value for name, value in named.items() if value is not None and name in wanted}


def _name(*parts: str) -> str:
    return ".".join(part for part in parts if part)
