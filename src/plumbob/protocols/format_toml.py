"""Formats of a user's own, of devices (``catalog/`` beside this file) and of rigs: one door, and one reader of TOML."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, Final

from plumbob.core import check, schema, units
from plumbob.core.errors import DecodeError, ParameterError, UnitError, unknown_name
from plumbob.core.extensions import ExtensibleTable
from plumbob.core.files import reading, text_of
from plumbob.core.resources import guide
from plumbob.core.text import closest
from plumbob.core.units import QUANTITY_BY_TRIAD, Quantity
from plumbob.protocols import checksum
from plumbob.protocols.field import ORDER, SIZES, Checksum, Field, Provenance
from plumbob.protocols.format import Format, Framing, LengthField, Message, Option, Register
from plumbob.protocols.overlap import require_places

GUIDE: Final = guide("formats.md")
KIND: Final = "plumbob format"
VERSION: Final = 1
_NAMED: Final = {
    "temp_c": Quantity.TEMPERATURE, "roll": Quantity.ANGLE, "pitch": Quantity.ANGLE, "yaw": Quantity.ANGLE,
    "heading": Quantity.ANGLE,
}  # fmt: skip


def load_format(path: str | Path) -> Format:
    """Read a format."""
    text = text_of(path)
    with reading(Path(path)):
        return parse_format(text)


def parse_format(text: str) -> Format:
    """Format from TOML text; errors as in `load_format`."""
    tables = schema.document(text, GUIDE, FORMAT)
    order = tables.get("byte_order", "")
    framing: Framing = tables["frame"]
    if framing.checksum and not framing.checksum.order:
        framing = replace(framing, checksum=replace(framing.checksum, order=_order("checksum", order)))
    if framing.length_field and not framing.length_field.order:
        framing = replace(framing, length_field=replace(framing.length_field, order=_order("length", order)))
    form = Format(
        name=tables["name"],
        title=tables["title"],
        framing=framing,
        messages=_messages(tables, framing, order),
        options=tables.get("option", {}),
        sources=tables.get("sources", {}),
        facts=tables.get("fact", {}),
        registers=tuple(_register(raw, order) for raw in tables.get("register", ())),
        noise=tables.get("noise", ""),
        aliases=tables.get("aliases", ()),
    )
    _require_sense(form)
    return form


def _order(where: str, order: str) -> str:
    if not order:
        raise DecodeError(
            f'{where} has several bytes, but their order is not given. Add byte_order = "big" or "little".'
        )
    return order


def _messages(tables: Mapping[str, Any], framing: Framing, order: str) -> tuple[Message, ...]:
    if ("message" in tables) == bool("field" in tables or "embed" in tables):
        raise DecodeError("a format has either [[field]] and [[embed]], or a [[message]] for each kind of frame.")
    raw = tables.get("message") or [
        {"name": tables["name"], "field": tables.get("field", []), "embed": tables.get("embed", [])}
    ]
    return tuple(_message(table, framing, order, tables.get("part", {})) for table in raw)


def _message(raw: Mapping[str, Any], framing: Framing, order: str, parts: Mapping[str, Any]) -> Message:
    """One kind of frame: its parts one behind the other, then its own fields."""
    at = _first(framing)
    fields: list[Field] = []
    wanted = raw.get("parts", ())
    if len(set(wanted)) < len(wanted):
        raise DecodeError(f"message {raw['name']} has a part twice; give each a name of its own.")
    for name in wanted:
        if name not in parts:
            raise unknown_name("part", name, parts, of=f"message {raw['name']}", error=DecodeError)
        begin = at
        for table in parts[name]:
            fields += _fields(table | {"at": begin + table["at"]} if "at" in table else table, at, order)
            at = fields[-1].at + fields[-1].size
    for table in raw.get("field", []):
        fields += _fields(table, at, order)
        at = fields[-1].at + fields[-1].size
    for table in raw.get("embed", []):
        fields += _embedded(table)
    return Message(raw["name"], raw.get("length", framing.length), tuple(fields), raw.get("title", ""))


def _first(framing: Framing) -> int:
    """First byte after the sync and a length field right behind it."""
    at = len(framing.sync[0]) if framing.sync else 0
    rule = framing.length_field
    return at + rule.size if rule and rule.at == at else at


def _fields(raw: Mapping[str, Any], at: int, order: str) -> list[Field]:
    """One field, or the three of a triad, one behind the other."""
    where, axes = f"field {raw['name']}", raw.get("axes", "")
    size = raw.get("size") or SIZES.get(raw["type"], 0)
    wide = size > 1 and raw["type"] not in ("bcd", "parity")
    order = _order(where, raw.get("order", order)) if wide else "big"
    begin = raw.get("at", at)
    base = Field(**{key: raw[key] for key in raw if key != "axes"} | {"at": begin, "size": size, "order": order})
    names = [f"{base.name}.{axis}" for axis in axes] or [base.name]
    made = [replace(base, name=name, at=begin + i * size) for i, name in enumerate(names)]
    for field in made:
        _require_unit(where, field)
    return made


def _require_unit(where: str, field: Field) -> None:
    if field.physical and field.name.rpartition(".")[2] in QUANTITY_BY_TRIAD:
        raise DecodeError(f'{where} is a triad without axes; add axes = "xyz", or name it {field.name}.x.')
    if not field.physical and field.role != "clock":
        if field.unit:
            raise UnitError(f"{where} is a {field.role}, which has no unit; remove it.")
        return
    if not field.unit:
        such = "ms" if field.role == "clock" else "deg/s"
        rest = "" if field.role == "clock" else ' ("1" for none)'
        raise UnitError(f'{where} needs a unit, because a plain number has none. Add unit = "{such}" or similar{rest}.')
    try:
        units.unit(field.unit, _measured(field))
    except UnitError as error:
        raise UnitError(f"{where}: {error}") from error


def _measured(field: Field) -> Quantity | None:
    """What the field's unit must measure; None where its name does not say."""
    if field.role == "clock":
        return Quantity.TIME
    return (QUANTITY_BY_TRIAD | _NAMED).get((field.triad or field.name).rpartition(".")[2])


