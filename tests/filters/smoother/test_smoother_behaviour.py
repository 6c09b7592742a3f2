"""The smoother on units moved by hand and simulated, whose truth is known: what it finds, what it says, what it leaves.

Bounds are a multiple of what the sensors' noise makes of a perfect estimate, or of the errors that were put in.
"""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from plumbob import Frame, ImuData, ImuMeta, North, estimate, evaluate, flags, simulate
from plumbob import rotations as rot
from plumbob.core.units import deg, dps
from plumbob.data.cards.residuals import upper_half
from plumbob.filters.smoother import Smoother, samples
from tests.helpers.hand_motion import by_hand, error_n, rms_deg
from tests.helpers.motion import consistent, heading_sd, tilt_between
from tests.helpers.smoother_pieces import in_stretches

FINE = 0.3
"""Degrees rms: 0.02 m/s² of white noise is 0.1° in each sample, 0.3 µT on 20 µT is 0.9°, and hundreds are averaged."""


def smoothed(imu, **params):
    smoother = Smoother(frame="ENU", params=params)
    return smoother.process(imu), " ".join(map(str, smoother.remarks))


def errors(track, h):
    """Error in navigation axes; of a free heading without its middle."""
    e = error_n(track.q_nb, h.q)
    if track.north is North.FREE:
        e[:, 2] -= np.median(e[:, 2])
    return e


def is_fine(track, h, times=1):
    return (rms_deg(errors(track, h)) < times * FINE).all()


# --- moved and at rest --------------------------------------------------------------------------------------


@pytest.mark.parametrize(("seed", "rest"), [(0, ()), (1, ()), (2, ()), (1, ((0.0, 5.0), (20.0, 25.0)))])
def test_a_hand_s_motion_is_followed(rest, seed):
    """From the first sample on, at rest or in motion.

    The mean of 1.5 s around a moment, and all that differs from it in 1.5 s: calm is 1.5 s from all motion.
    """
    h = by_hand(seed=seed, rest=rest)
    track, remarks = smoothed(h.imu())
    assert is_fine(track, h) and (rms_deg(errors(track, h)[:100]) < 2 * FINE).all()
    assert remarks == ""
    assert not (track.flags & (flags.MAG_GATED | flags.NOT_CONVERGED | flags.HEADING_FREE)).any()
    resting = track.flags & flags.AT_REST != 0
    for begin, end in rest:
        assert resting[(h.t > begin + 0.5 + 1.6) & (h.t < end - 0.5 - 1.6)].all()
        resting &= (h.t < begin) | (h.t > end)
    assert not resting.any()


@pytest.mark.parametrize("bias", [0.0, 2.0])
def test_rest_alone_gives_the_bias(bias):
    """A minute at rest: 0.06 °/s of white noise at 100 Hz leaves 0.06/√6000 = 0.0008 °/s of the mean; six of them."""
    h = by_hand(60.0, turn=0.0, speed=0.0)
    off = dps(np.array([bias, -bias, 0.5 * bias]))
    track, _ = smoothed(h.imu(gyr=h.gyr + off))
    assert (track.flags & flags.AT_REST).all() and np.abs(track.bias_b - off).max() < dps(0.005)
    assert is_fine(track, h, 1 / 3)


@pytest.mark.parametrize("bias", [0.0, 1.0])
@pytest.mark.parametrize("rate", [1.0, 3.0, 10.0])
def test_a_slow_even_turn_is_not_rest(rate, bias):
    """The table of the teaching arm, which turns at a constant rate from first to last: the field shows it."""
    h = by_hand(60.0, turn=0.0, speed=0.0)
    turn = rot.quat_from_rotvec(h.t[:, np.newaxis] * [0.0, 0.0, dps(rate)])
    q, middle = rot.quat_multiply(turn, h.q), rot.quat_multiply(turn, h.middle)
    mag = rot.quat_rotate(rot.quat_conjugate(middle), rot.quat_rotate(h.middle, h.mag))
    axis = rot.quat_rotate(rot.quat_conjugate(q), [0.0, 0.0, dps(rate)])
    off = dps(np.array([bias, -bias, bias]))
    track, _ = smoothed(h.imu(gyr=h.gyr + axis + off, mag=mag))
    assert not (track.flags & flags.AT_REST).any() and (rms_deg(error_n(track.q_nb, q)) < 3 * FINE).all()
    assert np.abs(track.bias_b - off).max() < dps(0.2)


