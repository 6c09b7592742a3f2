"""Accelerometer calibrations of simulated units in known numbers of poses: errors of bias, length and direction.

Units have a bias up to 30 mg, a scale wrong by up to 2 % and axes up to 0.5° off, all evenly distributed. Errors of
length and direction are root mean squares over all directions; that of direction is against the axes that turn the
measured vectors least, for the length of gravity tells no rotation.
"""

import itertools
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import numpy as np
from scipy.linalg import sqrtm

from benchmarks.harness.bar import Bar
from benchmarks.harness.calibration_mag import COVERED
from benchmarks.harness.calibration_world import Attitudes, force_b, posed, reading
from benchmarks.harness.section import Section
from plumbob.calibration.acc import fit_accel
from plumbob.calibration.fit import CaptureRefusedError
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.units import deg, from_si, g, to_deg
from plumbob.data.cards import TriadCalibration
from plumbob.simulation import TriadErrors
from plumbob.simulation.captures import facing, trembling

BIAS: Final = g(0.03)
SCALE: Final = 0.02
MISALIGNMENT: Final = deg(0.5)
BEST: Final = (0.04, 0.003)
"""Limits with 18 averaged positions: bias and length, mg, and direction, °."""

_COLUMNS: Final = ("bias, mg", "length, mg", "direction, °", "predicted, °", "within 1 sd, %", "refused, %")
_TESTED: Final = 400


class Care(NamedTuple):
    """How well poses are made: noise of a mean, m/s², and error of the hand, rad."""

    name: str
    noise: float
    jitter: float


CARES: Final = (
    Care("averaged, 0.05 mg, within 0.5°", g(0.05e-3), deg(0.5)),
    Care("0.6 mg, within 2°", g(0.6e-3), deg(2.0)),
)


class Row(NamedTuple):
    """One way to calibrate: directions that come up, none for poses by hand, and the shape that is fitted."""

    name: str
    upward: Floats | None
    shape: str


def _positions() -> tuple[Floats, Floats, Floats]:
    """Faces (6, 3), edges (12, 3) and corners (8, 3) of a cube."""
    signs = np.array(list(itertools.product((-1.0, 0.0, 1.0), repeat=3)))
    axes = np.abs(signs).sum(axis=1)
    return signs[axes == 1], signs[axes == 2], signs[axes == 3]


_FACES, _EDGES, _CORNERS = _positions()
_EIGHTEEN: Final = "18 positions, 9 parameters"
ROWS: Final = (
    Row("6 positions, pairs", _FACES, "six"),
    Row("6 positions, 6 parameters", _FACES, "axes"),
    Row("9 positions, 9 parameters", np.concatenate((_FACES, _EDGES[(_EDGES >= 0.0).all(axis=1)])), "ellipsoid"),
    Row(_EIGHTEEN, np.concatenate((_FACES, _EDGES)), "ellipsoid"),
    Row("18 positions, chosen", np.concatenate((_FACES, _EDGES)), "auto"),
    Row("26 positions, 9 parameters", np.concatenate((_FACES, _EDGES, _CORNERS)), "ellipsoid"),
    Row("40 poses by hand, chosen", None, "auto"),
)


class Trial(NamedTuple):
    """Figures of one unit: errors of bias and length, m/s², and direction, rad; the predicted one; z-scores (9,)."""

    bias: float
    length: float
    direction: float
    predicted: float
    scores: Floats


_REFUSED: Final = Trial(np.inf, np.inf, np.inf, np.inf, np.empty(0))


def measure_accel(seeds: Sequence[int], progress: Callable[[int], None] | None = None) -> Section:
    """Calibrate a unit per seed in each of `ROWS`, with each of `CARES`.

    Parameters
    ----------
    seeds : sequence of int
        One unit each.
    progress : callable, optional
        Called with 1 after each row.
    """
    rows: dict[str, tuple[float, ...]] = {}
    bars: list[Bar] = []
    for care, row in itertools.product(CARES, ROWS):
        name = f"{row.name}; {care.name}"
        rows[name] = figures = _figures([_trial(row, care, seed) for seed in seeds])
        bars += _bars(name, row, care, figures)
        if progress:
            progress(1)
    return Section(f"Accelerometer, {len(seeds)} units, medians", _COLUMNS, rows, tuple(bars))