def _register(raw: Mapping[str, Any], order: str) -> Register:
    """One register; its bytes make a whole number where it has a type and no unit."""
    word = None
    if "type" in raw:
        settings = {key: value for key, value in raw.items() if key in _KEYS or key == "origin"}
        word = _fields({"role": "value" if "unit" in raw else "status", **settings}, 0, order)[0]
    return Register(raw["address"], raw["name"], raw["meaning"], raw.get("reset"), word, raw["origin"])


def _embedded(raw: Mapping[str, Any]) -> list[Field]:
    """Fields of a catalogued device's message inside this frame.

    What begins its own frames, its constants, parity and check become statuses that can say absent: a device that is
    silent or disturbed must not cost the frame around it. Where frames may begin in several ways, a field of the
    message has to say in which.
    """
    inner = _device(raw["device"]).bind(raw.get("options", {}))
    message = inner.message(raw.get("message", ""))
    framing = inner.framing
    sync = framing.sync[0] if framing.sync else b""
    if len(framing.sync) > 1:
        if not set(range(len(sync))) <= {f.at + i for f in message.fields if not f.derived for i in range(f.size)}:
            raise DecodeError(f"embed: frames of {inner.name} begin in several ways, and cannot be embedded.")
        sync = b""
    if framing.end:
        raise DecodeError(f"embed: frames of {inner.name} have an end of their own, and cannot be embedded.")
    begin, unit = raw["at"], raw.get("unit", "")
    prefix = f"{unit}." if unit else ""
    values = tuple(dict.fromkeys(prefix + (f.triad or f.name) for f in message.fields if f.physical))
    stem = f"{prefix}{inner.name}"
    absent: dict[str, Any] = {"says": {0: "absent"}, "of": values}
    fields = [_inside(f, prefix, begin, values) for f in message.fields]
    for i, byte in enumerate(sync):
        fields.append(Field(f"{stem}.sync{i}", begin + i, "u8", 1, role="match", value=byte, **absent))
    if rule := framing.length_field:
        kind, length = f"u{8 * rule.size}", message.length - rule.add
        at = begin + rule.at
        fields.append(Field(f"{stem}.length", at, kind, rule.size, rule.order, role="match", value=length, **absent))
    absent["role"] = "status"
    for i, (start, stop, bit) in enumerate(framing.parity):
        fields.append(Field(f"{stem}.parity{i}", begin + start, "parity", stop - start, bits=(bit, bit), **absent))
    if check := framing.checksum:
        fields.append(Field(f"{stem}.check", begin, "check", message.length, check=check, **absent))
    return fields