def test_a_slow_turn_between_rests_is_not_rest_without_a_magnetometer_either():
    """What rests has the same rate each time; a turn of 2 °/s for 10 s has its own."""
    h = by_hand(60.0, turn=0.0, speed=0.0)
    angle = dps(2.0) * np.clip(h.t - 25.0, 0.0, 10.0)
    q = rot.quat_multiply(rot.quat_from_rotvec(angle[:, np.newaxis] * [0.0, 0.0, 1.0]), h.q)
    spin = rot.quat_rotate(rot.quat_conjugate(q), [0.0, 0.0, dps(2.0)]) * ((h.t > 25.0) & (h.t <= 35.0))[:, np.newaxis]
    track, _ = smoothed(h.imu(gyr=h.gyr + spin, mag=None))
    resting = track.flags & flags.AT_REST != 0
    assert not resting[(h.t > 26.0) & (h.t < 34.0)].any() and resting[(h.t < 23.0) | (h.t > 37.0)].all()
    assert np.degrees(np.abs(error_n(track.q_nb, q)[:, 2] - error_n(track.q_nb[:1], q[:1])[0, 2])).max() < 0.5


@pytest.mark.parametrize("scenario", ["buoy", "rod", "slide", "sway", "tumble"])
def test_simulated_units_are_followed(scenario):
    """A calibrated MPU-6000 with an HMC5983, the rod without a magnetometer; the bar is a third of mekf's 1° there."""
    sensors = "adis16355" if scenario == "rod" else "mpu6000+hmc5983"
    run = simulate(scenario, frame=Frame.NED, sensors=sensors, unit="calibrated", seed=3, duration=60.0)
    track = Smoother(frame=Frame.NED).process(run.imu)
    tilt = tilt_between(track.q_nb, run.truth.q_nb)
    assert np.degrees(np.sqrt(np.mean(tilt**2))) < 1.0 / 3.0
    if track.north is not North.FREE:
        assert np.degrees(np.sqrt(np.mean(rot.quat_angle(track.q_nb, run.truth.q_nb) ** 2))) < 0.6


# --- errors of the gyroscope --------------------------------------------------------------------------------


@pytest.mark.parametrize(("bias", "rest"), [(6.0, ()), (6.0, (20, 30)), (12.0, (20, 30)), (40.0, (20, 30))])
def test_a_bias_of_any_size_is_found_at_rest_and_one_of_6_degrees_a_second_in_motion(bias, rest):
    """A gyroscope that nobody calibrated: what turns across gravity, or with the field still, can be no turn."""
    h, off = by_hand(60.0, rest=(rest,) if rest else (), seed=2), dps(np.array([bias, -bias, bias]))
    track, _ = smoothed(h.imu(gyr=h.gyr + off))
    assert is_fine(track, h) and np.abs(track.bias_b - off).max() < dps(0.3)


UNCALIBRATED = {"frame": Frame.NED, "sensors": "mpu6000+hmc5983", "unit": "random", "duration": 60.0}


@pytest.mark.parametrize("seed", [1, 3, 5])
def test_a_buoy_whose_gyroscope_nobody_calibrated_keeps_its_heading(seed):
    """Nothing rests, biases of up to 18 °/s: the drift is found by the field, whose own errors, up to 12°, stay."""
    run = simulate("buoy", **UNCALIBRATED, seed=seed)
    track = Smoother(frame=Frame.NED).process(run.imu)
    assert evaluate(track, run.truth).summary()["heading"]["std_deg"] < 3.0


