"""Analyses as the table of a data sheet, as text and as JSON."""

import math
import textwrap
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np

from plumbob.core.text import WIDTH, aligned, listed, measured, number
from plumbob.core.units import Quantity, from_si, unit, written
from plumbob.noise.curve import Curve
from plumbob.noise.datasheet import numbers
from plumbob.noise.datasheet.numbers import Lowest, Triad, lowest, noise_name, rows, triads
from plumbob.noise.findings import Analysis, Band, Coefficient, Deviation, Estimates, GaussMarkov, Sinusoid
from plumbob.noise.terms import DATASHEET, DEVIATION, TERMS

Numbers = dict[str, float | None]


def as_dict(analyses: Sequence[Analysis]) -> dict[str, Any]:
    """Everything that was found, strictly valid for JSON.

    Returns
    -------
    dict
        By name of the channel. A number with a unit is a dictionary of unit and value: the unit inside first, then that
        of a data sheet, as in ``{"rad/s/rtHz": 8.7e-5, "deg/rth": 0.3}``. What is not known is None.

    Raises
    ------
    ShapeError
        If there is no analysis, or two share a name.
    """
    return {a.name: _channel(a) for triad in triads(analyses) for a in triad.channels.values()}


def curves_as_dict(deviations: Sequence[Deviation]) -> dict[str, Any]:
    """Deviations alone, as `as_dict` has them."""
    return {
        d.name: {"quantity": d.quantity.name.lower(), **curve_as_dict(d.curve, DEVIATION[d.quantity])}
        for d in deviations
    }


def _channel(a: Analysis) -> dict[str, Any]:
    sample = DEVIATION[a.quantity]
    return {
        "quantity": a.quantity.name.lower(),
        "duration_s": a.duration,
        "samples": a.curve.count,
        "dt_s": a.curve.dt,
        "mean": _units(a.mean, sample),
        "sd": _units(a.sd, sample),
        "step": _units(a.step, sample),
        "coefficients": _estimates(a.likelihood, a.quantity),
        "methods": {e.method: _estimates(e, a.quantity) for e in (a.lines, a.least_squares, a.likelihood)},
        "minimum": _minimum(a),
        "sinusoids": [_sinusoid(s, sample) for s in a.sinusoids],
        "bands": [_band(b, sample) for b in a.bands],
        "gauss_markov": None if a.markov is None else _markov(a.markov, sample),
        "mask": {"n": a.mask.n, "frequency_hz": a.mask.frequency, "reason": a.mask.reason},
        "candidates": [{"terms": c.terms, "bic": _finite(c.bic), "chosen": c.chosen} for c in a.candidates],
        "notes": list(a.notes),
        "curve": curve_as_dict(a.curve, sample),
    }


def _estimates(estimates: Estimates, quantity: Quantity) -> dict[str, Any]:
    return {
        letter: {"name": TERMS[letter].name, **_coefficient(c, DATASHEET[quantity][letter])}
        for letter, c in estimates.terms.items()
    }


def _coefficient(c: Coefficient, name: str) -> dict[str, Any]:
    numbers = {key: _units(getattr(c, key), name) for key in ("value", "lo", "hi", "upper")}
    return {**numbers, "observable": c.observable, "hours": c.hours}


def _minimum(a: Analysis) -> dict[str, Any] | None:
    least = lowest(a)
    if least is None:
        return None
    numbers = {key: _units(getattr(least, key), DEVIATION[a.quantity]) for key in ("dev", "lo", "hi")}
    return {"tau_s": least.tau, **numbers, "risen": least.risen}


def _sinusoid(s: Sinusoid, sample: str) -> dict[str, Any]:
    return {
        "amplitude": _units(s.amplitude, sample),
        "amplitude_sd": _units(s.amplitude_sd, sample),
        "frequency_hz": _finite(s.frequency),
        "frequency_sd_hz": _finite(s.frequency_sd),
    }


def _band(b: Band, sample: str) -> dict[str, Any]:
    limits = {"low_hz": _finite(b.low), "high_hz": _finite(b.high), "middle_hz": _finite(b.middle)}
    return {"sd": _units(b.sd, sample), **limits}


def _markov(m: GaussMarkov, sample: str) -> dict[str, Any]:
    return {"sd": _coefficient(m.sd, sample), "time": _coefficient(m.time, "s")}


def curve_as_dict(curve: Curve, sample: str) -> dict[str, Any]:
    """A curve, its deviations in the unit inside and in `sample`."""
    inside = unit(sample).quantity.value
    deviations = {
        key: {
            name: [_finite(v) for v in np.asarray(from_si(getattr(curve, key), name)).tolist()]
            for name in (inside, sample)
        }
        for key in ("dev", "lo", "hi")
    }
    return {
        "kind": curve.kind,
        "confidence": curve.confidence,
        "n": curve.n.tolist(),
        "tau_s": curve.tau.tolist(),
        **deviations,
        "alpha": curve.alpha.tolist(),
        "edf": [_finite(v) for v in curve.edf.tolist()],
        "ieee952_relative_error": [_finite(v) for v in curve.ieee.tolist()],
    }


