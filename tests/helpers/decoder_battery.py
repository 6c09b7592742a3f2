"""DecoderBattery: what the decoder of every catalogued format must do. A new one joins by its file in the catalogue."""

import hashlib
import itertools
import math
import re

import numpy as np
import pytest
from hypothesis import HealthCheck, given
from hypothesis import strategies as st

from benchmarks.harness.decoder_fuzz import fuzz, mutated
from benchmarks.harness.decoder_streams import columns_for, frames_of, settled
from plumbob.core import units
from plumbob.protocols.decode import Decoder, decode
from plumbob.protocols.encode import encode
from plumbob.protocols.format_toml import device_names, find_format
from tests.helpers import examples

MILLION = 1_000_000


def form_of(name):
    return settled(find_format(name))


def options_of(cell=""):
    """Options of a cell of a table, as 'rr 200, gr 4'."""
    return dict(one.split(" ", 1) for one in cell.split(", ") if one)


def fields_of(cell=""):
    """Fields of a cell, as 'temp_c -3920/340+36.53, gyr.z 100 deg/s, st 1', in SI where they have a unit."""
    fields = {}
    for name, text in options_of(cell).items():
        number, _, unit = text.partition(" ")
        value = int(number) if number.isdigit() else sum(map(_product, number.split("+")))
        fields[name] = units.to_si(value, unit) if unit else value
    return fields


def _product(text):
    factors = re.findall(r"([*/]?)([^*/]+)", text)
    return math.prod(1.0 / float(number) if sign == "/" else float(number) for sign, number in factors)


def streams():
    return [name for name in device_names() if not find_format(name).framing.transfers]


def promises(form):
    """Whether a single flipped bit is always noticed."""
    return form.framing.checksum is not None or bool(form.framing.parity)


def bits(found):
    """Every number of some frames as bytes."""
    parts = []
    for name, frames in sorted(found.items()):
        arrays = [frames.start, frames.t_ns, *frames.columns.values(), *frames.flags.values()]
        parts += [name.encode(), *(array.tobytes() for array in arrays)]
    return b"".join(parts)


def merged(parts):
    """Frames of several calls as one list of (message, start, time, values), in the stream's order."""
    rows = []
    for found in parts:
        for name, frames in found.items():
            columns = [frames.columns[key].tolist() for key in frames.columns]
            flags = [frames.flags[key].tolist() for key in frames.flags]
            rows += zip(itertools.repeat(name), frames.start.tolist(), *columns, *flags, strict=False)
    return sorted(map(repr, rows))


def in_pieces(form, data, cuts):
    decoder = Decoder(form)
    edges = [0, *sorted(cuts), len(data)]
    parts = [decoder.feed(data[a:b], a) for a, b in itertools.pairwise(edges)]
    return merged([*parts, decoder.finish()]), decoder.counts


def digest(name):
    """Hash of what comes out of a short damaged stream: the same compiled and as plain Python."""
    form, rng = form_of(name), np.random.default_rng(7)
    frames = np.frombuffer(b"".join(frames_of(form, 40, rng)), dtype=np.uint8)
    found, counts = decode(mutated(frames, rng).tobytes(), form)
    return hashlib.sha256(bits(found) + repr(counts).encode()).hexdigest()


