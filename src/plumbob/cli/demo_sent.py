"""Whether the demo recorded what its emulated buoy sent: every sample, its values and its time."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from plumbob.check import Floats
    from plumbob.data import ImuData
    from plumbob.sensors.decode import Counts

_SAME_TIME: Final = 1e-6
"""s: the buoy's clock counts microseconds."""


def require_as_sent(recorded: "ImuData | None", sent: "ImuData", counts: "Counts") -> None:
    """Refuse a recording that is not what was sent.

    Parameters
    ----------
    recorded : ImuData or None
        Samples in the recording, uncalibrated.
    sent : ImuData
        Samples that the emulation put into its frames.
    counts : Counts
        What became of the bytes.

    Raises
    ------
    DecodeError
        With all that differs.
    """
    from plumbob.errors import DecodeError

    wrong = [*_bytes(counts), *(_samples(recorded, sent) if recorded is not None else ("no sample was recorded",))]
    if wrong:
        raise DecodeError(
            f"the recording is not what was sent: {'; '.join(wrong)}. No figure of this demo can be trusted. Run it "
            "again; if that gives the same, please report it, with what this machine was doing meanwhile."
        )


def _bytes(counts: "Counts") -> Iterator[str]:
    if counts.framed < counts.received:
        yield f"{counts.received - counts.framed} of {counts.received} bytes belong to no whole frame"


def _samples(recorded: "ImuData", sent: "ImuData") -> Iterator[str]:
    import numpy as np

    from plumbob import flags

    if len(recorded) != len(sent):
        yield f"recorded {len(recorded)} of {len(sent)} samples"
    size = min(len(recorded), len(sent))
    ours, theirs = _table(recorded, size), _table(sent, size)
    differ = ((ours != theirs) & ~(np.isnan(ours) & np.isnan(theirs))).any(axis=1)
    if differ.any():
        yield f"values differ in {np.count_nonzero(differ)} of {size}, first at {sent.t[np.argmax(differ)]:.2f} s"
    late = float(np.abs(recorded.t[:size] - recorded.t[0] - sent.t[:size] + sent.t[0]).max())
    if late > _SAME_TIME:
        yield f"times are wrong by up to {late:.6g} s"
    long, due = (float(imu.t[-1] - imu.t[0]) for imu in (recorded, sent))
    if abs(long - due) > _SAME_TIME:
        yield f"they last {long:.2f} s instead of {due:.2f} s"
    if gaps := int(np.count_nonzero(recorded.flags & np.uint32(flags.GAP))):
        yield "1 gap is flagged" if gaps == 1 else f"{gaps} gaps are flagged"


def _table(imu: "ImuData", size: int) -> "Floats":
    """What was measured, a row for each of the first samples; the emulation has rounded it to the wire's counts."""
    import numpy as np

    return np.column_stack([getattr(imu, name)[:size] for name in imu.triads])
