"""What is gathered of a recording does not depend on its parts; traces keep every extreme; claimed angles are right."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import plumbob
from plumbob.core.errors import ShapeError
from plumbob.data import AttitudeTrack
from plumbob.overview import streaming_stats
from plumbob.overview.streaming_stats import TRACED, Gatherer, Tracing, channel_rows
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
