"""What is a static record: no noise is refused, motions are, and each finding names its place."""

import math
import re

import numpy as np
import pytest

from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.units import Quantity
from plumbob.data import plausibility
from plumbob.noise import artefacts
from plumbob.noise.static import FEWEST_SAMPLES, StaticCheck, bridged, judge
from plumbob.simulation.errors import flicker, random_walk
from tests.helpers import is_plain, slow_as_python

COUNT, DT = 6000, 0.01
T = np.arange(COUNT) * DT
PLAIN = is_plain()


def check(values, **words):
    values = np.asarray(values, dtype=float)
    names = ["x"] if values.ndim == 1 else [f"gyr {axis}" for axis in "xyz"[: values.shape[1]]]
    one = StaticCheck(names, words.pop("dt", DT), **words)
    one.add(values)
    return one


def report(values, **words):
    return judge(check(values, **words))


def kinds(judged):
    return [finding.kind for finding in judged.findings]


def judgement(judged):
    """Each finding's kind, and whether it refuses."""
    return [(finding.kind, finding.refuses) for finding in judged.findings]


def white(seed=0, count=COUNT):
    return np.random.default_rng(seed).standard_normal(count)


def noises(rng, count):
    def white_of(sd):
        return sd * rng.standard_normal((count, 3))

    flicker_1, walk_1 = flicker(np.ones(3), count, rng), random_walk(np.ones(3), count, 1.0 / DT, rng)
    t = np.arange(count)[:, np.newaxis] * DT
    yield from {
        "white": white_of(1.0), "flicker": flicker_1, "walk": walk_1,
        "all and a ramp": white_of(1.0) + 0.3 * flicker_1 + 0.1 * walk_1 + 5.0 * t,
        "warm-up": white_of(1.0) + 20.0 * np.exp(-t / 60.0),
        "quantised": np.round(white_of(0.7) + 0.3 * flicker_1 + 0.1 * walk_1),
        "coarse": np.round(white_of(0.3) + 0.1 * walk_1), "coarse and a ramp": np.round(white_of(0.05) + 0.1 * t),
        "quantised angle": np.diff(rng.standard_normal((count + 1, 3)), axis=0),
    }.items()  # fmt: skip


@slow_as_python
@pytest.mark.parametrize(
    ("dt", "rounds"),
    [(DT, 4), (1.0, 2), (0.05, 2), (5e-4, 2), pytest.param(DT, 34, marks=pytest.mark.long(reason="seconds"))],
)
def test_noise_is_not_refused(dt, rounds):
    """27 channels a round; if one in a hundred were refused, none of 900 would be in e⁻⁹ of such tests, 1e-4."""
    rng = np.random.default_rng(20)
    refused = [
        name
        for _ in range(rounds)
        for name, values in noises(rng, COUNT)
        for channel in (values.T if dt == DT else [values])
        if report(channel, dt=dt).errors
    ]
    assert refused == []


MOTIONS = {
    "a step": 5.0 * (T > 30.0),
    "a short bump": 8.0 * np.exp(-0.5 * ((T - 30.0) / 0.1) ** 2),
    "a slow bump": 20.0 * np.exp(-0.5 * ((T - 30.0) / 1.0) ** 2),
    "shaking for two seconds": 3.0 * np.sin(2.0 * math.pi * 5.0 * T) * (np.abs(T - 30.0) < 1.0),
    "half of the time": 30.0 * np.sin(T) * (T > 30.0),
}


@pytest.mark.parametrize("motion", MOTIONS)
def test_a_motion_is_refused_and_the_still_part_passes(motion):
    values = white() + MOTIONS[motion]
    judged = report(values, start=100.0)
    assert kinds(judged) == ["moving"]
    assert judged.moving[0][0] < 130.0 + 2.0 and judged.moving[0][1] > 130.0
    start, stop = judged.still
    assert (stop < 130.0 + 1.0) or (start > 130.0)
    assert stop - start > 15.0
    assert f"--from {math.ceil(10 * start - 1e-6) / 10:g}s --to" in str(judged.errors[0].finding)
    assert report(values[round((start - 100.0) / DT) : round((stop - 100.0) / DT)]).errors == ()
    assert judged.refused("x") and str(judged.errors[0]).startswith("x: moved or was disturbed from")


