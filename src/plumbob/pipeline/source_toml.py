"""The table [source] of a session, strictly."""

from collections.abc import Mapping
from typing import Any, Final

from plumbob import forms, units
from plumbob.errors import DecodeError, UnitError, excerpt
from plumbob.forms import Parse
from plumbob.pipeline.session import SourceSpec
from plumbob.units import Quantity


def parse_source(where: str, value: Any) -> SourceSpec:
    """Source from its table.

    Raises
    ------
    DecodeError
        If its kind or a key is unknown, missing or of the wrong type.
    UnitError
        If a unit is missing or wrong.
    """
    named = forms.section(where, value, {**dict.fromkeys(value, _anything), "kind": forms.one_of(*_SOURCES)}, ("kind",))
    kind = named["kind"]
    known, required = _SOURCES[kind]
    found = forms.section(where, value, {"kind": forms.text, **known}, required)
    return SourceSpec(kind, {key: item for key, item in found.items() if key != "kind"})


def _anything(where: str, value: Any) -> Any:
    return value


def _which(where: str, value: Any) -> str | int:
    """Name of a device, or its number."""
    return forms.whole(0)(where, value) if isinstance(value, int) else forms.text(where, value)


def _command(where: str, value: Any) -> bytes:
    try:
        data = bytes.fromhex(forms.text(where, value))
    except ValueError:
        data = b""
    if not data:
        raise DecodeError(f"{where} must be bytes in hex, as in '20 00 00 00', but it is {excerpt(str(value))}.")
    return data


def _commands(where: str, value: Any) -> tuple[bytes, ...]:
    return tuple(_command(where, item) for item in forms.texts(where, value))


def _steps(where: str, value: Any) -> tuple[bytes | float, ...]:
    """Commands, and times to wait between them, s."""
    return tuple(_step(where, item) for item in forms.texts(where, value))


def _step(where: str, text: str) -> bytes | float:
    try:
        return units.parse(text, Quantity.TIME) if units.split(text)[1] else _command(where, text)
    except UnitError:
        return _command(where, text)


_PORT: Final = forms.whole(1, 65535)
_RATE: Final = forms.size(Quantity.FREQUENCY)
_STREAM: Final[dict[str, Parse]] = {"gather": forms.size(Quantity.TIME), "speed": forms.positive, "rate": _RATE}
_PATIENT: Final[dict[str, Parse]] = {**_STREAM, "time": forms.one_of("host", "count")}
"""Of streams whose sender waits for a reader that is late; datagrams are lost instead."""
_IIO: Final[dict[str, Parse]] = {
    "device": _which,
    "channels": forms.texts,
    "rate": _RATE,
    "mount": forms.truth,
    "sys_root": forms.text,
}
_SOURCES: Final[Mapping[str, tuple[dict[str, Parse], tuple[str, ...]]]] = {
    "serial": (
        {"port": forms.text, "baud": forms.whole(1), "wait": forms.truth, **_PATIENT},
        ("port", "baud"),
    ),
    "udp": ({"host": forms.text, "port": _PORT, **_STREAM}, ("port",)),
    "file": ({"path": forms.text, "rate": _RATE}, ("path",)),
    "tcp": ({"host": forms.text, "port": _PORT, **_PATIENT}, ("host", "port")),
    "iio": (
        {
            **_IIO,
            "trigger": forms.text,
            "length": forms.whole(1),
            "watermark": forms.whole(1),
            "dev_root": forms.text,
        },
        ("device",),
    ),
    "iio-poll": (_IIO, ("device", "rate")),
    "spi": (
        {
            "bus": forms.whole(0),
            "device": forms.whole(0),
            "mode": forms.whole(0, 3),
            "hz": forms.whole(1),
            "rate": _RATE,
            "exchange": _commands,
            "skip": forms.whole(0),
            "start": _steps,
        },
        ("bus", "device", "mode", "hz", "rate", "exchange"),
    ),
}
