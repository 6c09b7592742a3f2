"""What one scan of a Linux IIO buffer holds, in which units, and the format of such scans.

Sources: Linux, Documentation/ABI/testing/sysfs-bus-iio (types, units, mount matrix); drivers/iio/industrialio-buffer.c
(order, alignment and padding of a scan).
"""

import json
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Final

from plumbob.core import schema
from plumbob.core.errors import DecodeError, ParameterError, UnitError, one_line
from plumbob.data import TRIADS
from plumbob.protocols.field import Field, Provenance
from plumbob.protocols.format import Format, Framing, Message

_TYPE: Final = re.compile(r"(le|be):([su])(\d+)/(\d+)(?:X(\d+))?(?:>>(\d+))?")


@dataclass(frozen=True, slots=True)
class IioType:
    """How a number lies in memory."""

    order: str  # ``"<"`` or ``">"``
    signed: bool  # two's complement
    # bits, storage, shift: bits that hold the number, of so many in memory, after a shift to the right
    bits: int
    storage: int
    repeat: int = 1  # how many of them follow each other
    shift: int = 0

    @property
    def size(self) -> int:
        """Bytes of all repeats, which is their alignment too."""
        return self.storage // 8 * self.repeat

    def __str__(self) -> str:
        order, sign = "le" if self.order == "<" else "be", "s" if self.signed else "u"
        repeat = f"X{self.repeat}" if self.repeat > 1 else ""
        return f"{order}:{sign}{self.bits}/{self.storage}{repeat}>>{self.shift}"


def parse_type(text: str) -> IioType:
    """Read a type as the kernel writes it, such as ``le:s12/16>>4`` or ``be:s32/32X4>>0``."""
    match = _TYPE.fullmatch(text.strip())
    if match is None:
        raise ParameterError(f"{text!r} is not the type of a scan element. Write it as le:s12/16>>4.")
    order, sign, bits, storage, repeat, shift = match.groups()
    kind = IioType(
        "<" if order == "le" else ">", sign == "s", int(bits), int(storage), int(repeat or 1), int(shift or 0)
    )
    if kind.storage not in {8, 16, 32, 64} or not 0 < kind.bits <= kind.storage - kind.shift or kind.repeat < 1:
        raise ParameterError(f"{text!r}: {bits} bits do not fit into {storage} after a shift by {shift or 0}.")
    return kind


TIMESTAMP: Final = "timestamp"
_CLOCKS: Final = ("monotonic", "realtime")

_NAME = re.compile(r"([a-z]+)(.*)")
_KINDS: Final = {
    "anglvel": ("gyr", "rad/s"),
    "accel": ("acc", "m/s2"),
    "magn": ("mag", "gauss"),
    "temp": ("temp_c", "mdegC"),
}
_AXES = "xyz"
Matrix = tuple[tuple[float, ...], ...]


@dataclass(frozen=True, slots=True)
class IioChannel:
    """One element of a scan."""

    name: str  # as the kernel calls it, such as ``anglvel_x``
    index: int  # its place in the order of the scan
    type: IioType  # how it lies in memory
    # scale, offset: ``(raw + offset) * scale`` is in IIO's unit
    scale: float = 1.0
    offset: float = 0.0

    @property
    def column(self) -> str:
        """Our name, such as ``gyr_x``; ``temp_c`` is in °C."""
        kind, rest = _split(self.name)
        return _KINDS[kind][0] + rest

    @property
    def unit_name(self) -> str:
        """Name of IIO's unit."""
        return iio_unit(self.name)


def iio_unit(name: str) -> str:
    """Name of the unit in which IIO gives a channel: rad/s, m/s², gauss, or thousandths of °C."""
    kind, _ = _split(name)
    if kind not in _KINDS:
        raise UnitError(
            f"The IIO channel '{name}' is none of {', '.join(_KINDS)}, so its unit is unknown. Leave it out."
        )
    return _KINDS[kind][1]


def is_known(name: str) -> bool:
    """Whether a channel is a time stamp, or measures something whose unit is known."""
    return name == TIMESTAMP or _split(name)[0] in _KINDS


def _split(name: str) -> tuple[str, str]:
    match = _NAME.fullmatch(name)
    return (match[1], match[2]) if match else (name, "")


@dataclass(frozen=True)
class IioLayout:
    """What the bytes of a device's scans mean, in `size` bytes each.

    Each element lies at a multiple of its own size, in the order of its index, and the whole is padded to a multiple of
    the largest. (Kernels before 5.5 do not pad, which only shows where no time stamp is enabled.) `mounts` (3, 3) lead
    from the chip's axes to those of the board, as the device tree says. `clock`: ``"monotonic"``, or ``"realtime"``
    where the kernel knows no other (before 4.5); empty where there are no time stamps.
    """

    device: str
    channels: tuple[IioChannel, ...]
    mounts: Mapping[str, Matrix] = field(default_factory=dict)
    clock: str = ""

    def __post_init__(self) -> None:
        if not self.channels:
            raise ParameterError(f"{self.device}: no channel is chosen.")
        for channel in self.channels:
            if channel.name != TIMESTAMP:
                iio_unit(channel.name)
        for triad, matrix in self.mounts.items():
            _check_mount(self.device, triad, matrix, self._axes(triad))

    @property
    def size(self) -> int:
        """Bytes in a scan."""
        return self._places()[1]

    @property
    def places(self) -> list[int]:
        """Byte of a scan at which each channel begins."""
        return self._places()[0]

    def to_json(self) -> str:
        """One line of text that `from_json` reads, to lie beside raw scans in a recording."""
        channels = [{**asdict(channel), "type": str(channel.type)} for channel in self.channels]
        return json.dumps(asdict(self) | {"channels": channels})

    @staticmethod
    def from_json(text: str) -> "IioLayout":
        """Layout from the text of `to_json`; DecodeError where it is none."""
        try:
            layout: IioLayout = _LAYOUT("layout", json.loads(text))
        except (ValueError, RecursionError) as error:
            raise DecodeError(f"This is not a layout of IIO scans, or it is damaged: {one_line(error)}") from error
        return layout

    def _places(self) -> tuple[list[int], int]:
        places, end, largest = [], 0, 1
        for channel in self.channels:
            size = channel.type.size
            places.append(_aligned(end, size))
            end = places[-1] + size
            largest = max(largest, size)
        return places, _aligned(end, largest)

    def _axes(self, triad: str) -> list[int]:
        there = {channel.column for channel in self.channels if channel.name != TIMESTAMP}
        return [i for i, axis in enumerate(_AXES) if f"{triad}_{axis}" in there]


