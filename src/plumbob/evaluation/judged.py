"""An estimate judged by a reference, as data."""

from collections.abc import Mapping
from dataclasses import dataclass

from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.data import AttitudeTrack
from plumbob.evaluation.align import Alignment, Fate, Match
from plumbob.evaluation.metrics import Consistency, Stats


@dataclass(frozen=True, slots=True)
class EvaluationSettings:
    """What was asked for; times in s, angles in rad, None where left to the default."""

    align: tuple[str, ...] = ()
    max_gap: float | None = None
    max_offset: float = 1.0
    declination: float | None = None
    settle: float = 0.0


@dataclass(frozen=True, eq=False, repr=False)
class JudgedTrack:
    """An estimate judged by a reference.

    Attributes
    ----------
    estimate, reference : AttitudeTrack
        As they were given.
    settings : EvaluationSettings
        As they were asked for.
    match : Match
        Which samples met, and why others did not; `match.q_ref` is the reference in the estimate's frame, brought to
        its times and aligned.
    alignment : Alignment
        What was found.
    errors : mapping of str to ndarray (N,)
        Error of each quantity that may be scored, rad, at the estimate's times, wherever both are known; NaN before the
        estimate had converged. The statistics take only the rows where `match.scored`.
    stats : mapping of str to Stats
        Of each quantity that is scored.
    not_scored : mapping of str to str
        Why the others are not.
    near_gimbal : int
        Scored samples without yaw and roll, because a pitch is within `GIMBAL_GUARD` of ±90°.
    consistency : Consistency or None
        Where the estimate claims a covariance.
    reference_rate : float or None
        Rms angular rate of the reference over the scored samples, rad/s; None where it cannot be determined.
    notes : tuple of str
        What a reader should know.
    """

    estimate: AttitudeTrack
    reference: AttitudeTrack
    settings: EvaluationSettings
    match: Match
    alignment: Alignment
    errors: Mapping[str, Floats]
    stats: Mapping[str, Stats]
    not_scored: Mapping[str, str]
    near_gimbal: int
    consistency: Consistency | None
    reference_rate: float | None
    notes: tuple[str, ...]

    @property
    def t(self) -> Floats:
        """Times of the estimate, s, (N,)."""
        return self.estimate.t

    @property
    def not_converged_until(self) -> float | None:
        """Time of the last sample that is left out because the estimate had not converged, s; None without one."""
        times = self.t[self.match.fate == Fate.NOT_CONVERGED]
        return float(times[-1]) if times.size else None

    def flag_counts(self) -> dict[str, int]:
        """Scored samples that carry each flag of the estimate that occurs."""
        if self.estimate.flags is None:
            return {}
        return flags.counts(self.estimate.flags[self.match.scored])
