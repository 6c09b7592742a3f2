"""How the units of an array sit on their bodies, as TOML, read strictly."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from plumbob.core import schema
from plumbob.core.errors import DecodeError
from plumbob.core.files import reading, text_of
from plumbob.core.resources import guide
from plumbob.core.units import Quantity
from plumbob.data.array import PRESETS, UnitMount
from plumbob.rotations import body_axes, quat_from_dcm, quat_from_euler_zyx

if TYPE_CHECKING:
    from plumbob.data.cards import CalibrationCard

KIND: Final = "plumbob array"
VERSION: Final = 1
GUIDE: Final = guide("sessions.md")

Fetch = Callable[[str], str]  # Gives the text of a file that is named


@dataclass(frozen=True, slots=True)
class MountedUnit:
    """What a table ``[[unit]]`` says."""

    name: str  # name of the unit
    mount: UnitMount = field(default_factory=UnitMount)  # how it sits on its body, with its noise card
    card: "CalibrationCard | None" = None  # its calibration card
    device: str = ""  # name of this unit, to which its calibration card belongs; empty where it is not said


def load_units(path: str | Path) -> dict[str, MountedUnit]:
    """What a file, beside the cards that it names, or one of `PRESETS` says of the units of an array, by name."""
    if str(path) in PRESETS:
        return {name: MountedUnit(name, mount) for name, mount in PRESETS[str(path)].items()}
    text, file = text_of(path), Path(path)
    with reading(file):
        tables = schema.document(text, GUIDE, ARRAY)["unit"]
        return listed_units(tables, lambda name: text_of(file.parent / name))


def listed_units(tables: Iterable[dict[str, Any]], fetch: Fetch) -> dict[str, MountedUnit]:
    """Units of the tables that `UNIT` has parsed, by name."""
    from plumbob.data.cards import CalibrationCard, NoiseCard  # chains, which share parsers, need no cards

    units: dict[str, MountedUnit] = {}
    for table in tables:
        name, card, noise = table["name"], table.get("card"), table.get("noise")
        if name in units:
            raise DecodeError(f"the unit '{name}' occurs twice; keep one of them.")
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


_ANGLES: Final = schema.listed(
    schema.quantity(Quantity.ANGLE),
    3,
    of="angles, roll, pitch and yaw, as in '0 deg, 5 deg, 90 deg'",
    names=("roll", "pitch", "yaw"),
)


def _rotation(where: str, value: Any) -> tuple[float, ...]:
    """Roll, pitch and yaw of the unit from the body's axes."""
    return tuple(quat_from_euler_zyx(_ANGLES(where, schema.text(where, value).split(","))[::-1]).tolist())


AXES: Final = schema.converted(lambda words: tuple(quat_from_dcm(body_axes(words)).tolist()))
QUATERNION: Final = schema.listed(schema.number, 4, names="wxyz")
PLACE: Final = schema.listed(schema.quantity(Quantity.LENGTH), 3, names="xyz")
_TURNS: Final = {"axes": AXES, "q_bs": QUATERNION, "rotation": schema.described(_rotation, type="string")}
UNIT: Final = schema.form(
    {
        **dict.fromkeys(("name", "device", "card", "noise"), schema.text),
        **_TURNS,
        "lever": PLACE,
        "clock_offset": schema.quantity(Quantity.TIME),
    },
    ("name",),
)
"""Parser of a table ``[[unit]]``, of an array's file and of a session's."""
_ARRAY: Final = {
    "kind": schema.one_of(KIND),
    "version": schema.version(VERSION),
    "unit": schema.tables(UNIT),
}
ARRAY: Final = schema.form(_ARRAY, _ARRAY, name="array")
