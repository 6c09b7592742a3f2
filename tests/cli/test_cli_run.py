"""plumbob run in this process: its figures against attitudes that were put in, and its notes."""

import json
import math
import re

import numpy as np
import pytest

from plumbob import AttitudeTrack, Filter, Frame, ImuData, ImuMeta, Recording, files
from plumbob.cli.main import main
from plumbob.rotations import North, dcm_from_quat, quat_conjugate, quat_from_euler_zyx
from tests.helpers.motion import seen_by


def posed(*degrees, frame, t=None):
    """A recording of attitudes (yaw, pitch, roll) as its accelerometer and magnetometer see them, and their track."""
    q = quat_from_euler_zyx(np.radians(degrees))
    t = 0.01 * np.arange(len(q)) if t is None else t
    imu = ImuData(t=t, gyr=np.zeros((len(q), 3)), **seen_by(q, frame), meta=ImuMeta(frame=frame))
    return imu, AttitudeTrack(t=t, q_nb=q, frame=frame, north=North.MAGNETIC)


@pytest.fixture
def run(capsys, tmp_path):
    """Run a filter on a recording; what it printed, and its notes."""

    def call(recording, *words, code=0):
        file = files.write(tmp_path / "a.parquet", recording, overwrite=True)
        capsys.readouterr()
        assert main(["run", str(file), *map(str, words)]) == code
        said = capsys.readouterr()
        return said.out, [line.removeprefix("note: ") for line in said.err.splitlines()]

    return call


@pytest.fixture
def report(run):
    return lambda recording, *words: json.loads(run(recording, *words, "--json")[0])


@pytest.mark.parametrize(
    ("frame", "yaw", "heading"),
    [  # clockwise from north: in NED that is the yaw; in ENU the yaw counts from east the other way, in NWU from north
        (Frame.NED, 100.0, 100.0),
        (Frame.NED, -100.0, 260.0),
        (Frame.ENU, 100.0, 350.0),
        (Frame.ENU, -30.0, 120.0),
        (Frame.NWU, 100.0, 260.0),
        (Frame.NWU, -30.0, 30.0),
    ],
)
def test_the_attitude_is_the_last_one_with_its_heading_from_north(run, report, frame, yaw, heading):
    recording = posed((5.0, 2.0, 1.0), (60.0, -10.0, 20.0), (yaw, -20.0, 35.0), frame=frame, t=[7.0, 7.25, 8.5])[0]
    found = report(recording, "--filter", "tilt_compass")
    assert found["last_attitude_deg"] == pytest.approx({"heading": heading, "yaw": yaw, "pitch": -20.0, "roll": 35.0})
    assert (found["samples"], found["duration_s"], found["frame"]) == (3, 1.5, str(frame))
    out, _ = run(recording, "--filter", "tilt_compass")
    assert f"at the end   yaw {yaw:.3f}°, pitch -20.000°, roll 35.000°" in out
    assert f"heading      {heading:.3f}° clockwise from magnetic north, of the body's x axis" in out
    assert "3 samples, 1.500 s" in out


def still(seconds, rate=50.0, *, mag=True, seed=0):
    """Noise of a unit at rest, tilted, in ENU."""
    n = round(seconds * rate)
    q = np.tile(quat_from_euler_zyx(np.radians([40.0, 25.0, -10.0])), (n, 1))
    rng = np.random.default_rng(seed)
    seen = {k: v + 0.02 * rng.normal(size=v.shape) for k, v in seen_by(q, Frame.ENU).items() if mag or k == "acc"}
    return ImuData(t=np.arange(n) / rate, gyr=1e-3 * rng.normal(size=(n, 3)), **seen, meta=ImuMeta(frame=Frame.ENU))