def _units(value: float, name: str) -> Numbers:
    """Number in the unit inside and in that of a data sheet."""
    return {key: _finite(float(from_si(value, key))) for key in (unit(name).quantity.value, name)}


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


_ROWS = 40  # of a curve's table
_COARSE = 0.05  # of N² from the rounding of the values: more is told
LEGEND = (
    "±: 68.3 %; <: not observable, limit with 95 % confidence; floor: where the interval of the deviation ends lowest, "
    "which need not be its least value"
)


def text(analyses: Sequence[Analysis], *, methods: bool = False, curve: bool = False) -> str:
    """Plain tables, a triad's axes side by side; 80 columns wide, unless an interval needs more digits.

    Parameters
    ----------
    analyses : sequence of Analysis
        Channels; names such as "gyr x" say which belong together.
    methods : bool
        Whether the three methods and the models that were weighed are shown too.
    curve : bool
        Whether the deviation itself is shown too, by averaging time.

    Raises
    ------
    ShapeError
        If there is no analysis, or two share a name.
    """
    return "\n\n".join("\n".join(_triad(triad, methods, curve)) for triad in triads(analyses))


def curves_text(deviations: Sequence[Deviation]) -> str:
    """Deviations alone, one table after the other."""
    return "\n".join(line for d in deviations for line in _curve(d.name, d)).lstrip("\n")


def facts(triad: Triad) -> str:
    """Length and rate of the record."""
    first = triad.first
    return f"{numbers.length(first.duration)} at {1.0 / first.curve.dt:.6g} Hz, {first.curve.count} samples"


def remarks(triad: Triad) -> list[str]:
    """What a reader must know beside the coefficients, each remark once with the axes that it holds for."""
    found: dict[str, list[str]] = {}
    for axis, a in triad.channels.items():
        for remark in (*_extras(a), *a.notes):
            found.setdefault(remark, []).append(axis)
    everywhere = len(triad.channels)
    rest = [r if len(axes) == everywhere else f"{', '.join(axes)}: {r}" for r, axes in found.items()]
    return [*_verdicts(triad), *rest]


def floor(a: Analysis) -> str:
    """Deviation whose interval ends lowest, as a cell."""
    found = lowest(a)
    return "-" if found is None else measured(*_in_unit(found, DEVIATION[a.quantity]))


def floor_at(a: Analysis) -> str:
    """Averaging time of that deviation as a cell."""
    found = lowest(a)
    if found is None:
        return "-"
    return f"{number(found.tau)} s" + ("" if found.risen else " or later")


def curve_cells(a: Analysis | Deviation, i: int) -> tuple[str, ...]:
    """Row i of the curve: τ, deviation, ends of its interval, degrees of freedom, IEEE's error in %, kind of noise."""
    c, unit = a.curve, DEVIATION[a.quantity]
    deviations = (number(from_si(float(v[i]), unit), 4) for v in (c.dev, c.lo, c.hi))
    edf, ieee = number(float(c.edf[i])), number(100.0 * float(c.ieee[i]))
    return (number(float(c.tau[i])), *deviations, edf, ieee, noise_name(float(c.alpha[i])))


def method_rows(a: Analysis) -> list[list[str]]:
    """Rows of a table of methods: letter with unit, and one cell for each of `estimates`."""
    units, found = DATASHEET[a.quantity], []
    for letter in TERMS:
        given = [e.terms.get(letter) for e in estimates(a)]
        if any(given):
            cells = ["-" if c is None else numbers.coefficient(c, units[letter]) for c in given]
            found.append([f"{letter} [{written(units[letter])}]", *cells])
    return found


def models(a: Analysis) -> list[tuple[str, str, bool]]:
    """Models that were weighed: terms, how far their criterion lies above the least, whether chosen."""
    least_bic = min((c.bic for c in a.candidates), default=0.0)
    return [(c.terms, f"{c.bic - least_bic:.1f}", c.chosen) for c in a.candidates]


def estimates(a: Analysis) -> tuple[Estimates, ...]:
    """The three methods, in the order of their sophistication."""
    return (a.lines, a.least_squares, a.likelihood)


def triad_rows(triad: Triad) -> list[list[str]]:
    """Rows of the table of a triad: name with unit, and one cell for each axis."""
    units, sample = DATASHEET[triad.quantity], DEVIATION[triad.quantity]
    pick: list[tuple[str, Callable[[Analysis], str]]] = [
        (f"{letter} {term.name} [{written(units[letter])}]", partial(_cell, letter=letter, unit=units[letter]))
        for letter, term in TERMS.items()
    ]
    pick += [
        (f"floor of the curve [{written(sample)}]", floor),
        ("at an averaging time of", floor_at),
        (f"mean [{written(sample)}]", lambda a: number(from_si(a.mean, sample), 4)),
        (f"standard deviation [{written(sample)}]", lambda a: number(from_si(a.sd, sample), 4)),
    ]
    return [[label, *(cell(a) for a in triad.channels.values())] for label, cell in pick]


