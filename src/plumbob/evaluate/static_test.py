"""Static test: attitudes at rest against a reference, with and without a calibration, pose by pose [Yu2018]."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from plumbob.check import Floats
from plumbob.evaluate.evaluation import Evaluation
from plumbob.evaluate.statistics import Stats
from plumbob.rotations import euler_zyx_from_quat
from plumbob.units import to_deg

ANGLES: Final = ("yaw", "pitch", "roll")


@dataclass(frozen=True, eq=False)
class StaticTest:
    """Result of a static test of M rests.

    Attributes
    ----------
    spans : ndarray (M, 2)
        Beginning and end of each rest, s.
    before, after : Evaluation
        Tilt and compass of the means of each rest, as measured and calibrated; one sample per rest.
    """

    spans: Floats
    before: Evaluation
    after: Evaluation

    @property
    def reference(self) -> Floats:
        """Yaw, pitch and roll of the reference, (M, 3), rad; NaN where it tells none."""
        return euler_zyx_from_quat(self.before.match.q_ref)

    def errors(self, which: str) -> Floats:
        """Errors of yaw, pitch and roll, (M, 3), rad, "before" or "after"; NaN where there is no reference."""
        e: Evaluation = getattr(self, which)
        nothing = np.full(len(self.spans), np.nan)
        return np.stack([e.errors[name] if name in e.stats else nothing for name in ANGLES], axis=1)

    @property
    def remarks(self) -> tuple[str, ...]:
        """What to know about it, each a line."""
        removed = [
            f"heading {which}: a constant offset of {to_deg(e.alignment.heading):+.2f}° was removed"
            for which, e in (("before", self.before), ("after", self.after))
            if e.alignment.heading is not None
        ]
        made = f"after: {self.after.estimate.source}"
        return (made, *removed, *dict.fromkeys((*self.after.not_scored.values(), *self.after.notes)))

    def as_dict(self) -> dict[str, Any]:
        """Ready for JSON: degrees and seconds; None where there is no figure."""
        rows = zip(self.spans.tolist(), self.reference, self.errors("before"), self.errors("after"), strict=True)
        return {
            "rests": [
                {"from_s": first, "to_s": last, "reference_deg": _degrees(ref), **_pair(before, after)}
                for (first, last), ref, before, after in rows
            ],
            "summary": {name: _summary(self.before.stats.get(name), self.after.stats.get(name)) for name in ANGLES},
            "remarks": list(self.remarks),
        }

    def text(self) -> str:
        """Table of the rests, largest errors and root mean squares below, degrees."""
        return "\n".join(_lines(self))


def _lines(test: StaticTest) -> Iterator[str]:
    yield f"Static test, {len(test.spans)} rests: tilt and compass of their means against the reference, degrees"
    yield ""
    yield f"{'':>4}{'at, s':>8}{'reference':^24}{'error before':^24}{'error after':^24}"
    yield f"{'':12}{''.join(f'{name:>8}' for _ in range(3) for name in ANGLES)}"
    numbers = np.hstack((test.reference, test.errors("before"), test.errors("after")))
    for i, (span, row) in enumerate(zip(test.spans, numbers, strict=True), start=1):
        yield f"{i:4d}{span.mean():8.1f}{''.join(map(_cell, row.tolist()))}"
    for label, figure in (("max |error|", "max_abs"), ("rms", "rmse")):
        stats = [getattr(test, which).stats.get(name) for which in ("before", "after") for name in ANGLES]
        yield f"{label:36}{''.join(_cell(math.nan if s is None else getattr(s, figure)) for s in stats)}"
    yield from test.remarks


def _cell(angle: float) -> str:
    return f"{to_deg(angle):z8.2f}" if math.isfinite(angle) else f"{'-':>8}"


def _degrees(angles: Floats) -> dict[str, float | None]:
    return {n: to_deg(a) if math.isfinite(a) else None for n, a in zip(ANGLES, angles.tolist(), strict=True)}


def _pair(before: Floats, after: Floats) -> dict[str, dict[str, float | None]]:
    return {"before_deg": _degrees(before), "after_deg": _degrees(after)}


def _summary(before: Stats | None, after: Stats | None) -> dict[str, float | None]:
    both = (("before", before), ("after", after))
    return {
        f"{figure}_{label}_deg": None if s is None else to_deg(getattr(s, name))
        for figure, name in (("max", "max_abs"), ("rms", "rmse"))
        for label, s in both
    }
