"""Guide of a magnetometer's capture: turned slowly until the field has been seen from all directions."""

from typing import Final

import numpy as np

from plumbob.calibration.ellipsoid.autocorrelation import alike_in
from plumbob.calibration.ellipsoid.ellipsoid_fit import Ellipsoid, NormFit, Shape, fit_norm
from plumbob.calibration.ellipsoid.scale import radius_of, scaled
from plumbob.calibration.ellipsoid.shape_choice import SPARE, start_of
from plumbob.calibration.fit import HEADING, grade_of
from plumbob.calibration.guide.guide import ENOUGH, Guide, Progress, Seen, Turn, nearest, turn_to
from plumbob.calibration.guide.stream_blocks import Block
from plumbob.calibration.mag.field_gradient import one_axis, unevenness_in
from plumbob.calibration.mag.outcome import DIP
from plumbob.calibration.predicted import NAMES, REGIONS, filled, heading_sd, region_of
from plumbob.core.check import Floats
from plumbob.core.units import dps, to_deg

TOO_FAST: Final = float(dps(180.0))
"""Rate above which a compass part, which averages for 10 ms or so, smears the field by degrees, rad/s."""

MOST: Final = 200
"""Samples that are kept of each direction, evenly in time: where there are more, every other one goes."""

_OF_BLOCK: Final = 10
_EVERY: Final = 4  # blocks
_IDLE: Final = 1.5
_FEWEST: Final = 12
_CERTAIN: Final = 0.15  # standard deviation of the centre over the radius from which on directions are told
_HOLLOW: Final = 0.25  # residuals over the radius; soft iron leaves 0.15 of a sphere, noise without a field 0.42
_OFF: Final = 0.1  # of the field
_QUARTER: Final = 0.5 * np.pi


