"""The command line as a user meets it: from a simulation to errors, benchmarks, and courtesy to terminals and pipes."""

import math
import subprocess
import sys

import numpy as np
import pytest

import plumbob
from plumbob import Filter, Frame, ImuData, Recording, files, simulate
from plumbob.fleet.experiments.scenario import MonteCarlo
from plumbob.rotations import euler_zyx_from_quat
from tests.helpers.commandline import PLUMBOB, answer, call, typed


@pytest.fixture(scope="module")
def buoy(tmp_path_factory):
    """A minute of the buoy with calibrated sensors, simulated by the command line."""
    folder = tmp_path_factory.mktemp("cli")
    unit = "--sensors mpu6000+hmc5983 --unit calibrated --duration 60s --seed 3"
    typed(f"sim buoy --frame NED {unit} --out buoy.parquet", cwd=folder)
    return folder / "buoy.parquet"


def test_simulate_run_evaluate(buoy, tmp_path):
    words = "--filter mahony --params gate=0.08g"
    report = answer(f"run {buoy} {words} --out track.parquet", cwd=tmp_path)
    assert report["samples"] == 6000
    assert report["filter"].startswith("mahony(kp=0.5 1/s, ki=0.03 1/s2, gate=0.784532 m/s2")
    summary = answer(f"eval track.parquet {buoy}", cwd=tmp_path)
    for key in ("total_rmse_deg", "heading_rmse_deg", "inclination_rmse_deg"):
        assert 0.0 < summary[key] < 3.0  # a few times the filter's rms error in these waves, about 1°
    assert report["errors"]["total_rmse_deg"] == pytest.approx(summary["total_rmse_deg"], rel=1e-9)
    said = answer(f"info {buoy}")
    assert (said["sensors"]["time"]["samples"], said["attitude"]["frame"]) == (6000, "NED")
    assert said["sensors"]["time"]["rate_hz"] == pytest.approx(100.0)


def test_errors_do_not_depend_on_the_frame_or_the_kind_of_file(buoy, tmp_path):
    """In each frame and from CSV: eval converts the reference."""
    files.write(tmp_path / "buoy.csv", files.read(buoy))
    by_table, by_file = (answer(f"run {file} --filter mahony")["errors"] for file in (tmp_path / "buoy.csv", buoy))
    assert by_table == by_file
    errors = []
    for frame in Frame:
        typed(f"run {buoy} --filter mahony --frame {frame} --out {frame}.parquet", cwd=tmp_path)
        errors.append(answer(f"eval {frame}.parquet {buoy}", cwd=tmp_path)["total_rmse_deg"])
    assert max(errors) - min(errors) < 1e-6


def test_benchmark_accuracy_on_a_folder(samples, tmp_path):
    """A recording that is damaged and one without an accelerometer do not stop it."""
    sea = files.read(samples / "sea.parquet")
    for name in ("a", "b"):
        files.write(tmp_path / f"{name}.parquet", sea)
    (tmp_path / "broken.parquet").write_bytes((tmp_path / "a.parquet").read_bytes()[:5000])
    gyro = ImuData(t=sea.imu.t, gyr=sea.imu.gyr, meta=sea.imu.meta)
    files.write(tmp_path / "gyro.parquet", Recording(imu=gyro, track=sea.track, name="gyro"))
    words = "benchmark accuracy . --filters mahony,tilt_compass --params mahony.kp=0.05 --align heading"
    result = answer(words, cwd=tmp_path)
    assert (set(result["trials"]), set(result["skipped"])) == ({"a", "b"}, {"broken.parquet", "gyro.parquet"})
    assert result["align"] == ["heading"]
    for name in ("mahony", "tilt_compass"):
        error = result["trials"]["a"][name]["total_rmse_deg"]
        assert result["mean"][name]["total_rmse_deg"] == pytest.approx(error)
    lines = typed(words, cwd=tmp_path).stdout.splitlines()
    assert [line.split()[0] for line in lines if line.split()[:1] in (["mahony"], ["tilt_compass"])][-2:] == [
        "mahony",
        "tilt_compass",
    ]


