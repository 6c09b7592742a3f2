"""The command line as a user meets it: real processes, real files, exit codes and one-line errors."""

import argparse
import json
import math
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks.harness.__main__ import main as measure
from plumbob import Filter, Frame, ImuData, ImuMeta, files, filter_names, simulate
from plumbob.cli.main import build_parser, main
from plumbob.core import _jit
from plumbob.rotations import euler_zyx_from_quat
from tests.helpers.commandline import call, ok, plumbob, refused

ROOT = Path(__file__).parents[2]
GOOD_PARAMS = "kp=0.5,ki=0.03,gate=off"


@pytest.fixture(scope="module")
def buoy(tmp_path_factory):
    """A minute of the buoy with calibrated sensors, simulated by the command line."""
    path = tmp_path_factory.mktemp("cli") / "buoy.parquet"
    ok("sim", "buoy", "--frame", "NED", "--sensors", "mpu6000+hmc5983", "--unit", "calibrated", "--duration", "60s",
       "--seed", 3, "--out", path)  # fmt: skip
    return path


# --- the main line ------------------------------------------------------------------------------------------


def test_simulate_run_evaluate(buoy, tmp_path):
    track, page = tmp_path / "track.parquet", tmp_path / "page.html"
    done = ok("run", buoy, "--filter", "mahony", "--params", "gate=0.08g", "--out", track)
    assert "frame        NED" in done.stdout
    summary = json.loads(ok("eval", track, buoy, "--json", "--html", page).stdout)
    for key in ("total_rmse_deg", "heading_rmse_deg", "inclination_rmse_deg"):
        assert 0.0 < summary[key] < 3.0  # a few times the filter's rms error in these waves, about 1°
    assert page.read_text().startswith("<!DOCTYPE html>")
    assert "total" in ok("eval", track, buoy, "--align", "heading").stdout


def test_run_as_json_tells_what_was_run(buoy):
    report = json.loads(ok("run", buoy, "--filter", "mahony", "--params", "gate=0.08g", "--json").stdout)
    assert report["samples"] == 6000
    assert report["filter"].startswith("mahony(kp=0.5 1/s, ki=0.03 1/s2, gate=0.784532 m/s2")
    assert report["errors"]["total_rmse_deg"] > 0.0


def test_parameters_from_a_toml_file(buoy, tmp_path):
    for text in ('kp = 0.7\ngate = "0.08 g"\n', '[mahony]\nkp = 0.7\ngate = "0.08 g"\n'):
        (tmp_path / "p.toml").write_text(text)
        report = json.loads(ok("run", buoy, "--filter", "mahony", "--params", tmp_path / "p.toml", "--json").stdout)
        assert report["filter"].startswith("mahony(kp=0.7 1/s, ki=0.03 1/s2, gate=0.784532 m/s2")


def test_info(buoy):
    report = json.loads(ok("info", buoy, "--json").stdout)
    assert report["sensors"]["time"]["samples"] == 6000
    assert report["sensors"]["time"]["rate_hz"] == pytest.approx(100.0)
    assert report["attitude"]["frame"] == "NED"
    assert "gyr" in ok("info", buoy).stdout


def test_benchmark_accuracy_on_a_folder(buoy, tmp_path):
    (tmp_path / "a.parquet").write_bytes(buoy.read_bytes())
    (tmp_path / "b.parquet").write_bytes(buoy.read_bytes())
    (tmp_path / "broken.parquet").write_bytes(buoy.read_bytes()[:5000])
    words = ("benchmark", "accuracy", tmp_path, "--filters", "mahony,tilt_compass", "--params", "mahony.kp=0.05")
    result = json.loads(ok(*words, "--json").stdout)
    assert set(result["trials"]) == {"a", "b"}
    assert "broken.parquet" in result["skipped"]
    for name in ("mahony", "tilt_compass"):
        one = result["trials"]["a"][name]["total_rmse_deg"]
        assert result["mean"][name]["total_rmse_deg"] == pytest.approx(one)
    assert "mean" in ok(*words).stdout


def test_benchmark_scenario(tmp_path):
    words = (
        "benchmark",
        "scenario",
        "slide",
        "--frame",
        "NED",
        "--seeds",
        2,
        "--filters",
        "mahony",
        "--params",
        "gate=off",
    )
    result = json.loads(ok(*words, "--json").stdout)
    assert len(result["seeds"]["mahony"]["roll"]["max_abs_deg"]) == 2
    assert "largest median" in ok(*words).stdout