@pytest.mark.skipif(PLAIN, reason="the kernels are the same as for shorter averages")
def test_a_step_of_two_standard_deviations_in_ten_minutes():
    """Of averages over 5.12 s, whose second differences have 0.108 sd, it bends one by 1 sd or more."""
    t = np.arange(60_000) * DT
    for seed in range(5):
        values = white(seed, t.size)
        values[30_000 + 50 * seed :] += 2.0
        found = report(0.05 * values)
        assert kinds(found) == ["moving"]
        assert found.moving[0][0] < 300.0 < found.moving[-1][1]
        assert report(0.05 * white(seed, t.size) + np.exp(-t / 300.0)).errors == ()


def test_all_axes_are_cut_alike_and_nothing_still_is_said():
    rough = 1000.0 * np.sin(T) * (T < 20.0) + 4.0 * ((T > 40.0) & (T < 41.0))  # and a gentle motion beside it
    still = report(white() + rough).still
    assert still[0] > 20.0 and (still[1] <= 40.0 or still[0] >= 41.0)
    values = np.stack([white(1), white(2), white(3)], axis=1)
    values[:3000, 0] += 20.0 * np.sin(3.0 * T[:3000])
    values[4500:, 2] += 20.0 * np.sin(3.0 * T[4500:])
    judged = report(values)
    assert judged.errors[0].channel == "gyr x, gyr y, gyr z"
    assert 30.0 <= judged.still[0] < judged.still[1] <= 45.0
    values[::700] += 50.0 * (1.0 + white(4, 3))
    values[1::700] += 50.0
    judged = report(values)
    assert judged.still is None and "no stretch is still for long enough" in str(judged.errors[0].finding)


def test_a_steady_shaking_is_refused_and_a_faint_line_is_told():
    judged = report(white() + 10.0 * np.sin(2.0 * math.pi * 3.0 * T))
    assert judgement(judged) == [("periodic", True)]
    assert "oscillates at 3.00" in str(judged.errors[0].finding)  # a line is known to 1/60 Hz
    t = np.arange(60_000) * DT
    assert judgement(report(white(0, t.size) + 0.8 * np.sin(2.0 * math.pi * 0.5 * t))) == [("periodic", False)]
    assert kinds(report(np.round(0.05 * white() + T), dt=0.1)) == ["coarse"]  # the stairs of a ramp are no shaking


@pytest.mark.parametrize("frequency", [0.5, 3.0, 20.0, 45.0])
def test_frequency_and_amplitude_of_an_oscillation(frequency):
    """Alone, so that the line is known to a bin of its spectrum, and the amplitude to its averaging there."""
    found = artefacts.shaking(7.0 * np.sin(2.0 * math.pi * frequency * T), DT)
    assert found.frequency == pytest.approx(frequency, abs=1.0 / (COUNT * DT))
    assert found.amplitude == pytest.approx(7.0, rel=0.05)
    assert artefacts.shaking(white(), DT) is None


def test_a_gyroscope_that_turns_all_the_time_and_an_accelerometer_that_is_tilted_or_not_in_gravity():
    """Stationary, so that no window is louder than another; but no gyroscope at rest says so."""
    rng = np.random.default_rng(5)
    tumbling = np.convolve(rng.standard_normal(COUNT + 199), np.ones(200), "valid") * 0.1  # rad/s, within ±3 rad/s
    values = np.stack([tumbling, tumbling[::-1], tumbling], axis=1) + 0.01 * rng.standard_normal((COUNT, 3))
    assert "moving" not in kinds(report(values))
    assert kinds(report(values, quantity=Quantity.RATE)) == ["moving"]

    def turned(degrees, size=9.81):
        angle = math.radians(degrees) * T / T[-1]  # as slow as a ramp, which noise has too
        return size * np.stack([np.sin(angle), 0.0 * T, np.cos(angle)], axis=1)

    noise = 0.02 * np.random.default_rng(6).standard_normal((COUNT, 3))
    words = {"quantity": Quantity.ACCELERATION, "triad": True}
    assert report(turned(6.0) + noise).errors == ()
    assert kinds(report(turned(6.0) + noise, **words)) == []  # within 3° of its middle
    assert kinds(report(turned(12.0) + noise, **words)) == ["moving"]
    judged = report(1.5 * (turned(0.0) + noise), **words)
    assert kinds(judged) == ["not_at_rest"]
    assert str(judged.errors[0].finding) == "measures 1.5 g, but at rest it is 1 g: a wrong scale, or never at rest?"
    for values in (noise, 0.05 * (turned(12.0) + noise), turned(108.0, 0.05 * 9.80665) + noise):
        assert kinds(report(values, **words)) == ["not_at_rest"]  # its direction says nothing


