"""The noise card of a unit, from the analyses of its triads.

Kalibr's ``imu.yaml``.

Kalibr wants five numbers that are greater than zero, noise densities of continuous time in SI, one for all axes, and
divides by √Δt itself (its wiki page "IMU Noise Model", and ``kalibr_common/ConfigReader.py``): the densities are N, the
random walks are K.
"""

import math
import re
from collections.abc import Mapping, Sequence

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError, ShapeError, UnitError
from plumbob.core.findings import Note, info, warning
from plumbob.core.text import visible
from plumbob.core.units import Quantity, written
from plumbob.data.cards import UNITS, NoiseCard, TriadNoise
from plumbob.noise.findings import AXES, Analysis, Coefficient, Triad, coefficient, length_and_rate, triads
from plumbob.noise.terms import DATASHEET


def noise_card(analyses: Sequence[Analysis], *, device: str, source: str) -> NoiseCard:
    """Noise card of one unit, from channels named as in "gyr x"; what is not a triad of three axes is left out.

    Coefficients that are not observable are those that are most likely, with their limits among the remarks.
    """
    by_name = {triad.name: triad for triad in triads(analyses)}
    complete = {name: by_name[name] for name in UNITS if name in by_name and set(by_name[name].channels) == set(AXES)}
    if not complete:
        raise ShapeError(f"a noise card needs x, y and z of gyr, acc or mag, but there are {_names(by_name)}.")
    for name, triad in complete.items():
        if triad.first.quantity.value != UNITS[name]:
            raise UnitError(
                f"{name} is in '{triad.first.quantity}', but a card holds {UNITS[name]}; scale the recording."
            )
    said = [source, *(str(remark) for triad in complete.values() for remark in _remarks(triad))]
    others = {name: triad for name, triad in by_name.items() if name not in complete}
    said += [f"left out, no triad of three axes: {_names(others)}"] if others else []
    noises = {name: _noise(triad) for name, triad in complete.items()}
    return NoiseCard(device, "; ".join(said), **noises)


def _noise(triad: Triad) -> TriadNoise:
    for axis in AXES:
        if "N" not in triad.channels[axis].terms:
            raise ShapeError(
                f"the white noise of {triad.name} {axis} is not known ({triad.channels[axis].mask.reason}), and "
                "without it there is no card; record without smoothing, or for longer."
            )
    values = []
    for letter in "NBK":  # as estimated, or as most likely where it is not observable
        given = [(a, a.terms.get(letter)) for a in (triad.channels[axis] for axis in AXES)]
        shown = [c.value if c and (c.observable or letter == "N") else a.most_likely.get(letter, 0.0) for a, c in given]
        values.append(np.array(shown))
    return TriadNoise(*values, *(_interval(triad, letter) for letter in "NBK"))


def _interval(triad: Triad, letter: str) -> Floats | None:
    """Ends (2, 3) of the intervals of x, y and z; None where one is not known."""
    per_axis = [triad.channels[axis].terms.get(letter) for axis in AXES]
    ends = np.array([(np.nan, np.nan) if c is None else (c.lo, c.hi) for c in per_axis]).T
    return ends if np.isfinite(ends).all() else None


def _remarks(triad: Triad) -> list[Note]:
    """Length of the record, and the limits of what is not observable."""
    units = DATASHEET[triad.first.quantity]
    remarks: list[Note] = [info("noise.record", name=triad.name, length=length_and_rate(triad))]
    for letter in ("B", "K"):
        hidden = {axis: c for axis in AXES if (c := triad.channels[axis].terms.get(letter)) and not c.observable}
        limits = ", ".join(f"{axis} {coefficient(c, units[letter])}" for axis, c in hidden.items())
        if hidden:
            limit = f"{limits} {written(units[letter])} (95 %)"
            remarks.append(warning("noise.not_observable", name=triad.name, letter=letter, limit=limit))
    return remarks


def _names(by_name: Mapping[str, Triad]) -> str:
    return ", ".join(f"{name} {''.join(triad.channels)}".strip() for name, triad in by_name.items())


