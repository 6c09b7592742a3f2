"""Guides of a capture: poses at rest for an accelerometer, turning for a magnetometer, rest for a gyroscope."""

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.calibration.autocorrelation import alike
from plumbob.calibration.ellipsoid_fit import (
    SPARE,
    Ellipsoid,
    NormFit,
    Shape,
    first_ellipsoid,
    fit_norm,
    mean_radius,
    scaled,
)
from plumbob.calibration.fit import HEADING, TILT, grade_of
from plumbob.calibration.mag.checks import DIP
from plumbob.calibration.mag.field_gradient import one_axis, unevenness
from plumbob.calibration.predicted import NAMES, REGIONS, filled, heading_sd, region_index, tilt_sd
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.event import Event
from plumbob.core.units import dps, to_deg
from plumbob.data import ImuData
from plumbob.live.guide.guide import (
    ENOUGH,
    AxisTurn,
    Block,
    Guide,
    Progress,
    RestGuide,
    Seen,
    nearest,
    pose_words,
    turn_to,
)
from plumbob.live.stream import ItemResult
from plumbob.live.transports.transport import Stop

HOLD: Final = 1.4
"""Rest after which a pose counts, s: six blocks of `still`, in which any other cut has a second between quiet ones."""

_UNTIL: Final = "keep it still until it counts, about 2 s"


class AccelGuide(Guide):
    """Asks for the 18 poses in which each face and each edge of the unit is up."""

    triad = "acc"

    def __init__(self) -> None:
        super().__init__()
        self._seen = Seen()
        self._poses = np.empty((0, 3))
        self._centre = np.zeros(3)
        self._force: Floats | None = None
        self._sd: float | None = None

    @property
    def centre(self) -> Floats:
        """Of the ellipsoid that the poses lie on."""
        return self._centre

    def progress(self) -> Progress:
        """State after the last whole block."""
        count = int(self._seen.filled.sum())
        grade = None if self._sd is None else grade_of(self._sd, TILT)
        direction = None if self._force is None else _unit(self._force - self._centre)
        here = None if direction is None else int(region_index(direction[np.newaxis])[0])
        missing = np.flatnonzero(~self._seen.filled).tolist()
        goal = nearest(direction, missing) if missing and direction is not None else None
        done = self._done or (grade == "good" and count >= ENOUGH)
        return Progress(
            elapsed=self._now,
            filled=self._seen.filled.copy(),
            direction=here,
            still_for=self._rest.lasting,
            next_step="done" if done else self._words(here, goal),
            turn=None if goal is None or goal == here or direction is None else turn_to(direction, REGIONS[goal]),
            goal=goal,
            predicted="" if self._sd is None else f"tilt ±{to_deg(self._sd):.2g}° (1 sd)",
            grade=grade,
            share=count / len(NAMES),
            warnings=self._warnings,
            done=done,
        )

    def _look(self, block: Block) -> None:
        mean = block.triads["acc"].mean(axis=0)
        self._force = mean if np.isfinite(mean).all() and np.any(mean != self._centre) else None
        stretches = [stretch for stretch in self._rest.stretches if self._rest.duration(stretch) >= HOLD]
        poses = np.array([self._rest.mean_force(stretch) for stretch in stretches]).reshape(-1, 3)
        if len(poses) != len(self._poses):
            self._fit(poses)
        self._poses = poses
        if (news := self._seen.update(_filled(poses - self._centre))) is not None:
            self._say(news)

    def _fit(self, poses: Floats) -> None:
        enough = len(poses) >= Shape.ELLIPSOID.value + SPARE
        fit = fit_norm(poses, Shape.ELLIPSOID, first_ellipsoid(poses)) if enough else None
        self._centre, self._sd = (np.zeros(3), None) if fit is None else (fit.ellipsoid.centre, _predicted(fit, poses))

    def _words(self, here: int | None, goal: int | None) -> str:
        if here is None or goal is None:
            return "hold the unit still in another pose" if goal is None else "wait for the accelerometer"
        if here == goal:
            return _UNTIL if self._rest.lasting else "let go of it, or hold it still"
        return f"hold it with {pose_words(goal)}, and {_UNTIL}"


def _predicted(fit: NormFit, poses: Floats) -> float:
    shared = alike(fit.residuals, fit.ellipsoid.to_sphere(poses), fit.used)
    return tilt_sd(*scaled(fit, G0, alike=shared.factor), size=G0)


def _filled(vectors: Floats) -> NDArray[np.bool_]:
    mask = np.zeros(len(NAMES), dtype=np.bool_)
    if len(vectors):
        mask[region_index(vectors)] = True
    return mask


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / np.linalg.norm(vector))


