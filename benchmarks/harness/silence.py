"""Whether a run that goes wrong says so: by a flag at the moment, or by what it claims of its error.

A sample is off where its error is `OFF_DEG` beyond that of the clean run at the same time. It is warned of by a flag
that the clean run has not up at that time, and it is claimed where heading and inclination are both within `SAID`
claimed standard deviations, or within `BACK_DEG`. Off and neither is silent.
"""

from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.harness.verdict import BACK_DEG, OFF_DEG, TAIL
from plumbob.core.check import Floats

SAID: Final = 3.0
"""An error of so many claimed standard deviations is one that the claim allows for."""
BEYOND: Final = 5.0
"""An error of more is one that the claim excludes,"""
MOMENT: Final = 0.1
"""where it lasts for longer than this in all, s."""
LONG: Final = 1.0
"""Silence for longer than this in all, s, is one."""


class Outcome(StrEnum):
    """How it went; the best first."""

    RIGHT = "right"
    SAID = "said"
    SILENT = "silent"
    WRONG = "silent and wrong at the end"
    NOT_APPLICABLE = "n/a"


COUNTED: Final = tuple(outcome for outcome in Outcome if outcome != Outcome.NOT_APPLICABLE)


@dataclass(frozen=True, slots=True)
class Claimed:
    """Errors of heading and inclination, degrees, and the standard deviations claimed of them, (N, 2) each."""

    error_deg: Floats
    sd_deg: Floats

    @property
    def ratio(self) -> Floats:
        """The larger error in claimed standard deviations, (N,); infinite where nothing is claimed."""
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.where(self.sd_deg > 0.0, self.error_deg / self.sd_deg, np.inf)
        return np.asarray(ratio.max(axis=1))

    @property
    def said(self) -> NDArray[np.bool_]:
        """Where the claim allows for both errors."""
        return np.asarray(((self.error_deg <= SAID * self.sd_deg) | (self.error_deg <= BACK_DEG)).all(axis=1))


@dataclass(frozen=True, slots=True)
class Run:
    """What is judged.

    Attributes
    ----------
    t : ndarray (N,)
        True time of the newest sample that had arrived, s.
    excess_deg : ndarray (N,)
        Error beyond that of the clean run, degrees; NaN where the attitude is not finite.
    warned : ndarray (N,) of bool
        Whether a warning was up that the clean run has not.
    claimed : Claimed or None
        What it claims; None for a contender that claims nothing.
    """

    t: Floats
    excess_deg: Floats
    warned: NDArray[np.bool_]
    claimed: Claimed | None = None


@dataclass(frozen=True, slots=True)
class Silence:
    """What became of a run.

    Attributes
    ----------
    by_flags, by_both : Outcome
        By flags alone; by flags or claims.
    peak_deg, end_deg : float
        Largest deviation, and the mean of the last seconds; 180 where the attitude is not finite.
    off_s, silent_flags_s, silent_s : float
        For how long it was off, off without a flag, and off without a flag or a claim.
    ratio : float or None
        Error in claimed standard deviations that is exceeded for `MOMENT`; None without a claim.
    """

    by_flags: Outcome
    by_both: Outcome
    peak_deg: float = 0.0
    end_deg: float = 0.0
    off_s: float = 0.0
    silent_flags_s: float = 0.0
    silent_s: float = 0.0
    ratio: float | None = None

    @property
    def beyond(self) -> bool:
        """Whether the error was excluded by the claim."""
        return self.ratio is not None and self.ratio > BEYOND

    def cell(self) -> str:
        """Short form for tables."""
        mark = f" {min(self.ratio, 999.0):.0f}σ" if self.ratio is not None and self.beyond else ""
        match self.by_both:
            case Outcome.RIGHT | Outcome.NOT_APPLICABLE:
                return self.by_both + mark
            case Outcome.SAID:
                return f"said {self.peak_deg:.0f}°{mark}"
            case Outcome.SILENT:
                return f"{self.peak_deg:.0f}°/{self.silent_s:.1f}s{mark}"
            case _:
                return f"WRONG {self.end_deg:.0f}°{mark}"

    def summary(self) -> dict[str, Any]:
        """Ready for JSON."""
        return {
            "by_flags": str(self.by_flags),
            "by_flags_or_claims": str(self.by_both),
            "peak_deg": self.peak_deg,
            "end_deg": self.end_deg,
            "off_s": self.off_s,
            "silent_by_flags_s": self.silent_flags_s,
            "silent_s": self.silent_s,
            "error_in_sd": None if self.ratio is None else min(self.ratio, 1e9),
        }


def judge(run: Run, *, judged_from: float) -> Silence:
    """Judge a run from a time on, s; each sample stands for the time since the one before, 0.1 s at most."""
    seen = run.t >= judged_from
    step = np.where(seen, np.clip(np.diff(run.t, prepend=run.t[0]), 0.0, 0.1), 0.0)
    excess = np.where(np.isfinite(run.excess_deg), np.maximum(run.excess_deg, 0.0), 180.0)
    off = excess > OFF_DEG
    quiet = off & ~run.warned
    both = quiet if run.claimed is None else quiet & ~run.claimed.said
    tail = run.t >= run.t[-1] - TAIL
    end = float(excess[tail].mean())

    def outcome(silent: NDArray[np.bool_]) -> Outcome:
        if end > OFF_DEG and silent[tail].mean() > 0.5:
            return Outcome.WRONG
        if float(step[silent].sum()) > LONG:
            return Outcome.SILENT
        return Outcome.SAID if off[seen].any() else Outcome.RIGHT

    return Silence(
        outcome(quiet), outcome(both), float(excess[seen].max()), end, float(step[off].sum()),
        float(step[quiet].sum()), float(step[both].sum()),
        None if run.claimed is None else _lasting(run.claimed.ratio, step),
    )  # fmt: skip


def _lasting(ratio: Floats, step: Floats) -> float:
    """Ratio that is exceeded for `MOMENT` in all."""
    order = np.argsort(-ratio, kind="stable")
    place = int(np.searchsorted(np.cumsum(step[order]), MOMENT + 1e-9))
    return float(ratio[order[min(place, order.size - 1)]])
