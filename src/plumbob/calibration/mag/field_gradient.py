"""What an uneven field leaves in a magnetometer's calibration, shown or not: a floor that only evidence lowers.

Let the field change by G per metre, and the sensor be at ``c + R l``: on an arm l that turns with the unit, R its
attitude, about a point c that wanders with the hand. Its length errs by ``(G b̂)·(c + R l)``, b̂ the field's direction.

What wanders averages out, but only as the unit turns: about two radians of turning make one independent value, a
*patch*, for a hand that turns a unit takes it elsewhere. The part of ``G b̂`` along the field makes of the arm a hard
iron, and the direction of the field is bent by as much as its length, which looks like a turn of the magnetometer in
its case. No length shows either, however long the capture is. For a G of no preferred direction both are about as
large as what is seen: ⅔ s² per axis, and s over the field.

How large s is, the part of the error that stays within a patch, follows from what residuals share from one visit of a
direction to the next. Residuals hide it in three ways: the parameters take up nine patches, noise drowns it, and what
is seen of a few components of G says little about the others. So a capture that cannot show the unevenness of a usual
room, 2 µT per metre over a hand's 25 cm, is taken to have been made in one.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.calibration.autocorrelation import FEWEST_VISITS, LONG, staying, visits
from plumbob.calibration.fit import Reason
from plumbob.core.check import Floats
from plumbob.core.units import deg

USUAL: Final = 0.5  # unevenness of the field in a usual room over the space that a hand moves a unit in, µT
PATCH: Final = 2.0  # turning of the measured field that makes one independent value of what wanders, rad
HIDDEN: Final = 40.0  # power that a capture may hide, over what chance makes of the power that it shows
TAKEN_UP: Final = 9.0  # patches whose errors the nine parameters of an ellipsoid take up, of one length each
# Share of a usual room's power that no length rules out: of the three components of its change along an arm, a length
# shows two; a usual room, counted as half a component more, leaves the third a variance of ½/(2 + ½) of its own.
ALONG: Final = 0.2

_LINGERING: Final = 2  # mean samples per visit of a unit that a hand turns; with fewer they are single poses
_LIKE_SEEN: Final = 2.0  # power of the unevenness over that shared by neighbours, which lie apart
_LEAST_SHARE: Final = 0.2  # of the errors, that residuals are scaled up from
_LIKELY: Final = 2.0  # standard deviations by chance
_SHARPNESS: Final = 8  # of the step from what shows to what hides
_HARD_IRON: Final = 2.0 / 3.0  # variance of the unseen hard iron per axis, over s²


class Unevenness(NamedTuple):
    """How uneven the field was."""

    sd: float = 0.0  # part of the error that stays within a patch, µT
    seen: float = 0.0  # what of it the residuals show, µT
    patches: float = np.inf  # how many independent values of it the capture has
    short: bool = False  # whether more of them would have shown what is counted beyond what is seen

    def counted(
        self,
        covariance: Floats,
        *,
        memory: float,
        residuals: Floats,
        matrix: Floats,
        radius: float,
        turned: bool = True,
    ) -> Floats:
        """Covariance (12, 12) of bias and matrix with what the field leaves, from that of independent samples.

        `memory` neighbouring samples count as one; `residuals` (N,), µT, are of those that were fitted; `radius`, µT,
        is the strength of the field in the sensor's own scale; `turned`: no vertical shows a turn of the axes.
        """
        unseen = np.zeros((12, 12))  # what no length shows: a hard iron, without a vertical a turn
        unseen[:3, :3] = _HARD_IRON * self.sd**2 * np.eye(3)
        for axis in np.eye(3) if turned else ():
            change = np.cross(axis, matrix.T).T.ravel()
            unseen[3:, 3:] += (self.sd / radius) ** 2 * np.outer(change, change)
        return covariance * (memory + self.spread(residuals)) + unseen

    def spread(self, residuals: Floats) -> float:
        """How many of the residuals (N,), µT, count as one, for what wanders."""
        power = float(residuals @ residuals)
        return self.sd**2 * len(residuals) ** 2 / power / self.patches if power > 0.0 else 0.0


def unevenness(
    residuals: Floats,
    directions: Floats,
    used: NDArray[np.bool_],
    *,
    patches: float | None = None,
    taken_up: float = TAKEN_UP,
    lengths: bool = True,
) -> Unevenness:
    """How uneven the field was in a capture, or may have been without showing it.

    `residuals` (N,) or (N, C), µT, are what a fit leaves of each sample in order of time; of C columns, the worst
    counts. `directions` (N, 3) or (N, 2) are fitted vectors of any length. Fewer than 100 `used` samples (N,) are
    readings of single poses, whose errors all count as noise. `patches` is through how many the unit turned, where more
    than the directions is known; the parameters take up errors of `taken_up` of them. `lengths`: the residuals are of
    lengths alone, which do not show a field that changes along itself.
    """
    columns = residuals.reshape(len(residuals), -1)[used].T
    if columns.shape[1] < LONG:
        return Unevenness()
    starts = visits(directions[used])
    if patches is None:
        unit = directions[used][starts]
        unit = unit / np.linalg.norm(unit, axis=1, keepdims=True)
        turned = np.arccos(np.clip(np.sum(unit[1:] * unit[:-1], axis=1), -1.0, 1.0))
        patches = float(np.sum(np.minimum(turned, PATCH))) / PATCH
    patches = max(1.0, patches)
    share = 1.0 - taken_up / patches if patches > taken_up else 0.0
    if len(starts) < FEWEST_VISITS or share == 0.0:
        return Unevenness(USUAL, 0.0, patches, short=True)
    stays = [staying(column, starts) for column in columns]
    hidden = np.max([each.chance for each in stays])
    shown = np.max([max(each.variance, each.neighbours * (each.neighbours > _LIKELY * each.chance)) for each in stays])
    evident = _LIKE_SEEN * shown / max(share, _LEAST_SHARE)
    least = HIDDEN * hidden / (USUAL**2 * share)
    drowned = least**_SHARPNESS / (1.0 + least**_SHARPNESS)
    by_hand = len(starts) * _LINGERING <= columns.shape[1]
    along = ALONG if lengths and by_hand else 0.0
    variance = evident + USUAL**2 * max(along, drowned)
    return Unevenness(float(np.sqrt(variance)), float(np.sqrt(evident)), patches, short=drowned > along)


FLAT: Final = 0.1  # thickness over width below which vectors lie on a circle: ±1° of jitter makes 0.04
_LEVEL: Final = deg(8.0)
_CONSTANT: Final = deg(10.0)


def one_axis(vectors: Floats, acc: Floats | None) -> Reason | None:
    """Reason to refuse vectors (N, 3) that were seen while turning about one axis only; None where they were not.

    The specific force (N, 3) at the same instants, where finite, distinguishes a level unit from an inclined one.
    """
    centred = vectors - vectors.mean(axis=0)
    _, sizes, directions = np.linalg.svd(centred[:: max(1, len(centred) // 10_000)], full_matrices=False)
    if not sizes[2] < FLAT * sizes[1]:
        return None
    axis = directions[2]
    upright = _from_case_axis(axis) < _LEVEL  # whether it was about an axis of the case
    label = f"the axis ({', '.join(f'{v:.2f}' for v in axis)})"
    if upright:
        label = f"the {'xyz'[int(np.argmax(np.abs(axis)))]} axis"
    if acc is not None and len(acc := acc[np.isfinite(acc).all(axis=1) & acc.any(axis=1)]):
        mean = (acc / np.linalg.norm(acc, axis=1, keepdims=True)).mean(axis=0)
        size = float(np.linalg.norm(mean))
        spread = math.sqrt(max(0.0, 2.0 * (1.0 - size)))  # root mean square angle about the mean direction
        upright = spread < _CONSTANT and _from_case_axis(mean / size) < _LEVEL
    advice = "Turn the unit about all its axes: each face and each edge once up, as if it were a cube."
    what = f"the field's directions lie on one circle about {label}, {100.0 * sizes[2] / sizes[1]:.1f} % thick"
    turned = "about the vertical while level" if upright else "about one inclined axis"
    return Reason(
        "level-ring" if upright else "cone", f"{what}: the unit was turned {turned}, and nothing else.", advice
    )


def _from_case_axis(direction: Floats) -> float:
    return math.acos(min(1.0, float(np.abs(direction).max())))