@pytest.mark.parametrize("name", device_names())
class DecoderBattery:
    """Inherited by the test class; each test runs for each format."""

    def test_what_is_built_parses_to_the_same_bytes(self, name):
        form = form_of(name)
        for message in form.messages:
            columns = columns_for(message, 50, np.random.default_rng(1))
            rows = encode(form, columns, message=message.name)
            found, counts = decode(rows.tobytes(), form)
            assert counts.frames[message.name] == len(rows) and counts.junk == 0
            own = {f.name for f in message.fields if f.role != "constant" and f.type != "parity"}
            again = {key: column for key, column in found[message.name].columns.items() if key in own}
            if again:
                assert encode(form, again, message=message.name).tobytes() == rows.tobytes()

    def test_a_cut_frame_is_junk_and_costs_no_other(self, name):
        form = form_of(name)
        first, second = frames_of(form, 2, np.random.default_rng(2))
        for size in range(len(first)):
            found, counts = decode(first[:size], form)
            assert found == {} and counts.junk == counts.received == size
            if form.framing.transfers:
                continue
            found, counts = decode(first[:size] + second, form)
            assert [frames.start.tolist() for frames in found.values()] == [[size]]
            assert (counts.junk, counts.framed) == (size, len(second))

    def test_no_flipped_bit_becomes_data_where_a_check_promises_it(self, name):
        form = form_of(name)
        if not promises(form):
            pytest.skip("no check")
        first, second = frames_of(form, 2, np.random.default_rng(3))
        for bit in range(0, 8 * len(first), len(first) // 20 | 1):
            wrong = bytearray(first)
            wrong[bit // 8] ^= 1 << bit % 8
            found, counts = decode(bytes(wrong) + second, form)
            assert [frames.start.tolist() for frames in found.values()] == [[len(first)]], bit
            assert counts.junk == len(first)

    def test_garbage_before_between_and_behind_costs_no_frame(self, name):
        form = form_of(name)
        if form.framing.transfers:
            pytest.skip("a bus has nothing between its transfers")
        rng = np.random.default_rng(4)
        for size in (1, 2, 3, 17, 300):
            frames = frames_of(form, 6, rng)
            blocks = [rng.bytes(size), frames[0] + frames[1], rng.bytes(size), *frames[2:4], rng.bytes(size)]
            found, counts = decode(b"".join(blocks), form)
            assert sum(map(len, found.values())) == 4
            assert (counts.junk, counts.framed) == (3 * size, sum(map(len, frames[:4])))

    def test_a_split_at_any_byte_changes_nothing(self, name):
        form = form_of(name)
        data = b"".join(frames_of(form, 3, np.random.default_rng(5)))
        whole = in_pieces(form, data, [])
        for at in range(1, len(data)):
            assert in_pieces(form, data, [at]) == whole, at

    @examples(0.15, suppress_health_check=list(HealthCheck))
    @given(data=st.data(), seed=st.integers(0, 2**32 - 1))
    def test_any_cutting_of_a_damaged_stream_gives_the_same_frames_and_counts(self, name, data, seed):
        form, rng = form_of(name), np.random.default_rng(seed)
        frames = np.frombuffer(b"".join(frames_of(form, 12, rng)), dtype=np.uint8)
        stream = mutated(frames, rng).tobytes()
        cuts = data.draw(st.lists(st.integers(0, len(stream)), max_size=20))
        assert in_pieces(form, stream, cuts) == in_pieces(form, stream, [])

    def test_one_byte_at_a_time_gives_the_same_frames_and_counts(self, name):
        form, rng = form_of(name), np.random.default_rng(8)
        frames = np.frombuffer(b"".join(frames_of(form, 8, rng)), dtype=np.uint8)
        stream = mutated(frames, rng).tobytes()
        assert in_pieces(form, stream, range(len(stream))) == in_pieces(form, stream, [])

    def test_a_frame_has_the_time_at_which_its_first_byte_was_read(self, name):
        form = form_of(name)
        data = b"".join(frames_of(form, 30, np.random.default_rng(9)))
        decoder = Decoder(form)
        parts = [decoder.feed(data[at : at + 7], 1000 + at) for at in range(0, len(data), 7)] + [decoder.finish()]
        read = {int(s): int(t) for found in parts for f in found.values() for s, t in zip(f.start, f.t_ns, strict=True)}
        assert len(read) == 30 and all(t == 1000 + start - start % 7 for start, t in read.items())

    def test_mutated_bytes_raise_nothing_and_let_nothing_grow(self, name):
        fuzzed = fuzz(form_of(name), MILLION // 5, np.random.default_rng(6))
        assert fuzzed.sound, fuzzed
        assert fuzzed.frames > 0
