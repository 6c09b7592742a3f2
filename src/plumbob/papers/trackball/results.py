"""Everything that the trackball paper's run computes, and its figures as outcomes with their bars."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.units import from_si, to_deg, to_dps
from plumbob.filters.channel_scalar import steady_gain
from plumbob.papers.description import TRACKBALL
from plumbob.papers.outcome import Outcome
from plumbob.papers.trackball import misprints
from plumbob.papers.trackball.recorded import Lapped, Rest, Soaked, Turned, apart
from plumbob.papers.trackball.records import AT_REST, IN_MOTION, RATIOS, SAMPLES, operations
from plumbob.papers.trackball.seeds import (
    LONG_TAUS,
    MEASURED,
    MEMORIES,
    REMOVED,
    SETTLED,
    TAUS,
    Long,
    OnTurntable,
    PowerFits,
    Short,
    degrees_of_freedom,
    powers,
    theory,
)


@dataclass(frozen=True)
class Found:
    """Results of all parts, in the order of the paper.

    Attributes
    ----------
    seeds : mapping of str to int
        How many runs each statistic is of.
    parts : mapping of float to Warmed
        By a part's true coefficient of temperature, °/s per °C.
    soaked, rest, turned, lapped
        The recorded tests.
    short, white, long
        At rest, over many seeds; `white` (k,) by Q/R.
    fit : PowerFits
        Of the recorded test at rest, before the filter.
    negative : tuple of float
        Share of the records with a negative coefficient, by the plain and by the weighted fit.
    table : mapping of float to mapping of str to OnTurntable
        By the error of the gain, and by filter.
    gain : tuple of float
        Best gain of a scalar filter on the ramp, and its rms, rad/s.
    """

    seeds: Mapping[str, int]
    parts: Mapping[float, misprints.Warmed]
    soaked: Soaked
    rest: Rest
    short: Short
    white: Floats
    long: Long
    fit: PowerFits
    negative: tuple[float, float]
    turned: Turned
    table: Mapping[float, Mapping[str, OnTurntable]]
    gain: tuple[float, float]
    lapped: Lapped
    printed: misprints.PrintedAllan
    matrix: tuple[float, float]

    def outcomes(self) -> list[Outcome]:
        """Every figure, in the order of the paper."""
        parts = (_drift, _setting, _series, _allan, _composition, _table_setting, _turntable, _ball)
        operation_count = TRACKBALL.row("filter.operations", faithful=float(operations()))
        return [*(row for part in parts for row in part(self)), operation_count]


def _drift(run: Found) -> Iterator[Outcome]:
    yield TRACKBALL.row("drift.k_t", faithful=0.1, best=to_dps(run.parts[0.03].coefficient))
    for name, part in (("a", 0.03), ("b", -0.05)):
        at = run.parts[part]
        yield TRACKBALL.row(f"drift.raw.{name}", faithful=to_dps(at.raw))
        yield TRACKBALL.row(f"drift.left.{name}", faithful=to_dps(at.printed), best=to_dps(abs(at.own)))
    yield TRACKBALL.row("drift.scale", faithful=1.0 / to_dps(run.rest.quantum))
    yield TRACKBALL.row("drift.k_a", faithful=to_dps(run.matrix[0]), best=to_dps(run.matrix[1]))
    yield TRACKBALL.row("drift.twice", faithful=to_dps(misprints.counted_twice()), best=0.0)
    yield TRACKBALL.row("drift.metres", faithful=to_dps(misprints.in_metres()), best=0.0)
    before, after = misprints.gain_error()
    yield TRACKBALL.row(
        "drift.gain",
        faithful=to_dps(after),
        best=abs(float(np.mean(to_dps(run.turned.rates["best"] - run.turned.true)[SAMPLES:]))),
        faithful_bar=(to_dps(before) - 0.01, to_dps(before) + 0.01),
    )


def _setting(run: Found) -> Iterator[Outcome]:
    yield TRACKBALL.row("rest.step", faithful=float(np.median(np.diff(run.rest.t))))
    yield TRACKBALL.row("rest.samples", faithful=float(run.rest.t.size))
    yield TRACKBALL.row("rest.temperature", faithful=run.rest.temp_c)
    yield TRACKBALL.row("filter.start", faithful=float(run.rest.after[0, 0] / run.rest.before[0, 0]))
    yield TRACKBALL.row("filter.gain", faithful=steady_gain(AT_REST), at_rest=AT_REST)


def _series(run: Found) -> Iterator[Outcome]:
    sd = [to_dps(float(part[:, 0].std())) for part in (run.rest.before, run.rest.after, run.rest.best)]
    yield TRACKBALL.row("rest.before", faithful=sd[0])
    yield TRACKBALL.row("rest.after", faithful=sd[1], best=sd[2], at_rest=AT_REST)
    for ratio, measured in zip(RATIOS, run.white.tolist(), strict=True):
        yield TRACKBALL.row(f"rest.variance.{_short(ratio)}", faithful=measured / theory(ratio))


def _allan(run: Found) -> Iterator[Outcome]:
    row = RATIOS.index(AT_REST)
    for tau, value in zip(TAUS, run.short.adev[row].tolist(), strict=True):
        yield TRACKBALL.row(f"allan.ratio.{tau:g}", faithful=value)
    for tau in (10.0, 50.0):
        k = TAUS.index(tau)
        yield TRACKBALL.row(f"allan.scatter.{tau:g}", faithful=float(run.short.scatter[k]))
    yield TRACKBALL.row("allan.freedom", faithful=degrees_of_freedom(SAMPLES, 50.0))
    for tau in (100.0, 600.0):
        yield TRACKBALL.row(f"allan.long.{tau:g}", faithful=float(run.long.adev[row, LONG_TAUS.index(tau)]))
    yield TRACKBALL.row("allan.angle", faithful=float(run.short.angle[row]), at_rest=AT_REST)
    yield TRACKBALL.row("allan.printed", faithful=to_dps(run.printed.printed), best=to_dps(run.printed.corrected))


def _composition(run: Found) -> Iterator[Outcome]:
    yield TRACKBALL.row("fit.condition", faithful=float(np.linalg.cond(powers())))
    yield TRACKBALL.row("fit.negative", faithful=100.0 * run.negative[0], best=100.0 * run.negative[1])
    yield TRACKBALL.row("noise.white", best=from_si(run.long.white, "deg/rth"))
    yield TRACKBALL.row("noise.flicker", best=from_si(run.long.flicker, "deg/h"))


def _short(ratio: float) -> str:
    """Q/R of 1e-3 as q3, for keys."""
    return f"q{-round(math.log10(ratio))}"


def _table_setting(run: Found) -> Iterator[Outcome]:
    true = run.turned.true
    slope = float(np.polyfit(run.turned.t[:SAMPLES], to_dps(true[:SAMPLES]), 1)[0])
    plane, along = misprints.axis_in_the_plane(1)
    yield TRACKBALL.row("turn.slope", faithful=slope)
    yield TRACKBALL.row("turn.rate", faithful=float(to_dps(true[-1])) / 6.0)
    yield TRACKBALL.row("turn.samples", faithful=float(true.size) / 2.0)
    yield TRACKBALL.row("turn.axis", faithful=plane, best=along)


def _turntable(run: Found) -> Iterator[Outcome]:
    rows, wrong = (run.table[scale] for scale in run.table)
    scalar, two = rows[f"scalar Q/R={IN_MOTION:g}"], rows["two states"]
    raw, removed = rows[MEASURED], rows[REMOVED]
    yield TRACKBALL.row("ramp.removed", faithful=to_dps(removed.ramp_rms))
    yield TRACKBALL.row(
        "ramp.rms",
        faithful=to_dps(scalar.ramp_rms),
        best=to_dps(two.ramp_rms),
        in_motion=IN_MOTION,
        ramp_rms=to_dps(raw.ramp_rms),
        removed_ramp_rms=to_dps(removed.ramp_rms),
    )
    yield TRACKBALL.row("ramp.mean", faithful=to_dps(scalar.ramp_mean), best=to_dps(two.ramp_mean))
    yield TRACKBALL.row("hold.rms", faithful=to_dps(scalar.hold_rms), best=to_dps(two.hold_rms))
    yield TRACKBALL.row("hold.late", faithful=to_dps(scalar.late_rms), best=to_dps(two.late_rms))
    yield TRACKBALL.row("hold.mean", faithful=to_dps(scalar.hold_mean), best=to_dps(two.hold_mean))
    yield from _lags(rows)
    yield TRACKBALL.row("ramp.angle", faithful=to_deg(scalar.angle), best=to_deg(two.angle))
    yield TRACKBALL.row("ramp.gain", faithful=to_dps(run.gain[1]))
    after = wrong[f"scalar Q/R={IN_MOTION:g}"]
    yield TRACKBALL.row("ramp.misled", faithful=to_dps(after.ramp_rms))
    yield from _recorded(run.turned)


def _lags(rows: Mapping[str, OnTurntable]) -> Iterator[Outcome]:
    for ratio in RATIOS:
        if MEMORIES / steady_gain(ratio) > SETTLED:
            continue  # it has not settled on this ramp
        row = rows[f"scalar Q/R={ratio:g}"]
        yield TRACKBALL.row(f"ramp.lag.{_short(ratio)}", faithful=to_dps(row.lag))
    yield TRACKBALL.row("ramp.lag", best=to_dps(rows["two states"].lag))


def _recorded(turned: Turned) -> Iterator[Outcome]:
    """One run each: flicker noise alone moves its rms by a tenth from seed to seed, so that the bars are wider."""
    errors = {name: to_dps(rate - turned.true) for name, rate in turned.rates.items()}
    for name, part in (("ramp", slice(0, SAMPLES)), ("hold", slice(SAMPLES, None))):
        paper, best = (float(np.sqrt(np.mean(errors[way][part] ** 2))) for way in ("paper", "best"))
        yield TRACKBALL.row(f"bytes.{name}", faithful=paper, best=best)
    ends = {name: abs(float(to_deg(error[SAMPLES - 1]))) for name, error in turned.headings.items()}
    yield TRACKBALL.row("bytes.heading", faithful=ends["calibrated, paper's filter"], best=ends["calibrated"])


def _ball(run: Found) -> Iterator[Outcome]:
    tracks = run.lapped.tracks
    paper, best = (
        to_deg(float(np.sqrt(np.mean(apart(tracks[name], tracks["true"]) ** 2)))) for name in ("paper", "calibrated")
    )
    yield TRACKBALL.row("ball.track", faithful=paper, best=best)
