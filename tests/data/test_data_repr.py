"""What an object shows of itself: one line in a terminal, a small escaped table in a notebook, angles in rad."""

from dataclasses import replace

import numpy as np
import pytest

from plumbob import AttitudeTrack, Filter, ImuData, ImuMeta, evaluate, simulate
from plumbob.rotations import quat_from_euler_zyx

MADE = simulate("static", frame="NED", sensors="mpu6000+hmc5983", unit="random", seed=0, rate=50.0, duration=2.0)
SHOWN = {
    "imu": (MADE.imu, ("<ImuData: samples 100 in 1.98 s at 50 Hz; sensors gyr, acc, mag, temp_c;", "calibration none")),
    "track": (MADE.truth, ("<AttitudeTrack: samples 100 in 1.98 s at 50 Hz; known 100; frame NED; north true;",)),
    "evaluation": (evaluate(MADE.truth, MADE.truth), ("<Evaluation: scored 100 of 100 samples; total rmse 0°;",)),
    "card": (MADE.calibration, ("<CalibrationCard: device mpu6000+hmc5983 #0; date 1970-01-01;", "; of gyr, acc, mag")),
    "noise": (MADE.noise, ("<NoiseCard: device mpu6000+hmc5983 #0; source", "; of gyr, acc, mag")),
    "filter": (
        Filter("mahony", frame="ENU", params={"kp": 0.25}),
        ("<Filter: name mahony; frame ENU; params kp=0.25 1/s; samples 0>",),
    ),
}


@pytest.mark.parametrize("name", SHOWN)
def test_one_line_and_a_small_table(name):
    shown, words = SHOWN[name]
    line, table = repr(shown), shown._repr_html_()
    assert "\n" not in line
    assert all(word in line for word in words)
    assert table.startswith(f"<table><caption>{type(shown).__name__}</caption><tr><th>")
    assert table.count("<tr>") == table.count("</tr>") == len(shown.facts())


def test_what_a_file_says_is_shown_as_text():
    """A device's name can hold anything: markup, and what steers a terminal."""
    name = "<script>alert(1)</script>\x1b[2J\nx"
    imu = ImuData(t=[0.0], gyr=[[0.0, 0.0, 0.0]], meta=ImuMeta(device=name))
    assert "samples 1; sensors gyr" in repr(imu) and not {"\x1b", "\n"} & {*repr(imu), *imu._repr_html_()}
    assert "<script>" not in imu._repr_html_() and "&lt;script&gt;" in imu._repr_html_()


def test_angles_of_a_track_are_yaw_pitch_roll_in_rad():
    angles = np.array([[0.1, -0.2, 0.3], [3.0, 1.5, -3.0]])
    track = AttitudeTrack(t=[0.0, 1.0], q_nb=quat_from_euler_zyx(angles), frame="NED", north="true")
    np.testing.assert_allclose(track.euler_zyx, angles, rtol=0, atol=1e-14)
    np.testing.assert_array_equal(np.column_stack((track.yaw, track.pitch, track.roll)), track.euler_zyx)
    unknown = replace(track, q_nb=np.full((2, 4), np.nan))
    assert np.isnan(unknown.euler_zyx).all()
