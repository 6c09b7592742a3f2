"""Chains as TOML files: read strictly, written so that the same chain is read back."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from plumbob.core import schema
from plumbob.core.errors import DecodeError, ShapeError, excerpt
from plumbob.core.files import reading, text_of
from plumbob.core.resources import guide
from plumbob.core.schema import toml_text
from plumbob.core.units import Quantity
from plumbob.data.array import Quat, UnitMount, Vec
from plumbob.data.array_toml import AXES, PLACE, QUATERNION
from plumbob.data.chain import DEGREES_OF_FREEDOM, Chain, Joint, Limits, Segment
from plumbob.rotations import quat_from_euler_zyx

KIND: Final = "plumbob chain"
VERSION: Final = 1
GUIDE: Final = guide("arm-teach.md")
_LIMITS: Final = {
    "low": Quantity.ANGLE,
    "high": Quantity.ANGLE,
    "velocity": Quantity.RATE,
    "acceleration": Quantity.ANGULAR_ACCELERATION,
    "jerk": Quantity.ANGULAR_JERK,
}
_LETTERS: Final = {
    sign + letter: tuple(float(sign + "1") * (letter == axis) for axis in "xyz")
    for sign in ("", "-")
    for letter in "xyz"
}


def load_chain(path: str | Path) -> Chain:
    """Read a chain.

    Parameters
    ----------
    path : path
        A TOML file.

    Raises
    ------
    DecodeError
        If it is not TOML, is not a chain, or a key is unknown, missing or of the wrong type.
    UnitError
        If a unit is missing or unknown.
    ParameterError
        If names, axes or limits do not make a chain, as of `Chain`, `Joint` and `UnitMount`.
    FrameError
        If the axes of a unit are not three letters of a right-handed set.
    """
    file = Path(path)
    text = text_of(file, KIND)
    with reading(file):
        return parse_chain(text, name=file.stem)


def parse_chain(text: str, *, name: str = "chain") -> Chain:
    """Chain from TOML text; errors as in `load_chain`. `name` is for one that has none itself."""
    table = schema.document(text, GUIDE, CHAIN)
    hand = table.get("hand", {})
    return Chain(
        table.get("name", name),
        table["segment"],
        table.get("joint", ()),
        hand=hand.get("segment", ""),
        hand_b=hand.get("at", (0.0, 0.0, 0.0)),
        base_fixed=table["base"] == "fixed",
    )


def chain_text(chain: Chain) -> str:
    """TOML text of a chain, in SI and radians; `parse_chain` gives the same chain. Noise of units is not in it."""
    return "\n".join(_lines(chain)) + "\n"


def _lines(chain: Chain) -> Iterator[str]:
    yield f"kind = {toml_text(KIND)}"
    yield f"version = {VERSION}"
    yield f"name = {toml_text(chain.name)}"
    yield f'base = "{"fixed" if chain.base_fixed else "free"}"'
    if chain.hand or any(chain.hand_b):
        place = [f"segment = {toml_text(chain.hand)}"] if chain.hand else []
        yield f"hand = {{ {', '.join([*place, f'at = {_lengths(chain.hand_b)}'])} }}"
    for segment in chain.segments:
        yield from ("", "[[segment]]", f"name = {toml_text(segment.name)}")
        yield from _mounted(segment)
    for joint in chain.joints:
        yield from ("", "[[joint]]")
        yield from (f"{key} = {toml_text(getattr(joint, key))}" for key in ("name", "parent", "child", "kind"))
        if joint.origin is None:
            continue
        yield f"origin = {_lengths(joint.origin)}"
        if joint.q_pc != (1.0, 0.0, 0.0, 0.0):
            yield f"q_pc = {list(joint.q_pc)}"
        if joint.axes:
            yield f"axes = {[list(axis) for axis in joint.axes]}"
        if any(limits != Limits() for limits in joint.limits):
            listed = ", ".join(_limits_text(limits) for limits in joint.limits)
            yield f"limits = {listed if len(joint.limits) == 1 else f'[{listed}]'}"


def _mounted(segment: Segment) -> Iterator[str]:
    if segment.unit:
        yield f"unit = {toml_text(segment.unit)}"
    mount, aligned = segment.mount, UnitMount()
    if mount.q_bs != aligned.q_bs:
        yield f"q_bs = {list(mount.q_bs)}"
    if mount.lever_b != aligned.lever_b:
        yield f"lever = {_lengths(mount.lever_b)}"
    if mount.clock_offset:
        yield f"clock_offset = {_with_unit(mount.clock_offset, Quantity.TIME)}"


def _lengths(vector: Vec) -> str:
    texts = ", ".join(_with_unit(value, Quantity.LENGTH) for value in vector)
    return f"[{texts}]"


def _with_unit(value: float, quantity: Quantity) -> str:
    return f'"{float(value)!r} {quantity}"'


def _limits_text(limits: Limits) -> str:
    finite = [(key, getattr(limits, key)) for key in _LIMITS if np.isfinite(getattr(limits, key))]
    texts = ", ".join(f"{key} = {_with_unit(value, _LIMITS[key])}" for key, value in finite)
    return f"{{ {texts} }}"


def _axes(where: str, value: Any) -> tuple[Vec, ...]:
    """Axes as letters, ``"y"`` or ``"z -y"``."""
    words = schema.text(where, value).split()
    unknown = next((word for word in words if word not in _LETTERS), None)
    if unknown is not None:
        raise DecodeError(f"{where} names {excerpt(unknown)}, but an axis is one of {', '.join(_LETTERS)}.")
    return tuple((_LETTERS[word][0], _LETTERS[word][1], _LETTERS[word][2]) for word in words)


def _one_of_two(where: str, table: Mapping[str, Any], key: str, other: str) -> Quat:
    if key in table and other in table:
        raise DecodeError(f"{where} has both {key} and {other}, which say the same; keep one of them.")
    q: Quat = table.get(key, table.get(other, (1.0, 0.0, 0.0, 0.0)))
    return q


def _segment(where: str, table: Mapping[str, Any]) -> Segment:
    lacking = [key for key in _MOUNT if key in table and "unit" not in table]
    if lacking:
        raise DecodeError(f"{where}.{lacking[0]} belongs to a unit, but {where} names none; add unit, or leave it out.")
    mount = UnitMount(
        q_bs=_normed(f"{where}.q_bs", _one_of_two(where, table, "q_bs", "axes")),
        lever_b=table.get("lever", (0.0, 0.0, 0.0)),
        clock_offset=table.get("clock_offset", 0.0),
    )
    return Segment(table["name"], table.get("unit", ""), mount)


def _joint(where: str, table: Mapping[str, Any]) -> Joint:
    if "origin" not in table and set(table) & {"axes", "q_pc", "euler"}:
        raise DecodeError(
            f"{where} has axes or a rotation, but no origin; leave out all of them where it is not known."
        )
    if "origin" in table and table["kind"] in ("hinge", "universal") and "axes" not in table:
        raise DecodeError(f"{where} is a {table['kind']} and needs 'axes', because nothing is guessed.")
    q_pc = _normed(f"{where}.q_pc", _one_of_two(where, table, "q_pc", "euler"))
    plain = {"origin": None} | {key: table[key] for key in table if key not in ("q_pc", "euler")}
    if len(table.get("limits", ())) == 1:  # one for all angles of the joint
        plain["limits"] = table["limits"] * DEGREES_OF_FREEDOM[table["kind"]]
    return Joint(q_pc=q_pc, **plain)


def _normed(where: str, q: Quat) -> Quat:
    """The quaternion, whose norm is judged with its place in the message."""
    if abs(float(np.linalg.norm(q)) - 1.0) > 1e-3:
        raise ShapeError(f"{where} has norm {np.linalg.norm(q):.6g}, but a rotation needs norm 1.")
    return q


def _is_name(value: Any) -> bool:
    return isinstance(value, str) and bool(value.strip()) and value.isprintable() and not set("[]") & set(value)


_NAME: Final = schema.plain("a name without brackets", _is_name, str, type="string")
_LIMIT: Final = schema.form(
    {key: schema.quantity(kind) if key in ("low", "high") else schema.size(kind) for key, kind in _LIMITS.items()},
    kind=Limits,
)
_MOUNT: Final = {"axes": AXES, "q_bs": QUATERNION, "lever": PLACE, "clock_offset": schema.quantity(Quantity.TIME)}
_SEGMENT: Final = schema.form({"name": _NAME, "unit": schema.text, **_MOUNT}, ("name",), _segment)
_VECTORS: Final = schema.listed(schema.listed(schema.number, 3, names="xyz"))
_EULER: Final = schema.listed(schema.quantity(Quantity.ANGLE), 3, names="xyz")
_ENDS: Final = {
    "name": _NAME,
    "parent": schema.text,
    "child": schema.text,
    "kind": schema.one_of(*DEGREES_OF_FREEDOM),
}
_JOINT: Final = schema.form(
    {
        **_ENDS,
        "origin": PLACE,
        "axes": schema.either(list, _VECTORS, schema.described(_axes, type="string")),
        "q_pc": QUATERNION,
        "euler": schema.converted(lambda angles: tuple(quat_from_euler_zyx(angles).tolist()), _EULER),
        "limits": schema.either(list, schema.listed(_LIMIT), schema.converted(lambda limits: (limits,), _LIMIT)),
    },
    _ENDS,
    _joint,
)
CHAIN: Final = schema.form(
    {
        "kind": schema.one_of(KIND),
        "version": schema.version(VERSION),
        "base": schema.one_of("fixed", "free"),
        "segment": schema.tables(_SEGMENT),
        "joint": schema.tables(_JOINT),
        "name": _NAME,
        "hand": schema.form({"segment": schema.text, "at": PLACE}),
    },
    ("kind", "version", "base", "segment"),
    name="chain",
)
