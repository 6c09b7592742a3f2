"""A format: what a device says on the wire, as data. `format_toml` reads one from a file, `catalog` holds the known.

A *frame* is one piece of the byte stream, found by its framing. A *message* is one kind of frame, identified by
its constant fields. A *field* is one number in it. One description decodes, encodes, and writes page and C struct.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Final

from plumbob.core import schema
from plumbob.core.errors import ParameterError, unknown_name
from plumbob.core.units import Quantity
from plumbob.protocols.field import ORDER, UNSAID, Checksum, Field, Provenance


def _is_hex(value: str) -> bool:
    return re.fullmatch(r"\s*([0-9A-Fa-f]{2}\s*)+", value) is not None


HEX: Final = schema.plain("bytes in hexadecimal, as in 'A5 5A'", str, bytes.fromhex, passes=_is_hex, type="string")
"""Parser of bytes."""
_SYNC: Final = schema.either(list, schema.listed(HEX), schema.converted(lambda octets: (octets,), HEX))
_CHOICES: Final = schema.mapping(schema.either(str, schema.text, schema.positive))
_PARITY: Final = schema.listed(schema.listed(schema.whole(), 3, of="numbers: first byte, end, bit"), of="lists")


@dataclass(frozen=True, slots=True)
class LengthField:
    """Length of a frame that stands in it."""

    # at, size: where, and of how many bytes
    at: Annotated[int, schema.whole(0)]
    size: Annotated[int, schema.whole(1, 4)]
    add: int  # what to add to get the length of the whole frame
    # least, most: lengths that are believed
    least: Annotated[int, schema.whole(1)]
    most: Annotated[int, schema.whole(1, 65535)]
    order: Annotated[str, ORDER] = ""  # of its bytes


@dataclass(frozen=True, slots=True)
class Framing:
    """How frames are found in a stream."""

    # what a frame begins with, one of several of equal length; empty for a bus, where each transfer is one frame
    sync: Annotated[tuple[bytes, ...], _SYNC] = ()
    end: Annotated[bytes, HEX] = b""  # what every frame ends with, behind its check; empty where nothing
    length: Annotated[int, schema.whole(1, 65535)] = 0  # bytes of every frame; 0 where `length_field` says it
    length_field: LengthField | None = None  # where the length stands
    checksum: Checksum | None = None  # check of the whole
    # first byte and end of what must hold an odd number of ones, and the bit that makes it so, counted from the range's
    # last bit
    parity: Annotated[tuple[tuple[int, int, int], ...], _PARITY] = ()
    # after a disturbance, believe a frame only once another begins right behind it: for weak checks
    confirm: bool = False
    # frames per second as the device sends them, Hz
    rate: Annotated[float | None, schema.size(Quantity.FREQUENCY)] = None
    baud: Annotated[int | None, schema.whole(1)] = None  # usual speed of the line

    @property
    def transfers(self) -> bool:
        """Whether the bus cuts the frames, so that nothing has to be searched."""
        return not self.sync

    @property
    def most(self) -> int:
        """Longest frame, bytes."""
        return self.length_field.most if self.length_field else self.length


@dataclass(frozen=True, slots=True)
class Message:
    """One kind of frame."""

    name: str  # the format's name where there is only one
    length: int  # bytes of the whole frame
    fields: tuple[Field, ...]  # in order of their bytes
    title: str = ""  # what it is

    def of_role(self, role: str) -> Field | None:
        """First field of a role, such as the frame counter."""
        return next((f for f in self.fields if f.role == role), None)


@dataclass(frozen=True, slots=True)
class Option:
    """Something that the bytes do not say: a range setting, a model's constant."""

    meaning: str  # one line
    # what each choice stands for; empty where it is any number above 0
    choices: Annotated[Mapping[str, float | str], _CHOICES] = field(default_factory=dict)
    default: Annotated[str | None, schema.text] = None  # none where it must be given
    origin: Provenance = UNSAID  # where it comes from

    def resolve(self, where: str, choice: str | None) -> float | str:
        """Number or word that a choice stands for."""
        chosen = self.default if choice is None else str(choice)
        listed = ", ".join(map(repr, self.choices)) or "a number above 0"
        if chosen is None:
            raise ParameterError(
                f"{where} must be given, because the bytes do not contain it ({self.meaning}); give {listed}."
            )
        if self.choices:
            if chosen not in self.choices:
                raise ParameterError(f"{where} must be one of {listed}, but it is '{chosen}'.")
            return self.choices[chosen]
        try:
            number = float(chosen)
        except ValueError:
            number = 0.0
        if not 0.0 < number < float("inf"):
            raise ParameterError(f"{where} must be {listed}, but it is '{chosen}'.")
        return number


