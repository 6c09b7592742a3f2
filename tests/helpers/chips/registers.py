"""Words of registers: bytes to values and back, and which reply of a pipelined chip answers which command."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from plumbob.core.errors import DecodeError, ParameterError
from plumbob.protocols.field import Field
from plumbob.protocols.format import Format, Register
from plumbob.protocols.unpack import counts_for, counts_of, put, values_of

Ints = NDArray[np.int64]
Column = NDArray[np.float64] | Ints


def register_values(form: Format, key: str | int, data: bytes) -> Column:
    """Values (N,) of a register's words, one behind the other.

    Parameters
    ----------
    form : Format
        Chip; its options must be settled, or all have defaults.
    key : str or int
        Name or address of the register.
    data : bytes
        The words.

    Returns
    -------
    ndarray (N,)
        In the units used inside; whole numbers where the register has no unit.

    Raises
    ------
    DecodeError
        If the bytes are not a whole number of words.
    ParameterError
        If there is no such register, or its bytes make no number.
    """
    word = _word(form, key)
    if len(data) % word.size:
        raise DecodeError(f"register {word.name} of {form.name} has {word.size} bytes, but {len(data)} came.")
    counts = counts_of(word, np.frombuffer(data, dtype=np.uint8).reshape(-1, word.size))
    return values_of(word, counts) if word.physical else counts


def register_bytes(form: Format, key: str | int, value: float) -> bytes:
    """Word of a register for a value in the units used inside, cut to its range; errors as in `register_values`."""
    word = _word(form, key)
    row = np.zeros((1, word.size), dtype=np.uint8)
    put(word, row, counts_for(word, np.array([value]))[0] if word.physical else np.array([int(value)]))
    return row.tobytes()


def register_of(form: Format, key: str | int) -> Register:
    """Register by its name or address."""
    found = [r for r in form.registers if key in (r.name, r.address)]
    if not found:
        raise ParameterError(f"{form.name} has no register {key!r}.")
    return found[0]


def _word(form: Format, key: str | int) -> Field:
    register = register_of(form.bind(), key)
    if register.word is None:
        raise ParameterError(f"register {register.name} of {form.name} makes no number: {register.meaning}.")
    return register.word


@dataclass(frozen=True, eq=False, slots=True)
class Readings:
    """What was read from one register.

    Attributes
    ----------
    place : ndarray (N,) of int64
        Numbers of the transfers in which the register was asked for.
    words : ndarray (N,) of int64
        The 16 bits that came, flags included.
    values : ndarray (N,)
        What they mean, in the units used inside; the words themselves where the catalogue says nothing.
    """

    place: Ints
    words: Ints
    values: Column


@dataclass(frozen=True, eq=False, slots=True)
class Answers:
    """Replies beside their commands.

    Attributes
    ----------
    readings : mapping of str to Readings
        By name of the register.
    unanswered : int
        Reads whose next reply is none: refused, damaged, or not there yet.
    unknown : int
        Reads that were answered from an address that the catalogue does not have.
    """

    readings: Mapping[str, Readings]
    unanswered: int
    unknown: int


def transfers(commands: bytes, replies: bytes, size: int) -> tuple[Ints, Ints]:
    """Words (N,) that went out and came in, of `size` bytes each.

    Raises
    ------
    DecodeError
        If they are not whole transfers, equally many.
    """
    if len(commands) != len(replies) or len(commands) % size:
        raise DecodeError(
            f"commands and replies must be equally many transfers of {size} bytes, but they have {len(commands)} and "
            f"{len(replies)} bytes."
        )
    sent, came = (np.frombuffer(data, dtype=f">u{size}").astype(np.int64) for data in (commands, replies))
    return sent, came


def paired(form: Format, asked: Ints, words: Ints) -> Answers:
    """Pair reads with the replies one transfer later, of a chip with registers of 16 bits.

    Parameters
    ----------
    form : Format
        Chip, with its options settled.
    asked : ndarray (N,) of int64
        Address that each transfer reads; −1 where it reads none.
    words : ndarray (N,) of int64
        The 16 bits that came in each transfer; −1 where it was no reply to a read.
    """
    reply = np.concatenate([words[1:], [-1]])[: asked.size]
    reads = asked >= 0
    good = reads & (reply >= 0)
    names = {r.address: r.name for r in form.registers}
    found = {
        name: _readings(form, name, np.flatnonzero(good & (asked == address)), reply)
        for address, name in names.items()
        if np.any(good & (asked == address))
    }
    known = int(sum(one.place.size for one in found.values()))
    return Answers(found, int(np.sum(reads & ~good)), int(np.sum(good)) - known)


def _readings(form: Format, name: str, place: Ints, reply: Ints) -> Readings:
    words = reply[place]
    word = register_of(form, name).word
    values = words if word is None else register_values(form, name, words.astype(">u2").tobytes())
    return Readings(place, words, values)
