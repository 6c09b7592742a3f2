"""Magnetometer of a capture: which samples count, and which fit runs."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.harness.room import room_of
from plumbob.calibration.calibrate_mag import calibrate_mag
from plumbob.calibration.calibration import Capture
from plumbob.calibration.fit import CaptureRefusedError
from plumbob.calibration.mag.outcome import dip_of
from plumbob.calibration.mag_checks import _dip
from plumbob.core.constants import G0
from plumbob.core.errors import CalibrationError, ParameterError, ShapeError
from plumbob.data import ImuData, ImuMeta
from plumbob.data.cards import UNITS, CalibrationCard, TriadCalibration
from plumbob.evaluation.many.trials import read_trial
from plumbob.rotations import dcm_from_quat, quat_from_rotvec
from tests.helpers.mag_scene import (
    STRENGTH,
    TURNED,
    Unit,
    attitudes,
    field,
    force,
    heading_rms,
    rates,
    trajectory,
    tumbling,
    unit_of,
)

COUNT = 400


@pytest.fixture(scope="module")
def scene():
    rng = np.random.default_rng(21)
    unit, q_nb = unit_of(rng), attitudes(rng, COUNT)
    t = 0.02 * np.arange(COUNT)
    return unit, ImuData(t=t, acc=force(rng, q_nb), mag=field(rng, unit, q_nb), meta=ImuMeta(device="SN1"))


def first_remark(imu, **options):
    return calibrate_mag(imu, strength=STRENGTH, **options).remarks[0]


def test_the_dip_is_that_of_samples_with_field_and_force(scene):
    """The capture's own truth has one dip; every third field and every fifth force are not there."""
    _, imu = scene
    mag, acc = imu.mag.copy(), imu.acc.copy()
    mag[::3], acc[::5] = np.nan, np.nan
    both = np.isfinite(mag[:, 0]) & np.isfinite(acc[:, 0])
    assert _dip(mag, acc) == dip_of(imu.mag[both], imu.acc[both])


def test_a_steady_accelerometer_helps_and_finds_the_turn(scene):
    unit, imu = scene
    helped = calibrate_mag(imu, strength=STRENGTH, acc_calibrated=True)
    alone = calibrate_mag(imu, strength=STRENGTH, with_="none")
    assert helped.remarks[0].startswith("Fitted with the accelerometer, whose specific force is gravity: 400 of 400")
    assert alone.remarks[0] == "Fitted without other sensors: as asked for."
    assert np.degrees(heading_rms(helped.calibration, unit)) < 0.2  # 0.05° at 1000 poses, by the root 0.08°
    assert np.degrees(heading_rms(alone.calibration, unit)) > 0.5  # turned by 2° or more, which no length shows


def test_a_moving_or_uncalibrated_accelerometer_does_not(scene):
    _, imu = scene
    rng = np.random.default_rng(1)
    shaken = imu.corrected(acc=imu.acc + 3.0 * rng.normal(size=imu.acc.shape), meta=imu.meta)
    biased = imu.corrected(acc=imu.acc + 0.05 * G0, meta=imu.meta)
    for spoiled in (shaken, biased):
        assert "which moved or is not calibrated" in first_remark(spoiled)
    assert "as asked for" in first_remark(imu, with_="acc")
    assert "there is no acc" in first_remark(replace(imu, acc=None))
    assert "smaller shape" in first_remark(imu, shape="axes")


def test_a_force_of_zero_tells_no_vertical_and_is_not_used(scene):
    _, imu = scene
    acc = imu.acc.copy()
    acc[5] = 0.0
    assert calibrate_mag(replace(imu, acc=acc), with_="none").calibration.quality.heading_sd < np.radians(2.0)


def test_absent_and_clipped_samples_do_not_count(scene):
    _, imu = scene
    mag = imu.mag.copy()
    mag[::2] = np.nan
    mag[1] = [200.0, 0.0, 0.0]
    fit = calibrate_mag(replace(imu, mag=mag, meta=replace(imu.meta, mag_range=200.0)), strength=STRENGTH)
    assert len(fit.measured) == COUNT // 2 - 1


def test_too_many_clipped_samples_are_refused(scene):
    _, imu = scene
    small = replace(imu, meta=replace(imu.meta, mag_range=0.95 * float(np.abs(imu.mag).max())))
    with pytest.raises(CaptureRefusedError) as refused:
        calibrate_mag(small)
    assert refused.value.reasons[0].kind == "clipping"


