"""The noise of a unit for others: the noise card, and the lines that other programs take.

What each program means by its numbers stands, with its source, in ``forms.toml``.
"""

import math
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError, ShapeError, UnitError
from plumbob.core.findings import Note, info, warning
from plumbob.core.text import visible
from plumbob.core.units import Quantity, written
from plumbob.data.cards import UNITS, NoiseCard, TriadNoise
from plumbob.noise.findings import AXES, Analysis, Coefficient, Triad, coefficient, length_and_rate, lowest, triads
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


_QUANTITIES: Final = {"gyr": Quantity.RATE, "acc": Quantity.ACCELERATION}
# Of a Gauss–Markov process: averaging time at which its Allan deviation is greatest, in correlation times.
_PEAK: Final = 1.8926  # [IEEE952] Annex C


def forms() -> dict[str, Any]:
    """What other programs take, by name: values and the text that has them."""
    return tomllib.loads(Path(__file__).with_name("forms.toml").read_text(encoding="utf-8"))


def lines(analyses: Sequence[Analysis], form: str, *, source: str = "") -> str:
    """Noise of a unit as another program takes it, with the definition of each number as a comment.

    Where a coefficient is not observable, its limit of 95 % stands for it, as no program takes a zero and a random walk
    that is too small binds a bias too tightly.

    Parameters
    ----------
    analyses : sequence of Analysis
        Channels of "gyr" and "acc"; others are not looked at.
    form : {"kalibr", "vins", "orbslam", "liosam", "kfgins", "ros"}
        The program.
    source : str
        Recording and device, for a comment.

    Raises
    ------
    ShapeError
        If the gyroscope or the accelerometer is missing.
    UnitError
        If one measures something else than its name says, as plain numbers do.
    ParameterError
        If the two have different rates, or a coefficient has neither value nor limit.
    """
    chosen = forms()[check.one_of("form", form, tuple(forms()))]
    index = {triad.name: triad for triad in triads(analyses)}
    for name, quantity in _QUANTITIES.items():
        if name not in index:
            raise ShapeError(f"{form} needs gyr and acc, but the record has only {', '.join(index)}.")
        if index[name].first.quantity is not quantity:
            raise UnitError(
                f"{name} is in '{index[name].first.quantity}', but {form} takes {quantity}; scale the recording."
            )
    values, rate = {}, _rate(index)
    about = [f"# {_ascii(source)}"] if source else []
    about += [f"# {name}: {_ascii(length_and_rate(index[name]))}; +/- is 68.3 %" for name in _QUANTITIES]
    for key, value in chosen["values"].items():
        sizes, comments = _sizes(index[value["of"]], value["letter"], form)
        about += [line for line in comments if line not in about]
        mean = sizes if value.get("axes") else np.sqrt(np.mean(sizes**2, keepdims=True))
        scaled = (value.get("factor", 1.0) * mean * rate ** value.get("rate", 0.0)) ** value.get("power", 1)
        values[key] = ", ".join(f"{number:.6e}" for number in scaled.tolist())
        for axis, number in zip(AXES, scaled.tolist(), strict=False):
            values[f"{key}_{axis}"] = f"{number:.6e}"
    floors = [least.tau for name in _QUANTITIES for a in index[name].channels.values() if (least := lowest(a))]
    values["hours"] = f"{float(np.exp(np.mean(np.log(floors or [math.nan])))) / _PEAK / 3600.0:.5g}"
    return str(chosen["text"]).format(about="\n".join(about), rate=rate, **values).strip() + "\n"


def _sizes(triad: Triad, letter: str, form: str) -> tuple[Floats, list[str]]:
    """A coefficient of each axis, SI, and comments that say what it was made of."""
    unit, sizes, comments = DATASHEET[triad.first.quantity][letter], [], []
    for axis, analysis in triad.channels.items():
        c = analysis.terms.get(letter, Coefficient(0.0, observable=False))
        sizes.append(c.value if c.observable else c.upper)
        if not (math.isfinite(sizes[-1]) and sizes[-1] > 0.0):
            raise ParameterError(
                f"{letter} of {triad.name} {axis} has neither a value nor a limit, but {form} needs a number greater "
                "than 0; record for longer."
            )
        limit = "" if c.observable else ", not observable: the limit of 95 % is taken"
        comments.append(f"#   {triad.name} {axis} {letter}: {_ascii(coefficient(c, unit))} {unit}{limit}")
    return np.array(sizes), comments


def _rate(by_name: dict[str, Triad]) -> float:
    rates = [1.0 / by_name[name].first.curve.dt for name in _QUANTITIES]
    if not math.isclose(*rates, rel_tol=1e-6):
        both = " and ".join(f"{rate:.6g} Hz" for rate in rates)
        raise ParameterError(f"gyr and acc have the rates {both}, but one is needed; resample one of them.")
    return rates[0]


def _ascii(text: str) -> str:
    """One line without letters that a reader of another locale could choke on."""
    return visible(" ".join(text.replace("±", "+/-").encode("ascii", "replace").decode().split()))
