"""Why a capture cannot calibrate anything: reasons with a name, in words, and with what to do about them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from plumbob.core.errors import CalibrationError

KINDS: Final = {
    "too-few": "fewer samples, poses or plateaus than the model has parameters",
    "level-ring": "the unit was only turned about the vertical while level",
    "cone": "the unit was only turned about one axis",
    "too-few-regions": "the directions that were seen do not determine the model",
    "outliers": "too many samples do not fit the others",
    "uneven-field": "the field differed from place to place by more than a calibration can bear",
    "magnet-moved": "the field changed during the capture: iron or a magnet moved",
    "mirrored": "axes of a sensor are swapped or have the wrong sign: the field turns or dips against the others",
    "turned-axes": "axes of a sensor are turned against those of the others",
    "clipping": "samples are at the end of the sensor's range",
    "wrong-gravity": "the specific force at rest is not that of gravity in the unit that is claimed",
    "wrong-field": "the field's strength is not that of the Earth in the unit that is claimed",
    "not-level": "the unit was inclined where it had to be level",
    "not-still": "the unit was not at rest where it had to be",
    "no-motion": "the unit was not moved as it had to be",
    "no-temperature": "the temperature is missing or did not change",
    "ill-conditioned": "the capture does not separate the parameters",
    "no-gain": "the calibration would rather harm than help: it changes little more than it may be wrong",
    "implausible": "the result is not a working sensor",
}
"""Every kind of reason, and what it means."""


@dataclass(frozen=True, slots=True)
class Reason:
    """One reason.

    Attributes
    ----------
    kind : str
        One of `KINDS`.
    text : str
        What is wrong, with figures.
    advice : str
        What to do.
    """

    kind: str
    text: str
    advice: str


class CaptureRefusedError(CalibrationError):
    """A capture cannot calibrate anything.

    Attributes
    ----------
    reasons : tuple of Reason
        At least one; the first is the one that matters most.
    """

    def __init__(self, *reasons: Reason) -> None:
        self.reasons = reasons
        super().__init__(" ".join(f"{r.kind}: {r.text} {r.advice}" for r in reasons))


def refuse(reasons: Sequence[Reason]) -> None:
    """Raise `CaptureRefusedError` where there is a reason."""
    if reasons:
        raise CaptureRefusedError(*reasons)
