"""What can happen to frames on their way, drawn from a seed: each fault is known, so that finding it can be judged."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core.errors import ParameterError, unknown_name
from plumbob.protocols.format import Format
from plumbob.simulation.errors import stream

KINDS: Final[Mapping[str, str]] = {
    "unplug": "the port is gone for a second, and comes back as another one; frames in between are lost",
    "stall": "nothing comes for half a second, then all of it at once",
    "reset": "the device's clock starts again at 0",
    "jump": "the frame counter leaps ahead, though no frame is lost",
    "skip": "a frame is never sent, though it is counted",
    "flip": "one bit is wrong",
    "lose": "one byte is missing",
    "add": "one byte too many",
    "cut": "the frame ends early",
    "noise": "64 bytes of noise before the frame",
    "length": "one bit of the length is wrong",
    "burst": "a million bytes of noise before the frame",
}
"""Faults by name, and what they do. At most one befalls a frame; the one listed first wins."""

UNPLUGGED_NS: Final = 1_000_000_000
STALLED_NS: Final = 500_000_000
_FARTHEST: Final = 1000
_NOISE: Final = {"noise": 64, "burst": 1_000_000}


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault."""

    kind: str  # from `KINDS`
    frame: int  # the frame that it befalls, from 0
    t_ns: int  # when that frame was ready, ns from the start
    at: int  # byte of the stream as it went out where it begins
    count: int  # bits, bytes, frames or nanoseconds, as `unit` says
    unit: str  # what `count` counts

    def summary(self) -> dict[str, Any]:
        """Everything by name, for JSON."""
        return asdict(self)


@dataclass(frozen=True, eq=False, slots=True)
class Drawn:
    """Which frame has which fault, and what that does to the device itself."""

    kinds: Mapping[int, str]  # by frame, in order
    # device_ns, counter: (N,), the device's clock, ns, and frame counter
    device_ns: NDArray[np.int64]
    counter: NDArray[np.int64]


@dataclass(frozen=True, eq=False, slots=True)
class LineDamage:
    """What happens to frames on the line."""

    faults: tuple[Fault, ...]  # in order
    changed: Mapping[int, bytes]  # what goes out instead of a frame
    lost: NDArray[np.bool_]  # (N,), frames that never go out
    send_ns: NDArray[np.int64]  # (N,), when each goes out, ns from the start
    unplugged: Mapping[int, int]  # first frame for which the port is gone, to the first for which it is back


def draw(form: Format, rates: Mapping[str, float], due_ns: NDArray[np.int64], seed: int) -> Drawn:
    """Draw which frames have a fault, from the share of each kind and a random stream of its own; the first has none.

    `due_ns` (N,): when each frame is ready, ns from the start.
    """
    for kind, rate in rates.items():
        if kind not in KINDS:
            raise unknown_name("fault", kind, KINDS)
        if not 0.0 <= rate <= 1.0:
            raise ParameterError(f"fault {kind} must be a share of the frames, from 0 to 1, but it is {rate:g}.")
    if "length" in rates and form.framing.length_field is None:
        raise ParameterError(f"fault length needs a length in the frame, and {form.name} has none; leave it out.")
    kinds: dict[int, str] = {}
    for kind in (kind for kind in KINDS if kind in rates):
        hit = np.flatnonzero(stream(seed, "fault", kind).random(due_ns.size) < rates[kind])
        for i in hit[hit > 0].tolist():
            kinds.setdefault(i, kind)
    kinds = _without_hidden(dict(sorted(kinds.items())), due_ns)
    device_ns, counter, rng = due_ns.copy(), np.arange(due_ns.size), stream(seed, "fault", "leap")
    for i, kind in kinds.items():
        if kind == "reset":
            device_ns[i:] = due_ns[i:] - due_ns[i]
        if kind == "jump":
            counter[i:] += int(rng.integers(2, _FARTHEST))
    return Drawn(kinds, device_ns, counter)


def _without_hidden(kinds: dict[int, str], due_ns: NDArray[np.int64]) -> dict[int, str]:
    """Leave out faults of frames that nobody would see, because the port is gone."""
    back, visible = 0, {}
    for i, kind in kinds.items():
        if i >= back:
            visible[i] = kind
            back = _after(due_ns, i, UNPLUGGED_NS) if kind == "unplug" else i
    return visible


def _after(due_ns: NDArray[np.int64], frame: int, pause_ns: int) -> int:
    return int(np.searchsorted(due_ns, due_ns[frame] + pause_ns))


def damage(form: Format, drawn: Drawn, frames: NDArray[np.uint8], due_ns: NDArray[np.int64], seed: int) -> LineDamage:
    """Do to the frames (N, L) what was drawn."""
    count, length = frames.shape
    lost, send_ns = np.zeros(count, dtype=bool), due_ns.copy()
    changed: dict[int, bytes] = {}
    unplugged: dict[int, int] = {}
    places: dict[int, tuple[int, int, str]] = {}  # by frame: byte in what goes out, count and its unit
    rng = stream(seed, "fault", "bytes")
    for i, kind in drawn.kinds.items():
        if kind == "unplug":
            unplugged[i] = _after(due_ns, i, UNPLUGGED_NS)
            lost[i : unplugged[i]] = True
            places[i] = (0, unplugged[i] - i, "frames")
        elif kind == "stall":
            send_ns = np.where(np.arange(count) < i, send_ns, np.maximum(send_ns, due_ns[i] + STALLED_NS))
            places[i] = (0, STALLED_NS, "ns")
        elif kind == "skip":
            lost[i] = True
            places[i] = (0, 1, "frames")
        elif kind == "reset":
            places[i] = (0, int(due_ns[i] - due_ns[0]), "ns")
        elif kind == "jump":
            places[i] = (0, int(drawn.counter[i] - drawn.counter[i - 1] - 1), "frames")
        else:
            changed[i], *where = _spoilt(form, kind, frames[i].tobytes(), rng)
            places[i] = (where[0], where[1], "bits" if kind in ("flip", "length") else "bytes")
    sizes = np.where(lost, 0, length)
    for i, data in changed.items():
        sizes[i] = len(data)
    begins = np.cumsum(sizes) - sizes
    faults = tuple(
        Fault(kind, i, int(due_ns[i]), int(begins[i]) + places[i][0], places[i][1], places[i][2])
        for i, kind in drawn.kinds.items()
    )
    return LineDamage(faults, changed, lost, send_ns, unplugged)


def _spoilt(form: Format, kind: str, frame: bytes, rng: np.random.Generator) -> tuple[bytes, int, int]:
    """What goes out instead of a frame, where in it the fault begins, and how many bits or bytes it concerns."""
    at = int(rng.integers(len(frame)))
    if kind in _NOISE:
        return rng.bytes(_NOISE[kind]) + frame, 0, _NOISE[kind]
    if kind == "cut":
        keep = max(1, at)
        return frame[:keep], keep, len(frame) - keep
    if kind == "lose":
        return frame[:at] + frame[at + 1 :], at, 1
    if kind == "add":
        return frame[:at] + rng.bytes(1) + frame[at:], at, 1
    if rule := form.framing.length_field if kind == "length" else None:
        at = rule.at + at % rule.size
    wrong = bytearray(frame)
    wrong[at] ^= 1 << int(rng.integers(8))
    return bytes(wrong), at, 1
