"""Bring an estimate and a reference to common times: the reference is read at the estimate's times.

A time stamp that both have is taken as it is, to the last bit. Between two stamps the reference is interpolated at
constant rate (slerp), never across a gap, never next to a row that is not known, never beyond its ends. Every sample of
the estimate gets a `Fate`, so that what was left out can be counted and shown.
"""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.errors import ClockError, ParameterError
from plumbob.core.time import to_ns
from plumbob.data import AttitudeTrack
from plumbob.data.reading import Reading, default_max_gap, read_at

Mask = NDArray[np.bool_]


class Fate(IntEnum):
    """What became of a sample of the estimate; the first that applies."""

    SCORED = 0
    ESTIMATE_UNKNOWN = 1
    NOT_CONVERGED = 2
    OUTSIDE = 3
    GAP = 4
    REFERENCE_UNKNOWN = 5
    SETTLING = 6
    MASKED = 7

    @property
    def label(self) -> str:
        """Short name for tables and JSON."""
        return self.name.lower()

    @property
    def meaning(self) -> str:
        """One line for a reader."""
        return _MEANING[self]


_MEANING = {
    Fate.SCORED: "scored",
    Fate.ESTIMATE_UNKNOWN: "the estimate holds no attitude",
    Fate.NOT_CONVERGED: "the estimate had not converged",
    Fate.OUTSIDE: "before the reference begins or after it ends",
    Fate.GAP: "the reference has no samples for longer than the largest gap",
    Fate.REFERENCE_UNKNOWN: "the reference lost the body",
    Fate.SETTLING: "in the settling time after the start of the estimate",
    Fate.MASKED: "the reference says that it does not count",
}


@dataclass(frozen=True, eq=False)
class Match:
    """A reference at the times of an estimate of N samples.

    Attributes
    ----------
    q_ref : ndarray (N, 4)
        The reference there; NaN where it is not known.
    fate : ndarray (N,) of uint8
        A `Fate` for each sample.
    exact : ndarray (N,) of bool
        The reference has this very time stamp; elsewhere it is interpolated.
    max_gap : float
        Largest step of the reference that was bridged, s.
    """

    q_ref: Floats
    fate: NDArray[np.uint8]
    exact: Mask
    max_gap: float

    @property
    def scored(self) -> Mask:
        """True where the sample counts, (N,)."""
        return np.asarray(self.fate == Fate.SCORED)

    def counts(self) -> dict[Fate, int]:
        """Samples of each fate that occurs."""
        return {fate: n for fate in Fate if (n := int(np.count_nonzero(self.fate == fate)))}


def associate(
    estimate: AttitudeTrack,
    reference: AttitudeTrack,
    *,
    max_gap: float | None = None,
    settle: float = 0.0,
    offset: float = 0.0,
) -> Match:
    """Read the reference at the times of the estimate.

    Parameters
    ----------
    estimate, reference : AttitudeTrack
        Their times count from the same start. The reference's ``score`` masks samples: an interpolated one counts only
        where both neighbours do. A ``score`` of the estimate is not heard; nobody marks his own work. What it holds
        before the filter has converged, `not_converged`, does not count.
    max_gap : float, optional
        Largest step between reference stamps that is bridged, s; by default `GAP_FACTOR` median steps of the reference.
    settle : float
        Time after the estimate's first sample that is left out, s.
    offset : float
        Added to the reference's stamps, s.

    Raises
    ------
    ClockError
        If the two have no time in common.
    ParameterError
        If `max_gap` or `settle` is out of range.
    """
    limit = default_max_gap(reference) if max_gap is None else max_gap
    if not 0.0 <= limit < np.inf:
        raise ParameterError(f"max_gap must be a finite time ≥ 0 s, but it is {max_gap}.")
    if not 0.0 <= settle < np.inf:
        raise ParameterError(f"settle must be a finite time ≥ 0 s, but it is {settle}.")
    reading = read_at(reference, to_ns(estimate.t), max_gap=limit, offset=offset)
    if reading.outside.all():
        raise ClockError(_no_overlap(estimate, reference, offset))
    fate = _fates(estimate, reference, reading, settle)
    return Match(reading.q_nb, fate, reading.exact & (fate == Fate.SCORED), limit)


def not_converged(track: AttitudeTrack) -> Mask:
    """True where a filter had no attitude yet, or one of which nothing had shown that it is right, (N,)."""
    if track.flags is None:
        return np.zeros(len(track), dtype=np.bool_)
    return np.asarray(track.flags & np.uint32(flags.NOT_CONVERGED) != 0)


def _fates(estimate: AttitudeTrack, reference: AttitudeTrack, reading: Reading, settle: float) -> NDArray[np.uint8]:
    fate = np.zeros(len(estimate), dtype=np.uint8)
    if reference.score is not None:
        fate[~(reference.score[reading.low] & reference.score[reading.high])] = Fate.MASKED
    fate[estimate.t < estimate.t[0] + settle] = Fate.SETTLING
    fate[~np.isfinite(reading.q_nb).all(axis=1)] = Fate.REFERENCE_UNKNOWN
    fate[reading.gap] = Fate.GAP
    fate[reading.outside] = Fate.OUTSIDE
    fate[not_converged(estimate)] = Fate.NOT_CONVERGED
    fate[~estimate.known] = Fate.ESTIMATE_UNKNOWN
    return fate


def _no_overlap(estimate: AttitudeTrack, reference: AttitudeTrack, offset: float) -> str:
    first, last = reference.t[0] + offset, reference.t[-1] + offset
    return (
        f"estimate and reference have no time in common: the estimate spans {estimate.t[0]:.3f} to "
        f"{estimate.t[-1]:.3f} s, the reference {first:.3f} to {last:.3f} s. Let both count from the same start."
    )
