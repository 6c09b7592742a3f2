"""A field: one number of a message, and where what is said of it comes from."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Annotated, Any, Final

from plumbob.core import schema
from plumbob.core.errors import DecodeError, ParameterError, excerpt
from plumbob.core.units import unit

MARKS: Final = ("V", "V1", "C", "UNVERIFIED", "")
"""V: read in the source named; V1: in one secondary source only; C: computed; UNVERIFIED: in none. Empty: one's own."""

SIZES: Final = {"u8": 1, "s8": 1, "u16": 2, "s16": 2, "u24": 3, "s24": 3, "u32": 4, "s32": 4, "u64": 8, "s64": 8} | {
    "f32": 4,
    "f64": 8,
    "bcd": 3,
}
"""Bytes of a field's word. ``bcd`` is a sign nibble and five digits."""

ROLES: Final = ("value", "status", "counter", "clock", "constant", "match")
WORDS: Final = ("absent", "clipped", "invalid")  # what a status can say of the triads that it belongs to

_TRIADS: Final = frozenset({"gyr", "acc", "mag"})
_PAIR: Final = schema.listed(schema.whole(), 2, of="whole numbers")
ORDER: Final = schema.one_of("big", "little")  # order of bytes
_WORDS: Final = schema.mapping(schema.one_of(*WORDS))
_NUMBERS: Final = schema.listed(schema.whole(), of="whole numbers")
_OPTION: Final = schema.either(str, schema.converted(lambda word: word.removeprefix("option:")), schema.positive)


def _fraction(words: str) -> float:
    try:
        fraction = float(Fraction(words.replace(" ", "")))
    except (ValueError, ZeroDivisionError):
        fraction = 0.0
    if fraction == 0.0:
        raise DecodeError(f"{excerpt(words)} is not a fraction such as '180/32768', or it is 0.")
    return fraction


def _says(where: str, value: Any) -> dict[int, str]:
    words = _WORDS(where, value)
    try:
        return {int(key, 0): word for key, word in words.items()}
    except ValueError as error:
        raise DecodeError(f"{where} must name counts, as in {{ 0 = 'absent' }}: {error}.") from error


@dataclass(frozen=True, slots=True)
class Provenance:
    """Where a fact comes from."""

    source: str = ""  # tag of a source of the format; empty in a format of your own
    mark: Annotated[str, schema.one_of(*MARKS)] = ""  # how sure it is, from `MARKS`
    note: str = ""  # what else to know


UNSAID: Final = Provenance()


@dataclass(frozen=True, slots=True)
class Checksum:
    """Check at the end or elsewhere of a frame."""

    kind: str  # name from `checksum.KINDS`, or of an option
    at: int  # where it stands; negative counts from the end of the frame
    # start, stop: bytes that it covers, `stop` exclusive; 0 or negative counts from the end
    start: int = 0
    stop: int = 0
    order: str = "big"  # of its own bytes


@dataclass(frozen=True, slots=True)
class Field:
    """One number of a message.

    ``value = ((raw + raw_offset) lsb times / counts + offset) unit``, where `counts` and `times` may be options.
    """

    # ``gyr.x``, ``acc.z``, ``mag.y``, ``temp_c``, ``roll``, or any other; several units in one frame have a prefix,
    # ``u1.gyr.x``
    name: str
    at: Annotated[int, schema.whole(0)]  # byte in the frame at which its word begins
    # from `SIZES`, or what says of `size` bytes whether they are sound: ``"parity"``, 1 where they hold an odd number
    # of ones, `bits` being what sees to it; ``"check"``, 1 where `check` fits
    type: Annotated[str, schema.one_of(*SIZES, "parity")]
    size: Annotated[int, schema.whole(1, 8)]  # bytes of the word
    order: Annotated[str, ORDER] = "big"  # ``"big"`` or ``"little"``
    # highest and lowest bit of the word that belong to it; all where None
    bits: Annotated[tuple[int, int] | None, _PAIR] = None
    unit: str = ""  # unit of the value; empty for a bare whole number
    # lsb, counts, times: size of a count: `lsb` times `times` over `counts`; a text names an option
    lsb: Annotated[float, schema.either(str, schema.converted(_fraction), schema.nonzero)] = 1.0
    counts: Annotated[float | str, _OPTION] = 1.0
    times: Annotated[float | str, _OPTION] = 1.0
    # raw_offset, offset: added to the count, and to the value in its unit
    raw_offset: float = 0.0
    offset: float = 0.0
    # From `ROLES`. A frame whose constant differs is another message; of a match the frame says 1 where it is as it
    # should be, else 0.
    role: Annotated[str, schema.one_of(*ROLES)] = "value"
    value: int = 0  # what a constant or a match is; what else is encoded where nothing is given
    # counts at and beyond which the sensor is at the end of its range
    clip: Annotated[tuple[int, int] | None, _PAIR] = None
    # counts that stand for "beyond the range": the value is absent and flagged as clipped
    overflow: Annotated[tuple[int, ...], _NUMBERS] = ()
    # least and greatest count of a frame that can be believed, where the check alone is weak
    range: Annotated[tuple[int, int] | None, _PAIR] = None
    wrap: bool = False  # whether its counts go round, as those of an angle do of which 360° are all counts
    # of a status: which counts mean a word of `WORDS` for the triads `of`
    says: Annotated[Mapping[int, str], schema.described(_says, type="object")] = field(default_factory=dict)
    of: tuple[str, ...] = ()  # names of triads, or of single fields such as ``gyr.x`` and ``temp_c``, with their prefix
    check: "Checksum | None" = None  # of a check, with places counted from `at`
    origin: Provenance = UNSAID  # where it comes from

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
    def tick(self) -> str:
        """What one count of a clock is, as in ``"0.1 ms"``; its unit alone where it is one of that."""
        return self.unit if abs(self.lsb) == 1.0 else f"{abs(self.lsb):g} {self.unit}"

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
    def full_scale(self) -> float:
        """Greatest size that a value can have both ways, or one way where it has one sign; in the unit used inside."""
        low, high = sorted((count + self.raw_offset) * self.scale + self.zero for count in self.clip or self.limits)
        return min(-low, high) if low < 0.0 < high else max(-low, high)

    @property
    def triad(self) -> str:
        """Name of the triad that it belongs to, with its prefix; empty for none."""
        head, _, axis = self.name.rpartition(".")
        return head if axis in {"x", "y", "z"} and head.rpartition(".")[2] in _TRIADS else ""


def unit_and_triad(name: str) -> tuple[str, str]:
    """Unit and triad (without it) of a triad's or a field's name; the triad is empty where it belongs to none."""
    head, _, axis = name.rpartition(".")
    triad = head if head and axis in {"x", "y", "z"} else name
    unit_name, _, last = triad.rpartition(".")
    return unit_name, last if last in _TRIADS else ""
