"""Analyses as a dictionary for JSON: every number that has a unit stands under the name of that unit."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from plumbob.core.units import Quantity, from_si, unit
from plumbob.noise.curve import Curve
from plumbob.noise.datasheet.numbers import lowest, triads
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
