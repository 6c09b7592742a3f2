"""The noise card of a unit, from the analyses of its triads."""

from collections.abc import Mapping, Sequence

import numpy as np

from plumbob.cards import UNITS, NoiseCard, TriadNoise
from plumbob.check import Floats
from plumbob.data import TITLES
from plumbob.datasheet import numbers
from plumbob.datasheet.table import facts
from plumbob.datasheet.triads import AXES, Triad, triads
from plumbob.digits import number
from plumbob.errors import ShapeError, UnitError
from plumbob.noise.findings import Analysis
from plumbob.noise.terms import DATASHEET, TERMS
from plumbob.plain import aligned, listed
from plumbob.units import Quantity, from_si, written


def noise_card(analyses: Sequence[Analysis], *, device: str, source: str) -> NoiseCard:
    """Card of a unit, for the simulator and the Kalman filters.

    N is taken as it was estimated. Where the record does not show B or K, the card has the value that together with all
    other terms is the most likely one, often 0: so the card makes the curve that was measured, even where B and K
    cannot be told apart. Their upper limits would be no estimates, and a short record would make a good sensor look
    bad; the limits are told in the card's `source`. Each value comes with its interval of 68.3 %.

    Parameters
    ----------
    analyses : sequence of Analysis
        Channels "gyr x", "gyr y", "gyr z", and likewise "acc" and "mag". What is no whole triad is left out, and the
        card's `source` says so.
    device : str
        The unit that was recorded.
    source : str
        Recording and method.

    Raises
    ------
    ShapeError
        If there is no triad of three axes, or the white noise of one is not known.
    UnitError
        If a triad measures something else than its name says, as bare numbers do.
    """
    found = {triad.name: triad for triad in triads(analyses)}
    whole = {name: found[name] for name in UNITS if name in found and set(found[name].channels) == set(AXES)}
    if not whole:
        raise ShapeError(f"a noise card needs x, y and z of gyr, acc or mag, but there are {_names(found)}.")
    for name, triad in whole.items():
        if triad.quantity.value != UNITS[name]:
            raise UnitError(f"{name} is in '{triad.quantity}', but a card holds {UNITS[name]}; scale the recording.")
    said = [source, *(remark for triad in whole.values() for remark in _remarks(triad))]
    others = {name: triad for name, triad in found.items() if name not in whole}
    said += [f"left out, no triad of three axes: {_names(others)}"] if others else []
    noises = {name: _noise(triad) for name, triad in whole.items()}
    return NoiseCard(device, "; ".join(said), **noises)


def card_text(card: NoiseCard) -> str:
    """Tell what a noise card holds, in the units of data sheets."""
    lines = [f"{card.device}: noise card", *listed([card.source])]
    for name in UNITS:
        triad: TriadNoise | None = getattr(card, name)
        if triad is not None:
            lines += ["", TITLES[name], *aligned(["", *AXES], *_rows(name, triad))]
    return "\n".join(lines)


def _rows(name: str, triad: TriadNoise) -> list[list[str]]:
    units = DATASHEET[Quantity(UNITS[name])]
    found = {
        "N": (triad.n_rpsd, triad.n_interval),
        "B": (triad.b, triad.b_interval),
        "K": (triad.k_rpsd, triad.k_interval),
    }
    rows = []
    for k, (values, ends) in found.items():
        rows.append([f"{k} {TERMS[k].name} [{written(units[k])}]", *_numbers(values, units[k])])
        if ends is not None:
            cells = (f"{lo} to {hi}" for lo, hi in zip(*(_numbers(end, units[k]) for end in ends), strict=True))
            rows.append(["  68.3 %", *cells])
    return rows


def _numbers(values: Floats, unit: str) -> list[str]:
    return [number(v) for v in from_si(values, unit).tolist()]


def _noise(triad: Triad) -> TriadNoise:
    for axis in AXES:
        if "N" not in triad.channels[axis].terms:
            raise ShapeError(
                f"the white noise of {triad.name} {axis} is not known ({triad.channels[axis].mask.reason}), and "
                "without it there is no card; record without smoothing, or for longer."
            )
    return TriadNoise(*(_axes(triad, letter) for letter in "NBK"), *(_interval(triad, letter) for letter in "NBK"))


def _axes(triad: Triad, letter: str) -> Floats:
    """Coefficient of x, y and z: as estimated, or as most likely where it is not observable."""
    return np.array([_value(triad.channels[axis], letter) for axis in AXES])


def _interval(triad: Triad, letter: str) -> Floats | None:
    """Ends (2, 3) of the intervals of x, y and z; None where one is not known."""
    found = [triad.channels[axis].terms.get(letter) for axis in AXES]
    ends = np.array([(np.nan, np.nan) if c is None else (c.lo, c.hi) for c in found]).T
    return ends if np.isfinite(ends).all() else None


def _value(analysis: Analysis, letter: str) -> float:
    c = analysis.terms.get(letter)
    if c is not None and (c.observable or letter == "N"):
        return c.value
    return analysis.most_likely.get(letter, 0.0)


def _remarks(triad: Triad) -> list[str]:
    """Length of the record, and the limits of what is not observable."""
    units = DATASHEET[triad.quantity]
    found = [f"{triad.name} from {facts(triad)}"]
    for letter in ("B", "K"):
        hidden = {axis: c for axis in AXES if (c := triad.channels[axis].terms.get(letter)) and not c.observable}
        limits = ", ".join(f"{axis} {numbers.coefficient(c, units[letter])}" for axis, c in hidden.items())
        if hidden:
            limit = f"{limits} {written(units[letter])} (95 %)"
            found.append(f"{triad.name} {letter} not observable, the most likely is taken: {limit}")
    return found


def _names(found: Mapping[str, Triad]) -> str:
    return ", ".join(f"{name} {''.join(triad.channels)}".strip() for name, triad in found.items())
