"""Statistics that are gathered while a recording passes."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import plumbob
from plumbob.core import flags
from plumbob.core.constants import G0
from plumbob.core.errors import ShapeError
from plumbob.data import AttitudeTrack
from plumbob.overview import streaming_stats
from plumbob.overview.streaming_stats import TRACED, Gatherer, Tracing, channel_rows
from plumbob.quality.quality import FAIL, MISSING, NOT_EVALUATED, PASS, SUSPECT, THRESHOLDS, verdict
from plumbob.quality.spectra import LEAST, Spectra, peak_period, welch
from plumbob.rotations import euler_zyx_from_quat, quat_from_euler_zyx, quat_from_rotvec, quat_multiply

SIM = {"frame": "NED", "sensors": "mpu6000+hmc5983", "unit": "calibrated"}


@pytest.fixture(scope="module")
def sea():
    """A minute with a gap of 3 s and an estimate."""
    made = plumbob.simulate("buoy", duration=60.0, seed=1, **SIM).imu
    t = made.t.copy()
    t[2500:] += 3.0
    imu = replace(made, t=t)
    return imu, plumbob.estimate(imu, "mekf").track


def gathered(imu, track, sizes, **how):
    gatherer = Gatherer(**how)
    gatherer.begin(imu)
    for start, stop in pairwise(np.unique(np.minimum(np.cumsum([0, *sizes]), len(imu)))):
        rows, names = slice(start, stop), ("t", "q_nb", "bias_b", "cov_b", "flags")
        part = {name: getattr(track, name)[rows] for name in names}
        gatherer.take(imu[rows], AttitudeTrack.trusted(**part, frame=track.frame, north=track.north))
    return gatherer.done()


def test_parts_do_not_change_what_is_gathered(sea):
    imu, track = sea
    one = gathered(imu, track, [len(imu)], burst=20.0)
    two = gathered(imu, track, [1, 2, 1997, 500, *[313] * 20], burst=20.0)  # the gap is between two
    assert one.tilt.roll.significant == two.tilt.roll.significant
    assert one.tilt.roll.sd == pytest.approx(two.tilt.roll.sd, rel=1e-12)
    assert one.headings.counts.tolist() == two.headings.counts.tolist()
    assert one.spectra.density == pytest.approx(two.spectra.density, rel=1e-9, nan_ok=True)
    assert np.array_equal(one.traces.values, two.traces.values, equal_nan=True)
    assert one.gaps == two.gaps and one.missing == two.missing
    assert [b.verdicts for b in one.bursts] == [b.verdicts for b in two.bursts]
    raised = [{n: (r.samples, r.stretches) for n, r in found.flags.items()} for found in (one, two)]
    assert raised[0] == raised[1]
    assert one.moments.sd == pytest.approx(two.moments.sd, rel=1e-9, nan_ok=True)
    for name in ("least", "greatest"):
        assert np.array_equal(getattr(one.moments, name), getattr(two.moments, name), equal_nan=True)


def test_the_step_of_stamps_in_whole_milliseconds_is_that_of_the_samples(sea):
    t = np.floor(np.arange(len(sea[0])) * 1e3 / 286.0) / 1e3
    assert gathered(replace(sea[0], t=t), replace(sea[1], t=t), [len(t)]).step == pytest.approx(1.0 / 286.0, rel=1e-3)


def test_gaps_are_counted_with_what_they_lack_and_bursts_by_time(sea):
    imu, track = sea
    found = gathered(imu, track, [len(imu)])
    assert len(found.gaps) == 1
    assert found.gaps[0] == pytest.approx((24.99, 28.0))
    assert found.missing == 300
    assert found.lost == pytest.approx(3.0)
    # a rest of less than half a burst is the last one's
    assert [round(b.end - b.begin) for b in gathered(imu, track, [len(imu)], burst=20.0).bursts] == [20, 20, 23]
    assert [round(b.end - b.begin) for b in gathered(imu, track, [len(imu)], burst=25.0).bursts] == [25, 25, 13]


def test_a_window_counts_alone_and_every_sample_of_a_short_recording_is_traced(sea):
    imu, track = sea
    found = gathered(imu, track, [700] * 20, window=(5.0, 15.0))
    assert (found.samples, found.begin, found.end) == (1001, 5.0, 15.0)
    with pytest.raises(ShapeError, match="no sample lies between 70 and 80 s"):
        gathered(imu, track, [700] * 20, window=(70.0, 80.0))
    found = gathered(imu, track, [999] * 10).traces
    assert found.each == 1
    assert found.t.size == len(imu) + 1  # a row of NaN in the gap
    assert np.isnan(found.values[2500]).all()
    assert np.delete(found.values[:, TRACED.index("gyr_y")], 2500) == pytest.approx(imu.gyr[:, 1], rel=1e-6)


def test_a_long_recording_keeps_every_extreme(monkeypatch):
    """Smallest and largest of each ten of 997, the last seven too; a spike of one sample is there."""
    monkeypatch.setattr(streaming_stats, "BUCKETS", 100)
    t, rng = np.arange(997) * 0.1, np.random.default_rng(1)
    values = rng.normal(size=(997, 2))
    values[503, 0] = 50.0
    tracing = Tracing(("a", "b"), 997, most=500)
    broken = np.zeros(997, dtype=bool)
    for start, stop in ((0, 3), (3, 250), (250, 251), (251, 997)):
        tracing.add(t[start:stop], values[start:stop], broken[start:stop])
    found = tracing.done()
    assert found.each == 10
    pairs = found.values[:, 0].reshape(-1, 2)
    tens = np.split(values[:, 0], np.arange(10, 997, 10))
    assert pairs.min(axis=1) == pytest.approx([ten.min() for ten in tens], rel=1e-6)
    assert pairs.max(axis=1) == pytest.approx([ten.max() for ten in tens], rel=1e-6)
    assert np.all(np.diff(found.t) > 0.0)


def test_a_gap_in_a_long_recording_breaks_the_line(monkeypatch):
    monkeypatch.setattr(streaming_stats, "BUCKETS", 10)
    t = np.arange(100) * 0.1
    t[55:] += 2.0
    broken = np.zeros(100, dtype=bool)
    broken[55] = True
    tracing = Tracing(("a",), 100, most=50)
    tracing.add(t[:52], np.ones((52, 1)), broken[:52])
    tracing.add(t[52:], np.ones((48, 1)), broken[52:])
    found = tracing.done()
    hole = np.flatnonzero(np.isnan(found.values[:, 0]))
    assert hole.size == 1
    assert found.t[hole[0] - 1] < 5.5 < found.t[hole[0]] < 7.5 <= found.t[hole[0] + 1]


def test_extremes_of_an_angle_are_about_its_first_value(monkeypatch):
    monkeypatch.setattr(streaming_stats, "BUCKETS", 1)
    angle = np.radians([350.0, 355.0, 1.0, 8.0])
    tracing = Tracing(("heading",), 4, most=2, circular=("heading",))
    tracing.add(np.arange(4.0), angle[:, None], np.zeros(4, dtype=bool))
    assert np.degrees(tracing.done().values[:, 0]) == pytest.approx([350.0, 368.0], rel=1e-6)


def test_claimed_angles_are_those_of_small_errors():
    """Deviation of roll, pitch and yaw over 4000 errors drawn of a covariance in body axes, within 4 of its errors."""
    rng = np.random.default_rng(7)
    n = 4000
    q = quat_from_euler_zyx(np.radians([40.0, 35.0, -25.0]))
    half = 1e-4 * rng.normal(size=(3, 3))
    errors = rng.normal(size=(n, 3)) @ half.T
    spread = np.std(euler_zyx_from_quat(quat_multiply(q, quat_from_rotvec(errors))), axis=0)
    track = AttitudeTrack(t=[0.0], q_nb=q[np.newaxis], frame="NED", north="magnetic", cov_b=(half @ half.T)[np.newaxis])
    found = dict(zip(TRACED, channel_rows(None, track)["traced"][0], strict=True))
    own = [found[f"{name}_sd"] for name in ("heading", "pitch", "roll")]
    assert own == pytest.approx(spread, rel=4.0 / math.sqrt(2.0 * n))
    assert np.degrees(found["roll"]) == pytest.approx(-25.0)


RATE = 50.0


def times(duration=1000.0):
    return np.arange(0.0, duration, 1.0 / RATE)


def test_the_integral_is_the_variance():
    """Of a sine A² / 2, of white noise σ²: the density is one-sided [Welch1967]."""
    t = times()
    rng = np.random.default_rng(1)
    noise = rng.normal(0.0, 0.3, t.size)
    found = welch(t, np.stack((2.0 * np.sin(2.0 * np.pi * 0.2 * t), noise), axis=1), segment=100.0)
    power = found.density.sum(axis=0) * found.frequency[0]
    assert power[0] == pytest.approx(2.0, rel=1e-3)
    assert power[1] == pytest.approx(0.09, rel=0.02)
    assert np.mean(found.density[:, 1]) == pytest.approx(2.0 * 0.09 / RATE, rel=0.02)
    assert found.frequency[0] == pytest.approx(0.01)
    assert found.segments.tolist() == [19, 19]


@pytest.mark.parametrize("period", [3.7, 5.0, 12.9])
def test_a_peak_is_found_between_the_steps_of_frequency(period):
    t = times()
    found = welch(t, np.sin(2.0 * np.pi * t / period)[:, None], segment=100.0)
    assert 1.0 / peak_period(found, 0) == pytest.approx(1.0 / period, abs=0.1 * found.frequency[0])


def test_no_segment_crosses_a_gap_or_an_unknown_value():
    """A jump at the gap would fill the spectrum."""
    t = times()
    x = np.sin(2.0 * np.pi * 0.2 * t)
    later = np.where(np.arange(t.size) >= 23_000, t + 5.0, t)
    jumps = np.where(np.arange(t.size) >= 23_000, x + 100.0, x)
    broken = welch(later, jumps[:, None], segment=100.0)
    assert broken.segments.tolist() == [8 + 9]
    assert broken.density.sum() * broken.frequency[0] == pytest.approx(0.5, rel=1e-3)
    hole = x.copy()
    hole[23_000:23_010] = np.nan
    assert welch(t, hole[:, None], segment=100.0).segments.tolist() == [8 + 9]
    assert math.isnan(peak_period(welch(t, np.full((t.size, 1), np.nan)), 0))


def test_an_angle_goes_on_through_the_half_turn_and_uneven_samples_are_interpolated():
    t = times()
    angle = np.pi + 0.3 * np.sin(2.0 * np.pi * 0.2 * t)
    wrapped = (angle + np.pi) % (2.0 * np.pi) - np.pi
    found = welch(t, wrapped[:, None], segment=100.0, turns=(0,))
    assert found.density.sum() * found.frequency[0] == pytest.approx(0.045, rel=1e-3)
    rng = np.random.default_rng(2)
    t = np.sort(times(400.0) + rng.uniform(-0.45, 0.45, times(400.0).size) / RATE)
    found = welch(t, np.sin(2.0 * np.pi * 0.2 * t)[:, None], segment=100.0)
    assert found.interpolated == found.segments.sum() == 7
    assert found.density.sum() * found.frequency[0] == pytest.approx(0.5, rel=0.01)


def test_parts_join_by_their_numbers_of_segments():
    t = times(400.0)
    rng = np.random.default_rng(5)
    x = rng.normal(size=(t.size, 1))
    one, two = welch(t[:10_000], x[:10_000], segment=40.0), welch(t[10_000:], x[10_000:], segment=40.0)
    joined = Spectra.joined([one, two])
    assert joined.segments.tolist() == [one.segments[0] + two.segments[0]]
    weighted = one.density * one.segments + two.density * two.segments
    assert joined.density == pytest.approx(weighted / joined.segments)


def test_bands_keep_the_power_and_a_short_stretch_has_short_segments():
    t = times()
    found = welch(t, np.random.default_rng(6).normal(size=(t.size, 1)), segment=200.0)
    frequency, density = found.gathered()
    assert frequency.size < found.frequency.size / 3
    assert frequency[:100] == pytest.approx(found.frequency[:100])
    assert np.mean(density) == pytest.approx(np.mean(found.density), rel=0.1)
    assert welch(np.arange(3.0), np.zeros((3, 1))).length == LEAST


QUALITY_RATE, LENGTH = 50.0, 600.0
SPAN = (0.0, LENGTH)
OFFSETS = {"gyr": 0.0, "acc": G0, "mag": 26.0, "attitude": 0.0, "temp": 0.0}
T = np.arange(0.0, LENGTH, 1.0 / QUALITY_RATE)
AXES = {"attitude": 2, "temp": 1}
RNG = np.random.default_rng(0)
WAVES = np.sin(2.0 * np.pi * T[:, None] / 5.0 + RNG.uniform(0.0, 6.0, 3)) + RNG.normal(0.0, 0.1, (T.size, 3))


def judged(channel, change=None, *, keep=slice(None), span=SPAN, vertical=None, marks=(0, 0)):
    """Verdict of ten minutes of waves and noise, changed, or of some samples; marks are flags of the first so many."""
    values, words = WAVES + OFFSETS[channel], np.zeros(T.size, dtype=np.uint32)
    words[: marks[1]] = marks[0]
    values = values if change is None else change(values.copy())
    values = values[:, : AXES.get(channel, 3)]
    return verdict(channel, T[keep], values[keep], words[keep], span, vertical)


@pytest.mark.parametrize("channel", ["gyr", "acc", "mag", "attitude"])
def test_a_healthy_burst_passes(channel):
    found = judged(channel)
    assert (found.flag, found.why, found.good) == (PASS, "", pytest.approx(1.0, abs=1e-3))


def test_noise_at_rest_a_slow_magnetometer_and_a_short_burst_pass():
    """White noise alone: of 60 000 values of three axes few are beyond four standard deviations."""
    for seed in range(5):
        assert judged("gyr", lambda v, seed=seed: np.random.default_rng(seed).normal(size=v.shape)).flag == PASS
    assert "mean shift" not in judged("gyr", keep=slice(2000), span=(0.0, 40.0)).tests
    # three values in four samples: its own rate counts
    found = judged("mag", lambda values: np.where(np.arange(T.size)[:, None] % 4 == 3, np.nan, values))
    assert (found.flag, found.good) == (PASS, pytest.approx(1.0, abs=1e-3))


def spikes(count, size):
    def change(values):
        values[100 : 100 + 7 * count : 7, 1] += size
        return values

    return change


def stuck(seconds):
    def change(values):
        values[1000 : 1000 + round(seconds * QUALITY_RATE) + 1] = values[1000]
        return values

    return change


HALF = T[:, None] >= LENGTH / 2.0
FAULTS = [
    ("spike", "gyr", spikes(8, 30.0), SUSPECT),
    ("spike", "gyr", spikes(400, 40.0), FAIL),
    ("flat line", "acc", stuck(0.5), PASS),
    ("flat line", "acc", stuck(2.0), SUSPECT),
    ("flat line", "acc", stuck(8.0), FAIL),
    # a step large against the noise is two standard deviations; a ramp changes 0.43 of them from eighth to eighth
    ("mean shift", "gyr", lambda values: values + 20.0 * HALF, FAIL),
    ("mean shift", "gyr", lambda values: values + 1.5 * HALF, SUSPECT),
    ("mean shift", "gyr", lambda values: values + 20.0 * T[:, None] / LENGTH, PASS),
    ("field", "mag", lambda values: values + 34.0, SUSPECT),
]


@pytest.mark.parametrize(("test", "channel", "change", "flag"), FAULTS)
def test_a_planted_fault_is_found(test, channel, change, flag):
    assert judged(channel, change).tests[test] == flag


def test_a_hole_is_a_gap_clipped_samples_are_out_of_range_and_untrusted_attitudes_not_good():
    for seconds, gap, good in ((0.5, PASS, PASS), (5.0, SUSPECT, PASS), (45.0, FAIL, SUSPECT), (90.0, FAIL, FAIL)):
        found = judged("gyr", keep=~((T >= 100.0) & (T - seconds < 100.0)))
        assert (found.tests["gap"], found.tests["percent good"]) == (gap, good)
        assert found.good == pytest.approx(1.0 - seconds / LENGTH, abs=1e-3)
    assert judged("gyr", keep=slice(-250)).tests["gap"] == SUSPECT  # at the end
    for count, flag in ((2, PASS), (30, SUSPECT), (600, FAIL)):
        assert judged("gyr", marks=(flags.GYR_CLIPPED, count)).tests["range"] == flag
    found = judged("attitude", marks=(flags.NOT_CONVERGED, T.size // 5))
    assert (found.flag, found.good) == (FAIL, pytest.approx(0.8, abs=1e-3))


def test_hard_accelerations_are_found():
    vertical = np.zeros(T.size)
    vertical[10] = -0.51 * G0
    assert judged("acc", vertical=vertical).tests["acceleration"] == SUSPECT
    vertical[:400] = 0.51 * G0
    assert judged("acc", vertical=vertical).tests["acceleration"] == FAIL
    assert judged("acc", vertical=0.9 * vertical).tests["acceleration"] == PASS


def test_nothing_is_missing_little_is_not_evaluated_and_every_test_has_its_threshold_stated():
    assert judged("gyr", lambda values: np.full_like(values, np.nan)).flag == MISSING
    assert judged("gyr", keep=slice(20)).flag == NOT_EVALUATED
    made = {test for channel in OFFSETS for test in judged(channel, vertical=np.zeros(T.size)).tests}
    assert made == {name for name, *_ in THRESHOLDS}