def test_a_large_bias_that_no_rest_shows_is_not_hidden_by_a_likelier_small_one():
    """A fin's gyroscope with a bias of 26 °/s: the velocity that a prior of 0.1 °/s leaves outweighs it."""
    run = simulate("fin", **UNCALIBRATED, seed=1, rate="100Hz")
    track = Smoother(frame=Frame.NED).process(run.imu)
    assert np.linalg.norm(track.bias_b[-1]) == pytest.approx(dps(26.4), abs=dps(1.0))
    assert evaluate(track, run.truth).summary()["total_rmse_deg"] < 10.0  # an uncalibrated field; 91° by the small bias


@pytest.mark.parametrize("scale", [1.01, 0.99])
def test_a_scale_that_is_wrong_by_a_hundredth_is_found(scale):
    """Without the states for it the heading would be off by 1 % of the way: 0.9 rad to and fro make 0.5°."""
    h = by_hand(60.0, seed=2)
    imu = h.imu(gyr=scale * h.gyr)
    assert is_fine(smoothed(imu)[0], h)
    matrix = Smoother(frame="ENU").smooth(imu).sweep.matrix.reshape(3, 3)
    assert np.abs(matrix - (1.0 - 1.0 / scale) * np.eye(3)).max() < 0.004  # rate = (1 − M) gyr


@pytest.mark.parametrize("rest", [(), ((0.0, 5.0),)], ids=["moved", "rested"])
@pytest.mark.parametrize("field", [True, False], ids=["field", "no field"])
@pytest.mark.parametrize("scale", [1.08, 1.04, 0.93])
def test_a_scale_that_a_data_sheet_allows_is_found(scale, field, rest):
    """Without a card; 4 to 8 % of each turn would be wrong otherwise: 0.9 rad to and fro make 2 to 4°.

    Without rest and field 4 % do not halve the speed that the body seems to have, and stay.
    """
    h = by_hand(60.0, seed=2, rest=rest)
    imu = h.imu(gyr=scale * h.gyr, mag=h.mag if field else None)
    smoother = Smoother(frame="ENU")
    track = smoother.process(imu)
    if scale == 1.04 and not (field or rest):
        assert not smoother.remarks
        return
    assert is_fine(track, h, times=2)
    assert [remark.code for remark in smoother.remarks] == ["estimate.as_delivered"]
    wrong = smoother.smooth(imu).sweep.matrix.reshape(3, 3) - (1.0 - 1.0 / scale) * np.eye(3)  # rate = (1 − M) gyr
    assert np.abs(wrong).max() < 0.15 * abs(1.0 - 1.0 / scale) + 0.003


@pytest.mark.parametrize("lag", [None, 0.0], ids=["smoothed", "no lag"])
def test_a_wrong_scale_is_remarked_once_however_long_it_lasts(lag):
    h = by_hand(1300.0, rate=25.0, seed=4, rest=((0.0, 20.0),))  # two stretches
    smoother = Smoother(frame="ENU", params={"lag": lag})
    assert rms_deg(error_n(smoother.process(h.imu(gyr=1.08 * h.gyr)).q_nb, h.q)[h.t > 600.0]).max() < 0.3
    (remark,) = smoother.remarks
    assert remark.code == "estimate.as_delivered"
    assert remark.values["percent"] == pytest.approx(100.0 * 0.08 / 1.08, abs=0.3)


def test_a_card_that_says_what_is_left_of_the_scale_is_believed():
    h = by_hand(60.0, seed=2)
    left = upper_half(np.diag(np.full(12, 1e-3**2)))
    imu = replace(h.imu(gyr=1.04 * h.gyr), meta=ImuMeta(calibration="a card", gyr_left=left))
    assert np.abs(Smoother(frame="ENU").smooth(imu).sweep.matrix).max() < 0.02  # of 0.04


# --- gaps ---------------------------------------------------------------------------------------------------