TOO_FAST: Final = float(dps(180.0))
"""Rate above which a compass part, which averages for 10 ms or so, smears the field by degrees, rad/s."""

MOST: Final = 200  # samples that are kept of each direction, evenly in time: where there are more, every other one goes

_OF_BLOCK: Final = 10
_EVERY: Final = 4  # blocks
_IDLE: Final = 1.5
_FEWEST: Final = 12
_CERTAIN: Final = 0.15  # standard deviation of the centre over the radius above which directions are told
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

    @property
    def centre(self) -> Floats:
        """Of the ellipsoid, or until there is one, the middle of what has come."""
        vectors = self._sample.vectors
        if self._fit is not None:
            return self._fit.ellipsoid.centre
        return np.asarray(vectors.mean(axis=0)) if len(vectors) else np.zeros(3)

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
            direction=None if direction is None else int(region_index(direction[np.newaxis])[0]),
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
        self._sd = _predicted_heading(fit, vectors) if fit is not None and full else None
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
        covered = self._seen.filled[region_index(arm)]
        if covered.all() and abs(float(np.median(sizes)) - 1.0) > _OFF:
            self._warn(
                "the field is not that of before: take iron, magnets and cables away, and what moves on the unit"
            )

    def _direction(self) -> Floats | None:
        if self._fit is None or self._field is None:
            return None
        arm = self._field - self._fit.ellipsoid.centre
        return np.asarray(arm / np.linalg.norm(arm))

    def _next(self, direction: Floats | None) -> tuple[int | None, AxisTurn | None]:
        """Direction to go to, and the turn towards it; a turn about another axis as long as no direction is known."""
        if direction is None:
            few = len(self._sample.vectors) < _FEWEST
            return None, None if few else AxisTurn(_least_turned(self._sample.vectors), _QUARTER)
        missing = np.flatnonzero(~self._seen.filled).tolist()
        if not missing:
            return None, None
        goal = nearest(direction, missing)
        return goal, turn_to(direction, REGIONS[goal])

    def _words(self, goal: int | None, turn: AxisTurn | None) -> str:
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
        where = region_index(every - (every.mean(axis=0) if centre is None else centre))
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
    start = first_ellipsoid(vectors)
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


def _predicted_heading(fit: NormFit, vectors: Floats) -> tuple[float, float]:
    """Predicted heading error, rad, and what of it more turning can make smaller: a length never shows the rest."""
    matrix, independent = scaled(fit, None, alike=1.0)
    samples = fit.residuals, fit.ellipsoid.to_sphere(vectors), fit.used
    memory, radius = alike(*samples).memory, mean_radius(fit.ellipsoid.shape)
    fields = (unevenness(*samples, lengths=lengths) for lengths in (True, False))
    residuals = fit.residuals[fit.used]
    counted = (
        field.counted(independent, memory=memory, residuals=residuals, matrix=matrix, radius=radius) for field in fields
    )
    total, shown = (heading_sd(matrix, covariance, size=radius, dip=DIP) for covariance in counted)
    return total, shown


def _least_turned(vectors: Floats) -> int:
    """Axis of the case about which the unit turned least: across that about which it turned most."""
    _, _, directions = np.linalg.svd(vectors - vectors.mean(axis=0), full_matrices=False)
    return int(np.argmin(np.abs(directions[2])))


GUIDES: Final[dict[str, type[Guide]]] = {"mag": MagGuide, "accel": AccelGuide, "gyro": RestGuide}
"""Guide of each kind of `plumbob calibrate` that has one."""

_CHUNK: Final = 4096


class GuideSink:
    """Hands the samples of a line to a guide, shows its progress, and stops the line when it is enough."""

    def __init__(self, guide: Guide, stop: Stop, show: Callable[[Progress], None]) -> None:
        self._guide, self._stop, self._show = guide, stop, show

    def on_part(self, part: ItemResult) -> None:
        """Go on, and stop when it is enough."""
        progress = self._guide.feed(part.sensed)
        self._show(progress)
        if progress.done:
            self._stop.set()

    def on_event(self, event: Event) -> None:
        """Go on: a line that comes back goes on with the same unit in the same capture."""

    def close(self) -> None:
        """Nothing is held open."""


def guided(guide: Guide, imu: ImuData) -> Progress:
    """Progress at the end of a recording, uncalibrated in what is calibrated; the guide's timeline shows the way."""
    for part in imu.chunks(_CHUNK):
        progress = guide.feed(part)
    return progress