def claimed_by_hand(imu, at):
    """Standard deviations of the level part and of the vertical part of the error, degrees, by their definition."""
    track = Filter("mekf", frame=Frame.ENU).process(imu, covariance=True)
    c_nb = dcm_from_quat(track.q_nb[at])
    p_n = c_nb @ track.cov_b[at] @ c_nb.T
    return math.degrees(math.sqrt(p_n[0, 0] + p_n[1, 1])), math.degrees(math.sqrt(p_n[2, 2]))


def test_what_the_filter_claims_is_of_the_last_attitude_without_a_free_heading(run, report):
    imu = still(4.0)
    claimed = report(imu, "--filter", "mekf")["claimed_sd_deg"]
    first, last = claimed_by_hand(imu, 0), claimed_by_hand(imu, -1)
    assert (claimed["inclination"], claimed["heading"]) == pytest.approx(last, rel=1e-9)
    assert first[0] > 2.0 * last[0]  # or the test could not tell the two
    told = f"claimed      inclination {last[0]:.3f}°, heading {last[1]:.3f}° (standard deviations at the end)"
    assert told in run(imu, "--filter", "mekf")[0]
    imu = still(1.0, mag=False)
    claimed = report(imu, "--filter", "mekf")["claimed_sd_deg"]
    assert claimed["heading"] is None
    assert claimed["inclination"] == pytest.approx(claimed_by_hand(imu, -1)[0], rel=1e-9)
    out, _ = run(imu, "--filter", "mekf")
    assert re.search(r"claimed +inclination \d\.\d{3}°, heading unknown \(standard", out)


@pytest.mark.parametrize(("gaps", "noted"), [(4, False), (6, True), (30, True)])
def test_restarts_are_noted_where_they_are_more_than_one_in_twenty(run, gaps, noted):
    """Gaps of a minute in 100 samples at 50 Hz; a filter starts again after each."""
    steps = np.full(99, 0.02)
    steps[np.arange(gaps) * 3] = 60.0
    imu = still(2.0)
    imu = ImuData(t=np.append(0.0, np.cumsum(steps)), gyr=imu.gyr, acc=imu.acc, mag=imu.mag, meta=imu.meta)
    out, notes = run(imu, "--filter", "tilt_compass")
    told = [note for note in notes if "come after a gap" in note]
    assert len(told) == noted
    assert f"flag         gap: {gaps} samples ({gaps:.2f} %)" in out
    if noted:
        assert told[0].startswith(f"{gaps} % of the samples come after a gap")
        assert "the median step is 0.02 s." in told[0]


def test_errors_are_those_against_the_recording_s_own_reference_where_it_can_be_compared(report):
    """Turned by 5° about the vertical, all of it is heading; turned by 3° of roll beside, the total is both."""
    imu, truth = posed(*[(30.0, 10.0, -20.0)] * 5, frame=Frame.NED)
    turn = np.tile(quat_from_euler_zyx(np.radians([35.0, 10.0, -20.0])), (5, 1))
    recording = Recording(imu=imu, track=truth.with_attitude(turn, frame=Frame.NED))
    errors = report(recording, "--filter", "tilt_compass")["errors"]
    assert errors["total_rmse_deg"] == errors["heading_rmse_deg"] == pytest.approx(5.0, abs=1e-6)
    assert errors["inclination_rmse_deg"] == pytest.approx(0.0, abs=1e-6)
    other_north = AttitudeTrack(t=truth.t, q_nb=truth.q_nb, frame=Frame.NED, north=North.TRUE)  # and no declination
    recording = Recording(imu=imu, track=other_north)
    assert set(report(recording, "--filter", "tilt_compass")["errors"]) == {"not_compared", "inclination_rmse_deg"}


