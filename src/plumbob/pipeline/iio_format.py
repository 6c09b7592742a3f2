"""What an IIO device's bytes mean, as a format: the kernel says it, so a session of one has no [format]."""

from typing import TYPE_CHECKING, Final

from plumbob.data import TRIADS
from plumbob.errors import ParameterError
from plumbob.sensors.field import Field, Provenance
from plumbob.sensors.format import Format, Framing, Message

if TYPE_CHECKING:
    from plumbob.acquire.iio_layout import IioChannel, IioLayout

CLOCK: Final = "t_ns"
"""Field with the kernel's time stamp."""

_ABI: Final = "IIO-ABI"
_SOURCES: Final = {_ABI: "Linux, Documentation/ABI/testing/sysfs-bus-iio, and the device as the kernel showed it"}
_STAMPS: Final = {
    "": "the scans carry no time stamps",
    "monotonic": "time stamps are on the host's monotonic clock",
    "realtime": "time stamps are on the host's wall clock, which may step: this kernel knows no other",
}
_AXES: Final = ("x", "y", "z")


def iio_format(layout: "IioLayout", *, mounted: bool = True) -> Format:
    """Format of a device's scans: ``gyr.x`` and so on in the axes of the board, ``temp_c``, and the kernel's time.

    Parameters
    ----------
    layout : IioLayout
        What the kernel says.
    mounted : bool
        Whether mount matrices are applied; each must then take every axis to an axis.

    Raises
    ------
    ParameterError
        If a mount matrix does more than that, or an element of a scan holds several numbers.
    """
    fields = tuple(
        _stamp(channel, at) if channel.name == "timestamp" else _measured(layout, channel, at, mounted)
        for channel, at in zip(layout.channels, layout.places, strict=True)
    )
    return Format(
        name=layout.device,
        title=f"{layout.device} behind the kernel's IIO driver",
        framing=Framing(length=layout.size),
        messages=(Message(layout.device, layout.size, fields),),
        sources=_SOURCES,
        facts={"clock": (_STAMPS[layout.clock], Provenance(_ABI))},
    )


def _stamp(channel: "IioChannel", at: int) -> Field:
    return _field(channel, CLOCK, at, "ns", 1.0, role="clock")


def _measured(layout: "IioLayout", channel: "IioChannel", at: int, mounted: bool) -> Field:
    head, _, axis = channel.column.rpartition("_")
    if head not in TRIADS or axis not in _AXES:
        return _field(channel, _plain_name(layout, channel), at, channel.unit_name, channel.scale)
    sign = 1
    if mounted and head in layout.mounts:
        axis, sign = _turned(layout, head, axis)
    return _field(channel, f"{head}.{axis}", at, channel.unit_name, sign * channel.scale)


def _plain_name(layout: "IioLayout", channel: "IioChannel") -> str:
    """Name of what belongs to no triad; the only temperature is that of the unit, whatever the driver numbers it."""
    thermometers = [one for one in layout.channels if one.name.startswith("temp")]
    return "temp_c" if thermometers == [channel] else channel.column


def _turned(layout: "IioLayout", triad: str, axis: str) -> tuple[str, int]:
    """Axis of the board that an axis of the chip is, and its sign."""
    matrix = layout.mounts[triad]
    lines = [*matrix, *zip(*matrix, strict=True)]
    if any(sorted(map(abs, line)) != [0.0, 0.0, 1.0] for line in lines):
        raise ParameterError(
            f"{layout.device}: the mount matrix of {triad} is {matrix}, which turns no axis into an axis; "
            "say mount = false to leave it out, and put it into the calibration card."
        )
    column = [row[_AXES.index(axis)] for row in matrix]
    board = next(i for i, value in enumerate(column) if value)
    return _AXES[board], round(column[board])


def _field(channel: "IioChannel", name: str, at: int, unit: str, lsb: float, role: str = "value") -> Field:
    kind = channel.type
    if kind.repeat > 1:
        raise ParameterError(f"{channel.name} holds {kind.repeat} numbers ({kind}); leave it out of the channels.")
    whole = kind.bits == kind.storage
    return Field(
        name=name,
        at=at,
        type=f"{'s' if kind.signed else 'u'}{kind.storage}",
        size=kind.size,
        order="little" if kind.order == "<" else "big",
        bits=None if whole else (kind.shift + kind.bits - 1, kind.shift),
        unit=unit,
        lsb=lsb,
        raw_offset=channel.offset,
        role=role,
        origin=Provenance(_ABI),
    )