def test_gaps_are_named_and_passed():
    """Five gaps of a second in motion: bias and field go through, attitude and velocity start again behind each.

    What is missing in one sample of twenty costs little.
    """
    h = by_hand(60.0, seed=4)
    cut = h.rows(np.abs((h.t + 5.0) % 10.0 - 5.0) > 0.5)
    track, remarks = smoothed(cut.imu())
    assert remarks.startswith("6 gaps in the samples (until 0.5") or remarks.startswith("5 gaps in the samples")
    assert is_fine(track, cut, 2)
    lost = np.random.default_rng(0).random((3, h.t.size)) < 0.05
    triads = {
        k: np.where(of[:, np.newaxis], np.nan, getattr(h, k)) for k, of in zip(("gyr", "acc", "mag"), lost, strict=True)
    }
    track, remarks = smoothed(h.imu(**triads))
    assert is_fine(track, h)
    assert remarks == ""


def test_a_hole_of_the_gyroscope_is_as_uncertain_as_it_is_long():
    h = by_hand(30.0, seed=6)
    gyr, inside = h.gyr.copy(), (h.t > 12.0) & (h.t < 14.0)
    gyr[inside] = np.nan
    track, _ = smoothed(h.imu(gyr=gyr))
    e = errors(track, h)
    assert (rms_deg(e[~inside]) < 2 * FINE).all()
    assert (track.flags[inside] & flags.GYR_HELD).all() and (track.flags[inside] & flags.NOT_CONVERGED).all()
    off_b = h.in_body(e)[inside]
    nees = np.einsum("ni,ni->n", off_b, np.linalg.solve(track.cov_b[inside], off_b[:, :, np.newaxis])[..., 0])
    assert np.median(nees) < 9.0


@pytest.mark.parametrize("where", [slice(0, 600), slice(2400, None), slice(600, 2400)])
@pytest.mark.parametrize("lag", ["off", 2.0])
def test_without_rates_for_long_the_rest_is_still_estimated(where, lag, monkeypatch):
    """Whole stretches without a rate: nothing is claimed of them, and those around are as they were."""
    in_stretches(monkeypatch, long=12.0, core=4.0, margin=2.0)
    h = by_hand(30.0, seed=7)
    gyr, lost = h.gyr.copy(), np.zeros(h.t.size, dtype=bool)
    gyr[where], lost[where] = np.nan, True
    track, _ = smoothed(h.imu(gyr=gyr), lag=lag)
    # a stream does not know that a hole is long, and bridges its first half second
    known = lost if lag == "off" else np.convolve(lost, np.ones(51))[: lost.size] > 50.5
    assert np.isfinite(track.q_nb).all() and (track.flags[known] & flags.NOT_CONVERGED).all()
    assert (track.flags[known] & flags.GYR_HELD).all()
    # beside a hole a stretch is short: what is estimated from a second of samples is doubtful, and may say so
    far = ~np.convolve(lost, np.ones(801), mode="same").astype(bool)
    assert (rms_deg(errors(track, h)[far]) < 5 * FINE).all()
    deep = np.convolve(~lost, np.ones(1001), mode="same") == 0
    assert (np.trace(track.cov_b[deep], axis1=1, axis2=2) > math.pi**2).all()


# --- fields -------------------------------------------------------------------------------------------------


def wrong_for(h, begin, end, off_n):
    """The recording with a field (east, north, up) added in a spell."""
    spell = (h.t > begin) & (h.t < end)
    return h.imu(mag=h.mag + np.where(spell[:, np.newaxis], h.in_body(np.array(off_n, dtype=float)), 0.0)), spell


