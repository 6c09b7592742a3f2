"""TypeScript types of the messages between the server of the live page and the page: ``web/src/messages.ts``."""

import types
import typing
from collections.abc import Sequence
from dataclasses import MISSING, fields, is_dataclass

from plumbob.viewer import messages

_PLAIN = {str: "string", int: "number", float: "number", bool: "boolean", type(None): "null", typing.Any: "unknown"}
_HEAD = "// Made by website/view_types.py of src/plumbob/viewer/messages.py: change that, then 'make pages'.\n"


def name_of(kind: object) -> str:
    """TypeScript of a type of Python."""
    if kind in _PLAIN:
        return _PLAIN[kind]
    if is_dataclass(kind):
        return kind.__name__
    origin, args = typing.get_origin(kind), typing.get_args(kind)
    if origin in (types.UnionType, typing.Union):
        return " | ".join(map(name_of, args))
    if origin is typing.Literal:
        return " | ".join(f'"{value}"' if isinstance(value, str) else repr(value) for value in args)
    if origin is Sequence:
        inner = name_of(args[0])
        return f"({inner})[]" if " | " in inner else f"{inner}[]"
    if origin is dict:
        return f"{{ [name: string]: {name_of(args[1])} }}"
    raise TypeError(f"no TypeScript for {kind}")


def interface(kind: type) -> str:
    """TypeScript interface of a dataclass; what has a default that is not a type's name may be left out."""
    hints = typing.get_type_hints(kind)
    told = (kind.__doc__ or "").strip().splitlines()[0]
    lines = [f"/** {told} */", f"export interface {kind.__name__} {{"]
    for one in fields(kind):
        optional = "?" if one.default is not MISSING and one.name not in ("type", "protocol") else ""
        lines.append(f"  {one.name}{optional}: {name_of(hints[one.name])};")
    return "\n".join([*lines, "}"])


def page() -> str:
    """The file."""
    skipped = {"Batch"}
    kinds = [kind for kind in vars(messages).values() if is_dataclass(kind) and isinstance(kind, type)]
    known = [kind for kind in kinds if kind.__module__ == messages.__name__ and kind.__name__ not in skipped]
    said = " | ".join(kind.__name__ for kind in typing.get_args(messages.FromServer))
    constants = "\n".join(
        f"export const {name} = {getattr(messages, name)};" for name in ("PROTOCOL", "TICK", "HISTORY")
    )
    union = f'export type FromServer = {said};\nexport type Verb = Command["verb"];'
    return "\n\n".join([_HEAD + constants, *map(interface, known), union]) + "\n"


if __name__ == "__main__":
    print(page(), end="")
