"""How the units of an array sit on their bodies, as TOML, read strictly."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from plumbob.core import schema
from plumbob.core.docs import guide
from plumbob.core.errors import DecodeError, PlumbobError, excerpt
from plumbob.core.files import text_of
from plumbob.core.schema import Parse
from plumbob.core.units import Quantity
from plumbob.data.array import PRESETS, UnitMount
from plumbob.data.cards import CalibrationCard, NoiseCard
from plumbob.rotations import body_axes, quat_from_dcm, quat_from_euler_zyx

KIND: Final = "plumbob array"
VERSION: Final = 1
GUIDE: Final = guide("sessions.md")

Fetch = Callable[[str], str]
"""Gives the text of a file that is named."""


@dataclass(frozen=True, slots=True)
class MountedUnit:
    """What a table ``[[unit]]`` says.

    Attributes
    ----------
    name : str
        Name of the unit.
    mount : UnitMount
        How it sits on its body, with its noise card.
    card : CalibrationCard or None
        Its calibration card.
    device : str
        Name of this unit, to which its calibration card belongs; empty where it is not said.
    """

    name: str
    mount: UnitMount = field(default_factory=UnitMount)
    card: CalibrationCard | None = None
    device: str = ""


def load_units(path: str | Path) -> dict[str, MountedUnit]:
    """Read what a file, or a preset such as ``"arm"``, says of the units of an array, by name.

    Parameters
    ----------
    path : path
        The file; cards that it names lie beside it. Or the name of one of `plumbob.data.array.PRESETS`.

    Raises
    ------
    DecodeError
        If a file is missing or no TOML, or a key is unknown, missing or of the wrong type.
    UnitError, FrameError, CalibrationError, ParameterError
        If a value cannot be what it should be.
    """
    if str(path) in PRESETS:
        return {name: MountedUnit(name, mount) for name, mount in PRESETS[str(path)].items()}
    text, file = text_of(path), Path(path)
    try:
        table = schema.section("array", schema.toml(text, GUIDE), _ARRAY, ("kind", "version", "unit"), top=True)
        return listed_units(table["unit"], lambda name: text_of(file.parent / name))
    except PlumbobError as error:
        raise type(error)(f"{file}: {error}") from error


def listed_units(tables: list[dict[str, Any]], fetch: Fetch) -> dict[str, MountedUnit]:
    """Units of the tables that `UNIT` has parsed, by name.

    Raises
    ------
    DecodeError
        If a name stands twice, there is more than one rotation, or a card cannot be read.
    """
    units: dict[str, MountedUnit] = {}
    for table in tables:
        name, card, noise = table["name"], table.get("card"), table.get("noise")
        if name in units:
            raise DecodeError(f"the unit '{name}' stands twice; keep one of them.")
        turns = [table[key] for key in _TURNS if key in table]
        if len(turns) > 1:
            raise DecodeError(f"the unit '{name}' has more than one of {', '.join(_TURNS)}; keep one of them.")
        mount = UnitMount(
            q_bs=turns[0] if turns else (1.0, 0.0, 0.0, 0.0),
            lever_b=table.get("lever", (0.0, 0.0, 0.0)),
            clock_offset=table.get("clock_offset", 0.0),
            noise=None if noise is None else NoiseCard.from_text(fetch(noise), noise),
        )
        calibration = None if card is None else CalibrationCard.from_text(fetch(card), card)
        units[name] = MountedUnit(name, mount, calibration, table.get("device", ""))
    return units


def _axes(where: str, value: Any) -> tuple[float, ...]:
    return tuple(quat_from_dcm(body_axes(schema.text(where, value))).tolist())


def _listed(parse: Parse, count: int) -> Parse:
    """Parser of a list of so many values."""

    def parse_all(where: str, value: Any) -> tuple[float, ...]:
        if not isinstance(value, list) or len(value) != count:
            raise DecodeError(f"{where} must be a list of {count} values, but it is {excerpt(str(value))}.")
        return tuple(parse(where, entry) for entry in value)

    return parse_all


def _rotation(where: str, value: Any) -> tuple[float, ...]:
    """Roll, pitch and yaw of the unit from the body's axes."""
    words = schema.text(where, value).split(",")
    if len(words) != 3:
        raise DecodeError(
            f"{where} must be roll, pitch and yaw, as in '0 deg, 5 deg, 90 deg', but it is {excerpt(value)}."
        )
    roll, pitch, yaw = (schema.quantity(Quantity.ANGLE)(where, word) for word in words)
    return tuple(quat_from_euler_zyx([yaw, pitch, roll]).tolist())


_TURNS: Final[dict[str, Parse]] = {"axes": _axes, "q_bs": _listed(schema.number, 4), "rotation": _rotation}
UNIT: Final = schema.form(
    {
        "name": schema.text,
        **_TURNS,
        "lever": _listed(schema.quantity(Quantity.LENGTH), 3),
        "clock_offset": schema.quantity(Quantity.TIME),
        "device": schema.text,
        "card": schema.text,
        "noise": schema.text,
    },
    ("name",),
)
"""Parser of a table ``[[unit]]``, of an array's file and of a session's."""
_ARRAY: Final[dict[str, Parse]] = {
    "kind": schema.one_of(KIND),
    "version": schema.version(VERSION),
    "unit": schema.tables(UNIT),
}