def _inside(f: Field, prefix: str, begin: int, values: tuple[str, ...]) -> Field:
    """Field of a message that stands inside another frame, whose own check is what makes it believed."""
    moved = replace(f, name=prefix + f.name, at=begin + f.at, of=tuple(prefix + n for n in f.of), range=None)
    return replace(moved, role="match", says={0: "absent"}, of=values) if f.role == "constant" else moved


def _require_sense(form: Format) -> None:
    framing = form.framing
    if len({len(word) for word in framing.sync}) > 1:
        raise DecodeError("frame.sync: all alternatives must be of equal length.")
    if not framing.length and not framing.length_field:
        raise DecodeError("frame needs its length in bytes, including sync and checksum, or a length_field.")
    if framing.transfers and (framing.length_field or framing.confirm):
        raise DecodeError("frame without sync is a bus transfer; it has one length, and no confirmation.")
    if framing.checksum and framing.checksum.kind not in form.options:
        checksum.algorithm(framing.checksum.kind)
    for message in form.messages:
        _require_room(form, message)


def _require_one_time(message: Message) -> None:
    for role in ("clock", "counter"):
        if len([f for f in message.fields if f.role == role]) > 1:
            raise DecodeError(f"message {message.name} has more than one {role}; each frame has one time.")


def _require_room(form: Format, message: Message) -> None:
    if not message.length or (form.framing.length and message.length != form.framing.length):
        raise DecodeError(f"message {message.name} needs its length in bytes, the whole frame's, as the frame has it.")
    names = [f.name for f in message.fields]
    _require_one_time(message)
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise DecodeError(f"message {message.name} has field {twice[0]} twice; give each a name of its own.")
    for f in message.fields:
        if f.at + f.size > message.length:
            raise DecodeError(
                f"field {f.name} ends at byte {f.at + f.size}, but message {message.name} has {message.length}."
            )
    require_places(form, message)
    for f in message.fields:
        if f.range and (f.type[0] == "f" or f.size > 4 or f.range[0] > f.range[1]):
            raise DecodeError(f"field {f.name}: range is [least, greatest] count of a whole number of 1 to 4 bytes.")
        for name in (f.counts, f.times):
            if isinstance(name, str) and name not in form.options:
                raise DecodeError(f"field {f.name} names option '{name}', which the format does not have.")
        if bool(f.says) != bool(f.of) or (f.says and f.role not in ("status", "match")):
            raise DecodeError(
                f'field {f.name}: says = {{ 1 = "absent" }} and of = ["mag"] belong together, to a status.'
            )
        least, most = f.limits
        if unheard := [count for count in f.says if not least <= count <= most]:
            raise DecodeError(f"field {f.name} gives a meaning to {unheard[0]}, but counts only {least} to {most}.")
        for name in f.of:
            if not any(name in (other.triad, other.name) for other in message.fields):
                raise DecodeError(f"field {f.name} refers to '{name}', which message {message.name} does not have.")


def _with_origin(_: str, table: dict[str, Any]) -> dict[str, Any]:
    """The table with its source, mark and note as its origin."""
    return table | {"origin": Provenance(**{key: table.pop(key) for key in _ORIGIN if key in table})}


def _fact(where: str, table: dict[str, Any]) -> tuple[str, Provenance]:
    return table["text"], _with_origin(where, table)["origin"]


def _checksum(_: str, table: dict[str, Any]) -> Checksum:
    return Checksum(table["kind"], table["at"], table["from"], table.get("to", table["at"]), table.get("order", ""))