@dataclass(frozen=True, slots=True)
class Register:
    """One register of a chip."""

    address: Annotated[int, schema.whole(0)]  # first address
    name: str  # as the data sheet calls it
    meaning: str  # bits and scale in words
    reset: Annotated[int | None, schema.whole(0)] = None  # value after power-up, where it is known
    word: Field | None = None  # how its bytes make a number, where they make one
    origin: Provenance = UNSAID  # where it comes from


@dataclass(frozen=True, slots=True)
class Format:
    """Everything about one device's bytes.

    Attributes
    ----------
    name, title : str
        Short and full name.
    framing : Framing
        How frames are found.
    messages : tuple of Message
        Kinds of frames.
    options : mapping of str to Option
        What the bytes do not say.
    chosen : mapping of str to str
        Choices that have been made; all of them once the format is bound.
    sources : mapping of str to str
        What the tags of sources stand for.
    facts : mapping of str to (str, Provenance)
        Bus, timing, traps: for the page.
    registers : tuple of Register
        Registers of a chip.
    noise : str
        Name of the simulator's preset with its noise; empty for none.
    aliases : tuple of str
        Other names.
    """

    name: str
    title: str
    framing: Framing
    messages: tuple[Message, ...]
    options: Mapping[str, Option] = field(default_factory=dict)
    chosen: Mapping[str, str] = field(default_factory=dict)
    sources: Mapping[str, str] = field(default_factory=dict)
    facts: Mapping[str, tuple[str, Provenance]] = field(default_factory=dict)
    registers: tuple[Register, ...] = ()
    noise: str = ""
    aliases: tuple[str, ...] = ()

    def message(self, name: str = "") -> Message:
        """Message by its name; the first where none is given.

        Raises
        ------
        ParameterError
            If there is none.
        """
        matching = [m for m in self.messages if name in ("", m.name)]
        if not matching:
            raise unknown_name("message", name, self._names(), of=self.name)
        return matching[0]

    def bind(self, chosen: Mapping[str, str] | None = None) -> "Format":
        """Return the format with every option settled, so that it can decode.

        Parameters
        ----------
        chosen : mapping of str to str
            Choices; defaults hold for the others.

        Raises
        ------
        ParameterError
            If an option or choice is unknown, one that has no default is missing, or one is settled otherwise.
        """
        given = {**self.chosen, **(chosen or {})}
        if other := [name for name, choice in self.chosen.items() if str(given[name]) != choice]:
            raise ParameterError(
                f"{self.name} option '{other[0]}' is settled as '{self.chosen[other[0]]}' and cannot become "
                f"'{given[other[0]]}'; bind the format as it was loaded."
            )
        if unknown := set(given) - set(self.options):
            raise unknown_name("option", min(unknown), self.options, of=self.name)
        values = {
            name: option.resolve(f"{self.name} option '{name}'", given.get(name))
            for name, option in self.options.items()
        }
        settled = {name: str(given.get(name, option.default)) for name, option in self.options.items()}
        return replace(
            self,
            framing=_settled_framing(self.framing, values),
            messages=tuple(replace(m, fields=tuple(_settled(f, values) for f in m.fields)) for m in self.messages),
            chosen=settled,
            registers=tuple(replace(r, word=_settled(r.word, values) if r.word else None) for r in self.registers),
        )

    def _names(self) -> Iterator[str]:
        return (m.name for m in self.messages)


def _settled(template: Field, values: Mapping[str, float | str]) -> Field:
    def number(value: float | str) -> float | str:
        return values.get(value, value) if isinstance(value, str) else value

    return replace(template, counts=number(template.counts), times=number(template.times))


def _settled_framing(framing: Framing, values: Mapping[str, float | str]) -> Framing:
    check = framing.checksum
    if check is None or check.kind not in values:
        return framing
    return replace(framing, checksum=replace(check, kind=str(values[check.kind])))