@pytest.fixture(scope="module")
def restricted():
    """Half a minute of turning with the inclination below 12°, and shaken too much to tell a vertical."""
    rng = np.random.default_rng(22)
    unit = unit_of(rng)
    t, q_nb, true = trajectory(rng, duration=30.0, tilt=np.radians(12.0))
    acc = force(rng, q_nb) + rng.normal(size=(len(t), 3))
    return unit, ImuData(t=t, gyr=rates(rng, true), acc=acc, mag=field(rng, unit, q_nb), meta=ImuMeta(device="SN1"))


def test_the_gyroscope_rescues_restricted_motion(restricted):
    unit, imu = restricted
    fit = calibrate_mag(imu, strength=STRENGTH, gyr_calibrated=True)
    assert fit.remarks[0].startswith("Fitted with the gyroscope, because otherwise no ellipsoid fits")
    assert heading_rms(fit.calibration, unit) < 3.0 * fit.calibration.quality.heading_sd
    assert first_remark(imu, with_="gyr", gyr_calibrated=True) == "Fitted with the gyroscope, as asked for."
    with pytest.raises(CaptureRefusedError, match="too-few-regions"):
        calibrate_mag(replace(imu, gyr=None), strength=STRENGTH)


def test_a_ring_is_refused_although_there_is_a_gyroscope():
    rng = np.random.default_rng(24)
    t, q_nb, true = trajectory(rng, duration=20.0, tilt=np.radians(1.0))
    imu = ImuData(t=t, gyr=rates(rng, true), acc=force(rng, q_nb), mag=field(rng, unit_of(rng), q_nb))
    with pytest.raises(CaptureRefusedError, match=r"level-ring.*choose the gyroscope to help.*--shape level"):
        calibrate_mag(imu)


def test_level_is_asked_for():
    rng = np.random.default_rng(23)
    q_nb = attitudes(rng, COUNT, np.radians(0.5))
    imu = ImuData(t=0.02 * np.arange(COUNT), acc=force(rng, q_nb), mag=field(rng, unit_of(rng), q_nb))
    fit = calibrate_mag(imu, shape="level")
    assert fit.calibration.matrix[2].tolist() == [0.0, 0.0, 1.0]
    assert "ONLY LEVEL" in fit.remarks[1]
    with pytest.raises(CaptureRefusedError, match="level-ring"):
        calibrate_mag(imu)


def test_choices_that_make_no_sense_are_refused(scene):
    _, imu = scene
    with pytest.raises(ShapeError, match="with_ must be one of"):
        calibrate_mag(imu, with_="barometer")
    with pytest.raises(ShapeError, match="shape must be one of"):
        calibrate_mag(imu, shape="cube")
    with pytest.raises(ParameterError, match="whole matrix"):
        calibrate_mag(imu, with_="acc", shape="axes")
    with pytest.raises(CalibrationError, match="no gyr"):
        calibrate_mag(imu, with_="gyr")
    with pytest.raises(CalibrationError, match="no acc"):
        calibrate_mag(replace(imu, acc=None), with_="acc")
    with pytest.raises(CaptureRefusedError, match="within 3 % of gravity; at least 14 are needed"):
        calibrate_mag(imu.corrected(acc=imu.acc / G0, meta=imu.meta), with_="acc")


MIRRORED = {"z negated": np.diag([1.0, 1.0, -1.0]), "x and y swapped": np.eye(3)[[1, 0, 2]]}


@pytest.fixture(scope="module")
def tumbled():
    """A minute of turning through all attitudes, slowly enough for a vertical, with a gyroscope's bias of 15 °/s."""
    rng = np.random.default_rng(25)
    unit = unit_of(rng)
    t, q_nb, true = trajectory(rng, duration=120.0, tilt=np.pi)
    gyr = rates(rng, true) + np.radians([15.0, 0.0, 0.0])
    meta = ImuMeta(device="SN1")
    return unit, ImuData(t=t, gyr=gyr, acc=force(rng, q_nb), mag=field(rng, unit, q_nb), meta=meta)


@pytest.mark.parametrize("mirror", MIRRORED.values(), ids=MIRRORED)
@pytest.mark.parametrize("helper", ["none", "gyr"])
def test_a_mirrored_magnetometer_turns_against_the_gyroscope(tumbled, mirror, helper):
    imu = tumbled[1]
    wrong = imu.corrected(mag=imu.mag @ mirror.T, meta=imu.meta)
    assert "mirrored" not in str(calibrate_mag(imu, with_="none").remarks)
    with pytest.raises(CaptureRefusedError, match=r"mirrored: .*mirrored = true"):
        calibrate_mag(wrong, with_=helper)