def draw_unit(noise: float, rng: np.random.Generator) -> TriadErrors:
    """Accelerometer of one unit."""
    misalignment = rng.uniform(-MISALIGNMENT, MISALIGNMENT, (3, 3))
    np.fill_diagonal(misalignment, 0.0)
    return TriadErrors(
        bias=rng.uniform(-BIAS, BIAS, 3),
        scale=rng.uniform(-SCALE, SCALE, 3),
        misalignment=misalignment,
        white_sd=np.full(3, noise),
    )


def _attitudes(row: Row, care: Care) -> Attitudes:
    upward = row.upward
    if upward is None:
        return posed("poses", number=40)

    def draw(rng: np.random.Generator) -> Floats:
        return trembling(facing(upward, rng.uniform(-np.pi, np.pi, len(upward))), care.jitter, rng)

    return draw


def _trial(row: Row, care: Care, seed: int) -> Trial:
    rng = np.random.default_rng(seed)
    errors = draw_unit(care.noise, rng)
    poses = reading(errors, force_b(_attitudes(row, care)(rng)), triad="acc", rng=rng)
    try:
        fit = fit_accel(poses, shape=row.shape, noise=care.noise).calibration
    except CaptureRefusedError:
        return _REFUSED
    directions = np.random.default_rng(0).normal(size=(_TESTED, 3))
    truth = G0 * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    inverse = np.linalg.inv(errors.response)
    true = np.real(sqrtm(inverse.T @ inverse))
    measured = np.linalg.solve(true, truth.T).T  # in the axes that the length can tell
    found = (measured + errors.bias - fit.bias) @ fit.matrix.T
    off = found - truth
    along = np.sum(off * truth, axis=1) / G0
    across = np.linalg.norm(off - along[:, np.newaxis] * truth / G0, axis=1) / G0
    predicted = np.inf if fit.quality is None or fit.quality.tilt_sd is None else fit.quality.tilt_sd
    scores = _scores(fit, true, errors.bias)
    return Trial(float(np.linalg.norm(fit.bias - errors.bias)), _rms(along), _rms(across), predicted, scores)


def _scores(fit: TriadCalibration, true: Floats, bias: Floats) -> Floats:
    """Errors of the nine parameters over their predicted standard deviations."""
    if fit.bias_sd is None or fit.matrix_sd is None:
        return np.full(9, np.inf)
    upper = np.triu_indices(3)
    off = np.append(fit.bias - bias, (fit.matrix - true)[upper])
    return np.abs(off) / np.append(fit.bias_sd, fit.matrix_sd[upper])


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _figures(trials: Sequence[Trial]) -> tuple[float, ...]:
    bias, length, direction, predicted = np.median([trial[:4] for trial in trials], axis=0).tolist()
    kept = [trial for trial in trials if trial is not _REFUSED]
    inside = 100.0 * float(np.mean([trial.scores <= 1.0 for trial in kept])) if kept else np.inf
    refused = 100.0 * (1.0 - len(kept) / len(trials))
    return from_si(bias, "mg"), from_si(length, "mg"), to_deg(direction), to_deg(predicted), inside, refused


def _bars(name: str, row: Row, care: Care, figures: tuple[float, ...]) -> list[Bar]:
    """Limits of the eighteen averaged positions; and intervals must hold wherever misalignment is found."""
    told = dict(zip(_COLUMNS, figures, strict=True))
    limits = [] if row.upward is _FACES else [("within 1 sd, %", *COVERED)]
    if row.name == _EIGHTEEN and care is CARES[0]:
        limits += [("bias, mg", 0.0, BEST[0]), ("length, mg", 0.0, BEST[0]), ("direction, °", 0.0, BEST[1])]
    return [Bar(f"{name}: {column}", told[column], low, high) for column, low, high in limits]