def _triad(triad: Triad, methods: bool, curve: bool) -> list[str]:
    lines = [f"{triad.title}: {facts(triad)}", "", *aligned(["", *triad.channels], *triad_rows(triad))]
    lines += listed([LEGEND, *remarks(triad)])
    for axis, a in triad.channels.items():
        lines += _methods(axis, a) if methods else []
        lines += _curve(axis, a) if curve else []
    return lines


def _cell(a: Analysis, letter: str, unit: str) -> str:
    c = a.terms.get(letter)
    return "-" if c is None else numbers.coefficient(c, unit)


def _verdicts(triad: Triad) -> Iterator[str]:
    """Coefficients that this record does not show, and how long ones would."""
    for letter in TERMS:
        found = {axis: a.terms[letter] for axis, a in triad.channels.items() if letter in a.terms}
        lacking = {axis: c for axis, c in found.items() if not c.observable}
        if lacking:
            where = "" if len(lacking) == len(triad.channels) else f" on {', '.join(lacking)}"
            longer = {axis: numbers.longer(c) for axis, c in lacking.items()}
            alike = set(longer.values())
            lengths = alike.pop() if len(alike) == 1 else ", ".join(f"{time} ({axis})" for axis, time in longer.items())
            yield f"{letter} is not observable{where}: to show half of the limit takes a record of {lengths}"


def _extras(a: Analysis) -> list[str]:
    """Sinusoids, bands, Gauss–Markov process, mask and step."""
    unit = DEVIATION[a.quantity]
    found = []
    for s in a.sinusoids:
        size, sd = from_si(s.amplitude, unit), from_si(s.amplitude_sd, unit)
        at = measured(s.frequency, s.frequency - s.frequency_sd, s.frequency + s.frequency_sd)
        amplitude = numbers.with_unit(measured(size, size - sd, size + sd), unit)
        found.append(f"sinusoid of {amplitude} at {at} Hz, or folded from another frequency: k × rate ± it")
    for b in a.bands:
        power = numbers.with_unit(number(from_si(b.sd, unit)), unit)
        limits = f"{number(b.low)} to {number(b.high)} Hz"
        found.append(f"left out: a band of {power} rms about {number(b.middle)} Hz ({limits}): motion or interference")
    if a.markov is not None:
        sd_words, time = numbers.verdict(a.markov.sd, unit), numbers.verdict(a.markov.time, "s")
        found.append(f"Gauss-Markov process: standard deviation {sd_words}, correlation time {time}")
    if a.mask.n > 1:
        above = "" if a.mask.frequency is None else f", above {number(a.mask.frequency)} Hz"
        found.append(f"masked: averaging times below {number(a.mask.n * a.curve.dt)} s{above}: {a.mask.reason}")
    if a.step:
        step = numbers.with_unit(number(from_si(a.step, unit), 4), unit)
        found.append(f"values are multiples of {step}{_rounding(a)}")
    return found


def _rounding(a: Analysis) -> str:
    """How much of the white noise is the rounding of the values to their step, which scatters by step/√12."""
    white = a.terms.get("N")
    density = a.step**2 / 12.0 * a.curve.dt
    if white is None or not white.observable or density <= _COARSE * white.value**2:
        return ""
    return f", whose rounding (step²/12 · Δt) is {number(100.0 * density / white.value**2, 2)} % of N²"


def _methods(axis: str, a: Analysis) -> list[str]:
    head = [f"{axis or a.name} by method", *(e.method for e in estimates(a))]
    lines = ["", *aligned(head, *method_rows(a))]
    weighed = [(terms, bic, "chosen" if chosen else "") for terms, bic, chosen in models(a)]
    return lines + (aligned(["models", "ΔBIC"], *weighed) if weighed else [])


def _curve(axis: str, a: Analysis | Deviation) -> list[str]:
    unit = numbers.in_unit(DEVIATION[a.quantity])
    shown = rows(a.curve, _ROWS)
    some = "" if shown.size == a.curve.n.size else f", {shown.size} of {a.curve.n.size} rows"
    what = f"{axis or a.name}: {a.curve.kind}{unit}, interval of {100.0 * a.curve.confidence:.1f} %"
    lines = ["", *textwrap.wrap(f"{what}, IEEE Std 952 (disjoint averages) in %{some}", WIDTH)]
    lines.append(_curve_row(("tau [s]", "deviation", "from", "to", "edf", "IEEE", "noise")))
    return lines + [_curve_row(curve_cells(a, int(i))) for i in shown]


def _curve_row(cells: tuple[str, ...]) -> str:
    columns = zip(cells, (9, 12, 11, 11, 9, 8), strict=False)
    return "".join(f"{cell:>{width}}" for cell, width in columns) + f"  {cells[-1]}"


def _in_unit(found: Lowest, unit: str) -> tuple[float, float, float]:
    return from_si(found.dev, unit), from_si(found.lo, unit), from_si(found.hi, unit)
