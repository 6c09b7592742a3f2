"""A format: what a device says on the wire, as data. `format_toml` reads one from a file, `catalog` holds the known.

A *frame* is one piece of the byte stream, found by its framing. A *message* is one kind of frame, told from others by
its constant fields. A *field* is one number in it. One description decodes, encodes, and writes page and C struct.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Final

from plumbob.errors import ParameterError
from plumbob.units import unit

MARKS: Final = ("V", "V1", "C", "UNVERIFIED", "")
"""V: read in the source named; V1: in one secondary source only; C: computed; UNVERIFIED: in none. Empty: one's own."""

SIZES: Final = {"u8": 1, "s8": 1, "u16": 2, "s16": 2, "u24": 3, "s24": 3, "u32": 4, "s32": 4, "u64": 8, "s64": 8} | {
    "f32": 4,
    "f64": 8,
    "bcd": 3,
}
"""Bytes of a field's word. ``bcd`` is a sign nibble and five digits."""

ROLES: Final = ("value", "status", "counter", "clock", "constant", "match")
WORDS: Final = ("absent", "clipped", "invalid")
"""What a status can say of the triads that it belongs to."""

_TRIADS: Final = frozenset({"gyr", "acc", "mag"})


@dataclass(frozen=True, slots=True)
class Provenance:
    """Where a fact comes from.

    Attributes
    ----------
    source : str
        Tag of a source of the format; empty in one's own.
    mark : str
        How sure it is, from `MARKS`.
    note : str
        What else to know.
    """

    source: str = ""
    mark: str = ""
    note: str = ""


@dataclass(frozen=True, slots=True)
class Field:
    """One number of a message.

    ``value = ((raw + raw_offset) lsb times / counts + offset) unit``, where `counts` and `times` may be options.

    Attributes
    ----------
    name : str
        ``gyr.x``, ``acc.z``, ``mag.y``, ``temp_c``, ``roll``, or any other; several units in one frame have a prefix,
        ``u1.gyr.x``.
    at : int
        Byte in the frame at which its word begins.
    type : str
        From `SIZES`, or what says of `size` bytes whether they are sound: ``"parity"``, 1 where they hold an odd number
        of ones, `bits` being what sees to it; ``"check"``, 1 where `check` fits.
    size : int
        Bytes of the word.
    order : str
        ``"big"`` or ``"little"``.
    bits : tuple of int or None
        Highest and lowest bit of the word that belong to it; all where None.
    unit : str
        Unit of the value; empty for a bare whole number.
    lsb, counts, times : float or str
        Size of a count: `lsb` times `times` over `counts`; a text names an option.
    raw_offset, offset : float
        Added to the count, and to the value in its unit.
    role : str
        From `ROLES`. A frame whose constant differs is another message; of a match the frame says 1 where it is as it
        shall be, else 0.
    value : int
        What a constant or a match is; what else is encoded where nothing is given.
    clip : tuple of int or None
        Counts at and beyond which the sensor is at the end of its range.
    overflow : tuple of int
        Counts that stand for "beyond the range": the value is absent and flagged as clipped.
    range : tuple of int or None
        Least and greatest count of a frame that can be believed, where the check alone is weak.
    wrap : bool
        Whether its counts go round, as those of an angle do of which 360° are all counts.
    says : mapping of int to str
        Of a status: which counts mean a word of `WORDS` for the triads `of`.
    of : tuple of str
        Names of triads, or of single fields such as ``gyr.x`` and ``temp_c``, with their prefix.
    check : Checksum or None
        Of a check, with places counted from `at`.
    origin : Provenance
        Where it comes from.
    """

    name: str
    at: int
    type: str
    size: int
    order: str = "big"
    bits: tuple[int, int] | None = None
    unit: str = ""
    lsb: float = 1.0
    counts: float | str = 1.0
    times: float | str = 1.0
    raw_offset: float = 0.0
    offset: float = 0.0
    role: str = "value"
    value: int = 0
    clip: tuple[int, int] | None = None
    overflow: tuple[int, ...] = ()
    range: tuple[int, int] | None = None
    wrap: bool = False
    says: Mapping[int, str] = field(default_factory=dict)
    of: tuple[str, ...] = ()
    check: "Checksum | None" = None
    origin: Provenance = Provenance()

    @property
    def signed(self) -> bool:
        """Whether a count may be below 0."""
        return self.type[0] in "sfb"

    @property
    def width(self) -> int:
        """Number of bits of a count."""
        return 8 * self.size if self.bits is None else self.bits[0] - self.bits[1] + 1

    @property
    def limits(self) -> tuple[int, int]:
        """Least and greatest count that its bits can hold."""
        if self.type == "bcd":
            return -99999, 99999
        half = 1 << (self.width - 1)
        return (-half, half - 1) if self.signed else (0, 2 * half - 1)

    @property
    def physical(self) -> bool:
        """Whether it is decoded to a number with a unit; others stay whole numbers."""
        return self.role == "value" and not self.derived

    @property
    def fixed(self) -> bool:
        """Whether every frame has the same there."""
        return self.role in ("constant", "match")

    @property
    def derived(self) -> bool:
        """Whether it has no bytes of its own, but follows from those of others."""
        return self.type in ("parity", "check")

    @property
    def scale(self) -> float:
        """One count in the unit used inside."""
        return self._factor * self.lsb * self._number("times") / self._number("counts")

    @property
    def zero(self) -> float:
        """What is added to the scaled count, in the unit used inside."""
        if not self.unit:
            return self.offset
        return unit(self.unit).factor * self.offset + unit(self.unit).offset

    @property
    def _factor(self) -> float:
        return unit(self.unit).factor if self.unit else 1.0

    def _number(self, key: str) -> float:
        value = getattr(self, key)
        if isinstance(value, str):
            raise ParameterError(f"field {self.name} needs option '{value}'; bind the format first: format.bind().")
        return float(value)

    @property
    def triad(self) -> str:
        """Name of the triad that it belongs to, with its prefix; empty for none."""
        head, _, axis = self.name.rpartition(".")
        return head if axis in {"x", "y", "z"} and head.rpartition(".")[2] in _TRIADS else ""


