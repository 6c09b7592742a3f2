"""A format that cannot be what its author means is refused when it is read, in one line that says where."""

import numpy as np
import pytest

from plumbob.core.errors import DecodeError, UnitError
from plumbob.protocols.decode import Decoder, decode
from plumbob.protocols.encode import encode
from plumbob.protocols.format_toml import parse_format

BOARD = """
kind = "plumbob format"
version = 1
name = "board"
title = "board"
byte_order = "big"
[frame]
sync = "FE ED 42"
length = 18
end = "0D"
checksum = { kind = "xor8", at = -2, from = 3, to = -2 }
[[field]]
name = "clock"
type = "u16"
unit = "ms"
role = "clock"
[[field]]
name = "gyr"
axes = "xyz"
type = "s16"
bits = [15, 4]
unit = "deg/s"
lsb = "1/16"
[[field]]
name = "temp_c"
type = "s16"
unit = "degC"
[[field]]
name = "spare"
type = "u8"
role = "status"
[[field]]
name = "ready"
type = "u16"
bits = [3, 0]
role = "status"
says = { 0 = "absent" }
of = ["gyr"]
"""

SAME_WORD = """
says = { 0 = "absent" }
of = ["gyr"]
role = "status"
[[field]]
name = "other"
at = 14
type = "u16"
bits = [7, 3]
"""


PLACES = [
    ('name = "clock"', 'name = "clock"\nat = 2', "frame.sync and field clock share byte 2"),
    ("length = 18", "length = 17", "field ready and frame.checksum share byte 15"),
    ('"FE ED 42"', '"FE ED 42 01"', "field ready and frame.checksum share byte 16"),
    ("at = -2", "at = -1", "frame.checksum and frame.end share byte 17"),
    ('name = "temp_c"', 'name = "temp_c"\nat = 10', "field gyr.z and field temp_c share byte 10"),
    ("at = -2", "at = 18", "checksum.at = 18 puts xor8 of 1 byte outside message board"),
    ("at = -2", "at = -19", "checksum.at = -19 puts"),
    ("from = 3", "from = 16", "checksum covers bytes 16 to 16"),
    ("to = -2", "to = 19", "checksum covers bytes 3 to 19"),
    ("[15, 4]", "[4, 15]", r"field gyr.x: bits must be .* but they are \[4, 15\] of s16"),
    ("[15, 4]", "[16, 4]", "field gyr.x: bits must be"),
    ("[3, 0]", "[3, -1]", "field ready: bits must be"),
    ("[3, 0]", "[3, 0]\nat = 14\n" + SAME_WORD, "fields ready and other share bit 3"),
    ('sync = "FE ED 42"', "sync = 0xFEED42", "frame.sync must be bytes in hexadecimal"),
    ('lsb = "1/16"', "lsb = 0", r"lsb must be a finite number other than 0"),
    ('axes = "xyz"\n', "", 'field gyr is a triad without axes; add axes = "xyz"'),
    ('of = ["gyr"]', "", "field ready: says = .* and of = .* belong together"),
    ("{ 0 =", "{ 16 =", "field ready says something of 16, but counts only 0 to 15"),
]
UNITS = [
    ('"deg/s"', '"g"', "field gyr: 'g' is not a unit of rate"),
    ('"degC"', '"g"', "field temp_c: 'g' is not a unit of temperature"),
    ('unit = "ms"\n', "", "field clock needs a unit"),
    ('"ms"', '"g"', "field clock: 'g' is not a unit of time"),
]


@pytest.mark.parametrize(
    ("error", "old", "new", "pattern"), [(DecodeError, *row) for row in PLACES] + [(UnitError, *row) for row in UNITS]
)
def test_what_cannot_lie_in_the_frame_is_refused_with_its_field(error, old, new, pattern):
    with pytest.raises(error, match=pattern):
        parse_format(BOARD.replace(old, new, 1))


def test_a_buffer_that_is_used_again_does_not_change_what_waits():
    """A caller who reads into one buffer must not change the half frame that the decoder keeps."""
    form = parse_format(BOARD)
    assert form.message().length == 18
    stream = encode(form, {"gyr.x": np.zeros(4)}).tobytes()
    decoder, buffer, found = Decoder(form), bytearray(9), 0
    for at in range(0, len(stream), 9):
        buffer[:] = stream[at : at + 9]
        found += sum(map(len, decoder.feed(memoryview(buffer)).values()))
    assert (found, decoder.counts.junk) == (4, 0)
    assert len(decode(np.frombuffer(stream, dtype=np.uint8), form)[0]["board"]) == 4
