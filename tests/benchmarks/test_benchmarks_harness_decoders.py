"""The decoder benchmark: what it does to frames, and that it notices losses, wrong frames and growth."""

import numpy as np
import pytest

from benchmarks.harness.decoder_fuzz import Fuzzed, fuzz
from benchmarks.harness.decoder_streams import HARMS, Damaged, damage, frames_of, settled, user_frame
from benchmarks.harness.decoders import judge, measure_decoders
from plumbob import decode, find_format

GROWTH = {"bit flip": 0, "byte dropped": -1, "byte inserted": 1, "length flip": 0}


def rng():
    return np.random.default_rng(3)


@pytest.mark.parametrize("kind", HARMS)
@pytest.mark.parametrize("name", ["ahrs400", "x5555"])
def test_each_way_of_damage_does_what_it_says(kind, name):
    form = settled(find_format(name))
    (frame,) = frames_of(form, 1, rng())
    for _ in range(20 if kind != "1 MB noise" else 1):
        harmed = HARMS[kind](form, frame, rng())
        assert harmed != frame or kind in ("64 B noise", "1 MB noise")
        if kind in GROWTH:
            assert len(harmed) == len(frame) + GROWTH[kind]
        if kind == "cut frame":
            assert frame.startswith(harmed) and 0 < len(harmed) < len(frame)
        if "flip" in kind:
            assert sum((a ^ b).bit_count() for a, b in zip(harmed, frame, strict=True)) == 1
        if kind == "length flip":
            assert harmed[:4] + harmed[5:] == frame[:4] + frame[5:] if name == "x5555" else harmed[1:] == frame[1:]
        assert len(harmed) == {"64 B noise": 64, "1 MB noise": 1_000_000}.get(kind, len(harmed))


def test_damage_says_where_the_others_are():
    form = user_frame()
    frames = frames_of(form, 500, rng())
    found, _ = decode(b"".join(frames), form)
    assert found["user_crc16"].start.tolist() == list(range(0, 500 * 18, 18))
    stream = damage(form, frames, "byte dropped", 0.02, rng())
    assert stream.faults == 10 and len(stream.whole) == 490 and len(stream.data) == 500 * 18 - 10
    assert all(stream.data[at : at + size] in frames for at, size in stream.whole.items())
    assert {frame for frame in frames if frame not in stream.lost} == {
        stream.data[at : at + size] for at, size in stream.whole.items()
    }


def test_a_lost_frame_a_wrong_one_and_growth_are_noticed():
    form = user_frame()
    first, second, third = frames_of(form, 3, rng())
    hidden = Damaged(first + second[:-1] + third, {0: 18, 18: 18, 35: 18}, frozenset(), 1)
    assert judge(form, "cut frame", hidden).lost == 1
    assert judge(form, "cut frame", hidden).met
    two = Damaged(first[1:] + second[1:] + third, {0: 18, 17: 18, 34: 18}, frozenset(), 1)
    found = judge(form, "cut frame", two)
    assert (found.lost, found.longest, found.wrong, found.met) == (2, 2, 0, False)
    forged = Damaged(first + second + third, {0: 18, 36: 18}, frozenset(), 1)
    assert judge(form, "cut frame", forged).wrong == 1 and not judge(form, "cut frame", forged).met
    restored = Damaged(first + second + third, {0: 18, 36: 18}, frozenset({second}), 1)
    assert judge(form, "cut frame", restored).wrong == 0
    fuzzed = fuzz(user_frame(), 20_000, rng())
    assert fuzzed.size == 20_000 and fuzzed.sound and 300 < fuzzed.frames < 20_000 / 18
    assert not Fuzzed(10, 1, fuzzed.bound + 1, fuzzed.bound, 1, 0.1).sound
    assert not Fuzzed(10, 1, 0, fuzzed.bound, 2, 0.1).sound


@pytest.mark.parametrize("name", ["ahrs400", "rion", "adxrs453", "witmotion"])
def test_targets_are_met_on_a_small_scale(name):
    result = measure_decoders([find_format(name)], frames=1000, noise=100_000, fuzzing=10_000)
    assert result.met, result.text()
    (one,) = result.formats
    assert [harm.kind for harm in one.harms] == (["bit flip"] if name == "adxrs453" else list(HARMS))