def test_benchmark_of_the_arm_paper_s_rows(capsys):
    """Gyroscope alone beside fuzzy-PI, at rest; a std is kept for papers that give nothing else.

    The figures are those of the Euler angles of an estimate and of the truth, simulated and estimated once more here.
    """
    words = "benchmark scenario arm --set turn=0deg --sensors arm --unit random --frame NED --seeds 2 --json"
    assert main([*words.split(), "--filters", "integrate,fuzzy_pi"]) == 0
    result = json.loads(capsys.readouterr().out)
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


def test_benchmark_scenario_with_a_limit_and_a_free_heading():
    """Ideal sensors at rest: both filters are right to rounding, all seeds keep any limit, the heading has no error."""
    words = ("benchmark", "scenario", "static", "--frame", "NED", "--seeds", 2, "--duration", "2s", "--limit", "1deg")
    words += ("--filters", "ekf7,integrate", "--params", "ekf7.mag=off,integrate.mag=off")
    result = json.loads(ok(*words, "--json").stdout)
    assert result["limit_deg"] == pytest.approx(1.0)
    assert result["share_within_limit"] == {"ekf7": 1.0, "integrate": 1.0}
    assert set(result["seeds"]["ekf7"]) == {"roll", "pitch"}
    text = ok(*words).stdout
    assert text.count("stay within 1° in 100 % of the seeds") == 2
    assert "largest tilt error of integrate over that of ekf7" in text


def test_filters_and_sim_list():
    listed = json.loads(ok("filters", "--json").stdout)
    first = listed["filters"]["mahony"]["parameters"][0]
    assert (first["name"], first["unit"], first["default"]) == ("kp", "1/s", 0.5)
    assert "gate" in ok("filters").stdout
    assert "mpu6000" in ok("sim", "--list").stdout


def test_csv_and_back(buoy, tmp_path):
    """A track and a recording survive CSV: the same errors to the last digit."""
    recording = files.read(buoy)
    files.write(tmp_path / "buoy.csv", recording)
    a = json.loads(ok("run", buoy, "--filter", "mahony", "--json").stdout)["errors"]
    b = json.loads(ok("run", tmp_path / "buoy.csv", "--filter", "mahony", "--json").stdout)["errors"]
    assert a == b


@pytest.mark.long(reason="ten minutes of sea")
# --- speed and courtesy -------------------------------------------------------------------------------------