def test_blocks_of_any_size_give_the_same_report_and_runs():
    values = white(7) + MOTIONS["a step"]
    values[1234] = 40.0
    whole = report(values)
    for size in (7, 1000) if not PLAIN else (1000,):
        one = StaticCheck(["x"], DT)
        for start in range(0, COUNT, size):
            one.add(values[start : start + size])
        assert judge(one) == whole
    runs = artefacts.ChannelWatch()
    values = np.repeat([1.0, 2.0, 1.5, 3.0], [5, 40, 1, 30])
    for block in (values[:0], *np.array_split(values, 20)):
        runs.add(block)
    assert runs.one_way is None
    runs.add(np.arange(1000) % 2)
    assert runs.stuck() == [(5, 45), (46, 76)]  # 72 of 1075 are equal: 10 + 3 ln 1076 / 2.70 = 17.7


def test_too_short_and_what_does_not_meet():
    judged = report(white()[: FEWEST_SAMPLES - 1])
    assert kinds(judged) == kinds(judge(StaticCheck(["x"], DT))) == ["short"]
    assert "999 samples are too few; record 1000 or more" in str(judged.errors[0].finding)
    assert report(white()[:FEWEST_SAMPLES]).errors == ()
    slow = StaticCheck(["mag x"], 100.0 * DT)  # which does not hide what the others saw
    slow.add(white(5, COUNT // 100))
    judged = judge(check(white() + MOTIONS["a step"]), slow)
    assert [(f.kind, f.channel) for f in judged.findings] == [("moving", "x"), ("short", "mag x")]
    assert judged.still is not None
    apart = judge(check(white(1)), check(white(2), start=2.0 * COUNT * DT))  # stretches that have nothing in common
    assert (apart.errors, apart.still) == ((), None)
    with pytest.raises(ShapeError, match=r"must have shape \(n, 1\), but its shape is \(5, 2\)"):
        StaticCheck(["x"], DT).add(np.zeros((5, 2)))
    with pytest.raises(ParameterError, match="dt must be a positive time"):
        StaticCheck(["x"], 0.0)


def test_not_finite_is_counted_and_placed():
    values = np.stack([white(1), white(2)], axis=1)
    values[[50, 5000], 1] = math.nan, math.inf
    static = StaticCheck(["gyr x", "gyr y"], DT)
    static.add(values[:40])
    static.add(values[40:])
    (finding,) = judge(static).findings
    text = "gyr y: sample 50 is not finite (2 such of 6000); the longest stretch of numbers is --from 0.6s --to 50s."
    assert str(finding) == text
    assert report(values[60:5000], start=0.6).errors == ()
    values[::900, 0] = math.nan
    assert "6000); no stretch is long enough." in str(report(values).errors[0].finding)
    assert "--from 0s --to 20s" in str(report(np.append(white()[:2000], [math.nan, 1.0, math.nan])).errors[0])


LEVELS = np.array([1, 0, 2, 5, 3, 4])


@pytest.mark.parametrize(("values", "kind", "refuses", "text"), [
    (np.full(COUNT, 0.25), "constant", True, "all 6000 values are 0.25; the sensor is stuck"),
    (0.0625 * np.round(0.3 * white() + 0.2), "coarse", False, "of the step 0.0625 with"),
    (
        white() + 30.0 * np.isin(T, T[[1234, 4000]]),
        "spikes",
        False,
        "as errors of transmission do: 2, at sample 1234, 4000;",
    ),
    (np.arange(COUNT), "one_way", True, r"only rises; is it time or a counter\? Leave"),
    (1.7e9 + T, "one_way", True, "only rises"),
    (0.1 * T, "one_way", True, "only rises"),
    (-T, "one_way", True, "only falls"),
    (np.floor(T), "one_way", True, "only rises"),
    *(
        (np.repeat(white(), n)[:COUNT], "held", True, f"about {n} times in a row.* about {100 / n:.4g} Hz")
        for n in (2, 3, 10)
    ),
    # in turn, apart by four standard deviations
    *(
        (white(8) + 4.0 * LEVELS[np.arange(COUNT) % n], "interleaved", True, f"{n} channels in turn")
        for n in (2, 3, 6)
    ),
])  # fmt: skip
def test_what_no_noise_gives_is_named(values, kind, refuses, text):
    judged = report(np.stack([white(), values], axis=1))
    assert [(f.kind, f.channel, f.refuses) for f in judged.findings] == [(kind, "gyr y", refuses)]
    assert re.search(text, str(judged.findings[0].finding))
    assert kind != "coarse" or judged.steps["gyr y"] == pytest.approx(0.0625, rel=1e-12)


def test_units_and_what_looks_alike():
    judged = report(np.full(COUNT, 0.25), quantity=Quantity.RATE)
    assert "all 6000 values are 0.25 rad/s; the sensor is stuck" in str(judged.errors[0].finding)
    assert report(0.0625 * np.round(white())).findings == ()
    for ramp in (np.arange(COUNT), 1.7e9 + T, 0.1 * T, -T):
        assert "one_way" not in kinds(report(ramp + white()))
    for n in (2, 3, 10):
        uneven = np.repeat(white(), np.random.default_rng(9).integers(n, n + 2, COUNT))[:COUNT]
        assert kinds(report(uneven)) == ["held"]
    for sd in (0.2, 0.3, 0.5, 1.0):
        for seed in range(5):
            assert artefacts.hold_length(np.round(sd * white(seed) + 0.4)) == artefacts.hold_length(white(seed)) == 1
    hum = 0.5 * np.sin(math.pi * np.arange(COUNT) + 0.5)  # of half the rate, folded
    for channel in (white(1) + hum, np.cumsum(white(2)), white(3) + 0.01 * np.arange(COUNT)):
        assert artefacts.interleaved(channel) == 1


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("off", "told"), [(8.4, False), (9.6, True)])
def test_a_spike_begins_nine_standard_deviations_off_its_neighbours(off, told, sign):
    """The second differences of white noise have 6 sd² [Riley2008]; the median of 23 cells of 256 knows sd to 1.5 %."""
    values = 0.3 * white()
    values[2999:3002] = 1.0, 1.0 + sign * 0.3 * off, 1.0
    one = artefacts.Spikes()
    for block in np.split(values, [700, 2999, 3001]):
        one.add(block)
    assert one.places(0.0) == ([3000] if told else [])
    assert one.places(0.3 * (off + 0.1)) == []  # a least distance goes before the law


@pytest.mark.parametrize("at", [0.5, 1.0, 2.0])
def test_clipped_values_are_refused(at):
    both, above, below = np.clip(white(), -at, at), np.minimum(white(), at), np.maximum(white(), -at)
    for values, end in ((both, -at), (both, at), (above, at), (below, -at)):
        found = report(values, quantity=Quantity.ACCELERATION)
        assert [(f.kind, f.refuses) for f in found.findings] == [("clipped", True)]
        assert f"{np.count_nonzero(values == end)} times {end:g} m/s2" in str(found.errors[0].finding)
    assert kinds(report(np.clip(np.round(4.0 * white()), -4.0, 4.0))) == ["clipped"]


def test_noise_of_few_levels_is_not_clipped():
    """The outermost level of a normal distribution never has more than its neighbour where sd is the step or more."""
    for sd in (1.0, 1.5, 3.0, 10.0):
        for seed, offset in enumerate(np.linspace(0.0, 0.5, 6)):
            values = np.round(sd * white(seed) + offset)
            assert plausibility.clipped({"": values}) == {}
            assert report(values).findings == ()
    slow = np.round(np.convolve(white(3), np.ones(40), "same"))
    slow[3000:3030] = slow.max() + 1.0
    assert plausibility.clipped({"": slow}) == {}  # for long, but once
    assert kinds(report(np.round(0.2 * white() + 30.0 * np.exp(-T / 5.0)))) == ["coarse"]  # rests at its last level


@pytest.mark.parametrize("values", [lambda x: x, np.round, lambda x: np.round(x + 0.05 * T)])
@pytest.mark.parametrize("level", [0.0, None])
def test_a_stuck_part_is_refused_and_the_rest_passes(values, level):
    """Ten seconds, then most of the record: noise beside it is no motion."""
    for first, end in ((3000, 4000), (1200, COUNT), (0, 4500)):
        stuck = values(white())
        stuck[first:end] = stuck[first] if level is None else level
        judged = report(stuck, start=100.0)
        assert kinds(judged) == ["stuck"]
        (part,) = judged.moving
        assert part == pytest.approx((100.0 + first * DT, 100.0 + end * DT), abs=8 * DT)  # neighbours may be equal
        assert f"repeats one value from {part[0]:.4g} s" in str(judged.errors[0].finding)
        start, stop = (round((edge - 100.0) / DT) for edge in judged.still)
        assert stop <= first or start >= end
        assert report(stuck[start:stop]).errors == ()


@pytest.mark.parametrize(
    ("step", "digits"), [(0.00875, 6), (0.061, 3), (0.061, 2), (1.0, 0), (4.0, 0), (1.0 / 131.0, 6), (2.0**-12, 9)]
)
@pytest.mark.parametrize("offset", [0.0, 7.0])
def test_a_step_is_found_through_the_rounding_of_a_text(step, digits, offset):
    """A straight line through 40 or more levels knows its slope to the rounding over the span of the levels."""
    counts = np.round(12.0 * white(8)) + 100.0
    values = np.round(counts * step + offset, digits)
    assert artefacts.find_step(values) == pytest.approx(step, abs=10.0**-digits / 40.0, rel=1e-6)
    if digits > 3:
        assert artefacts.find_step(values.astype(np.float32)) == pytest.approx(step, rel=1e-3)


def test_no_step_is_invented_kernels_intervals_and_gaps():
    for seed in range(20):
        assert artefacts.find_step(white(seed)) == 0.0
        assert artefacts.find_step(np.round(1e5 * white(seed))) == 0.0  # hardly a value comes twice
    assert artefacts.find_step(np.full(500, 3.0)) == 0.0
    assert artefacts.find_step(np.repeat(white()[:50], 20)) == 0.0  # repeated, but at no multiples
    assert artefacts.find_step(np.tile([1.0, 1.5], 500)) == pytest.approx(0.5)
    middle = np.empty(5)
    artefacts.median_of_three(np.array([0.0, 5.0, 1.0, 2.0, 2.0, -9.0, 3.0]), middle)
    assert middle.tolist() == [1.0, 2.0, 2.0, 2.0, 2.0]
    total, largest = np.empty(2), np.empty(2)
    artefacts.bend_energies(np.array([0.0, 1.0, 4.0, 9.0, 0.0, 0.0]), 2, total, largest)
    assert (total.tolist(), largest.tolist()) == ([8.0, 277.0], [4.0, 196.0])  # bends 2, 2, -14, 9
    assert artefacts.joined([(5, 7), (0, 2), (1, 3), (3, 4)]) == [(0, 4), (5, 7)]
    assert artefacts.between([(2, 3), (6, 9)], 0, 10) == [(0, 2), (3, 6), (9, 10)]
    assert artefacts.between([], 0, 10) == [(0, 10)]
    assert artefacts.between([(-5, 20)], 0, 10) == []
    # Left of the middle the samples before it, mirrored; right of it as many after it; their levels make a line.
    row = np.array([8.0, 1.0, 2.0, 0.0, 9.0, 9.0, 9.0, 9.0, 5.0, 7.0, 6.0])[:, np.newaxis]
    found = bridged(row, 1.0, 99.0, [(103.0, 107.0)])[:, 0]
    low, high = (1.0 + 2.0 + 0.0) / 3.0, (5.0 + 7.0 + 6.0) / 3.0
    line = low + (high - low) * np.array([0.125, 0.375, 0.625, 0.875])
    assert found[4:8] == pytest.approx(line + [0.0 - low, 2.0 - low, 7.0 - high, 5.0 - high])
    assert np.array_equal(np.delete(found, [4, 5, 6, 7]), np.delete(row[:, 0], [4, 5, 6, 7]))
    assert row[4, 0] == 9.0
    assert bridged(row, 1.0, 99.0, [(98.0, 102.0), (108.0, 111.0)])[:, 0].tolist() == row[3:9, 0].tolist()


@pytest.mark.parametrize(("width", "moved"), [(1, False), (3, True)])
def test_a_spike_of_one_sample_is_no_motion_and_one_of_three_is(width, moved):
    values = white()
    values[3000 : 3000 + width] += 100.0
    stillness = artefacts.Stillness(DT)
    stillness.add(values)
    assert bool(stillness.moving(0, COUNT, 0.0)) == moved


LONG = np.arange(60_000) * DT
BUMPS = 8.0 * np.exp(-0.5 * ((LONG - 200.0) / 0.1) ** 2) + 20.0 * np.exp(-0.5 * ((LONG - 207.0) / 0.2) ** 2)


@pytest.mark.skipif(PLAIN, reason="the kernels are the same as for shorter records")
def test_short_disturbances_of_a_long_record_are_skipped_and_told():
    noise = white(2, LONG.size)
    judged = report(noise + BUMPS, start=1000.0)
    assert judged.errors == () and kinds(judged) == ["disturbed"]
    first, second = judged.skipped["x"]
    assert first[0] < 1200.0 - 0.5 < 1200.0 + 0.5 < first[1] < 1204.0
    assert second[0] < 1207.0 - 0.5 < 1207.0 + 0.5 < second[1] < 1212.0
    remaining = 100.0 * (1.0 - (first[1] - first[0] + second[1] - second[0]) / 600.0)
    text = str(judged.findings[0].finding)
    assert f"and is skipped there: {first[0]:.6g} to {first[1]:.6g} s" in text
    assert f"(2 in all); {remaining:.4g} % of the record is left" in text
    drifting = report(noise + BUMPS + 0.05 * LONG)  # a drift that goes on is no other level
    assert (drifting.errors, list(drifting.skipped)) == ((), ["x"])
    level = report(noise + BUMPS + 2.0 * (LONG > 207.0))
    assert kinds(level) == ["moving"] and level.skipped == {}
    assert "and may be at another level after" in str(level.errors[0].finding)
    every = 8.0 * np.exp(-0.5 * (((LONG + 10.0) % 20.0 - 10.0) / 0.1) ** 2)  # too much of it
    assert kinds(report(noise + every)) == ["moving"]


@pytest.mark.skipif(PLAIN, reason="the kernels are the same as for shorter records")
def test_what_is_asked_for_is_skipped_whatever_it_holds():
    record = check(white(2, LONG.size) + BUMPS)
    judged = judge(record, skip=[(190.0, 210.0), (-5.0, 1.0), (700.0, 800.0)])
    assert (judged.errors, judged.skipped) == ((), {"x": ((0.0, 1.0), (190.0, 210.0))})
    for span, text in (
        ((0.0, 121.0), r"121 s of 600 s would be skipped, but at most 20 % can be\. Choose one"),
        ((3.0, 2.0), "must end after it begins, but it is 3 s to 2 s"),
    ):
        with pytest.raises(ParameterError, match=text):
            judge(record, skip=[span])


@pytest.mark.parametrize("unit", [False, True])
def test_each_sensor_is_judged_by_itself_but_a_unit_that_moves_as_a_whole(unit):
    words = [{"quantity": q} for q in (Quantity.RATE, Quantity.ACCELERATION)] if unit else [{}, {}]
    quiet, moved = (StaticCheck([name], DT, **more) for name, more in zip(("gyr x", "acc x"), words, strict=True))
    quiet.add(0.01 * white(3))
    moved.add(0.01 * (white(4) + MOTIONS["half of the time"]))
    judged = judge(quiet, moved)
    assert (judged.refused("gyr x"), judged.refused("acc x")) == (unit, True)
    assert str(judged.errors[0].finding).startswith("the unit moved or was disturbed from") is unit
