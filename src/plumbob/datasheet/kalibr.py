"""Kalibr's ``imu.yaml``.

Kalibr wants five numbers that are greater than zero, noise densities of continuous time in SI, one for all axes, and
divides by √Δt itself (its wiki page "IMU Noise Model", and ``kalibr_common/ConfigReader.py``): the densities are N, the
random walks are K.
"""

import math
import re
from collections.abc import Sequence

from plumbob.datasheet import numbers
from plumbob.datasheet.table import facts
from plumbob.datasheet.triads import Triad, triads
from plumbob.errors import ParameterError, ShapeError, UnitError
from plumbob.noise.findings import Analysis, Coefficient
from plumbob.noise.terms import DATASHEET
from plumbob.plain import visible
from plumbob.units import Quantity

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
        If one measures something else than its name says, as bare numbers do.
    ParameterError
        If the topic is no name of ROS, the two have different rates, or a coefficient has neither value nor limit.
    """
    if not _TOPIC.fullmatch(rostopic):
        raise ParameterError(f"rostopic must be a name of ROS such as /imu0, but it is {rostopic!r}.")
    found = {triad.name: triad for triad in triads(analyses)}
    lines = ["# Noise of an IMU for Kalibr: continuous time, SI; by plumbob"]
    lines += [f"# {_ascii(source)}"] if source else []
    lines.append("# each number is the quadratic mean over the axes below it; +/- is 68.3 %")
    for name, sensor, quantity in _SENSORS:
        if name not in found:
            raise ShapeError(f"Kalibr needs gyr and acc, but of these there is only {', '.join(found)}.")
        if found[name].quantity is not quantity:
            raise UnitError(f"{name} is in '{found[name].quantity}', but Kalibr takes {quantity}; scale the recording.")
        lines += ["", f"# {sensor}: {_ascii(facts(found[name]))}"]
        for letter, field in _FIELDS:
            lines += _field(f"{sensor}_{field}", found[name], letter)
    lines += ["", f"rostopic: {rostopic}", f"update_rate: {_rate(found):.6f}"]
    return "\n".join(lines) + "\n"


def _field(field: str, triad: Triad, letter: str) -> list[str]:
    """A number and, as comments, what it was made of."""
    unit = DATASHEET[triad.quantity][letter]
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
        comments.append(f"#   {letter} {axis}: {_ascii(numbers.coefficient(c, unit))} {unit}{limit}")
    return [f"{field}: {math.sqrt(sum(squares) / len(squares)):.6e}", *comments]


def _rate(found: dict[str, Triad]) -> float:
    rates = [1.0 / found[name].first.curve.dt for name, *_ in _SENSORS]
    if not math.isclose(*rates, rel_tol=1e-6):
        both = " and ".join(f"{rate:.6g} Hz" for rate in rates)
        raise ParameterError(f"acc and gyr have the rates {both}, but Kalibr takes one; resample one of them.")
    return rates[0]


def _ascii(text: str) -> str:
    """One line without letters that a reader of another locale could choke on."""
    return visible(" ".join(text.replace("±", "+/-").encode("ascii", "replace").decode().split()))