def test_help_imports_nothing_heavy():
    """The answer in 0.2 s rests on this; the time itself belongs to no test."""
    code = (
        "import sys; from plumbob.cli.main import build_parser; build_parser().format_help();"
        "print([m for m in ('numpy', 'numba', 'scipy', 'pyarrow', 'matplotlib', 'rich', 'h5py') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.skipif(os.environ.get("NUMBA_DISABLE_JIT") == "1", reason="nothing is compiled here")
def test_the_first_run_on_a_cold_cache_says_why_it_waits(buoy, tmp_path):
    words = ("run", buoy, "--filter", "integrate_first_order")
    first = ok(*words, PLUMBOB_CACHE_DIR=str(tmp_path))
    assert "compiling integrate_first_order for this processor, which takes some seconds, once" in first.stderr
    assert str(tmp_path) in first.stderr
    second = ok(*words, PLUMBOB_CACHE_DIR=str(tmp_path))
    assert "compiling" not in second.stderr
    assert second.stdout == first.stdout


def test_a_closed_pipe_is_no_error(buoy):
    done = subprocess.run(
        f"{sys.executable} -m plumbob.cli.main filters | head -1",
        shell=True,
        capture_output=True,
        text=True,
        check=False,
    )
    assert "Traceback" not in done.stderr
    assert done.stderr == ""


@pytest.mark.parametrize("words", [["run"], ["eval"], ["fly"], ["run", "x", "--filter"]])
def test_wrong_usage_exits_2(words):
    assert plumbob(*words).returncode == 2


def test_without_a_verb_the_order_of_work_is_printed():
    """Its commands are those that the parser takes."""
    lines = ok().stdout.splitlines()
    assert len([line for line in lines if line]) <= 8
    commands = [line.partition("plumbob ")[2].split() for line in lines if line.startswith("  ")]
    assert [words[0] for words in commands] == ["sim", "record", "calibrate", "run", "eval"]
    for words in commands:
        build_parser(words[:1]).parse_args(words)


def helped():
    """Each verb and kind with its parser."""
    todo = [((), build_parser())]
    for verb, parser in todo:
        nested = (action for action in parser._actions if isinstance(action, argparse._SubParsersAction))
        todo += [((*verb, name), one) for action in nested for name, one in action.choices.items()]
    return todo[1:]


@pytest.mark.parametrize(
    ("verb", "parser"), helped(), ids=lambda value: " ".join(value) if value.__class__ is tuple else ""
)
def test_every_verb_has_help_with_an_example_and_its_page(verb, parser):
    """The example is one that the parser takes, and the page exists."""
    example, *_, page = re.fullmatch(
        r"example:\n  (.*?)\n\n(.*\n)?documentation: (.*)", parser.epilog, re.DOTALL
    ).groups()
    program, *words = shlex.split(example)
    assert (program, *words[: len(verb)]) == ("plumbob", *verb)
    build_parser(words[:1]).parse_args(words)
    assert (ROOT / page).is_file()
    assert parser.format_help().startswith(f"usage: {parser.prog}")


# --- what users get wrong -----------------------------------------------------------------------------------


def table(n=200, **change):
    """A level unit at rest, as columns of a logger: time in s, rates in °/s, force in g."""
    t = np.arange(n) / 100.0
    columns = {"t": t, **{k: np.zeros(n) for k in ("gx", "gy", "gz", "ax", "ay")}, "az": np.ones(n)}
    return columns | change


def write_table(path, columns):
    rows = np.stack(list(columns.values()), axis=1)
    np.savetxt(path, rows, delimiter=",", header=",".join(columns), comments="", fmt="%.9g")
    return path


PROFILE = """
separator = ","
[header]
names = true
[time]
column = "t"
unit = "s"
[gyr]
columns = ["gx", "gy", "gz"]
unit = "{gyr}"
[acc]
columns = ["ax", "ay", "az"]
unit = "{acc}"
sign = "specific-force"
"""


def write_profile(path, gyr="dps", acc="g"):
    path.write_text(PROFILE.format(gyr=gyr, acc=acc))
    return path


RUN = ("--filter", "mahony", "--frame", "ENU")


def test_a_csv_with_a_profile_runs(tmp_path):
    csv = write_table(tmp_path / "log.csv", table())
    profile = write_profile(tmp_path / "p.toml")
    done = ok("run", csv, "--profile", profile, *RUN)
    assert "NONE: these sensor values are uncalibrated" in done.stdout


def test_wrong_units_are_refused(tmp_path):
    csv = write_table(tmp_path / "log.csv", table())
    line = refused("run", csv, "--profile", write_profile(tmp_path / "p.toml", acc="m/s2"), *RUN)
    assert "looks like g" in line
    fast = write_table(tmp_path / "fast.csv", table(gx=np.full(200, 300.0)))
    line = refused("run", fast, "--profile", write_profile(tmp_path / "q.toml", gyr="rad/s"), *RUN)
    assert "gyr[0, 0] = 300 rad/s" in line
    assert "°/s" in line


def test_an_unknown_unit_is_refused(tmp_path):
    csv = write_table(tmp_path / "log.csv", table())
    assert "furlong" in refused("run", csv, "--profile", write_profile(tmp_path / "p.toml", gyr="furlong"), *RUN)


def test_a_csv_without_a_profile_is_refused(tmp_path):
    csv = write_table(tmp_path / "log.csv", table())
    line = refused("run", csv, *RUN)
    assert "--profile" in line
    assert "log.csv" in line


def test_wrong_shapes_are_refused(tmp_path):
    (tmp_path / "log.csv").write_text("t,gx,gy,gz,ax,ay\n0,0,0,0,0,0\n")
    assert "az" in refused("run", tmp_path / "log.csv", "--profile", write_profile(tmp_path / "p.toml"), *RUN)


def test_time_that_runs_back_is_refused(tmp_path):
    t = np.arange(200) / 100.0
    t[50] = 0.1
    csv = write_table(tmp_path / "log.csv", table(t=t))
    assert "increase" in refused("run", csv, "--profile", write_profile(tmp_path / "p.toml"), *RUN)


def test_a_sensor_that_is_all_nan_is_refused(tmp_path):
    nothing = np.full(200, np.nan)
    csv = write_table(tmp_path / "log.csv", table(gx=nothing, gy=nothing, gz=nothing))
    assert "gyr is NaN in all 200 samples" in refused("run", csv, "--profile", write_profile(tmp_path / "p.toml"), *RUN)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.999])
