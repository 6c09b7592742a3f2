"""Plateaus of a rate table as a linear regression takes them: columns of parameters, mountings, weights."""

from dataclasses import dataclass, replace
from typing import Final, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob.calibration.rejection import CaptureRefusedError, Reason
from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.constants import EARTH_RATE
from plumbob.core.errors import ParameterError

SIMPLE: Final = 4
"""Parameters of one axis without g-sensitivity: bias and a row of the response. With it there are 7."""

_TURNING = 0.02  # share of the highest rate below which a plateau says nothing about its mounting
_TINY = 1e-300


@dataclass(frozen=True, eq=False)
class TableSession:
    """Regression of one session.

    Attributes
    ----------
    measured : ndarray (N, 3)
        Mean of the gyroscope over each plateau, rad/s.
    columns : ndarray (N, 4) or (N, 7)
        What bias, response and g-sensitivity are multiplied by: 1, true rate, rad/s, specific force, m/s².
    spins : ndarray (N, K)
        Signed speed in each mounting, rad/s; zero for plateaus of others.
    spin_axes : ndarray (K, 3)
        Axis of each mounting, a unit vector.
    faces : ndarray (N, F)
        1 where a face was up, else 0; F = 0 where plateaus are too few to see what changed from face to face.
    weight : ndarray (N,)
        In proportion to the inverse variance of a mean.
    """

    measured: Floats
    columns: Floats
    spins: Floats
    spin_axes: Floats
    faces: Floats
    weight: Floats

    @property
    def parameters(self) -> int:
        """Parameters of one axis."""
        return int(self.columns.shape[1])

    @property
    def rate(self) -> Floats:
        """True rate (N, 3), rad/s."""
        return self.columns[:, 1:SIMPLE]

    @property
    def condition(self) -> float:
        """Condition number of the scaled columns: 1 for an orthogonal session."""
        return float(np.linalg.cond(scaled(self.columns)))

    def without_force(self) -> Self:
        """Return the same session for the model without g-sensitivity."""
        return replace(self, columns=self.columns[:, :SIMPLE])

    def left(self, *, by_face: bool) -> tuple[Floats, int]:
        """Weighted sum of squares (3,) that a fit leaves, and its degrees of freedom.

        Each mounting has whatever tilt fits best, and with `by_face` each face whatever bias.
        """
        root = np.sqrt(self.weight)[:, np.newaxis]
        free = (self.columns, self.spins, *([self.faces] if by_face else []))
        design, wanted = scaled(np.hstack(free) * root), self.measured * root
        found, _, rank, _ = np.linalg.lstsq(design, wanted, rcond=1e-9)
        return np.asarray(((wanted - design @ found) ** 2).sum(axis=0)), len(wanted) - int(rank)

    def tilting(self, response: Floats) -> Floats:
        """What a tilt of each mounting about two axes makes a gyroscope of that response read, (3 N, 2 K), by axis."""
        across = np.array([np.linalg.svd(axis[np.newaxis])[2][1:].T for axis in self.spin_axes])
        read = np.einsum("nk,ai,kij->ankj", self.spins, response, across)
        return np.asarray(read.reshape(3 * len(self.spins), -1))


def session_of(
    rate: ArrayLike,
    measured: ArrayLike,
    *,
    force: ArrayLike | None,
    seconds: ArrayLike | None,
    latitude: float | None,
) -> TableSession:
    """Session of plateaus; arguments as in `plumbob.calibration.table.fit_table`."""
    rates = check.rows("rate", rate, 3)
    means = check.rows("measured", measured, 3, len(rates))
    forces = None if force is None else check.rows("force", force, 3, len(rates))
    length = np.ones(len(rates)) if seconds is None else check.column("seconds", seconds, len(rates))
    known = [rates, means, *([] if forces is None else [forces])]
    if not all(np.isfinite(part).all() for part in known) or not (length > 0.0).all():
        told = "some plateau has no finite mean of rate or specific force, or no length."
        raise CaptureRefusedError(Reason("too-few", told, "Leave it out."))
    up = np.zeros(len(rates), dtype=np.intp) if forces is None else _face(forces)
    spins, axes = _mountings(rates, up)
    true = _with_earth(rates, forces, latitude)
    columns = np.hstack((np.ones((len(rates), 1)), true, *([] if forces is None else [forces])))
    faces = (up[:, np.newaxis] == np.unique(up)).astype(np.float64)
    session = TableSession(means, columns, spins, axes, faces, length / length.mean() if length.size else length)
    return session if session.left(by_face=True)[1] > 0 else replace(session, faces=faces[:, :0])


def _mountings(rates: Floats, up: NDArray[np.intp]) -> tuple[Floats, Floats]:
    """Spins and their axes: a mounting is one axis of spin with one face up."""
    speed = np.linalg.norm(rates, axis=1)
    turning = speed > _TURNING * speed.max(initial=0.0)
    kind = 6 * np.argmax(np.abs(rates), axis=1) + up
    kinds = np.unique(kind[turning])
    spins, axes = np.zeros((len(rates), kinds.size)), np.zeros((kinds.size, 3))
    for k, one in enumerate(kinds):
        rows = np.flatnonzero((kind == one) & turning)
        ahead = rates[rows] * np.sign(rates[rows, one // 6])[:, np.newaxis]
        axes[k] = ahead.sum(axis=0) / np.linalg.norm(ahead.sum(axis=0))
        spins[rows, k] = rates[rows] @ axes[k]
    return spins, axes


def _face(forces: Floats) -> NDArray[np.intp]:
    """Which of the six faces is up: 0 to 2 for x to z, 3 to 5 for their opposites."""
    axis = np.argmax(np.abs(forces), axis=1)
    return np.asarray(axis + 3 * (forces[np.arange(len(forces)), axis] < 0.0))


def _with_earth(rates: Floats, forces: Floats | None, latitude: float | None) -> Floats:
    """Rates with the vertical part of the Earth's: what is horizontal averages out in a turn."""
    if latitude is None:
        return rates
    if forces is None:
        raise ParameterError("the Earth's rate by latitude needs the specific force, which shows where up is.")
    up = forces / np.linalg.norm(forces, axis=1, keepdims=True)
    return np.asarray(rates + EARTH_RATE * np.sin(latitude) * up)


def scaled(columns: Floats) -> Floats:
    """Columns brought to norm 1; what is zero stays so."""
    return np.asarray(columns / np.maximum(np.linalg.norm(columns, axis=0), _TINY))
