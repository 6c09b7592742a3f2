"""A format that cannot be what its author means is refused when it is read, in one line that says where."""

import numpy as np
import pytest

from plumbob.core import errors
from plumbob.protocols.decode import Decoder, decode
from plumbob.protocols.encode import encode
from plumbob.protocols.format_toml import parse_format
from tests.helpers import beside
from tests.helpers.commandline import table_of

BOARD = beside(__file__, "board.toml")


@pytest.mark.parametrize(("error", "old", "new", "pattern"), table_of(beside(__file__, "board_wrong.txt")))
def test_what_cannot_lie_in_the_frame_is_refused_with_its_field(error, old, new, pattern):
    with pytest.raises(getattr(errors, error), match=pattern):
        parse_format(BOARD.replace(old.replace(r"\n", "\n"), new.replace(r"\n", "\n"), 1))


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