def test_a_truncated_parquet_file_is_refused(buoy, tmp_path, share):
    whole = buoy.read_bytes()
    (tmp_path / "cut.parquet").write_bytes(whole[: int(share * len(whole))])
    assert "cut.parquet" in refused("run", tmp_path / "cut.parquet", "--filter", "mahony")


def test_a_missing_frame_filter_parameter_or_file_is_refused(buoy, tmp_path):
    imu = ImuData(t=[0.0, 0.01], gyr=np.zeros((2, 3)), acc=[[0, 0, 9.8]] * 2, meta=ImuMeta(device="x"))
    plain = files.write(tmp_path / "plain.parquet", imu)
    assert "--frame ENU" in refused("run", plain, "--filter", "mahony")
    assert "known are kp, ki, gate" in refused("run", buoy, "--filter", "mahony", "--params", "kq=1")
    assert "needs a unit" in refused("run", buoy, "--filter", "mahony", "--params", "gate=0.08")
    assert "known are" in refused("run", buoy, "--filter", "mahoney")
    assert "--card is for the smoother" in refused("run", buoy, "--filter", "mekf", "--card", tmp_path / "gyr.json")
    assert "does not exist" in refused("info", tmp_path / "nothing.parquet")
    assert "known are" in refused("sim", "bouy", "--frame", "ENU", "--out", tmp_path / "x.parquet")
    assert "--unit" in refused("sim", "buoy", "--frame", "ENU", "--sensors", "mpu6000", "--out", tmp_path / "x.parquet")
    assert "no attitude" in refused("eval", plain, buoy)


def test_a_card_of_another_unit_is_refused(buoy, tmp_path):
    card = tmp_path / "card.json"
    ok("sim", "static", "--frame", "NED", "--sensors", "mpu6000+hmc5983", "--unit", "random", "--seed", 8,
       "--out", tmp_path / "other.parquet", "--card", card)  # fmt: skip
    line = refused("run", buoy, "--filter", "mahony", "--calibration", card)
    assert "device" in line
    done = ok("run", tmp_path / "other.parquet", "--filter", "mahony", "--calibration", card)
    assert "calibration  mpu6000" in done.stdout


def test_a_place_that_cannot_be_written_is_one_line(buoy, tmp_path):
    line = refused("run", buoy, "--filter", "mahony", "--out", tmp_path / "no-such-folder" / "x.parquet")
    assert "no-such-folder" in line


def test_frames_are_told_apart(buoy, tmp_path):
    """The same attitude estimated in ENU and in NED gives the same errors: eval converts the reference and says so."""
    found = []
    for frame in Frame:
        track = tmp_path / f"{frame}.parquet"
        ok("run", buoy, "--filter", "mahony", "--frame", frame, "--out", track)
        found.append(json.loads(ok("eval", track, buoy, "--json").stdout)["total_rmse_deg"])
    assert max(found) - min(found) < 1e-6


def test_info_neither_compiles_nor_imports_numba(buoy):
    code = (
        "import sys; from plumbob.cli.main import main; "
        f"main(['info', {str(buoy)!r}]); sys.exit(1 if 'numba' in sys.modules else 0)"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, check=False).returncode == 0


def test_an_output_never_replaces_an_input(buoy, tmp_path):
    copy = tmp_path / "copy.parquet"
    copy.write_bytes(buoy.read_bytes())
    line = refused("run", copy, "--filter", "mahony", "--out", tmp_path / "." / "copy.parquet")
    assert "is an input" in line
    assert copy.read_bytes() == buoy.read_bytes()


@pytest.mark.parametrize("encoding", ["ascii", "gbk", "cp1252"])
def test_a_terminal_that_cannot_show_units_still_gets_the_result(buoy, encoding):
    assert "mahony" in ok("filters", PYTHONIOENCODING=encoding).stdout
    ok("info", buoy, PYTHONIOENCODING=encoding)
    ok("sim", "--list", PYTHONIOENCODING=encoding)


def test_the_card_is_named_in_the_estimate(tmp_path):
    card, raw, out = (tmp_path / name for name in ("card.json", "raw.parquet", "out.parquet"))
    ok(
        "sim",
        "static",
        "--frame",
        "NED",
        "--sensors",
        "mpu6000+hmc5983",
        "--unit",
        "random",
        "--out",
        raw,
        "--card",
        card,
    )
    done = ok("run", raw, "--filter", "mahony", "--calibration", card, "--out", out)
    assert "uncalibrated" not in done.stderr
    assert any("; calibration mpu6000" in note for note in files.read(out).notes)