class MagGuide(Guide):
    """Asks for turns until each of the 18 directions of the field has been seen."""

    triad = "mag"

    def __init__(self) -> None:
        super().__init__()
        self._seen = Seen()
        self._sample = _Sample()
        self._count = 0
        self._fit: NormFit | None = None
        self._sd: tuple[float, float] | None = None
        self._field: Floats | None = None

    def progress(self) -> Progress:
        """State after the last whole block."""
        count = int(self._seen.filled.sum())
        grade, shown = (None, None) if self._sd is None else (grade_of(sd, HEADING) for sd in self._sd)
        done = self._done or (shown == "good" and count >= ENOUGH)
        direction = self._direction()
        goal, turn = self._next(direction)
        return Progress(
            elapsed=self._now,
            filled=None if self._fit is None else self._seen.filled.copy(),
            direction=None if direction is None else int(region_of(direction[np.newaxis])[0]),
            still_for=self._rest.lasting,
            next_step="done" if done else self._words(goal, turn),
            turn=turn,
            goal=goal,
            predicted="" if self._sd is None else f"heading ±{to_deg(self._sd[0]):.2g}° (1 sd)",
            grade=grade,
            share=count / len(NAMES),
            warnings=self._warnings,
            done=done,
        )

    def _look(self, block: Block) -> None:
        mag = block.triads["mag"]
        usable = mag[np.isfinite(mag).all(axis=1) & ~block.clipped["mag"]]
        if len(usable):
            some = usable[:: -(-len(usable) // _OF_BLOCK)]
            self._judge_field(some)
            self._field = some[-1]
            self._sample.take(some, None if self._fit is None else self._fit.ellipsoid.centre)
        self._judge_speed(block)
        self._count += 1
        idle = self._rest.lasting > _IDLE  # nothing new can be seen
        if self._count % _EVERY == 0 and len(self._sample.vectors) >= _FEWEST and not idle:
            self._refit()

    def _refit(self) -> None:
        vectors = self._sample.vectors
        fit = _determined(vectors) if one_axis(vectors, None) is None else None
        self._fit = fit
        full = fit is not None and fit.shape is Shape.ELLIPSOID
        self._sd = _predicted(fit, vectors) if fit is not None and full else None
        if fit is None:
            return
        if (news := self._seen.update(filled(vectors - fit.ellipsoid.centre) > 0)) is not None:
            self._say(news)

    def _judge_speed(self, block: Block) -> None:
        rate = np.linalg.norm(block.triads["gyr"], axis=1)
        if np.isfinite(rate).any() and float(np.nanmean(rate)) > TOO_FAST:
            self._warn(f"too fast: turn it slower than {to_deg(TOO_FAST):.0f}° in a second")

    def _judge_field(self, samples: Floats) -> None:
        """Warn of a field whose length does not fit what was seen before in the same direction."""
        fit = self._fit
        if fit is None:
            return
        arm = samples - fit.ellipsoid.centre
        sizes = np.linalg.norm(arm @ fit.ellipsoid.shape, axis=1)
        known = self._seen.filled[region_of(arm)]
        if known.all() and abs(float(np.median(sizes)) - 1.0) > _OFF:
            self._warn(
                "the field is not that of before: take iron, magnets and cables away, and what moves on the unit"
            )

    def _direction(self) -> Floats | None:
        if self._fit is None or self._field is None:
            return None
        arm = self._field - self._fit.ellipsoid.centre
        return np.asarray(arm / np.linalg.norm(arm))

    def _next(self, direction: Floats | None) -> tuple[int | None, Turn | None]:
        """Direction to go to, and the turn towards it; a turn about another axis as long as no direction is known."""
        if direction is None:
            few = len(self._sample.vectors) < _FEWEST
            return None, None if few else Turn(_least_turned(self._sample.vectors), _QUARTER)
        missing = np.flatnonzero(~self._seen.filled).tolist()
        if not missing:
            return None, None
        goal = nearest(direction, missing)
        return goal, turn_to(direction, REGIONS[goal])

    def _words(self, goal: int | None, turn: Turn | None) -> str:
        if turn is None:
            return "turn it slowly about all its axes" if goal is None else "turn it slowly"
        if goal is None:
            return f"tilt it: {turn}, then slowly through all attitudes"
        return f"{turn}, to {NAMES[goal]}"


class _Sample:
    """Samples (N, 3) of a stream that every direction has its share in, and every moment within a direction."""

    def __init__(self) -> None:
        self.vectors = np.empty((0, 3))
        self._arrived = np.zeros(len(NAMES), dtype=np.int64)
        self._stride = np.ones(len(NAMES), dtype=np.int64)

    def take(self, samples: Floats, centre: Floats | None) -> None:
        """Take what comes, in directions as seen from the centre, else from the middle of what has come."""
        every = np.concatenate((self.vectors, samples))
        where = region_of(every - (every.mean(axis=0) if centre is None else centre))
        keep = np.ones(len(every), dtype=np.bool_)
        for i, region in enumerate(where[len(self.vectors) :].tolist(), start=len(self.vectors)):
            keep[i] = self._arrived[region] % self._stride[region] == 0
            self._arrived[region] += 1
        for region in np.flatnonzero(np.bincount(where[keep], minlength=len(NAMES)) > MOST).tolist():
            keep[np.flatnonzero(keep & (where == region))[1::2]] = False
            self._stride[region] *= 2
        self.vectors = every[keep]


def _determined(vectors: Floats) -> NormFit | None:
    """Fit of the full shape, else of a sphere, whose centre is known well enough to tell directions."""
    start = start_of(vectors)
    for shape in (Shape.ELLIPSOID, Shape.SPHERE):
        if len(vectors) < shape.value + SPARE:
            continue
        fit = fit_norm(vectors, shape, start, robust=False)
        if fit is not None and _is_certain(fit):
            return fit
        start = Ellipsoid(start.centre, np.eye(3) * np.trace(start.shape) / 3.0)
    return None


def _is_certain(fit: NormFit) -> bool:
    radius = 3.0 / float(np.trace(fit.ellipsoid.shape))
    centre_sd = float(np.sqrt(np.linalg.eigvalsh(fit.covariance[:3, :3])[-1]))
    return centre_sd < _CERTAIN * radius and fit.sd < _HOLLOW * radius


def _predicted(fit: NormFit, vectors: Floats) -> tuple[float, float]:
    """Predicted heading error, rad, and what of it more turning can make smaller: a length never shows the rest."""
    matrix, independent = scaled(fit, None, alike=1.0)
    memory, radius = alike_in(fit, vectors).memory, radius_of(fit.ellipsoid.shape)
    fields = (unevenness_in(fit, vectors, lengths=lengths) for lengths in (True, False))
    residuals = fit.residuals[fit.used]
    counted = (
        field.counted(independent, memory=memory, residuals=residuals, matrix=matrix, radius=radius) for field in fields
    )
    whole, shown = (heading_sd(matrix, covariance, size=radius, dip=DIP) for covariance in counted)
    return whole, shown


def _least_turned(vectors: Floats) -> int:
    """Axis of the case about which the unit turned least: across that about which it turned most."""
    _, _, directions = np.linalg.svd(vectors - vectors.mean(axis=0), full_matrices=False)
    return int(np.argmin(np.abs(directions[2])))