@pytest.mark.parametrize(
    ("off", "worst"),
    # 10 µT east turn a level field of 20 µT by 27° and change its size by 2.4 µT only: some of it is believed
    [((20.0, 0.0, 0.0), 3 * FINE), ((10.0, 0.0, 0.0), 3.0), ((15.0, -10.0, 20.0), 3 * FINE)],
)
def test_a_wrong_field_for_a_minute_is_seen_and_named(off, worst):
    h = by_hand(180.0, seed=8, rest=((0.0, 5.0),))
    imu, spell = wrong_for(h, 80.0, 140.0, off)
    track, remarks = smoothed(imu)
    e = errors(track, h)
    assert (rms_deg(e) < [FINE, worst]).all()
    assert (track.flags[spell] & flags.MAG_GATED != 0).mean() > 0.95
    assert (track.flags[~spell] & flags.MAG_GATED != 0).mean() < 0.05
    assert "the field was not that of the place (80–140 s)" in remarks
    assert (np.abs(e[:, 2]) < 3.0 * heading_sd(track.q_nb, track.cov_b)).all()


@pytest.mark.parametrize("off", [(0.0, -25.0, 0.0), (0.0, -40.0, 0.0), (15.0, -10.0, 20.0)])
def test_a_wrong_first_field_does_not_decide(off):
    """Twenty seconds, weakened, exactly reversed (of the right size and dip), and off in all."""
    h = by_hand(100.0, seed=9)
    imu, spell = wrong_for(h, -1.0, 20.0, off)
    track, remarks = smoothed(imu)
    assert is_fine(track, h, 2) and (track.flags[spell] & flags.MAG_GATED != 0).mean() > 0.95
    assert "(0–20 s)" in remarks


def test_two_fields_of_equal_weight_are_named_and_the_error_is_inside_the_claim():
    """Nobody can know which half has the field of the place; either heading is inside of 95 %."""
    h = by_hand(150.0, seed=10)
    imu, _ = wrong_for(h, 75.0, 151.0, (25.0, 0.0, 10.0))
    track, remarks = smoothed(imu)
    assert "two fields have nearly equal weight" in remarks
    away = math.degrees(math.atan2(25.0, 20.0))
    assert f"the heading may be off by {away:.0f}°" in remarks or f"off by {away - 1:.0f}°" in remarks
    first = errors(track, h)[:, 2]
    other = first + math.radians(away)  # east of north: a body's heading is less by that, and its yaw is more
    for error in (first, other):
        assert (np.abs(error) < 2.0 * heading_sd(track.q_nb, track.cov_b)).mean() > 0.95


@pytest.mark.parametrize(
    ("own", "spell"), [((10.0, -20.0, 8.0), True), ((10.0, -20.0, 8.0), False), ((6.0, -3.0, 2.0), False)]
)
def test_a_magnet_on_the_unit_and_its_own_iron_are_taken_off(own, spell):
    """For a minute, or for the whole recording; 6 µT across are 17° of a level field of 20 µT."""
    h = by_hand(150.0, seed=11)
    on = (h.t > 40.0) & (h.t < 100.0) if spell else h.t >= 0.0
    track, remarks = smoothed(h.imu(mag=h.mag + np.where(on[:, np.newaxis], own, 0.0)))
    assert is_fine(track, h, 2)
    size = float(remarks.split("a field of ")[1].split(" µT")[0])
    assert size == pytest.approx(np.linalg.norm(own), abs=0.5 if spell else 0.2)  # in whole µT, or in tenths
    assert ("turned with the sensor" if spell else "of its own") in remarks


@pytest.mark.parametrize("own", [(3.0, 0.0, 0.0), (2.5, 0.0, -1.7)])
def test_what_may_be_iron_or_an_uneven_field_is_named_and_inside_the_claim(own):
    """3 µT of 20 µT are 8.6°; a room whose field is uneven by as much looks the same."""
    h = by_hand(150.0, seed=11)
    track, remarks = smoothed(h.imu(mag=h.mag + own))
    assert "a field of 3.0 µT seems to turn with the unit" in remarks
    error = np.abs(errors(track, h)[:, 2])
    assert math.degrees(error.max()) > 2.0 and (error < 1.96 * heading_sd(track.q_nb, track.cov_b)).mean() > 0.9


