"""The static test on simulated pairs: deviations in closed form, perfect cards, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from plumbob import AttitudeTrack, Frame, North
from plumbob.calibration.fit import CaptureRefusedError
from plumbob.core.errors import CalibrationError, FrameError
from plumbob.core.units import deg
from plumbob.papers.static_test import static_test
from plumbob.simulation import Module, TriadErrors, simulate

IRON = 8.0  # µT along the unit's nose
LEVEL = 50.0 * np.cos(deg(50.0))  # level part of the simulator's field, µT


def on_table(frame=Frame.NED, *, seed=1, acc=None, mag=None, **settings):
    unit = Module("unit", "test", gyr=TriadErrors(), acc=acc or TriadErrors(), mag=mag or TriadErrors())
    return simulate("table36", frame=frame, sensors=unit, unit="random", seed=seed, rate=20.0, **settings)


@pytest.fixture(scope="module")
def iron():
    return on_table(mag=TriadErrors(hard_iron=[IRON, 0.0, 0.0]), tilt=0.0)


def test_iron_along_the_nose_deviates_a_level_compass_as_the_triangle_says_and_so_does_json(iron):
    test = static_test(iron.imu, reference=iron.truth, calibration=iron.calibration)
    assert test.spans.shape == (36, 2)
    heading = deg(10.0) * np.arange(36)
    # the level field in the body is H (cos ψ, −sin ψ) + (h, 0), and the compass reads the angle back from it
    reads = np.arctan2(LEVEL * np.sin(heading), LEVEL * np.cos(heading) + IRON)
    deviation = np.angle(np.exp(1j * (reads - heading)))
    np.testing.assert_allclose(test.errors("before")[:, 0], deviation, atol=1e-12)
    np.testing.assert_allclose(test.errors("before")[:, 1:], 0.0, atol=1e-12)
    np.testing.assert_allclose(test.errors("after"), 0.0, atol=1e-12)
    worst = np.arcsin(IRON / LEVEL)  # where field and iron make a right angle; of 36 headings one is within 5° of it
    assert 0.98 * worst < test.before.stats["yaw"].max_abs <= worst
    told = test.summary()
    assert (len(told["rests"]), told["rests"][9]["reference_deg"]["yaw"]) == (36, pytest.approx(90.0))
    worst = max(abs(rest["before_deg"]["yaw"]) for rest in told["rests"])
    assert told["summary"]["yaw"]["max_before_deg"] == pytest.approx(worst)
    (yaw,) = [line.split() for line in test.text().splitlines() if line.startswith("yaw ")]
    assert yaw[1] == f"{worst:.2f}"


@pytest.mark.parametrize("frame", list(Frame))
def test_a_perfect_card_leaves_nothing_on_the_slant_table_in_any_frame(frame):
    acc = TriadErrors(bias=[0.3, -0.2, 0.4], scale=[0.02, -0.03, 0.01])
    made = on_table(frame, acc=acc, mag=TriadErrors(hard_iron=[4.0, -6.0, 3.0], scale=[0.1, -0.1, 0.05]))
    test = static_test(made.imu, reference=made.truth, calibration=made.calibration)
    np.testing.assert_allclose(test.errors("after"), 0.0, atol=1e-12)
    assert (np.abs(test.errors("before")).max(axis=0) > deg(1.0)).all()


def test_noise_is_averaged_over_a_rest():
    sd = 0.02
    made = on_table(acc=TriadErrors(white_sd=[sd] * 3), tilt=0.0)
    pitch = static_test(made.imu, reference=made.truth, calibration=made.calibration).errors("after")[:, 1]
    samples = 12 * 4  # of a rest of 3 s at 20 Hz at least 48 are in blocks of 1/4 s that lie wholly in it
    # 3 sd: the rms of 36 has a relative sd of 0.12
    assert np.sqrt(np.mean(pitch**2)) < 1.36 * sd / 9.80665 / np.sqrt(samples)


def test_a_constant_heading_between_the_two_is_removed_where_asked_and_untold_rests_are_left_out(iron):
    turned = replace(iron.truth, north=North.FREE)
    free = static_test(iron.imu, reference=turned, calibration=iron.calibration)
    assert np.isnan(free.errors("after")[:, 0]).all() and "arbitrary zero" in free.text()
    aligned = static_test(iron.imu, reference=turned, calibration=iron.calibration, align=("heading",))
    np.testing.assert_allclose(aligned.errors("after")[:, 0], 0.0, atol=1e-12)
    assert any("was removed" in str(remark) for remark in aligned.remarks)
    known = (iron.truth.t > 20.0) & (iron.truth.t < 60.0)  # 10 cycles of 4 s
    part = AttitudeTrack(
        t=iron.truth.t[known], q_nb=iron.truth.q_nb[known], frame=iron.truth.frame, north=iron.truth.north
    )
    assert len(static_test(iron.imu, reference=part, calibration=iron.calibration).spans) == 10


def test_magnetic_and_true_headings_meet_by_a_declination(iron):
    made = on_table(declination=deg(5.0))
    moving = simulate("tumble", frame=Frame.NED, sensors="ideal", unit="random", seed=1)
    # a recording that does not know its declination has magnetic headings
    magnetic = made.imu.corrected(meta=replace(made.imu.meta, declination=None))
    test = static_test(magnetic, reference=made.truth, calibration=made.calibration, declination=deg(5.0))
    np.testing.assert_allclose(test.errors("after"), 0.0, atol=1e-12)
    for imu, truth, card, error, words in (
        (magnetic, made.truth, made.calibration, FrameError, "declination"),
        (moving.imu, moving.truth, moving.calibration, CaptureRefusedError, "^too-few"),
        (iron.imu, iron.truth, moving.calibration, CalibrationError, "card is for device"),
    ):
        with pytest.raises(error, match=words):
            static_test(imu, reference=truth, calibration=card)
