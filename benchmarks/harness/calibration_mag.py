"""Magnetometer calibrations of simulated units: errors of bias and heading, what was predicted, what was refused.

Units have a hard iron of 100 mG and a soft iron of 10 to 20 % of either sign, along random axes or along the sensor's;
the field has 500 mG and a dip of 60°. One reading per attitude scatters by 2 mG and has steps of 0.73 mG. Where the
magnetometer is told to be turned, its axes are 1° off a right angle each, and 2° off those of the accelerometer, whose
vertical scatters by 0.3° about each axis. On a trajectory, a reading is made 20 times a second; rates are off by up to
1 °/s and 1 %, and one scatters by 0.05 °/s.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from scipy.linalg import sqrtm

from benchmarks.harness.bar import Bar
from benchmarks.harness.calibration_world import (
    AVERAGED,
    NOISE,
    STEP,
    STRENGTH,
    Attitudes,
    faced_by_the_field,
    field_n,
    force_b,
    heading_error,
    in_body,
    leaning,
    posed,
    random_axes,
    reading,
    small_turn,
)
from benchmarks.harness.section import Section
from plumbob.calibration.fit import CaptureRefusedError, Fitted
from plumbob.calibration.mag.ellipsoid import fit_mag
from plumbob.calibration.mag.with_acc import fit_mag_acc
from plumbob.calibration.mag.with_gyr import fit_mag_gyr
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.units import deg, dps, from_si, to_deg, to_si
from plumbob.data.cards import TriadCalibration
from plumbob.simulation import Scenario, TriadErrors, scenario

DIP: Final = deg(60.0)
HARD_IRON: Final = to_si(100.0, "mgauss")
SKEW: Final = deg(1.0)
MOUNTING: Final = deg(2.0)
SILENT: Final = deg(3.0)
"""Heading error above which a calibration that is not called poor has failed silently, rad."""

COVERED: Final = (60.0, 78.0)
"""Limits for the share of errors within one predicted standard deviation, %; 68.3 is right."""

_OUTLIER: Final = to_si(100.0, "mgauss")
_TRAJECTORY: Final = scenario("sway", limit=deg(15.0), time=60.0)
_RATE: Final = 20.0  # of readings on a trajectory, Hz
_GYROSCOPE: Final = TriadErrors(white_sd=np.full(3, dps(0.05)))
_RATE_BIAS, _RATE_SCALE = dps(1.0), 0.01
_ACCELEROMETER: Final = TriadErrors(white_sd=np.full(3, G0 * deg(0.3)))
_ZERO: Final = 1e-12
_COLUMNS: Final = ("bias, mG", "heading, °", "95 %, °", "predicted, °", "within 1 sd, %", "refused, %", "silent, %")


class Capture(NamedTuple):
    """What a fit gets: time, s, field, µT, specific force, m/s², and rates, rad/s, in N attitudes."""

    t: Floats
    mag: Floats
    acc: Floats
    gyr: Floats


@dataclass(frozen=True, kw_only=True)
class Case:
    """A row of the table.

    Attributes
    ----------
    name : str
        What the capture is.
    attitudes : callable
        Draws them; in seconds from 0, with rates, where it is a scenario of motion.
    limit : float or None
        What the median heading error may be, rad.
    fit : callable
        From a capture to a fit.
    noise, step : float
        Of a reading, µT.
    random_axes : bool
        Whether the soft iron lies along random axes, or along the sensor's.
    outliers : float
        Share of readings that are wrong by 100 mG.
    turned : bool
        Whether the axes are neither at right angles nor those of the accelerometer.
    every : int
        Every how many seeds it is tried, where a fit takes long.
    """

    name: str
    attitudes: Attitudes | Scenario
    limit: float | None = None
    fit: Callable[[Capture], Fitted] = lambda capture: fit_mag(capture.mag, strength=STRENGTH)
    noise: float = NOISE
    step: float = STEP
    random_axes: bool = True
    outliers: float = 0.0
    turned: bool = False
    every: int = 1


def _with_gyr(capture: Capture) -> Fitted:
    return fit_mag_gyr(capture.t, capture.mag, capture.gyr, strength=STRENGTH)


def _with_acc(capture: Capture) -> Fitted:
    return fit_mag_acc(capture.mag, capture.acc, strength=STRENGTH)


CASES: Final = (
    Case(name="18 poses, 2 mG", attitudes=faced_by_the_field(DIP), limit=deg(0.31)),
    Case(name="18 poses, averaged 0.2 mG", attitudes=faced_by_the_field(DIP), noise=AVERAGED, step=0.0),
    Case(name="18 poses, soft iron along the axes", attitudes=faced_by_the_field(DIP), random_axes=False),
    Case(name="1000 poses", attitudes=posed("poses", number=1000), limit=deg(0.033)),
    Case(name="1000 poses, soft iron along the axes", attitudes=posed("poses", number=1000), random_axes=False),
    Case(name="1000 poses, 5 % outliers", attitudes=posed("poses", number=1000), outliers=0.05, limit=deg(0.045)),
    Case(name="1000, pitch and roll within 25°", attitudes=leaning(deg(25.0), 1000), limit=deg(0.34)),
    Case(name="60 s, pitch and roll within 15°", attitudes=_TRAJECTORY),
    Case(
        name="60 s, pitch and roll within 15°, with gyroscope",
        attitudes=_TRAJECTORY,
        fit=_with_gyr,
        limit=deg(0.25),
        every=4,
    ),
    Case(name="1000 poses, turned", attitudes=posed("poses", number=1000), turned=True),
    Case(
        name="1000 poses, turned, with accelerometer",
        attitudes=posed("poses", number=1000),
        fit=_with_acc,
        turned=True,
        limit=deg(0.07),
    ),
    Case(
        name="18 averaged, turned, with accelerometer",
        attitudes=faced_by_the_field(DIP),
        fit=_with_acc,
        noise=AVERAGED,
        step=0.0,
        turned=True,
    ),
)


class Trial(NamedTuple):
    """Figures of one unit: errors of bias, µT, and heading, rad; what was predicted; z-scores; infinite if refused."""

    bias: float
    heading: float
    predicted: float
    scores: Floats
    grade: str


_REFUSED: Final = Trial(math.inf, math.inf, math.inf, np.empty(0), "refused")


def measure_mag(seeds: Sequence[int], progress: Callable[[int], None] | None = None) -> Section:
    """Calibrate a unit per seed in each of `CASES`.

    Parameters
    ----------
    seeds : sequence of int
        One unit each.
    progress : callable, optional
        Called with 1 after each case.
    """
    rows, bars = {}, []
    for case in CASES:
        trials = [_trial(case, seed) for seed in seeds[:: case.every]]
        rows[case.name] = row = _row(trials)
        bars += _bars(case, row)
        if progress:
            progress(1)
    title = f"Magnetometer, {len(seeds)} units, medians; heading over pitch and roll within ±45°"
    return Section(title, _COLUMNS, rows, tuple(bars))


def unit(case: Case, rng: np.random.Generator) -> TriadErrors:
    """Magnetometer of one unit."""
    axes = random_axes(rng) if case.random_axes else np.eye(3)
    stretch = rng.uniform(0.1, 0.2, 3) * rng.choice((-1.0, 1.0), 3)
    case_from_body = _skewed(rng) @ small_turn(MOUNTING, rng) if case.turned else np.eye(3)
    return TriadErrors(
        soft_iron=case_from_body @ (np.eye(3) + axes @ np.diag(stretch) @ axes.T),
        hard_iron=HARD_IRON * random_axes(rng)[0],
        white_sd=np.full(3, case.noise),
        lsb=np.full(3, case.step),
    )


def _skewed(rng: np.random.Generator) -> Floats:
    """Axes (3, 3) that are off a right angle each."""
    return np.eye(3) + np.triu(SKEW * rng.choice((-1.0, 1.0), (3, 3)), 1)


def _trial(case: Case, seed: int) -> Trial:
    rng = np.random.default_rng(seed)
    errors = unit(case, rng)
    try:
        fit = case.fit(_captured(case, errors, rng)).calibration
    except CaptureRefusedError:
        return _REFUSED
    quality = fit.quality
    return Trial(
        bias=float(np.linalg.norm(fit.bias - errors.iron)),
        heading=heading_error(fit.matrix, fit.bias, errors, DIP),
        predicted=math.inf if quality is None or quality.heading_sd is None else quality.heading_sd,
        scores=scores(fit, errors),
        grade="" if quality is None else quality.grade,
    )


def _captured(case: Case, errors: TriadErrors, rng: np.random.Generator) -> Capture:
    """Readings of a unit."""
    t, q_nb, rate_b = _moved(case.attitudes, rng)
    mag = reading(errors, in_body(q_nb, field_n(DIP)), triad="mag", rng=rng)
    wrong = rng.random(len(mag)) < case.outliers
    mag[wrong] += _OUTLIER * np.array([random_axes(rng)[0] for _ in range(np.count_nonzero(wrong))]).reshape(-1, 3)
    acc = reading(_ACCELEROMETER, force_b(q_nb), triad="acc", rng=rng)
    bias, scale = rng.uniform(-1.0, 1.0, (2, 3)) * [[_RATE_BIAS], [_RATE_SCALE]]
    gyr = reading(replace(_GYROSCOPE, bias=bias, scale=scale), rate_b, triad="gyr", rng=rng)
    return Capture(t, mag, acc, gyr)


def _moved(attitudes: Attitudes | Scenario, rng: np.random.Generator) -> tuple[Floats, Floats, Floats]:
    """Time (N,), attitudes (N, 4) and rates (N, 3); poses are at rest, a second apart."""
    if isinstance(attitudes, Scenario):
        t = np.arange(round(attitudes.duration * _RATE)) / _RATE
        truth = attitudes.motion(rng, attitudes.duration).truth(t)
        return t, truth.q_nb, truth.rate_b
    q_nb = attitudes(rng)
    return np.arange(float(len(q_nb))), q_nb, np.zeros((len(q_nb), 3))


def scores(fit: TriadCalibration, errors: TriadErrors) -> Floats:
    """Errors of bias and matrix over their predicted standard deviations, without those that are rightly zero."""
    true = np.linalg.inv(errors.response)
    if np.allclose(fit.matrix, fit.matrix.T, rtol=0.0, atol=1e-12):  # by length alone, which does not tell a rotation
        true = np.real(sqrtm(true.T @ true))
    if fit.covariance is None:
        return np.full(12, math.inf)
    off = np.abs(np.concatenate((fit.bias - errors.iron, (fit.matrix - true).ravel())))
    sd = np.sqrt(np.diag(fit.covariance))
    told = (sd > 0.0) | (off > _ZERO)
    return np.asarray(off[told] / np.maximum(sd[told], _ZERO))


def _row(trials: Sequence[Trial]) -> tuple[float, ...]:
    kept = [t for t in trials if t is not _REFUSED]
    scores = np.concatenate([t.scores for t in kept]) if kept else np.full(1, math.inf)
    heading = np.array([t.heading for t in trials])
    silent = [t for t in kept if t.heading > SILENT and t.grade != "poor"]
    return (
        from_si(float(np.median([t.bias for t in trials])), "mgauss"),
        to_deg(float(np.median(heading))),
        to_deg(float(np.quantile(heading, 0.95, method="higher"))),
        to_deg(float(np.median([t.predicted for t in trials]))),
        100.0 * float(np.mean(scores <= 1.0)),
        100.0 * (1.0 - len(kept) / len(trials)),
        100.0 * len(silent) / len(trials),
    )


def _bars(case: Case, row: tuple[float, ...]) -> list[Bar]:
    if case.limit is None:
        return []
    figures = dict(zip(_COLUMNS, row, strict=True))
    return [
        Bar(f"{case.name}: heading, °", figures["heading, °"], 0.0, to_deg(case.limit)),
        Bar(f"{case.name}: within 1 sd, %", figures["within 1 sd, %"], *COVERED),
        Bar(f"{case.name}: failing silently, %", figures["silent, %"], 0.0, 0.0),
    ]