@pytest.mark.parametrize("mirror", MIRRORED.values(), ids=MIRRORED)
def test_a_mirrored_magnetometer_turns_the_field_up_beside_an_accelerometer(scene, mirror):
    imu = scene[1]
    wrong = imu.corrected(mag=imu.mag @ mirror.T, meta=imu.meta)
    with pytest.raises(CaptureRefusedError, match=r"mirrored: .*turned by 1[78]\d°.*with a dip of -60°"):
        calibrate_mag(wrong)
    south = calibrate_mag(wrong, dip=-np.radians(60.0))  # a magnetometer that is turned, and no mirror
    assert any(told.startswith("TURNED BY 1") for told in south.remarks)


def test_all_axes_negated_are_a_field_of_the_south(scene):
    imu = scene[1]
    wrong = imu.corrected(mag=-imu.mag, meta=imu.meta)
    assert any(told.startswith("FIELD POINTS UP: a dip of -60°") for told in calibrate_mag(wrong).remarks)
    with pytest.raises(CaptureRefusedError, match="wrong-field: the field dips by -60"):
        calibrate_mag(wrong, dip=np.radians(60.0))


@pytest.mark.parametrize("helper", ["none", "acc"])
def test_the_dip_of_the_place_is_compared(scene, helper):
    imu = scene[1]  # its field dips by 60°
    assert not any("DIP OFF" in told for told in calibrate_mag(imu, with_=helper, dip=np.radians(59.0)).remarks)
    doubtful = calibrate_mag(imu, with_=helper, dip=np.radians(65.0))
    assert any("in the capture, but by 65.0°" in told for told in doubtful.remarks)
    with pytest.raises(CaptureRefusedError, match=r"wrong-field: .* in the capture, but by 40.0° at the place"):
        calibrate_mag(imu, with_=helper, dip=np.radians(40.0))


def test_what_is_not_calibrated_is_told(scene):
    imu = scene[1]
    assert any("UNCALIBRATED accelerometer" in told for told in calibrate_mag(imu).remarks)
    assert not any("UNCALIBRATED" in told for told in calibrate_mag(imu, acc_calibrated=True).remarks)


def test_a_bias_alone_is_no_gain_of_the_gyroscope(scene):
    """A card of rest has the bias of the gyroscope and no covariance of its matrix."""
    rest, known = np.zeros((12, 12)), np.zeros((12, 12))
    rest[:3, :3], known[3:, 3:] = 1e-8 * np.eye(3), 1e-6 * np.eye(9)
    for covariance, calibrated in ((None, False), (rest, False), (known, True)):
        gyr = TriadCalibration(
            matrix=np.eye(3), bias=np.zeros(3), unit_in=UNITS["gyr"], unit_out=UNITS["gyr"], covariance=covariance
        )
        card = CalibrationCard(device="SN1", date="2026-01-01", method="rest", gyr=gyr)
        assert Capture(scene[1], "SN1", card, "2026-01-01").gyr_calibrated == calibrated
    assert not Capture(scene[1], "SN1", None, "2026-01-01").gyr_calibrated


def slowed(imu):
    """The same a third as fast, and without the gyroscope's bias."""
    return replace(imu, t=3.0 * imu.t, gyr=(imu.gyr - np.radians([15.0, 0.0, 0.0])) / 3.0)


def test_fast_turning_tells_no_vertical(tumbled):
    """Of a slow trajectory, what is below 15 °/s; twenty times as fast, hardly anything."""
    imu = slowed(tumbled[1])
    gyr = imu.gyr
    calm = int(np.count_nonzero(np.linalg.norm(gyr, axis=1) < np.radians(15.0)))
    told = first_remark(imu, with_="acc")
    assert "the accelerometer, as asked for" in told
    # the bias is known by the field, 10 to 20 % of soft iron in it, and few samples are so near the limit
    assert int(told.split(": ")[1].split(" of")[0]) == pytest.approx(calm, rel=0.1)
    fast = replace(imu, t=0.05 * imu.t, gyr=20.0 * gyr)
    assert "the unit turned too fast" in first_remark(fast)


def test_a_vertical_by_chance_is_refused_by_the_gyroscope(tumbled):
    """A specific force that is of the right size but turned by 30° in the unit."""
    imu = slowed(tumbled[1])
    lean = dcm_from_quat(quat_from_rotvec(np.radians([0.0, 0.0, 30.0])))
    turned = replace(imu, acc=imu.acc @ lean.T)
    with pytest.raises(
        CaptureRefusedError, match=r"not-still: the field is turned by (29|30|31)° against the gyroscope"
    ):
        calibrate_mag(turned, with_="acc")


