"""Guide of an accelerometer's capture: poses at rest, one in each direction of gravity."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.calibration.ellipsoid.autocorrelation import alike_in
from plumbob.calibration.ellipsoid.ellipsoid_fit import NormFit, Shape
from plumbob.calibration.ellipsoid.scale import scaled
from plumbob.calibration.ellipsoid.shape_choice import SPARE, fit_shape
from plumbob.calibration.fit import TILT, grade_of
from plumbob.calibration.guide.guide import ENOUGH, Guide, Progress, Seen, nearest, pose_words, turn_to
from plumbob.calibration.guide.stream_blocks import Block
from plumbob.calibration.predicted import NAMES, REGIONS, region_of, tilt_sd
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.units import to_deg

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

    def progress(self) -> Progress:
        """State after the last whole block."""
        count = int(self._seen.filled.sum())
        grade = None if self._sd is None else grade_of(self._sd, TILT)
        direction = None if self._force is None else _unit(self._force - self._centre)
        here = None if direction is None else int(region_of(direction[np.newaxis])[0])
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
        stretches = [one for one in self._rest.stretches if self._rest.time_of(one) >= HOLD]
        poses = np.array([self._rest.mean_force(one) for one in stretches]).reshape(-1, 3)
        if len(poses) != len(self._poses):
            self._fit(poses)
        self._poses = poses
        if (news := self._seen.update(_filled(poses - self._centre))) is not None:
            self._say(news)

    def _fit(self, poses: Floats) -> None:
        fit = fit_shape(poses, Shape.ELLIPSOID) if len(poses) >= Shape.ELLIPSOID.value + SPARE else None
        self._centre = np.zeros(3) if fit is None else fit.ellipsoid.centre
        self._sd = None if fit is None else _predicted(fit, poses)

    def _words(self, here: int | None, goal: int | None) -> str:
        if here is None or goal is None:
            return "hold the unit still in another pose" if goal is None else "wait for the accelerometer"
        if here == goal:
            return _UNTIL if self._rest.lasting else "let go of it, or hold it still"
        return f"hold it with {pose_words(goal)}, and {_UNTIL}"


def _predicted(fit: NormFit, poses: Floats) -> float:
    matrix, covariance = scaled(fit, G0, alike=alike_in(fit, poses).factor)
    return tilt_sd(matrix, covariance, size=G0)


def _filled(vectors: Floats) -> NDArray[np.bool_]:
    seen = np.zeros(len(NAMES), dtype=np.bool_)
    if len(vectors):
        seen[region_of(vectors)] = True
    return seen


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / np.linalg.norm(vector))