_CHANNEL: Final = schema.table(IioChannel, type=schema.converted(parse_type))
_LAYOUT: Final = schema.table(
    IioLayout, channels=schema.listed(_CHANNEL), clock=schema.one_of("", *_CLOCKS),
    mounts=schema.mapping(schema.listed(schema.listed(schema.number, 3), 3)),
)  # fmt: skip


def _aligned(at: int, size: int) -> int:
    return -(-at // size) * size


def _check_mount(device: str, triad: str, matrix: Matrix, axes: list[int]) -> None:
    if axes and len([i for i in range(3) if all(matrix[i][j] == 0.0 for j in range(3) if j not in axes)]) != len(axes):
        raise ParameterError(
            f"{device}: the mount matrix of {triad} mixes axes that are not all enabled "
            f"({', '.join(_AXES[j] for j in axes)} are); choose all of them."
        )


CLOCK: Final = "t_ns"  # field with the kernel's time stamp
_ABI: Final = "IIO-ABI"
_DOCUMENTED: Final = {_ABI: "Linux, Documentation/ABI/testing/sysfs-bus-iio, and the device as the kernel showed it"}

_STAMPS: Final = {
    "": "the scans carry no time stamps",
    "monotonic": "time stamps are on the host's monotonic clock",
    "realtime": "time stamps are on the host's wall clock, which may step: this kernel knows no other",
}


def iio_format(layout: IioLayout, *, mounted: bool = True) -> Format:
    """Format of a device's scans: ``gyr.x`` and so on in the axes of the board, ``temp_c``, and the kernel's time.

    Mount matrices, where they are applied (`mounted`), must take every axis to an axis.
    """
    fields = tuple(
        _field(channel, CLOCK, at, "ns", 1.0, role="clock")
        if channel.name == TIMESTAMP
        else _measured(layout, channel, at, mounted)
        for channel, at in zip(layout.channels, layout.places, strict=True)
    )
    return Format(
        name=layout.device,
        title=f"{layout.device} behind the kernel's IIO driver",
        framing=Framing(length=layout.size),
        messages=(Message(layout.device, layout.size, fields),),
        sources=_DOCUMENTED,
        facts={"clock": (_STAMPS[layout.clock], Provenance(_ABI))},
    )


def _measured(layout: IioLayout, channel: IioChannel, at: int, mounted: bool) -> Field:
    head, _, axis = channel.column.rpartition("_")
    if head not in TRIADS or axis not in _AXES:
        return _field(channel, _plain_name(layout, channel), at, channel.unit_name, channel.scale)
    sign = 1
    if mounted and head in layout.mounts:
        axis, sign = _board_axis(layout, head, axis)
    return _field(channel, f"{head}.{axis}", at, channel.unit_name, sign * channel.scale)


def _plain_name(layout: IioLayout, channel: IioChannel) -> str:
    """Name of what belongs to no triad; the only temperature is that of the unit, whatever the driver numbers it."""
    thermometers = [c for c in layout.channels if c.name.startswith("temp")]
    return "temp_c" if thermometers == [channel] else channel.column


def _board_axis(layout: IioLayout, triad: str, axis: str) -> tuple[str, int]:
    """Axis of the board that an axis of the chip is, and its sign."""
    matrix = layout.mounts[triad]
    lines = [*matrix, *zip(*matrix, strict=True)]
    if any(sorted(map(abs, line)) != [0.0, 0.0, 1.0] for line in lines):
        raise ParameterError(
            f"{layout.device}: the mount matrix of {triad} is {matrix}, which does not map axes to axes. "
            "Set mount = false to leave it out, and put it into the calibration card."
        )
    column = [row[_AXES.index(axis)] for row in matrix]
    board = next(i for i, value in enumerate(column) if value)
    return _AXES[board], round(column[board])


def _field(channel: IioChannel, name: str, at: int, unit: str, lsb: float, role: str = "value") -> Field:
    kind = channel.type
    if kind.repeat > 1:
        raise ParameterError(f"{channel.name} holds {kind.repeat} numbers ({kind}); leave it out of the channels.")
    is_full = kind.bits == kind.storage
    return Field(
        name=name,
        at=at,
        type=f"{'s' if kind.signed else 'u'}{kind.storage}",
        size=kind.size,
        order="little" if kind.order == "<" else "big",
        bits=None if is_full else (kind.shift + kind.bits - 1, kind.shift),
        unit=unit,
        lsb=lsb,
        raw_offset=channel.offset,
        role=role,
        origin=Provenance(_ABI),
    )
