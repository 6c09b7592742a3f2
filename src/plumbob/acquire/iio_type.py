"""How one number lies in a scan of a Linux IIO buffer.

Source: Linux, Documentation/ABI/testing/sysfs-bus-iio.
"""

import re
from dataclasses import dataclass
from typing import Final

from plumbob.errors import ParameterError

_TYPE: Final = re.compile(r"(le|be):([su])(\d+)/(\d+)(?:X(\d+))?(?:>>(\d+))?")


@dataclass(frozen=True, slots=True)
class IioType:
    """How a number lies in memory.

    Attributes
    ----------
    order : str
        ``"<"`` or ``">"``.
    signed : bool
        Two's complement.
    bits, storage, shift : int
        Bits that hold the number, of so many in memory, after a shift to the right.
    repeat : int
        How many of them follow each other.
    """

    order: str
    signed: bool
    bits: int
    storage: int
    repeat: int = 1
    shift: int = 0

    @property
    def size(self) -> int:
        """Bytes of all repeats, which is their alignment too."""
        return self.storage // 8 * self.repeat

    def __str__(self) -> str:
        order, sign = "le" if self.order == "<" else "be", "s" if self.signed else "u"
        repeat = f"X{self.repeat}" if self.repeat > 1 else ""
        return f"{order}:{sign}{self.bits}/{self.storage}{repeat}>>{self.shift}"


def parse_type(text: str) -> IioType:
    """Read a type as the kernel writes it, such as ``le:s12/16>>4`` or ``be:s32/32X4>>0``.

    Raises
    ------
    ParameterError
        If it is none, or its bits have no room.
    """
    match = _TYPE.fullmatch(text.strip())
    if match is None:
        raise ParameterError(f"{text!r} is no type of a scan element; it looks like le:s12/16>>4.")
    order, sign, bits, storage, repeat, shift = match.groups()
    kind = IioType(
        "<" if order == "le" else ">", sign == "s", int(bits), int(storage), int(repeat or 1), int(shift or 0)
    )
    if kind.storage not in {8, 16, 32, 64} or not 0 < kind.bits <= kind.storage - kind.shift or kind.repeat < 1:
        raise ParameterError(f"{text!r}: {bits} bits do not fit into {storage} after a shift by {shift or 0}.")
    return kind
