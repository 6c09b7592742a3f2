"""TSS1, the text line of motion sensors on ships: accelerations, heave, roll and pitch, 27 bytes and no checksum.

``:XXAAAASMHHHHQMRRRRSMPPPP<CR><LF>``: XX the horizontal acceleration, 3.835 cm/s² a count, and AAAA the vertical,
0.0625 cm/s² a count, two's complement, both hexadecimal; S a space; M a space or a minus; HHHH heave, cm; Q the
quality; RRRR roll and PPPP pitch, 0.01° [SBG Systems, description of the TSS1 output]. Other text lines (NMEA 0183) and
MAVLink have well-kept libraries.
"""

import re
from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.units import unit
from plumbob.protocols.decode import Counts, Frames
from plumbob.protocols.field import Field
from plumbob.protocols.format import Message
from plumbob.protocols.scan import Reads

SIZE: Final = 27
"""Bytes of a line."""

QUALITIES: Final = "UuGgHhFf"
"""Letters that the quality can be."""

_LINE: Final = re.compile(
    rb":([0-9A-Fa-f]{2})([0-9A-Fa-f]{4}) ([ -]\d{4})([" + QUALITIES.encode() + rb"])([ -]\d{4}) ([ -]\d{4})\r\n"
)

MESSAGE: Final = Message(
    "tss1",
    SIZE,
    (
        Field("acc_horizontal", 1, "u8", 2, unit="cm/s2", lsb=3.835),
        Field("acc_vertical", 3, "s16", 4, unit="cm/s2", lsb=0.0625),
        Field("heave", 8, "s16", 5, unit="cm", range=(-9999, 9999)),
        Field("quality", 13, "u8", 1, role="status", value=ord("H")),
        Field("roll", 14, "s16", 5, unit="deg", lsb=0.01, range=(-9999, 9999)),
        Field("pitch", 20, "s16", 5, unit="deg", lsb=0.01, range=(-9999, 9999)),
    ),
    "motion of a ship",
)
_LIMITS: Final = {"acc_horizontal": (0, 255), "acc_vertical": (-32768, 32767)} | {
    one.name: one.range for one in MESSAGE.fields if one.range
}


class Tss1Decoder:
    """Finds TSS1 lines in a stream, as `decode.Decoder` finds frames; the layout of all 27 bytes is the only check.

    Attributes
    ----------
    counts : Counts
        What became of every byte.
    """

    def __init__(self) -> None:
        self.counts = Counts(frames={MESSAGE.name: 0})
        self._pending = b""
        self._reads = Reads()
        self._done = 0

    def feed(self, data: bytes, t_ns: int = 0) -> dict[str, Frames]:
        """Take bytes, and return the lines that they complete.

        Parameters
        ----------
        data : bytes
            Next bytes of the stream.
        t_ns : int
            Host's time at which they were read, ns.
        """
        if data:
            self._reads.add(self._done + len(self._pending), t_ns)
        self.counts.received += len(data)
        return self._take(self._pending + data, final=False)

    def finish(self) -> dict[str, Frames]:
        """Say that the stream has ended: what is pending is junk."""
        return self._take(self._pending, final=True)

    def _take(self, whole: bytes, *, final: bool) -> dict[str, Frames]:
        found = list(_LINE.finditer(whole))
        behind = found[-1].end() if found else 0
        colon = whole.find(b":", max(behind, len(whole) - SIZE + 1))
        keep = len(whole) if final or colon < 0 else colon
        lines = self._frames(found) if found else {}
        self._pending = whole[keep:]
        self._done += keep
        self._reads.forget(self._done)
        self.counts.frames[MESSAGE.name] += len(found)
        self.counts.framed += SIZE * len(found)
        self.counts.pending = len(self._pending)
        self.counts.junk = self.counts.received - self.counts.framed - self.counts.pending
        return lines

    def _frames(self, found: list[re.Match[bytes]]) -> dict[str, Frames]:
        start = np.array([self._done + line.start() for line in found], dtype=np.int64)
        nothing = {"": np.zeros(len(found), dtype=np.uint32)}
        return {MESSAGE.name: Frames(MESSAGE, start, self._reads.times(start), _columns(found), nothing)}


def _columns(found: list[re.Match[bytes]]) -> dict[str, NDArray[np.float64] | NDArray[np.int64]]:
    counts = np.array([_counts(line) for line in found], dtype=np.int64).T
    return {
        one.name: column * unit(one.unit).factor * one.lsb if one.physical else column
        for one, column in zip(MESSAGE.fields, counts, strict=True)
    }


def _counts(line: re.Match[bytes]) -> tuple[int, ...]:
    across, up, heave, quality, roll, pitch = line.groups()
    vertical = int(up, 16)
    vertical -= 65536 if vertical > 32767 else 0
    return int(across, 16), vertical, int(heave), quality[0], int(roll), int(pitch)


def encode_tss1(columns: Mapping[str, ArrayLike]) -> bytes:
    """Lines of TSS1, one behind the other.

    Parameters
    ----------
    columns : mapping of str to array_like (N,)
        ``acc_horizontal`` and ``acc_vertical`` m/s², ``heave`` m, ``roll`` and ``pitch`` rad, ``quality`` as the code
        of its letter (``H`` where it is not given). Values beyond the range are cut to its end; one not given is 0.

    Raises
    ------
    ParameterError
        If a column is unknown, a value is not finite, or a quality is none of its letters.
    ShapeError
        If columns differ in length, or there is none.
    """
    given = {name: np.asarray(value, dtype=np.float64) for name, value in columns.items()}
    _require_columns(given)
    size = next(iter(given.values())).size
    counts = [_counts_for(one, given.get(one.name), size) for one in MESSAGE.fields]
    return b"".join(_line(*row) for row in np.stack(counts, axis=1).tolist())


def _require_columns(given: Mapping[str, NDArray[np.float64]]) -> None:
    known = [one.name for one in MESSAGE.fields]
    if unknown := set(given) - set(known):
        raise ParameterError(f"tss1 has no field '{min(unknown)}' to encode; known are {', '.join(known)}.")
    shapes = {value.shape for value in given.values()}
    if len(shapes) != 1 or len(next(iter(shapes))) != 1:
        raise ShapeError(f"columns of tss1 must be of shape (N,), all alike, but they are {sorted(shapes) or 'none'}.")
    for name, value in given.items():
        if not np.isfinite(value).all():
            raise ParameterError(f"{name} of tss1 must be finite, for a line has no word for a missing value.")
    if "quality" in given and not np.isin(given["quality"], list(QUALITIES.encode())).all():
        raise ParameterError(f"quality of tss1 must be the code of one of {QUALITIES}.")


def _counts_for(one: Field, value: NDArray[np.float64] | None, size: int) -> NDArray[np.int64]:
    if value is None:
        return np.full(size, one.value)
    if not one.physical:
        return value.astype(np.int64)
    return np.rint(np.clip(value / (unit(one.unit).factor * one.lsb), *_LIMITS[one.name])).astype(np.int64)


def _line(across: int, up: int, heave: int, quality: int, roll: int, pitch: int) -> bytes:
    parts = (
        f":{across:02X}{up & 0xFFFF:04X} ",
        f"{heave: 05d}",
        chr(quality),
        f"{roll: 05d}",
        " ",
        f"{pitch: 05d}",
        "\r\n",
    )
    return "".join(parts).encode()