def test_the_track_that_is_written_is_the_estimate_in_the_frame_that_is_asked_for(run, tmp_path, report):
    imu, truth = posed((5.0, 2.0, 1.0), (60.0, -10.0, 20.0), frame=Frame.NED)
    out, _ = run(imu, "--filter", "tilt_compass", "--out", tmp_path / "t.parquet")
    assert out.splitlines()[-1] == f"written      {tmp_path / 't.parquet'}"
    found = files.read(tmp_path / "t.parquet").track
    apart = dcm_from_quat(found.q_nb) @ dcm_from_quat(quat_conjugate(truth.q_nb))
    assert np.abs(apart - np.eye(3)).max() < 1e-12
    assert found.source.startswith("tilt_compass(")
    # yaw 100° in NED is 260° counted from north against the clock, −100°, in NWU
    found = report(posed((100.0, 0.0, 0.0), frame=Frame.NED)[0], "--filter", "tilt_compass", "--frame", "NWU")
    assert found["frame"] == "NWU"
    assert found["last_attitude_deg"]["yaw"] == pytest.approx(-100.0)
    assert found["last_attitude_deg"]["heading"] == pytest.approx(100.0)


NATICK = "42.283,-71.35,1000"
"""Declination −13.6891° on 2028-07-04 by MATLAB's example of wrldmagm, good to half of its last digit."""


def test_a_place_makes_headings_true_or_is_refused(run, report):
    pytest.importorskip("pygeomag", reason="the extra geomag is not installed")
    imu = posed((20.0, 0.0, 0.0), (20.0, 0.0, 0.0), frame=Frame.NED)[0]
    found = report(imu, "--filter", "tilt_compass", "--place", NATICK, "--date", "2028-07-04")
    assert found["declination_deg"] == pytest.approx(-13.6891, abs=0.0055)
    assert found["last_attitude_deg"]["heading"] == pytest.approx(20.0 - 13.6891, abs=0.0055)
    _, notes = run(imu, "--filter", "tilt_compass", "--place", NATICK, "--date", "2028-07-04")
    assert any("declination -13.69 deg, by WMM-2025" in note for note in notes)
    twice = ("--date", "2028-07-04", "--params", "declination=1deg")
    for words, why in (((), "does not say when it was made"), (twice, "both give the declination")):
        assert why in " ".join(run(imu, "--filter", "tilt_compass", "--place", NATICK, *words, code=1)[1])


def spun(first_known=0):
    """A gyroscope alone that turns at 0.5 rad/s about its z axis, up, from a heading of 30°, with its truth in ENU."""
    t = np.arange(200) / 100.0
    q = quat_from_euler_zyx(np.stack([math.radians(60.0) + 0.5 * t, 0.0 * t, 0.0 * t], axis=1))
    q[:first_known] = np.nan
    imu = ImuData(t=t, gyr=np.tile([0.0, 0.0, 0.5], (200, 1)), meta=ImuMeta(frame=Frame.NED))
    return Recording(imu=imu, track=AttitudeTrack(t=t, q_nb=q, frame=Frame.ENU, north=North.TRUE))


@pytest.mark.parametrize("unknown", [0, 40])
def test_a_gyroscope_alone_started_from_the_truth_is_scored(run, tmp_path, unknown):
    """Exact rates of a steady turn: what is left is rounding, in a file of seven digits."""
    found = run(spun(unknown), "--filter", "integrate", "--init", "truth", "--out", tmp_path / "a.csv", "--json")[0]
    report = json.loads(found)
    assert (report["samples"], report["north"]) == (200 - unknown, "true")
    assert report["errors"]["total_rmse_deg"] < 1e-6


def test_the_start_may_be_level_or_said(report):
    free = report(spun(), "--filter", "integrate", "--init", "level")
    assert (free["north"], free["errors"]["not_scored"].keys()) == ("free", {"heading", "total", "yaw"})
    said = report(spun(), "--filter", "integrate", "--init", "0deg,0deg,30deg", "--params", "declination=0deg")
    assert said["north"] == "true"
    assert said["last_attitude_deg"]["heading"] == pytest.approx(30.0 + math.degrees(0.5 * 1.99))
    below = report(spun(), "--filter", "integrate", "--init", "-5deg,0deg,30deg", "--params", "declination=0deg")
    assert below["north"] == "true"  # argparse takes -33.9,151.2 for an option unless it is joined to its own by =
