"""Recordings made harder: what is changed, what stays, and that a seed says all that is drawn."""

import numpy as np
import pytest

from plumbob import AttitudeTrack, Frame, ImuData, ImuMeta, flags
from plumbob.core.errors import ParameterError, ShapeError, UnitError
from plumbob.core.units import dps
from plumbob.fleet.experiments.variants import CHANGES, MARGIN, changed, motion_begins, turning
from plumbob.rotations import North, quat_rotate

RATE, STILL = 50.0, 5.0


@pytest.fixture
def imu():
    """At rest for 5 s, then 35 s of turning by 30 °/s."""
    t = np.arange(2000) / RATE
    rng = np.random.default_rng(0)
    gyr = np.where(t[:, np.newaxis] < STILL, 0.0, dps(30.0)) * [0.0, 0.6, 0.8]
    acc = [0.0, 0.0, 9.8] + 0.1 * rng.standard_normal((t.size, 3))
    mag = [18.0, 0.0, -44.0] + rng.standard_normal((t.size, 3))
    return ImuData(t=t, gyr=gyr, acc=acc, mag=mag, meta=ImuMeta(frame=Frame.ENU))


@pytest.fixture
def reference(imu):
    """Attitudes that turn, unknown in one second."""
    q = np.random.default_rng(1).standard_normal((len(imu), 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    q[100:150] = np.nan
    return AttitudeTrack(t=imu.t, q_nb=q, frame=Frame.ENU, north=North.MAGNETIC, source="drawn")


def test_motion_begins_where_two_thirds_of_a_second_turn_and_constants_are_those_that_are_named(imu, reference):
    """A mean of 20 °/s over a second around a sample, with 30 °/s from 5 s on: at 5 s + (2/3 − 1/2) s."""
    assert motion_begins(imu) == pytest.approx(STILL + 1.0 / 6.0, abs=1.5 / RATE)
    assert turning(imu)[1000] == pytest.approx(dps(30.0))
    assert changed(imu, reference, {}) is imu
    for name, how in (("scale", "1%"), ("hard_iron", "1uT"), ("wrong_field", "1,2,3uT:0s-5s")):
        other = changed(imu, reference, {name: how})
        touched = "gyr" if name == "scale" else "mag"
        for triad in {"gyr", "acc", "mag"} - {touched}:
            assert np.array_equal(getattr(other, triad), getattr(imu, triad))
        assert not np.array_equal(getattr(other, touched), getattr(imu, touched))
    assert np.allclose(changed(imu, reference, {"bias": "6dps"}).gyr - imu.gyr, dps(6.0))
    assert np.allclose(changed(imu, reference, {"bias": "2,-2,1dps"}).gyr - imu.gyr, dps(np.array([2.0, -2.0, 1.0])))
    assert np.allclose(changed(imu, reference, {"hard_iron": "5,0,0uT"}).mag - imu.mag, [5.0, 0.0, 0.0])
    assert np.allclose(changed(imu, reference, {"scale": "1%"}).gyr, 1.01 * imu.gyr)


def test_a_late_start_keeps_what_comes_after_it_means_keep_the_angle_and_changes_go_together(imu, reference):
    late = changed(imu, reference, {"start": "20s"})
    assert late.t[0] == pytest.approx(motion_begins(imu) + 20.0, abs=1.0 / RATE)
    assert np.array_equal(late.gyr, imu.gyr[-len(late) :])
    slow = changed(imu, reference, {"rate": "10Hz"})
    assert np.allclose(np.diff(slow.t), 0.1)
    assert slow.t[0] == imu.t[4]
    assert np.allclose(slow.gyr.sum(axis=0) / 10.0, imu.gyr.sum(axis=0) / RATE)
    both = {"gaps": "2x1s", "start": "2s", "no_mag": ""}
    one, other = (changed(imu, reference, dict(pairs)) for pairs in (both.items(), reversed(both.items())))
    assert one.mag is None and np.array_equal(one.t, other.t) and np.array_equal(one.gyr, other.gyr)


def test_gaps_lie_in_the_motion_and_follow_the_seed(imu, reference):
    once, again, other = (changed(imu, reference, {"gaps": "2x0.5s"}, seed=seed) for seed in (1, 1, 2))
    assert np.array_equal(once.t, again.t) and not np.array_equal(once.t, other.t)
    lost = np.setdiff1d(imu.t, once.t)
    assert 0 < lost.size <= 2 * 0.5 * RATE
    assert lost.min() >= motion_begins(imu) + MARGIN and lost.max() <= imu.t[-1] - MARGIN + 0.5
    kept = np.isin(imu.t, once.t)
    assert np.array_equal(once.acc, imu.acc[kept])


def test_a_wrong_field_is_constant_in_the_frame_of_the_reference_and_may_count_from_the_motion(imu, reference):
    field = [15.0, -10.0, 20.0]
    other = changed(imu, reference, {"wrong_field": "15,-10,20uT:1s-4s"})
    added = other.mag - imu.mag
    inside = (imu.t >= 1.0) & (imu.t < 4.0) & np.isfinite(reference.q_nb[:, 0])
    assert np.allclose(quat_rotate(reference.q_nb[inside], added[inside]), field)
    assert not added[~inside].any()
    told = "20,0,0uT:10s-12s@motion;0,5,0uT:0s-1s"
    added = changed(imu, reference, {"wrong_field": told}).mag - imu.mag
    size = np.linalg.norm(added, axis=1)
    begin = motion_begins(imu) + 10.0
    assert np.allclose(size[(imu.t >= begin) & (imu.t < begin + 2.0)], 20.0)
    assert np.allclose(size[imu.t < 1.0], 5.0)
    assert np.count_nonzero(size) == pytest.approx(3.0 * RATE, abs=1)


def test_missing_rows_keep_their_stamps_and_asynchronous_sensors_share_no_row(imu, reference):
    thin = changed(imu, reference, {"missing": "5%"})
    lost = np.isnan(thin.gyr).any(axis=1)
    assert np.array_equal(thin.t, imu.t)
    assert 0.03 < lost.mean() < 0.07  # 5 % of 2000 rows: 4 standard deviations are 2 %
    for triad in ("acc", "mag"):
        assert np.array_equal(np.isnan(getattr(thin, triad)).all(axis=1), lost)
    assert np.array_equal(thin.flags & flags.GYR_ABSENT != 0, lost)
    other = changed(imu, reference, {"asynchronous": ""})
    rate, force, field = (np.isfinite(getattr(other, triad)).all(axis=1) for triad in ("gyr", "acc", "mag"))
    assert not (rate & force).any() and (rate | force).all()
    assert np.array_equal(np.flatnonzero(field), np.arange(0, 2000, 5))


def test_what_cannot_be_read_or_made_is_refused(imu, reference):
    for how, error, words in (
        ({"noise": "1"}, ParameterError, "there is no change 'noise'"),
        ({"wrong_field": "1,2,3uT:0s-2s@noon"}, ParameterError, "'15,-10,20uT:0s-20s'"),
        ({"bias": "6"}, UnitError, "needs a unit"),
        ({"start": "60s"}, ShapeError, "less than 60 s after its motion begins"),
        ({"rate": "100Hz"}, ShapeError, "own rate is too low"),
    ):
        with pytest.raises(error, match=words):
            changed(imu, reference, how)
    with pytest.raises(ShapeError, match="it has no mag that could be changed"):
        changed(changed(imu, reference, {"no_mag": ""}), reference, {"hard_iron": "5uT"})
    with pytest.raises(ShapeError, match="no motion in it"):
        motion_begins(imu[:200])


def test_the_recording_itself_stays_as_it_was(imu, reference):
    before = [getattr(imu, name).tobytes() for name in ("t", "gyr", "acc", "mag", "flags")]
    how = {"start": "1s", "wrong_field": "9,9,9uT:0s-9s", "hard_iron": "5uT", "scale": "1%", "bias": "1dps",
           "gaps": "1x1s", "rate": "25Hz", "missing": "5%", "no_mag": "", "asynchronous": ""}  # fmt: skip
    assert set(how) == set(CHANGES)
    for name, text in how.items():
        changed(imu, reference, {name: text})
    assert [getattr(imu, name).tobytes() for name in ("t", "gyr", "acc", "mag", "flags")] == before
