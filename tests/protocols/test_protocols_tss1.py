"""TSS1: the worked line both ways, damage, any cutting, and what cannot be encoded."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from plumbob.core.errors import ParameterError, ShapeError
from tests.helpers.chips.tss1 import SIZE, Tss1Decoder, encode_tss1

# 38.35 and −12.5 cm/s², heave −42 cm, roll 1.25°, pitch −3.07°, from the layout that SBG Systems describes
LINE = b":0AFF38 -0042H 0125 -0307\r\n"
SAYS = {
    "acc_horizontal": 0.3835,
    "acc_vertical": -0.125,
    "heave": -0.42,
    "quality": ord("H"),
    "roll": np.radians(1.25),
    "pitch": np.radians(-3.07),
}


def decoded(data, cuts=()):
    decoder, rows = Tss1Decoder(), []
    for a, b in itertools.pairwise([0, *sorted(cuts), len(data)]):
        rows += [(s, *row) for f in decoder.feed(data[a:b], a).values() for s, *row in rows_of(f)]
    assert decoder.finish() == {}
    return rows, decoder.counts


def rows_of(frames):
    return zip(frames.start.tolist(), *(column.tolist() for column in frames.columns.values()), strict=True)


def lines(count, seed):
    rng = np.random.default_rng(seed)
    values = {"acc_horizontal": rng.uniform(0, 9, count), "acc_vertical": rng.uniform(-20, 20, count)}
    values |= {
        "heave": rng.uniform(-99, 99, count),
        "roll": rng.uniform(-1, 1, count),
        "pitch": rng.uniform(-1, 1, count),
    }
    return encode_tss1(values)


def test_the_worked_line_decodes():
    found = Tss1Decoder().feed(LINE, 5)["tss1"]
    assert (found.start.tolist(), found.t_ns.tolist()) == ([0], [5])
    for name, value in SAYS.items():
        assert found.columns[name][0] == pytest.approx(value, rel=1e-12)


def test_the_worked_line_encodes():
    assert encode_tss1({name: [value] for name, value in SAYS.items()}) == LINE


def test_lines_build_and_parse_to_the_same_bytes():
    data = lines(300, 1)
    found = Tss1Decoder().feed(data)["tss1"]
    assert len(found) == 300 and encode_tss1(found.columns) == data


def test_beyond_its_range_a_value_is_cut():
    data = encode_tss1({"acc_horizontal": [1e3, -1.0], "acc_vertical": [1e3, -1e3], "heave": [1e3, -1e3]})
    assert [data[i * SIZE + 1 : i * SIZE + 13] for i in (0, 1)] == [b"FF7FFF  9999", b"008000 -9999"]


@pytest.mark.parametrize("at", range(SIZE))
def test_a_wrong_or_missing_byte_costs_its_line_only(at):
    for damaged in (LINE[:at] + b"#" + LINE[at + 1 :], LINE[:at] + LINE[at + 1 :], LINE[:at]):
        rows, counts = decoded(LINE + damaged + LINE)
        assert [row[0] for row in rows] == [0, SIZE + len(damaged)]
        assert (counts.junk, counts.framed, counts.frames) == (len(damaged), 2 * SIZE, {"tss1": 2})


@given(st.lists(st.integers(0, 400), max_size=30), st.integers(0, 2**32 - 1))
def test_any_cutting_gives_the_same_lines_and_counts(cuts, seed):
    rng = np.random.default_rng(seed)
    data = np.frombuffer(lines(15, seed), dtype=np.uint8).copy()
    hit = rng.random(data.size) < 0.02
    data[hit] = rng.choice(np.frombuffer(b":0 -\r\n\xff", dtype=np.uint8), int(hit.sum()))
    whole = data.tobytes()
    assert decoded(whole, cuts) == decoded(whole)


def test_nothing_waits_but_the_beginning_of_a_line():
    decoder = Tss1Decoder()
    for at in range(2000):
        decoder.feed(b":" if at % 3 else b":0AFF38 -00", at)
        assert decoder.counts.pending < SIZE
    decoder.feed(LINE, 9)
    assert decoder.counts.frames == {"tss1": 1} and decoder.counts.pending == 0


def test_a_line_has_the_time_at_which_its_first_byte_was_read():
    decoder = Tss1Decoder()
    assert decoder.feed(b"\x00" + LINE[:9], 1) == {}
    assert decoder.feed(LINE[9:] + LINE[:1], 2)["tss1"].t_ns.tolist() == [1]
    assert decoder.feed(LINE[1:], 3)["tss1"].t_ns.tolist() == [2]


@pytest.mark.parametrize(
    ("columns", "error", "words"),
    [
        ({}, ShapeError, "columns of tss1"),
        ({"roll": [0.0], "pitch": [0.0, 1.0]}, ShapeError, "columns of tss1"),
        ({"yaw": [0.0]}, ParameterError, "no field 'yaw'"),
        ({"roll": [np.nan]}, ParameterError, "roll of tss1 must be finite"),
        ({"quality": [ord("X")]}, ParameterError, "one of UuGgHhFf"),
    ],
)
def test_what_cannot_be_a_line_is_refused(columns, error, words):
    with pytest.raises(error, match=words):
        encode_tss1(columns)