def test_one_unfit_recording_does_not_stop_the_benchmark(buoy, tmp_path):
    (tmp_path / "good.parquet").write_bytes(buoy.read_bytes())
    whole = files.read(buoy)
    gyro_only = ImuData(t=whole.imu.t, gyr=whole.imu.gyr, meta=whole.imu.meta)
    files.write(tmp_path / "gyro.parquet", files.Recording(imu=gyro_only, track=whole.track, name="gyro"))
    result = json.loads(
        ok("benchmark", "accuracy", tmp_path, "--filters", "mahony", "--align", "heading", "--json").stdout
    )
    assert set(result["trials"]) == {"good"}
    assert "no acc" in result["skipped"]["gyro.parquet"]
    assert result["align"] == ["heading"]


def test_a_parameter_given_twice_is_refused(buoy):
    assert "twice" in refused("run", buoy, "--filter", "mahony", "--params", "kp=0.5,kp=0.1")


def test_warmup_says_where_kernels_are_kept_or_that_they_are_not(buoy, tmp_path, monkeypatch):
    """Compiled once for all tests of a run, kept in memory then: no cache folder costs a compilation here."""
    assert str(_jit.cache_folder()) in ok("warmup").stdout
    assert "compiling" not in ok("run", buoy, "--filter", "mekf").stderr
    assert "compiling" not in call("channel", "--seeds", 1, main=measure).stderr
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("PLUMBOB_CACHE_DIR", str(tmp_path / "file"))
    assert "cannot be written" in refused("warmup")


@pytest.mark.long(reason="compiles every kernel: three minutes")
def test_after_a_warmup_nothing_waits(buoy, tmp_path):
    cache = {"PLUMBOB_CACHE_DIR": str(tmp_path)}
    assert str(tmp_path) in ok("warmup", **cache).stdout
    kept = {path.name for path in tmp_path.rglob("*.nb?")}
    for name in filter_names():
        assert "compiling" not in ok("run", buoy, "--filter", name, **cache).stderr
    assert {path.name for path in tmp_path.rglob("*.nb?")} == kept


def test_python_m_plumbob_and_discovery():
    done = subprocess.run([sys.executable, "-m", "plumbob", "--version"], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("plumbob ")
    import plumbob

    assert {"Filter", "ImuData", "simulate", "read"} <= set(dir(plumbob))


def test_time_in_milliseconds_declared_as_seconds_is_noticed(tmp_path):
    csv = write_table(tmp_path / "log.csv", table(t=np.arange(200) * 10.0))
    done = ok("run", csv, "--profile", write_profile(tmp_path / "p.toml"), *RUN)
    assert "the median step is 10 s. Check the unit of time" in done.stderr


def test_heading_is_clockwise_from_north_in_every_frame(tmp_path):
    """A level body heading east-north-east, 60°: yaw is 60° in NED and 30° in ENU, its heading 60° in all."""
    for frame, yaw in (("NED", 60.0), ("ENU", 30.0), ("NWU", -60.0)):
        ok(
            "sim",
            "static",
            "--frame",
            frame,
            "--set",
            "heading=60deg",
            "--duration",
            "1s",
            "--out",
            tmp_path / f"{frame}.parquet",
        )
        last = json.loads(ok("run", tmp_path / f"{frame}.parquet", "--filter", "mahony", "--json").stdout)[
            "last_attitude_deg"
        ]
        assert last["heading"] == pytest.approx(60.0, abs=1e-6)
        assert last["yaw"] == pytest.approx(yaw, abs=1e-6)


def test_an_error_of_zero_is_printed_and_one_that_is_not_scored_says_why(tmp_path):
    """Ideal sensors at rest are without error to the last printed digit."""
    ok("sim", "static", "--frame", "ENU", "--duration", "5s", "--out", tmp_path / "s.parquet")
    done = ok("run", tmp_path / "s.parquet", "--filter", "mahony")
    assert "inclination rmse: 0.000°" in done.stdout
    free = ok("run", tmp_path / "s.parquet", "--filter", "mahony", "--params", "mag=off").stdout
    assert "not scored   heading: " in free
    assert "inclination rmse: 0.000°" in free