@pytest.mark.parametrize("seed", range(4))
def test_no_magnet_is_invented(seed):
    """Clean fields, and one that bends by a few µT over the room."""
    h = by_hand(100.0, seed=seed)
    bent = h.in_body(2.0 * np.sin(2.0 * np.pi * h.t[:, np.newaxis] / [17.0, 29.0, 37.0]))
    for mag in (h.mag, h.mag + bent):
        attached = Smoother(frame="ENU").smooth(h.imu(mag=mag)).attached
        assert attached is not None and not attached.present


@pytest.mark.parametrize("rest", [(), ((0.0, 10.0), (30.0, 40.0))])
def test_without_a_field_the_tilt_is_right_and_the_heading_free(rest):
    h = by_hand(60.0, seed=12, rest=rest)
    none, remarks = smoothed(h.imu(mag=None))
    assert none.north is North.FREE and (none.flags & flags.HEADING_FREE).all()
    assert (rms_deg(errors(none, h)) < 2 * FINE).all()
    assert remarks == ""
    off, _ = smoothed(h.imu(), mag=False)
    assert (off.q_nb == none.q_nb).all()
    steep, remarks = smoothed(h.imu(mag=h.in_body([0.0, 0.0, -48.0])))
    assert steep.north is North.FREE and rot.quat_angle(steep.q_nb, none.q_nb).max() < 1e-12
    assert "no field of the recording gives a heading" in remarks


# --- invariances --------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def moved():
    """A recording with rest and a gap, and its track."""
    h = by_hand(60.0, seed=13, rest=((20.0, 26.0),))
    h = h.rows((h.t < 40.0) | (h.t > 41.0))
    return h, Smoother(frame="ENU").process(h.imu())


@pytest.mark.parametrize("frame", [Frame.NED, Frame.NWU])
def test_every_frame_gives_the_same_attitude(moved, frame):
    h, enu = moved
    other = Smoother(frame=frame).process(h.imu())
    assert other.frame is frame
    assert rot.quat_angle(rot.change_frame(other.q_nb, to=Frame.ENU, from_=frame), enu.q_nb).max() < 1e-7
    assert (other.cov_b == enu.cov_b).all()


def test_a_declination_and_another_north_turn_headings_alone_and_the_date_does_not_matter(moved):
    """East positive: magnetic north lies east of true north, so that the body's true heading is larger."""
    h, magnetic = moved
    known = ImuData(t=h.t, gyr=h.gyr, acc=h.acc, mag=h.mag, meta=ImuMeta(declination=0.2, calibration="by hand"))
    for track in (
        Smoother(frame="ENU", params={"declination": 0.2}).process(h.imu()),
        Smoother(frame="ENU").process(known),
    ):
        assert (magnetic.north, track.north) == (North.MAGNETIC, North.TRUE)
        expected = rot.quat_multiply(rot.quat_from_rotvec([0.0, 0.0, -0.2]), magnetic.q_nb)  # clockwise from above
        assert rot.quat_angle(track.q_nb, expected).max() < 1e-7 and (track.cov_b == magnetic.cov_b).all()
    # The field of the place turned by 57° about the vertical; errors of the tilt turn a steep field otherwise then.
    h, one = moved
    yaw = rot.quat_from_rotvec([0.0, 0.0, 1.0])
    field = rot.quat_rotate(h.middle, h.mag)
    other = Smoother(frame="ENU").process(
        h.imu(mag=rot.quat_rotate(rot.quat_conjugate(h.middle), rot.quat_rotate(yaw, field)))
    )
    away = np.degrees(np.abs(error_n(other.q_nb, rot.quat_multiply(rot.quat_conjugate(yaw), one.q_nb))).max(axis=0))
    assert (away < [0.05, 0.05, 1.0]).all()
    other = Smoother(frame="ENU").process(h.imu(t=h.t + 4096.0))  # a power of two: stamps keep their digits
    assert rot.quat_angle(other.q_nb, one.q_nb).max() < deg(0.01)


