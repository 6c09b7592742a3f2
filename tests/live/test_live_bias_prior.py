"""A bias that a filter was told not to expect: the words, and where they are said."""

import json
from dataclasses import replace

import numpy as np
import pytest

from plumbob import AttitudeTrack, Filter, Frame, North, Recording, Stream, files, filter_names, simulate
from plumbob.core.units import dps
from plumbob.filters.offline import Stage, bias_beyond
from plumbob.fleet.experiments.scenario import measure_scenario
from plumbob.live.runner import SETTLED, Watch
from plumbob.live.transports.transport import Received
from plumbob.simulation.presets import draw_module
from tests.helpers.commandline import ok
from tests.helpers.live_samples import SESSION, session, stream


def track(bias_dps):
    bias_b = None if bias_dps is None else dps(np.atleast_2d(np.asarray(bias_dps, dtype=float)))
    n = 3 if bias_b is None else len(bias_b)
    return AttitudeTrack(np.arange(n) * 0.01, np.tile([1.0, 0, 0, 0], (n, 1)), Frame.NED, North.FREE, bias_b=bias_b)


def test_filters_with_a_prior_are_those_with_such_a_parameter():
    made = {name: Filter(name, frame=Frame.NED).bias_prior for name in filter_names()}
    assert {name: prior for name, prior in made.items() if prior} == {
        "ekf7": ("start_bias", dps(1.0)), "mekf": ("bias_start", dps(0.5)), "vqf": ("bias_start", dps(0.5)),
    }  # fmt: skip


@pytest.mark.parametrize(("filter", "params", "bias", "beyond"), [
    ("mekf", {}, [1.49, 0.0, -1.49], False),  # 3 × 0.5 °/s
    ("mekf", {}, [0.0, 0.0, -1.51], True),
    ("mekf", {}, [[2.0, 0.0, 0.0], [0.0, 0.0, 0.0]], False),  # the last counts, not the start
    ("mekf", {"bias_start": "5 deg/s"}, [12.3, 0.0, 0.0], False),
    ("mekf", {}, [np.nan, 0.0, 0.0], False),
    ("mekf", {}, None, False),
    ("mahony", {}, [100.0, 0.0, 0.0], False),  # it has no prior
])  # fmt: skip
def test_three_standard_deviations(filter, params, bias, beyond):
    assert (bias_beyond(Filter(filter, frame=Frame.NED, params=params), track(bias)) != ()) is beyond
    (beyond,) = bias_beyond(Filter("mekf", frame=Frame.NED), track([0.1, -12.3, 0.0]))
    assert "the estimated gyroscope bias, 12.3 °/s, is far outside of the prior of 0.5 °/s (1 sd)" in str(beyond)


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    """A gyroscope that is off by 4 °/s and perfect otherwise, at rest."""
    perfect = draw_module("mpu6000+hmc5983", 1).calibrated()
    unit = replace(perfect, gyr=replace(perfect.gyr, bias=dps(np.array([0.0, 4.0, 0.0]))))
    found = simulate("static", frame=Frame.NED, sensors=unit, unit="random", seed=1, duration=20.0, rate=100.0)
    path = tmp_path_factory.mktemp("bias") / "a.parquet"
    return files.write(path, Recording(imu=found.imu, name="a"))


def test_run_says_it_and_json_has_it(file):
    done = ok("run", file, "--filter", "mekf", "--json")
    (beyond,) = [n["text"] for n in json.loads(done.stdout)["notes"] if n["code"] == "estimate.bias_beyond"]
    assert "is far outside of the prior of 0.5 °/s" in beyond
    assert f"note: {beyond}" in done.stderr
    fits = ok("run", file, "--filter", "mekf", "--params", "bias_start=4 deg/s", "--json")
    assert "estimate.bias_beyond" not in [note["code"] for note in json.loads(fits.stdout)["notes"]]


def test_a_benchmark_says_in_how_many_seeds():
    found = measure_scenario(
        "static", [Stage("mekf", {}), Stage("mahony", {})], frame=Frame.NED, sensors="mpu6000+hmc5983",
        unit="random", seeds=range(3), settings={"duration": 20.0, "rate": 100.0},
    )  # fmt: skip
    many = len(found.warnings["mekf"])
    text = " ".join(found.text().split())
    assert many > 0  # the sheet allows ±20 °/s; within ±1.5 °/s on all three axes of all three units are (0.075)⁹
    assert f"in {many} of 3 seeds, as in the first of them: the estimated gyroscope bias" in text
    assert found.warnings["mahony"] == []
    assert found.summary()["warnings"]["mekf"] == found.warnings["mekf"]
    assert text.count("plumbob calibrate gyro") == 1


def test_a_line_says_it_in_the_part_in_which_a_start_in_motion_is_over():
    doubts_all = 'filter = "mekf"\nparams = { bias_start = "0.00001 deg/s", gyr_walk = "0.1 deg/s2/rtHz" }\n'
    line = Stream(session(SESSION.split("filter")[0] + doubts_all))
    notes, begins, size = [], [], 30 * 140
    status, data = Watch(line, notes.append), stream(duration=32.0)
    for at in range(0, len(data), size):  # reads of 0.7 s: one begins before the time and ends after it
        part = line.feed(Received(round((at + size) / 30 * 5e6), data[at : at + size]))
        if part is not None:
            status.on_part(part)
            begins += [part.imu.t[0]] if part.imu.t[-1] >= SETTLED else []
    assert begins[0] < SETTLED - 0.1
    assert notes == [f"at {begins[0]:.1f} s: {status.beyond[0]}"]