_ORIGIN: Final = schema.keys(Provenance)
_KEYS: Final = schema.keys(Field, "check", "origin")
_AXES: Final = schema.one_of("xyz", "xzy", "yxz", "yzx", "zxy", "zyx", "xy", "x", "y", "z")
_FIELDS: Final = schema.tables(schema.form({**_KEYS, "axes": _AXES, **_ORIGIN}, ("name", "type"), _with_origin))
_EMBED: Final = schema.form(
    {
        **dict.fromkeys(("device", "message", "unit"), schema.text),
        "at": schema.whole(0),
        "options": schema.mapping(schema.text),
    },
    ("device", "at"),
)
_BODY: Final = {"field": _FIELDS, "embed": schema.tables(_EMBED)}
_NAME: Final = {"name": schema.text, "title": schema.text}
_MESSAGE: Final = schema.form({**_NAME, "length": schema.whole(1), "parts": schema.texts, **_BODY}, ("name", "length"))
_OPTION: Final = schema.form(
    schema.keys(Option, "origin") | _ORIGIN, ("meaning",), lambda where, table: Option(**_with_origin(where, table))
)
_SCALE: Final = ("type", "order", "bits", "unit", "lsb", "counts", "times", "raw_offset", "offset")
_REGISTER: Final = schema.form(
    schema.keys(Register, "word", "origin") | {key: _KEYS[key] for key in _SCALE} | _ORIGIN,
    ("address", "name", "meaning"),
    _with_origin,
)
_CHECKSUM: Final = schema.form(
    {"kind": schema.text, "at": schema.whole(), "from": schema.whole(0), "to": schema.whole(), "order": ORDER},
    ("kind", "at", "from"),
    _checksum,
)
_FRAME: Final = schema.table(Framing, length_field=schema.table(LengthField), checksum=_CHECKSUM)
_FACT: Final = schema.form({"text": schema.text, **_ORIGIN}, ("text",), _fact)
FORMAT: Final = schema.form(
    {
        "kind": schema.one_of(KIND),
        "version": schema.version(VERSION),
        **_NAME,
        "aliases": schema.texts,
        "byte_order": ORDER,
        "noise": schema.text,
        "sources": schema.mapping(schema.text),
        "frame": _FRAME,
        "option": schema.mapping(_OPTION),
        "part": schema.mapping(_FIELDS),
        "fact": schema.mapping(_FACT),
        "register": schema.tables(_REGISTER),
        **_BODY,
        "message": schema.tables(_MESSAGE),
    },
    ("kind", "version", "name", "title", "frame"),
    name="format",
)


@cache
def _formats(folder: str) -> "dict[str, Format]":
    """Formats of a folder, by their names and aliases."""
    files = (Path(__file__).parent / folder).glob("*.toml")
    forms = [parse_format(file.read_text(encoding="utf-8")) for file in files]
    return {name: form for form in forms for name in (form.name, *form.aliases)}


def _of_package(name: str, what: "Format | str | Path") -> Format:
    """Format of another package, as it is, or from its TOML."""
    if isinstance(what, str) and "\n" in what:
        what = parse_format(what)
    form = what if isinstance(what, Format) else load_format(what)
    if form.name != name:
        raise ParameterError(f"it names itself '{form.name}'; both names must be the same")
    return form


EXTENSIBLE: Final = ExtensibleTable[Format](
    "format", "format of bytes", lambda: _formats("rigs") | _formats("catalog"), _of_package
)
"""All formats by name; `plumbob.register` adds to them."""


def device_names() -> tuple[str, ...]:
    """Names of all devices of the catalogue, without aliases; those of other packages come last."""
    return (*sorted({form.name for form in _formats("catalog").values()}), *EXTENSIBLE.added())


def rig_names() -> tuple[str, ...]:
    """Names of all rigs: of the frames that their microcontrollers send."""
    return tuple(sorted(_formats("rigs")))


def find_format(name: str | Path) -> "Format":
    """Format that a name means.

    Parameters
    ----------
    name : str or path
        A ``.toml`` file, a device of the catalogue or one of its aliases, or a rig.

    Raises
    ------
    DecodeError
        If the file cannot be read, or is not a format.
    ParameterError
        If there is neither.
    """
    name = str(check.path("name", name))
    if name.endswith(".toml"):
        return load_format(Path(name))
    if name in _formats("rigs"):
        return _formats("rigs")[name]
    return _device(name)


def _device(name: str) -> Format:
    """Device of the catalogue, by its name or an alias, or of another package."""
    form = _formats("catalog").get(name) or EXTENSIBLE.find(name)
    if form is None:
        raise ParameterError(
            f"'{name}' is not a known device; known: {', '.join(device_names())}. For another format, give its "
            f".toml file.{closest(name, (*device_names(), *rig_names()))} Rigs are {', '.join(rig_names())}."
        )
    return form


def unassigned_told(form: "Format", message: "Message") -> str | None:
    """Which bytes of a message the user's own format leaves out; of a known device they are known to be spare."""
    from plumbob.protocols.overlap import unassigned

    if form.name in _formats("catalog") or form.name in _formats("rigs") or not (places := unassigned(form, message)):
        return None
    spans = ", ".join(str(at) if end == at + 1 else f"{at} to {end - 1}" for at, end in places)
    return f"no field of message {message.name} uses its bytes {spans} of {message.length}; they are ignored"