@pytest.mark.parametrize("axes", [(1, 2, 0), (2, 0, 1)])
def test_how_the_axes_sit_in_the_body_does_not_matter(moved, axes):
    h, one = moved
    turn = np.eye(3)[list(axes)]
    other = Smoother(frame="ENU").process(h.imu(gyr=h.gyr @ turn.T, acc=h.acc @ turn.T, mag=h.mag @ turn.T))
    back = rot.quat_multiply(other.q_nb, rot.quat_from_dcm(turn))
    assert rot.quat_angle(back, one.q_nb).max() < deg(0.01)


def test_upside_down_and_nose_up_are_attitudes_as_all_others():
    for euler in itertools.product((0.0, math.pi / 2, math.pi), (0.0, math.pi / 2), (0.0, math.pi)):
        h = by_hand(10.0, seed=14)
        turn = rot.quat_from_euler_zyx(np.array(euler))
        dcm = rot.dcm_from_quat(turn)
        track = Smoother(frame="ENU").process(h.imu(gyr=h.gyr @ dcm, acc=h.acc @ dcm, mag=h.mag @ dcm))
        assert rot.quat_angle(track.q_nb, rot.quat_multiply(h.q, turn)).max() < deg(3.0)


@pytest.mark.parametrize("rate", [20.0, 50.0, 400.0, None])
def test_the_answer_does_not_depend_on_the_rate(rate):
    """Irregular stamps are taken as they are."""
    steps = np.random.default_rng(1).uniform(0.002, 0.03, 3000)
    h = by_hand(40.0, rate, seed=15) if rate else by_hand(t=np.cumsum(steps), seed=16)
    assert is_fine(smoothed(h.imu())[0], h)


def test_a_latency_turns_the_attitude_ahead():
    """By its own rate: 20 ms at the rates of the motion, up to about 3 rad/s."""
    h = by_hand(30.0, seed=17)
    late, usual = smoothed(h.imu(), latency=0.02)[0], smoothed(h.imu())[0]
    turned = rot.quat_multiply(usual.q_nb, rot.quat_from_rotvec(0.02 * (h.gyr - usual.bias_b)))
    assert rot.quat_angle(late.q_nb, turned).max() < 0.02 * 0.01 * 3.0  # scale and misalignment of a hundredth
    assert rot.quat_angle(late.q_nb, usual.q_nb).max() > 0.01


# --- stretches ----------------------------------------------------------------------------------------------


@pytest.fixture
def stretched(monkeypatch):
    in_stretches(monkeypatch, long=60.0, core=40.0, margin=20.0)


def test_a_long_recording_in_stretches_is_as_the_whole(stretched, monkeypatch):
    """Progress counts every sample once."""
    h, done = by_hand(130.0, seed=18, rest=((30.0, 36.0),)), []
    off = dps(np.array([1.0, -1.0, 2.0]))
    parts = Smoother(frame="ENU").process(h.imu(gyr=h.gyr + off), progress=done.append)
    assert (len(done), sum(done)) == (4, h.t.size)
    monkeypatch.setattr(samples, "LONG", 1e9)
    whole, _ = smoothed(h.imu(gyr=h.gyr + off))
    assert (parts.q_nb != whole.q_nb).any() and is_fine(parts, h)
    assert np.degrees(rot.quat_angle(parts.q_nb, whole.q_nb)).max() < 2 * FINE
    steps, true_steps = (rot.quat_multiply(q[1:], rot.quat_conjugate(q[:-1])) for q in (parts.q_nb, h.q))
    assert np.degrees(rot.quat_angle(steps, true_steps)).max() < 2 * FINE