def test_benchmark_of_the_arm_paper_s_rows():
    """Gyroscope alone beside fuzzy-PI, at rest; a std is kept for papers that give nothing else.

    The figures are those of the Euler angles of an estimate and of the truth, simulated and estimated once more here.
    """
    words = "benchmark scenario arm --set turn=0deg --sensors arm --unit random --frame NED --seeds 2"
    result = answer(f"{words} --filters integrate,fuzzy_pi")
    assert "arm (turn=0 deg, time=30 s)" in result["scenario"]
    for seed in range(2):
        run = simulate("arm", frame=Frame.NED, sensors="arm", unit="random", seed=seed, turn=0.0)
        for name in ("integrate", "fuzzy_pi"):
            q_nb = Filter(name, frame=Frame.NED).process(run.imu).q_nb
            off = np.degrees(euler_zyx_from_quat(q_nb) - euler_zyx_from_quat(run.truth.q_nb))
            assert np.abs(off).max() < 90.0  # at rest no angle comes near ±180°, so that the difference is the error
            for axis, error in zip(("yaw", "pitch", "roll"), off.T, strict=True):
                found = result["seeds"][name][axis]
                rms, worst = math.sqrt(np.mean(error**2)), np.abs(error).max()
                assert found["rmse_deg"][seed] == pytest.approx(rms, rel=1e-9)
                assert found["std_deg"][seed] == pytest.approx(error.std(), rel=1e-9)
                assert found["max_abs_deg"][seed] == pytest.approx(worst, rel=1e-9)


def test_benchmark_scenario_with_a_limit_and_a_free_heading_and_an_error_that_is_not_scored(tmp_path):
    """Ideal sensors at rest: both filters are right to rounding, all seeds keep any limit, the heading has no error."""
    words = "benchmark scenario static --frame NED --seeds 2 --duration 2s --limit 1deg"
    words += " --filters ekf7,integrate --params ekf7.mag=off,integrate.mag=off"
    result = answer(words)
    assert result["limit_deg"] == pytest.approx(1.0)
    assert result["share_within_limit"] == {"ekf7": 1.0, "integrate": 1.0}
    assert set(result["seeds"]["ekf7"]) == {"roll", "pitch"}
    assert typed(words).stdout.count("stay within 1° in 100 % of the seeds") == 2
    errors = {"max_abs_deg": [0.5, 1.0, 1.05, 2.0]}
    assert MonteCarlo("made up", {}, {"f": {"roll": errors, "pitch": errors}}).kept("f", 1.0) == 0.5
    # Ideal sensors at rest are without error to the last printed digit.
    typed("sim static --frame ENU --duration 5s --out s.parquet", cwd=tmp_path)
    free = typed("run s.parquet --filter mahony --params mag=off", cwd=tmp_path).stdout
    assert ("not scored   heading: " in free, "inclination rmse: 0.000°" in free) == (True, True)


def test_a_closed_pipe_is_no_error_and_python_m_plumbob_is_plumbob():
    line = " ".join([*PLUMBOB, "list filters | head -1"])
    done = subprocess.run(line, shell=True, capture_output=True, text=True, check=False)
    assert (done.stderr, done.returncode) == ("", 0)
    done = subprocess.run([sys.executable, "-m", "plumbob", "--version"], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["plumbob", plumbob.__version__]
    assert {"Filter", "ImuData", "simulate", "read"} <= set(dir(plumbob))


@pytest.mark.parametrize("encoding", ["ascii", "gbk", "cp1252"])
def test_a_terminal_that_cannot_show_units_still_gets_the_result(samples, encoding):
    for words in (("list", "filters"), ("info", samples / "sea.parquet"), ("list", "scenarios")):
        done = call(*words, encoding=encoding)
        assert (done.returncode, len(done.stdout) > 100) == (0, True)