_SENSORS = (("acc", "accelerometer", Quantity.ACCELERATION), ("gyr", "gyroscope", Quantity.RATE))
_FIELDS = (("N", "noise_density"), ("K", "random_walk"))
_TOPIC = re.compile(r"[/~]?[A-Za-z][A-Za-z0-9_]*(/[A-Za-z0-9_]+)*")


def kalibr_yaml(analyses: Sequence[Analysis], *, rostopic: str, source: str = "") -> str:
    """Text of the file.

    Each number is the quadratic mean over the axes. Where a coefficient is not observable, its limit of 95 % stands for
    it, with a comment, as Kalibr takes no zero and a random walk that is too small binds its biases too tightly.

    Parameters
    ----------
    analyses : sequence of Analysis
        Channels of "gyr" and "acc"; others are not looked at.
    rostopic : str
        Topic of the sensor's messages, such as "/imu0".
    source : str
        Recording and device, for a comment.

    Raises
    ------
    ShapeError
        If the gyroscope or the accelerometer is missing.
    UnitError
        If one measures something else than its name says, as plain numbers do.
    ParameterError
        If the topic is not a name of ROS, the two have different rates, or a coefficient has neither value nor limit.
    """
    if not _TOPIC.fullmatch(rostopic):
        raise ParameterError(f"rostopic must be a ROS name such as /imu0, but it is {rostopic!r}.")
    index = {triad.name: triad for triad in triads(analyses)}
    lines = ["# Noise of an IMU for Kalibr: continuous time, SI; by plumbob"]
    lines += [f"# {_ascii(source)}"] if source else []
    lines.append("# each number is the quadratic mean over the axes below it; +/- is 68.3 %")
    for name, sensor, quantity in _SENSORS:
        if name not in index:
            raise ShapeError(f"Kalibr needs gyr and acc, but the record has only {', '.join(index)}.")
        if index[name].first.quantity is not quantity:
            raise UnitError(
                f"{name} is in '{index[name].first.quantity}', but Kalibr takes {quantity}; scale the recording."
            )
        lines += ["", f"# {sensor}: {_ascii(length_and_rate(index[name]))}"]
        for letter, field in _FIELDS:
            lines += _field(f"{sensor}_{field}", index[name], letter)
    lines += ["", f"rostopic: {rostopic}", f"update_rate: {_rate(index):.6f}"]
    return "\n".join(lines) + "\n"


def _field(field: str, triad: Triad, letter: str) -> list[str]:
    """A number and, as comments, what it was made of."""
    unit = DATASHEET[triad.first.quantity][letter]
    squares, comments = [], []
    for axis, analysis in triad.channels.items():
        c = analysis.terms.get(letter, Coefficient(0.0, observable=False))
        size = c.value if c.observable else c.upper
        if not (math.isfinite(size) and size > 0.0):
            raise ParameterError(
                f"{letter} of {triad.name} {axis} has neither a value nor a limit, but Kalibr needs a number greater "
                "than 0; record for longer."
            )
        squares.append(size**2)
        limit = "" if c.observable else ", not observable: the limit of 95 % is taken"
        comments.append(f"#   {letter} {axis}: {_ascii(coefficient(c, unit))} {unit}{limit}")
    return [f"{field}: {math.sqrt(sum(squares) / len(squares)):.6e}", *comments]


def _rate(by_name: dict[str, Triad]) -> float:
    rates = [1.0 / by_name[name].first.curve.dt for name, *_ in _SENSORS]
    if not math.isclose(*rates, rel_tol=1e-6):
        both = " and ".join(f"{rate:.6g} Hz" for rate in rates)
        raise ParameterError(f"acc and gyr have the rates {both}, but Kalibr takes one; resample one of them.")
    return rates[0]


def _ascii(text: str) -> str:
    """One line without letters that a reader of another locale could choke on."""
    return visible(" ".join(text.replace("±", "+/-").encode("ascii", "replace").decode().split()))