def test_a_dead_axis_and_a_unit_that_lay_still_are_refused(scene):
    imu = scene[1]
    dead, still = (
        imu.mag.copy(),
        np.array([20.0, 0.0, 40.0]) + 0.2 * np.random.default_rng(2).normal(size=imu.mag.shape),
    )
    dead[:, 1] = 3.0
    for mag, match in ((dead, "implausible: y of the magnetometer always reads 3 µT"), (still, "no-motion")):
        for helper in ("auto", "none", "acc"):
            with pytest.raises(CaptureRefusedError, match=match):
                calibrate_mag(replace(imu, mag=mag), with_=helper)


def test_a_gyroscope_without_a_card_is_to_be_calibrated_first():
    rng = np.random.default_rng(24)
    t, q_nb, true = trajectory(rng, duration=10.0, tilt=np.radians(1.0))
    level = ImuData(t=t, gyr=rates(rng, true), mag=field(rng, unit_of(rng), q_nb))
    with pytest.raises(CaptureRefusedError, match=r"ill-conditioned.*Calibrate the gyroscope first"):
        calibrate_mag(level, with_="gyr")


@pytest.mark.parametrize(
    "trial", [*TURNED[:2], *(pytest.param(t, marks=pytest.mark.long(reason="other rooms")) for t in TURNED[2:])]
)
def test_a_calibration_in_a_room_says_how_good_it_is(broad_folder, trial):
    """Within 2.6 times the predicted error, beyond which one of six trials lies once in twenty times."""
    imu, reference = read_trial(broad_folder / trial)
    room = room_of(imu, reference)
    fit = calibrate_mag(imu, force=True)  # whether it is worth using or not, its figure must hold
    assert room.heading_off(fit.calibration) < 2.6 * fit.calibration.quality.heading_sd
    assert fit.calibration.quality.grade != "good"


def test_where_the_field_is_uneven_the_gyroscope_helps_unasked(broad_folder):
    """Alone, this trial has seven directions, and a misfit that stays; the heading would be off by 4.5°."""
    imu, _ = read_trial(broad_folder / TURNED[3])
    with pytest.raises(CaptureRefusedError, match="uneven-field: the residuals do not average out"):
        calibrate_mag(imu, with_="none")
    told = "Fitted with the gyroscope, because otherwise the residuals do not average out"
    assert calibrate_mag(imu).remarks[0].startswith(told)


def by_gyroscope(imu, **options):
    (told,) = [one for one in calibrate_mag(imu, **options).remarks if "of the rates" in one]
    return told


def test_every_fit_is_held_against_the_gyroscope(tumbled):
    """A unit mounted askew by 2° is told in figures; rates that are 8 % off, more than any data sheet, as a doubt."""
    imu = tumbled[1]
    told = {helper: by_gyroscope(imu, with_=helper) for helper in ("none", "gyr")}
    assert all(one.startswith("Against the gyroscope, the calibrated field turns at 1.00 of") for one in told.values())
    assert 1.0 < float(told["none"].split("turned by ")[1].split("°")[0]) < 4.0  # its axes are not at right angles
    assert float(told["gyr"].split("turned by ")[1].split("°")[0]) < 0.3
    wrong = replace(imu, gyr=1.08 * imu.gyr)
    assert by_gyroscope(wrong, with_="none").startswith("GYROSCOPE DISAGREES: the calibrated field turns at 0.9")


def test_without_rates_nothing_is_held_against_them(tumbled):
    imu = tumbled[1]
    part = imu.usable("gyr").copy()
    part[5:] = np.nan
    for blind in (replace(imu, gyr=None), replace(imu, gyr=part, flags=None)):
        assert not any("of the rates" in one for one in calibrate_mag(blind, with_="none").remarks)


def test_a_calibration_that_would_rather_harm_is_refused_unless_forced():
    """A perfect magnetometer, turned for 15 s: its card could only be worse, and says so where it is asked for."""
    rng = np.random.default_rng(41)
    t, q_nb, _ = tumbling(rng, duration=15.0)
    perfect = ImuData(t=t, mag=field(rng, Unit(np.eye(3), np.zeros(3)), q_nb), meta=ImuMeta(device="SN1"))
    with pytest.raises(CaptureRefusedError, match=r"no-gain: .* may itself be wrong by .*Do not use it.*force=True"):
        calibrate_mag(perfect)
    forced = calibrate_mag(perfect, force=True)
    assert forced.remarks[0].startswith("DO NOT USE: the calibration changes headings by")
    iron = replace(perfect, mag=perfect.mag + [10.0, 0.0, 0.0])
    assert not any(told.startswith("DO NOT USE") for told in calibrate_mag(iron).remarks)