def owner_of(name: str) -> tuple[str, str]:
    """Unit and triad (without it) of a triad's or a field's name; the triad is empty where it belongs to none."""
    head, _, axis = name.rpartition(".")
    triad = head if head and axis in {"x", "y", "z"} else name
    unit_name, _, last = triad.rpartition(".")
    return unit_name, last if last in _TRIADS else ""


@dataclass(frozen=True, slots=True)
class Checksum:
    """Check at the end or elsewhere of a frame.

    Attributes
    ----------
    kind : str
        Name from `checksum.KINDS`, or of an option.
    at : int
        Where it stands; negative counts from the end of the frame.
    start, stop : int
        Bytes that it covers, `stop` exclusive; 0 or negative counts from the end.
    order : str
        Of its own bytes.
    """

    kind: str
    at: int
    start: int = 0
    stop: int = 0
    order: str = "big"


@dataclass(frozen=True, slots=True)
class LengthField:
    """Length of a frame that stands in it.

    Attributes
    ----------
    at, size : int
        Where, and of how many bytes.
    order : str
        Of its bytes.
    add : int
        What to add to get the length of the whole frame.
    least, most : int
        Lengths that are believed.
    """

    at: int
    size: int
    order: str
    add: int
    least: int
    most: int


@dataclass(frozen=True, slots=True)
class Framing:
    """How frames are found in a stream.

    Attributes
    ----------
    sync : tuple of bytes
        What a frame begins with, one of several of equal length; empty for a bus, where each transfer is one frame.
    end : bytes
        What every frame ends with, behind its check; empty where nothing.
    length : int
        Bytes of every frame; 0 where `length_field` says it.
    length_field : LengthField or None
        Where the length stands.
    checksum : Checksum or None
        Check of the whole.
    parity : tuple of (int, int, int)
        First byte and end of what must hold an odd number of ones, and the bit that makes it so, counted from the
        range's last bit.
    confirm : bool
        After a disturbance, believe a frame only once another begins right behind it: for weak checks.
    rate : float or None
        Frames per second as the device sends them, Hz.
    baud : int or None
        Usual speed of the line.
    """

    sync: tuple[bytes, ...] = ()
    end: bytes = b""
    length: int = 0
    length_field: LengthField | None = None
    checksum: Checksum | None = None
    parity: tuple[tuple[int, int, int], ...] = ()
    confirm: bool = False
    rate: float | None = None
    baud: int | None = None

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
    """One kind of frame.

    Attributes
    ----------
    name : str
        Of the message; the format's name where there is only one.
    length : int
        Bytes of the whole frame.
    fields : tuple of Field
        In order of their bytes.
    title : str
        What it is.
    """

    name: str
    length: int
    fields: tuple[Field, ...]
    title: str = ""

    @property
    def constants(self) -> tuple[Field, ...]:
        """Fields by which the message is known."""
        return tuple(f for f in self.fields if f.role == "constant")

    def of_role(self, role: str) -> Field | None:
        """First field of a role, such as the frame counter."""
        return next((f for f in self.fields if f.role == role), None)


