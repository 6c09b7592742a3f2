"""Bytes and texts with something wrong in them."""

import re
from collections.abc import Callable, Sequence
from random import Random
from typing import Final

_MOST: Final = 1 << 20
"""Bytes that a case may grow to."""
_WHOLE: Final = (0, 1, 2, 7, 127, 128, 255, *(2**bits - less for bits in (15, 16, 31, 32, 63, 64) for less in (0, 1)))
_WORDS: Final = (
    b"nan", b"inf", b"-inf", b"1e400", b"-1e308", b"1e-320", b"-0.0", b"0", b"-1", b"2", b"1e9", b"9" * 400, b"0x10",
    b"1_000", b"true", b"null", b'""', b'"x"', b"[]", b"{}", b"[[]]", b"{ a = 1 }", b"1979-05-27", b"\xff", b"\x00",
    b"\xc2\xb5", b"\xe2\x80\xae", b"\x1b[31m", b'"\\u0000"', b'"\\ud800"', b"*/", b"<script>", b"1 furlong",
    b'"' + b"A" * 5000 + b'"',
)  # fmt: skip
_TOKEN: Final = re.compile(rb'"[^"\n]*"|[-+]?[0-9][0-9.eE+_-]*|[A-Za-z_][A-Za-z0-9_]*|[^\sA-Za-z0-9_"]')
_VALUE: Final = re.compile(rb"(?:(?<==)|(?<=:)|(?<=,)|(?<=\[))[^,\n\]\}]+")


def mutated(rng: Random, data: bytes, others: Sequence[bytes], *, text: bool) -> bytes:
    """One to four things wrong; `others` are files of the format, from which pieces are taken."""
    if text and rng.random() < 0.7:
        return mutated_text(rng, data, others)
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        data = rng.choice(_BYTES)(rng, data, others)[:_MOST]
    return data


def mutated_text(rng: Random, data: bytes, others: Sequence[bytes]) -> bytes:
    """One to four other words, values, lines or brackets."""
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        data = rng.choice(_TEXT)(rng, data, others)[:_MOST]
    return data


def _piece(rng: Random, data: bytes, most: int = 4096) -> tuple[int, int]:
    """Ends of a piece; at the beginning and the end of a file, where headers are, as often as elsewhere."""
    size = min(len(data), int(2 ** rng.uniform(0, 1 + most.bit_length())) - 1)
    last = max(len(data) - size, 0)
    at = rng.choice((rng.randint(0, last), rng.randint(0, min(last, 256)), rng.randint(max(0, last - 256), last)))
    return at, at + size


def _flipped(rng: Random, data: bytes, others: Sequence[bytes]) -> bytes:
    out = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 16))):
        if out:
            out[_piece(rng, data, 1)[0] % len(out)] ^= 1 << rng.randrange(8)
    return bytes(out)


def _cut(rng: Random, data: bytes, others: Sequence[bytes]) -> bytes:
    return data[: rng.randint(0, len(data))]


def _without(rng: Random, data: bytes, others: Sequence[bytes]) -> bytes:
    a, b = _piece(rng, data)
    return data[:a] + data[b:]


def _spliced(rng: Random, data: bytes, others: Sequence[bytes]) -> bytes:
    """A piece of a file of the format, put or laid somewhere."""
    other = rng.choice([data, *others])
    a, b = _piece(rng, other)
    at = _piece(rng, data)[0]
    return data[:at] + other[a:b] + data[at + rng.choice((0, b - a)) :]


def _repeated(rng: Random, data: bytes, others: Sequence[bytes]) -> bytes:
    a, b = _piece(rng, data)
    times = rng.choice((2, 3, 10, 1 + (1 << 16) // max(1, b - a)))
    return data[:a] + data[a:b] * times + data[b:]


def _filled(rng: Random, data: bytes, others: Sequence[bytes]) -> bytes:
    a, b = _piece(rng, data)
    return data[:a] + rng.choice((b"\x00", b"\x00", b"\xff", b" ")) * (b - a) + data[b:]


def _random(rng: Random, data: bytes, others: Sequence[bytes]) -> bytes:
    a, b = _piece(rng, data, 256)
    return data[:a] + rng.randbytes(b - a) + data[rng.choice((a, b)) :]


def _number(rng: Random, data: bytes, others: Sequence[bytes]) -> bytes:
    size = rng.choice((1, 2, 4, 8))
    value = rng.choice((*_WHOLE, len(data), len(data) - 1)) % (1 << 8 * size)
    at = _piece(rng, data, 1)[0]
    return data[:at] + value.to_bytes(size, rng.choice(("little", "big"))) + data[at + size :]


def _other_match(rng: Random, data: bytes, pattern: re.Pattern[bytes], new: bytes) -> bytes:
    found = [*pattern.finditer(data)]
    if not found:
        return data + new
    one = rng.choice(found)
    return data[: one.start()] + new + data[one.end() :]


def _word(rng: Random, data: bytes, others: Sequence[bytes]) -> bytes:
    return _other_match(rng, data, _TOKEN, rng.choice(_WORDS))


def _value(rng: Random, data: bytes, others: Sequence[bytes]) -> bytes:
    return _other_match(rng, data, _VALUE, b" " + rng.choice(_WORDS))


def _swapped_word(rng: Random, data: bytes, others: Sequence[bytes]) -> bytes:
    found = _TOKEN.findall(rng.choice([data, *others]))
    return _other_match(rng, data, _TOKEN, rng.choice(found) if found else b"")


def _lines(rng: Random, data: bytes, others: Sequence[bytes]) -> bytes:
    """Lines left out, repeated, swapped or taken from elsewhere."""
    lines = data.splitlines(keepends=True) or [b"\n"]
    i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
    how = rng.randrange(4)
    if how == 0:
        del lines[i]
    elif how == 1:
        lines[i:i] = [lines[j]] * rng.choice((1, 2, 1000))
    elif how == 2:
        lines[i], lines[j] = lines[j], lines[i]
    else:
        lines.insert(i, rng.choice(rng.choice([data, *others]).splitlines(keepends=True) or [b"\n"]))
    return b"".join(lines)


def _nested(rng: Random, data: bytes, others: Sequence[bytes]) -> bytes:
    depth = rng.choice((2, 50, 2000, 100_000))
    opening, closing = rng.choice(((b"[", b"]"), (b"{", b"}"), (b'{"a":', b"}"), (b"(", b")")))
    at = _piece(rng, data, 1)[0]
    return data[:at] + opening * depth + closing * rng.choice((0, depth)) + data[at:]


def _encoded(rng: Random, data: bytes, others: Sequence[bytes]) -> bytes:
    """The same in another encoding, with a mark at its beginning, or with other line ends."""
    how = rng.randrange(4)
    if how == 0:
        return data.decode("utf-8", "replace").encode("utf-16")
    if how == 1:
        return b"\xef\xbb\xbf" + data
    return data.replace(b"\n", b"\r" if how == 2 else b"\r\n")


_Mutation = Callable[[Random, bytes, Sequence[bytes]], bytes]
_BYTES: Final[tuple[_Mutation, ...]] = (_flipped, _cut, _without, _spliced, _repeated, _filled, _random, _number)
_TEXT: Final[tuple[_Mutation, ...]] = (_word, _value, _value, _swapped_word, _lines, _nested, _encoded)