def test_a_free_heading_goes_on_from_stretch_to_stretch(stretched):
    h = by_hand(130.0, seed=19)
    track, _ = smoothed(h.imu(mag=None))
    e = error_n(track.q_nb, h.q)[:, 2]
    assert np.degrees(np.abs(np.diff(np.unwrap(e)))).max() < 0.2  # of 2π that each stretch could choose by itself
    assert np.degrees(np.ptp(np.unwrap(e))) < 3.0
    # The third stretch sees 60 to 140 s, and another field for more than half of that; without what was before, 20°.
    # What is wrong for most of a stretch widens what is believed of a field, so that it still pulls, by less than
    # half.
    h = by_hand(200.0, seed=20)
    imu, spell = wrong_for(h, 77.0, 118.0, (20.0, 0.0, 10.0))
    e = errors(smoothed(imu)[0], h)
    assert (rms_deg(e[spell]) < [FINE, 10.0]).all() and (rms_deg(e[~spell]) < 5 * FINE).all()


def test_a_vertical_bias_is_no_field_of_the_sensor():
    """Ten minutes at sea, 0.9 °/s about the vertical unknown at first: in an attitude without heading that turns the
    field of the place as evenly as one of the sensor would. The heading was 96° off.
    """
    sea = simulate("buoy", frame="NED", sensors="mpu6000+hmc5983", unit="calibrated", seed=1)
    attached = Smoother(frame="NED").smooth(sea.imu).attached
    assert attached is not None and not attached.present
    assert evaluate(estimate(sea.imu).track, sea.truth).summary()["heading_rmse_deg"] < 0.5


@pytest.mark.parametrize("params", [{}, {"lag": 0.0}], ids=["whole", "no lag"])
def test_how_far_each_field_was_believed_is_in_the_track(params):
    """Nearly nothing of one that is 20 µT off, and most of the right one; unknown without any."""
    h = by_hand(60.0, rest=((0.0, 5.0),), seed=3)
    wrong = (h.t > 30.0) & (h.t < 40.0)
    mag = h.mag + np.where(wrong[:, np.newaxis], h.in_body(np.tile([20.0, 0.0, 0.0], (h.t.size, 1))), 0.0)
    track = Smoother(frame="ENU", params=params).process(h.imu(mag=mag))
    assert track.mag_weight[(h.t > 31.0) & (h.t < 39.0)].max() < 0.1
    assert np.median(track.mag_weight[(h.t > 10.0) & (h.t < 29.0)]) > 0.8
    assert np.isnan(Smoother(frame="ENU", params=params).process(h.imu(mag=None)).mag_weight).all()


@pytest.mark.parametrize("lag", ["off", "0 s"])
def test_a_rate_that_falls_to_a_tenth_is_no_row_of_gaps(lag):
    """100 Hz, 20 s of 10 Hz, 100 Hz: steps of 0.1 s, and their rounding, are not gaps."""
    data, q = consistent(6000, amplitude=0.1)
    kept = np.arange(6000)
    kept = kept[(kept < 2000) | (kept >= 4000) | (kept % 10 == 0)]
    few = ImuData(t=data.t[kept], gyr=data.gyr[kept], acc=data.acc[kept], mag=data.mag[kept])
    smoother = Smoother(frame=Frame.ENU, params={"lag": lag})
    track = smoother.process(few)
    assert smoother.remarks == ()
    assert np.degrees(rot.quat_angle(track.q_nb, q[kept])[500:].max()) < 2.0


@pytest.mark.parametrize("lag", ["0 s", "off"])
def test_an_accelerometer_that_is_silent_in_motion_costs_nothing_beside_a_good_gyroscope(lag):
    """A held force turns with the body: it is no acceleration. The gyroscope is exact, so that nothing else is off."""
    data, truth = consistent(5500, amplitude=1.5)

    def worst(missing):
        acc = np.where(((data.t > 30.0) & (data.t < 30.0 + missing))[:, np.newaxis], np.nan, data.acc)
        imu = ImuData(t=data.t, gyr=data.gyr, acc=acc, mag=data.mag)
        track = Smoother(frame="ENU", params={"lag": lag}).process(imu)
        return np.degrees(rot.quat_angle(track.q_nb[2500:], truth[2500:])).max()

    assert max(worst(5.0), worst(20.0)) < worst(0.0) + 0.2
