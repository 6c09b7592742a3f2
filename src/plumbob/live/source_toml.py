"""The table [source] of a session, and the format of a Linux IIO device that it names."""

from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING, Any, Final

from plumbob.core import schema, units
from plumbob.core.errors import ParameterError, UnitError
from plumbob.core.schema import Parse
from plumbob.core.units import Quantity
from plumbob.data import TRIADS
from plumbob.live.session import SourceSpec
from plumbob.protocols.field import Field, Provenance
from plumbob.protocols.format import HEX, Format, Framing, Message

if TYPE_CHECKING:
    from plumbob.live.transports.iio_layout import IioChannel, IioLayout

CLOCK: Final = "t_ns"  # field with the kernel's time stamp

_ABI: Final = "IIO-ABI"

_DOCUMENTED: Final = {_ABI: "Linux, Documentation/ABI/testing/sysfs-bus-iio, and the device as the kernel showed it"}

_STAMPS: Final = {
    "": "the scans carry no time stamps",
    "monotonic": "time stamps are on the host's monotonic clock",
    "realtime": "time stamps are on the host's wall clock, which may step: this kernel knows no other",
}
_AXES: Final = ("x", "y", "z")


def iio_format(layout: "IioLayout", *, mounted: bool = True) -> Format:
    """Format of a device's scans: ``gyr.x`` and so on in the axes of the board, ``temp_c``, and the kernel's time.

    Mount matrices, where they are applied (`mounted`), must take every axis to an axis.
    """
    fields = tuple(
        _field(channel, CLOCK, at, "ns", 1.0, role="clock")
        if channel.name == "timestamp"
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


def _measured(layout: "IioLayout", channel: "IioChannel", at: int, mounted: bool) -> Field:
    head, _, axis = channel.column.rpartition("_")
    if head not in TRIADS or axis not in _AXES:
        return _field(channel, _plain_name(layout, channel), at, channel.unit_name, channel.scale)
    sign = 1
    if mounted and head in layout.mounts:
        axis, sign = _board_axis(layout, head, axis)
    return _field(channel, f"{head}.{axis}", at, channel.unit_name, sign * channel.scale)


def _plain_name(layout: "IioLayout", channel: "IioChannel") -> str:
    """Name of what belongs to no triad; the only temperature is that of the unit, whatever the driver numbers it."""
    thermometers = [c for c in layout.channels if c.name.startswith("temp")]
    return "temp_c" if thermometers == [channel] else channel.column


def _board_axis(layout: "IioLayout", triad: str, axis: str) -> tuple[str, int]:
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


def _field(channel: "IioChannel", name: str, at: int, unit: str, lsb: float, role: str = "value") -> Field:
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


def parse_source(where: str, value: Any) -> SourceSpec:
    """Source from its table."""
    kind = _KIND(f"{where}.kind", _TABLE(where, value).get("kind"))
    settings: dict[str, Any] = _SOURCES[kind](where, value)
    return SourceSpec(settings.pop("kind"), settings)


def _step(where: str, value: Any) -> bytes | float:
    """Command, or time to wait, s."""
    words = schema.text(where, value)
    try:
        return units.parse(words, Quantity.TIME) if units.split(words)[1] else HEX(where, words)
    except UnitError:
        return HEX(where, words)  # type: ignore[no-any-return]


_PORT: Final = schema.whole(1, 65535)
_RATE: Final = schema.size(Quantity.FREQUENCY)
_COUNT: Final = schema.whole(1)
_LINES: Final = {"lines": schema.text}
_STREAM: Final = {"gather": schema.size(Quantity.TIME), "speed": schema.positive, "rate": _RATE, **_LINES}
_PATIENT: Final = {**_STREAM, "time": schema.one_of("host", "count")}
"""Of streams whose sender waits for a reader that is late; datagrams are lost instead."""
_IIO: Final = {
    "device": schema.either(int, schema.whole(0), schema.text),
    "channels": schema.texts,
    "rate": _RATE,
    "mount": schema.truth,
    "sys_root": schema.text,
}
_BUFFER: Final = {"trigger": schema.text, "length": _COUNT, "watermark": _COUNT, "dev_root": schema.text}
_SPI: Final = {
    "bus": schema.whole(0),
    "device": schema.whole(0),
    "mode": schema.whole(0, 3),
    "hz": _COUNT,
    "rate": _RATE,
    "exchange": schema.listed(HEX, of="commands"),
}
_START: Final = schema.listed(schema.described(_step, type="string"), of="commands and times")
_KEYS: Final[Mapping[str, tuple[dict[str, Parse], Collection[str]]]] = {
    "serial": ({"port": schema.text, "baud": _COUNT, "wait": schema.truth, **_PATIENT}, ("port", "baud")),
    "udp": ({"host": schema.text, "port": _PORT, **_STREAM}, ("port",)),
    "file": ({"path": schema.text, "rate": _RATE, **_LINES}, ("path",)),
    "stdin": ({key: parse for key, parse in _PATIENT.items() if key != "gather"}, ()),
    "tcp": ({"host": schema.text, "port": _PORT, **_PATIENT}, ("host", "port")),
    "iio": (_IIO | _BUFFER, ("device",)),
    "iio-poll": (_IIO, ("device", "rate")),
    "spi": (_SPI | {"skip": schema.whole(0), "start": _START}, _SPI),
}
_SOURCES: Final = {
    kind: schema.form({"kind": schema.one_of(kind), **keys}, ("kind", *required))
    for kind, (keys, required) in _KEYS.items()
}
_TABLE: Final = schema.mapping(schema.anything)
_KIND: Final = schema.one_of(*_SOURCES)
schema.described(parse_source, anyOf=[schema.json_schema(parse) for parse in _SOURCES.values()])
