"""Streams of frames for decoders: values over the whole range, and seven ways to damage frames."""

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.protocols.encode import encode
from plumbob.protocols.field import Field
from plumbob.protocols.format import Format, Message
from plumbob.protocols.format_toml import parse_format
from plumbob.protocols.unpack import field_values

Column = NDArray[np.float64] | NDArray[np.int64]
Harm = Callable[[Format, bytes, np.random.Generator], bytes]

USER_FRAME: Final = """
kind = "plumbob format"
version = 1
name = "user_crc16"
title = "a user's own frame of 18 bytes: counter, rates and accelerations, CRC-16"
byte_order = "little"

[frame]
sync = "A5 5A"
length = 18
checksum = { kind = "crc16-ccitt-false", at = -2, from = 2 }

[[field]]
name = "counter"
type = "u16"
role = "counter"

[[field]]
name = "gyr"
axes = "xyz"
type = "s16"
unit = "deg/s"
counts = 16.4

[[field]]
name = "acc"
axes = "xyz"
type = "s16"
unit = "g"
counts = 2048
"""


def user_frame() -> Format:
    """A format as a user would write it, with a check of 16 bits."""
    return parse_format(USER_FRAME)


def settled(form: Format) -> Format:
    """The format with some choice for options that have no default; which one does not change what is a frame."""
    open_ones = {name: option for name, option in form.options.items() if option.default is None}
    return form.bind({name: next(iter(option.choices), "1") for name, option in open_ones.items()})


def columns_for(message: Message, count: int, rng: np.random.Generator) -> dict[str, Column]:
    """Values by field, anywhere in its range; statuses keep their own value, and counters count."""
    found: dict[str, Column] = {}
    for one in message.fields:
        if one.physical:
            found[one.name] = _anywhere(one, count, rng)
        elif one.role in ("counter", "clock"):
            found[one.name] = np.arange(count, dtype=np.int64)
    return found


def _anywhere(one: Field, count: int, rng: np.random.Generator) -> NDArray[np.float64]:
    if one.type[0] == "f":
        return np.asarray(field_values(one, rng.normal(size=count)))
    low, high = one.range or one.clip or one.limits
    return field_values(one, rng.integers(low, high, count, dtype=np.int64, endpoint=True))


def frames_of(form: Format, count: int, rng: np.random.Generator) -> list[bytes]:
    """Frames in turn of each message that carries values; of every message where none does."""
    kinds = [m for m in form.messages if any(f.physical for f in m.fields)] or list(form.messages)
    each = -(-count // len(kinds))
    rows = [_rows(form, message, each, rng) for message in kinds]
    return [frame for turn in zip(*rows, strict=True) for frame in turn][:count]


def _rows(form: Format, message: Message, count: int, rng: np.random.Generator) -> list[bytes]:
    columns = columns_for(message, count, rng)
    if not columns:
        return [encode(form, {}, message=message.name).tobytes()] * count
    return [row.tobytes() for row in encode(form, columns, message=message.name)]


def _flip_in(frame: bytes, at: int, rng: np.random.Generator) -> bytes:
    return frame[:at] + bytes([frame[at] ^ 1 << int(rng.integers(8))]) + frame[at + 1 :]


def flip_bit(_form: Format, frame: bytes, rng: np.random.Generator) -> bytes:
    """One bit turned round."""
    return _flip_in(frame, int(rng.integers(len(frame))), rng)


def drop_byte(_form: Format, frame: bytes, rng: np.random.Generator) -> bytes:
    """One byte less."""
    at = int(rng.integers(len(frame)))
    return frame[:at] + frame[at + 1 :]


def insert_byte(_form: Format, frame: bytes, rng: np.random.Generator) -> bytes:
    """One byte more, inside."""
    at = int(rng.integers(1, len(frame)))
    return frame[:at] + rng.bytes(1) + frame[at:]


def cut(_form: Format, frame: bytes, rng: np.random.Generator) -> bytes:
    """Only the beginning."""
    return frame[: int(rng.integers(1, len(frame)))]


def burst(_form: Format, _frame: bytes, rng: np.random.Generator) -> bytes:
    """64 random bytes instead."""
    return rng.bytes(64)


def flip_length(form: Format, frame: bytes, rng: np.random.Generator) -> bytes:
    """One bit of the length turned round; of the header where there is no length."""
    rule = form.framing.length_field
    at, size = (rule.at, rule.size) if rule else (0, len(form.framing.sync[0]))
    return _flip_in(frame, at + int(rng.integers(size)), rng)


def long_noise(_form: Format, _frame: bytes, rng: np.random.Generator) -> bytes:
    """A million random bytes instead."""
    return rng.bytes(1_000_000)


HARMS: Final[dict[str, Harm]] = {
    "bit flip": flip_bit,
    "byte dropped": drop_byte,
    "byte inserted": insert_byte,
    "cut frame": cut,
    "64 B noise": burst,
    "length flip": flip_length,
    "1 MB noise": long_noise,
}
ON_A_BUS: Final = ("bit flip",)
"""A bus cuts its transfers itself, so that no byte can come or go."""


class Damaged(NamedTuple):
    """A stream with damaged frames."""

    data: bytes
    whole: dict[int, int]
    """Of undamaged frames, length by the byte at which each begins."""
    lost: frozenset[bytes]
    """Damaged frames as they were."""
    faults: int


def damage(form: Format, frames: list[bytes], kind: str, share: float, rng: np.random.Generator) -> Damaged:
    """Damage a share of frames in one way; a million bytes of noise come once, in the middle."""
    if kind == "1 MB noise":
        chosen = {len(frames) // 2}
    else:
        chosen = set(rng.choice(len(frames), max(1, round(share * len(frames))), replace=False).tolist())
    parts, whole, at = [], {}, 0
    for number, frame in enumerate(frames):
        sent = HARMS[kind](form, frame, rng) if number in chosen else frame
        if number not in chosen:
            whole[at] = len(frame)
        parts.append(sent)
        at += len(sent)
    return Damaged(b"".join(parts), whole, frozenset(frames[i] for i in chosen), len(chosen))
