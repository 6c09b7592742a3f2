"""What a run under a fault comes to: one verdict from its error beyond the clean run, and what it said about it."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats

OFF_DEG: Final = 2.0
"""A deviation beyond this is one."""
BACK_DEG: Final = 1.0
"""Within this the contender has recovered."""
TAIL: Final = 5.0
"""Last seconds of a run, whose mean says where it ends."""


class Verdict(StrEnum):
    """How it went; the best first."""

    OK = "ok"
    CLEAR_ERROR = "clear error"
    FLAGGED = "flagged, recovers"
    SILENT = "recovers, silent"
    WRONG = "wrong"
    NAN = "NaN for ever"
    NOT_APPLICABLE = "n/a"


COUNTED: Final[tuple[Verdict, ...]] = tuple(verdict for verdict in Verdict if verdict != Verdict.NOT_APPLICABLE)
STRICT: Final = (Verdict.OK, Verdict.CLEAR_ERROR)
PASS: Final = (*STRICT, Verdict.FLAGGED)


@dataclass(frozen=True, slots=True)
class Trace:
    """What is judged.

    Attributes
    ----------
    t : ndarray (N,)
        True time of the newest sample that had arrived, s.
    excess_deg : ndarray (N,)
        Error beyond that of the clean run, degrees, not below zero; NaN where the attitude is not finite.
    raised : ndarray (N,) of bool
        Whether a flag was up that the clean run did not have.
    errors : tuple of str
        Distinct messages of exceptions.
    clear : bool
        Whether every exception was a ValueError or TypeError with a text.
    """

    t: Floats
    excess_deg: Floats
    raised: NDArray[np.bool_]
    errors: tuple[str, ...] = ()
    clear: bool = True


@dataclass(frozen=True, slots=True)
class Judgement:
    """Verdict and its figures.

    Attributes
    ----------
    verdict : Verdict
        How it went.
    peak_deg : float
        Largest deviation; 180 while the attitude is not finite.
    recover_s : float or None
        Time from the end of the fault (from its beginning, where it lasts) until the deviation stays small.
    end_deg : float
        Mean deviation of the last seconds.
    flagged : bool
        Whether a flag was raised during the fault or until the recovery.
    flags : tuple of str
        Names of those flags.
    errors : tuple of str
        Distinct messages of exceptions.
    """

    verdict: Verdict
    peak_deg: float = 0.0
    recover_s: float | None = None
    end_deg: float = 0.0
    flagged: bool = False
    flags: tuple[str, ...] = ()
    errors: tuple[str, ...] = ()

    def cell(self) -> str:
        """Short form for tables; a star says that a flag was raised."""
        star = "*" if self.flagged else ""
        match self.verdict:
            case Verdict.OK | Verdict.NOT_APPLICABLE:
                return self.verdict + star
            case Verdict.CLEAR_ERROR:
                return "error" + star
            case Verdict.NAN:
                return f"NaN{star}"
            case Verdict.WRONG:
                return f"WRONG {self.end_deg:.0f}°{star}"
            case _:
                return f"{self.peak_deg:.0f}°/{self.recover_s:.0f}s{star}"

    def summary(self) -> dict[str, Any]:
        """Ready for JSON."""
        return {
            "verdict": str(self.verdict),
            "peak_deg": self.peak_deg,
            "recover_s": self.recover_s,
            "end_deg": self.end_deg,
            "flagged": self.flagged,
            "flags": list(self.flags),
            "errors": list(self.errors),
        }


def judge(trace: Trace, *, begin: float, end: float, judged_from: float) -> Judgement:
    """Judge a trace.

    Parameters
    ----------
    trace : Trace
        The run.
    begin, end : float
        When the fault acted, s; an infinite end is one that lasts.
    judged_from : float
        Deviations before this time do not count, s.
    """
    lasts = end > trace.t[-1]
    seen = trace.t >= judged_from
    finite = np.isfinite(trace.excess_deg)
    excess = np.where(finite, trace.excess_deg, 180.0)
    peak = float(excess[seen].max())
    at_end = float(excess[trace.t >= trace.t[-1] - TAIL].mean())
    back = _back(trace.t, np.where(seen, excess, 0.0))
    watched = (trace.t >= begin) & (trace.t <= max(trace.t[-1] if lasts else end, back))
    flagged = bool(trace.raised[watched].any())
    verdict = _verdict(trace, bool(finite[-1]), peak, at_end, flagged)
    recover = max(0.0, back - (begin if lasts else end)) if at_end <= BACK_DEG and verdict != Verdict.NAN else None
    return Judgement(verdict, peak, recover, at_end, flagged, errors=trace.errors)


def _back(t: Floats, excess: Floats) -> float:
    """Time from which the deviation stays small, s; the last one where it never does."""
    far = np.flatnonzero(excess > BACK_DEG)
    return float(t[min(far[-1] + 1, t.size - 1)]) if far.size else float(t[0])


def _verdict(trace: Trace, finite: bool, peak: float, at_end: float, flagged: bool) -> Verdict:
    """Decide; an error without a text has told nobody anything."""
    if not finite:
        return Verdict.NAN
    good = peak <= OFF_DEG
    if trace.errors and trace.clear and (good or at_end <= BACK_DEG):
        return Verdict.CLEAR_ERROR
    if good and not trace.errors:
        return Verdict.OK
    if at_end > BACK_DEG:
        return Verdict.WRONG
    return Verdict.FLAGGED if flagged else Verdict.SILENT