@dataclass(frozen=True, slots=True)
class Option:
    """Something that the bytes do not say: a range setting, a model's constant.

    Attributes
    ----------
    meaning : str
        One line.
    choices : mapping of str to float or str
        What each choice stands for; empty where it is any number above 0.
    default : str or None
        None where it must be given.
    origin : Provenance
        Where it comes from.
    """

    meaning: str
    choices: Mapping[str, float | str]
    default: str | None
    origin: Provenance = Provenance()

    def value_of(self, where: str, choice: str | None) -> float | str:
        """Number or word that a choice stands for.

        Raises
        ------
        ParameterError
            If the choice is unknown or missing.
        """
        chosen = self.default if choice is None else str(choice)
        listed = ", ".join(map(repr, self.choices)) or "a number above 0"
        if chosen is None:
            raise ParameterError(f"{where} must be given, for the bytes do not say it ({self.meaning}); give {listed}.")
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
    """One register of a chip.

    Attributes
    ----------
    address : int
        First address.
    name : str
        As the data sheet calls it.
    meaning : str
        Bits and scale in words.
    reset : int or None
        Value after power-up, where it is known.
    word : Field or None
        How its bytes make a number, where they make one.
    origin : Provenance
        Where it comes from.
    """

    address: int
    name: str
    meaning: str
    reset: int | None = None
    word: Field | None = None
    origin: Provenance = Provenance()


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
        found = [m for m in self.messages if name in ("", m.name)]
        if not found:
            raise ParameterError(f"{self.name} has no message '{name}'; known are {', '.join(self._names())}.")
        return found[0]

    def register(self, key: str | int) -> Register:
        """Register by its name or address.

        Raises
        ------
        ParameterError
            If there is none.
        """
        found = [r for r in self.registers if key in (r.name, r.address)]
        if not found:
            known = ", ".join(r.name for r in self.registers) or "none"
            raise ParameterError(f"{self.name} has no register {key!r}; known are {known}.")
        return found[0]

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
            listed = ", ".join(self.options) or "none"
            raise ParameterError(f"{self.name} has no option '{min(unknown)}'; known are {listed}.")
        values = {
            name: option.value_of(f"{self.name} option '{name}'", given.get(name))
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


def _settled(one: Field, values: Mapping[str, float | str]) -> Field:
    def number(value: float | str) -> float | str:
        return values.get(value, value) if isinstance(value, str) else value

    return replace(one, counts=number(one.counts), times=number(one.times))


def _settled_framing(framing: Framing, values: Mapping[str, float | str]) -> Framing:
    check = framing.checksum
    if check is None or check.kind not in values:
        return framing
    return replace(framing, checksum=replace(check, kind=str(values[check.kind])))
