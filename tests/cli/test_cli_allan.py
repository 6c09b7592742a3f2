"""plumbob allan on files."""

import re

import numpy as np
import pytest
from scipy.signal import lfilter

from plumbob import NoiseCard
from plumbob.core.units import dps, from_si, to_si
from tests.helpers.commandline import answer, typed
from tests.helpers.real_data import DATA, needs

L3GD20 = DATA / "static_l3gd20" / "gyro2_x.txt"
TRIAL = DATA / "broad" / "03_undisturbed_slow_rotation_C.hdf5"
needs_data = needs("static_l3gd20/gyro2_x.txt")
SCALED = "--rate 100Hz --scale '1 deg/s'"
SD = 0.2  # °/s of a sample at 100 Hz: N = 0.02 °/s/√Hz, 1.2 °/√h


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """White noise of one axis as text, of three as .npy and as raw values, and one smoothed over 0.1 s."""
    folder = tmp_path_factory.mktemp("allan")
    rng = np.random.default_rng(0)
    one, three = SD * rng.standard_normal(20_000), SD * rng.standard_normal((20_000, 3))
    np.savetxt(folder / "one.txt", one, fmt="%.9f")
    np.save(folder / "three.npy", three)
    three.astype("<f4").tofile(folder / "three.f32")
    keep = np.exp(-0.1)
    np.savetxt(folder / "smooth.txt", lfilter([1.0 - keep], [1.0, -keep], one, zi=[keep * one[0]])[0], fmt="%.9f")
    return folder


def densities(result):
    """White noise of each axis, rad/s/√Hz."""
    axes = [axis for name, axis in result.items() if name not in {"file", "calibration"}]
    return [axis["coefficients"]["N"]["value"]["rad/s/rtHz"] for axis in axes]


def test_json_holds_what_the_table_says_in_both_units_from_raw_values_too(folder):
    result = answer(f"allan three.npy {SCALED}", cwd=folder)
    for axis in ("gyr x", "gyr y", "gyr z"):
        n = result[axis]["coefficients"]["N"]
        assert n["lo"]["deg/rth"] < n["value"]["deg/rth"] < n["hi"]["deg/rth"]
        assert to_si(n["value"]["deg/rth"], "deg/rth") == pytest.approx(n["value"]["rad/s/rtHz"], rel=1e-12)
        assert n["value"]["rad/s/rtHz"] == pytest.approx(dps(0.02), rel=0.03)
        assert result[axis]["curve"]["tau_s"][0] == 0.01
        assert result[axis]["curve"]["dev"]["deg/h"][0] == pytest.approx(SD * 3600.0, rel=0.03)
    raw = answer(f"allan three.f32 --columns 3 {SCALED}", cwd=folder)
    assert densities(raw) == pytest.approx(densities(result), rel=1e-6)


def test_averaging_times_and_deviations_on_demand(folder):
    some = answer(f"allan one.txt {SCALED} --taus 0.1,1,50", cwd=folder)["one"]["curve"]
    assert some["tau_s"] == pytest.approx([0.1, 1.0, 50.0])
    table = typed(f"allan one.txt {SCALED} --taus 0.1,1", cwd=folder).stdout
    assert [row.split()[0] for row in table.splitlines()[-2:]] == ["0.100", "1.00"]
    every = answer(f"allan one.txt {SCALED} --taus all", cwd=folder)["one"]["curve"]
    assert len(every["n"]) == 10_000
    assert every["dev"]["rad/s"][9] == pytest.approx(some["dev"]["rad/s"][0], rel=1e-12)
    other = answer(f"allan one.txt {SCALED} --deviation mdev --taus 1", cwd=folder)["one"]
    assert other["kind"] == "mdev"
    expected = 0.02 * np.sqrt(0.5) * 3600.0  # [Riley2008] Table 5: half of the Allan variance, for n ≫ 1
    assert other["dev"]["deg/h"][0] == pytest.approx(expected, rel=0.1)


def test_before_and_after_and_what_is_no_static_record_gets_no_picture(folder, tmp_path):
    words = f"allan one.txt smooth.txt {SCALED}"
    done = typed(f"{words} --label raw,filtered --html change.html --plot change.png --width 85mm", cwd=folder)
    assert "a filter of first order with a time constant of 0.1" in " ".join(done.stdout.split())
    assert (folder / "change.html").read_text(encoding="utf-8").count("<svg") == 1
    dots = int.from_bytes((folder / "change.png").read_bytes()[16:20], "big")
    assert dots == int(85.0 / 25.4 * 200.0)  # 200 an inch
    result = answer(words, cwd=folder)
    change = result["smooth"]["changes"]["smooth"]
    assert change["time_constant_s"] == pytest.approx(0.1, rel=0.05)
    assert (len(change["ratio"]), result["one"].get("changes")) == (len(change["tau_s"]), None)
    np.save(tmp_path / "x.npy", np.random.default_rng(3).standard_normal(20_000) + 20.0 * (np.arange(20_000) > 9000))
    done = typed("allan x.npy --rate 100Hz --scale 1 --plot x.png", cwd=tmp_path, code=1)
    assert ("moved" in done.stderr, (tmp_path / "x.png").exists()) == (True, False)


def test_cards_pages_and_imu_yaml(folder):
    """The magnetometer comes with three of four samples."""
    unit = "--sensors mpu6000+hmc5983 --unit random --rate 50Hz --duration 60s"
    typed(f"sim static --frame NED {unit} --set mag_rate=37.5Hz --out rest.parquet", cwd=folder)
    outputs = "--card noise.json --html noise.html --plot noise.png"
    done = typed(f"allan rest.parquet {outputs} --device 'unit 7'", cwd=folder)
    assert "rest.parquet: mag left out: comes unevenly" in done.stderr
    assert (folder / "noise.png").stat().st_size > 10_000
    noise = NoiseCard.load(folder / "noise.json")
    assert (noise.device, noise.mag) == ("unit 7", None)
    # sheet of the MPU-6000: 0.005 °/s/√Hz and 400 µg/√Hz; 3000 samples tell them to 1.3 %, 4 of which are allowed
    assert from_si(noise.gyr.n_rpsd, "deg/s/rtHz") == pytest.approx([0.005] * 3, rel=0.052)
    assert from_si(noise.acc.n_rpsd, "ug/rtHz") == pytest.approx([400.0] * 3, rel=0.052)
    assert "gyroscope_noise_density: 8." in typed("allan rest.parquet --as kalibr", cwd=folder).stdout
    assert "unit 7" in (folder / "noise.html").read_text(encoding="utf-8")
    report = answer("run rest.parquet --filter mekf --params mag=off --noise noise.json", cwd=folder)
    assert report["noise_card"].startswith("unit 7")


@needs_data
def test_a_real_gyroscope_on_one_line():
    """ST's L3GD20: 0.03 °/s/√Hz, data sheet table 4; the rate of the record is not known, 100 Hz is an assumption."""
    result = answer(f"allan {L3GD20} {SCALED}")
    assert from_si(densities(result)[0], "deg/s/rtHz") == pytest.approx(0.03, rel=0.6)
    assert result["gyro2_x"]["step"]["rad/s"] == pytest.approx(dps(0.00875), rel=1e-4)


def test_disturbed_seconds_are_skipped_on_their_own_or_on_demand(tmp_path):
    t = np.arange(60_000) * 0.01
    values = SD * (np.random.default_rng(6).standard_normal(t.size) + 9.0 * np.exp(-0.5 * ((t - 300.0) / 0.1) ** 2))
    np.save(tmp_path / "bump.npy", values)
    for words, where in (("", r"29[0-9.]+ to 30[0-9.]+ s"), ("--skip 295s..305s", "295 to 305 s")):
        result = answer(f"allan bump.npy {SCALED} {words}", cwd=tmp_path)
        assert re.search(f"is skipped there: {where}", " ".join(note["text"] for note in result["bump"]["notes"]))
        assert densities(result) == pytest.approx([dps(0.02)], rel=0.02)


@needs("broad")
def test_a_trial_that_moves_is_refused_and_its_still_start_is_not():
    told = typed(f"allan {TRIAL}", code=1).stderr
    start, stop = re.search(r"the longest still stretch is --from (\S+) --to (\S+)\.$", told.strip()).groups()
    assert (start, float(stop.removesuffix("s"))) == ("0s", pytest.approx(44.5, abs=1.2))  # it begins to move at 45.7 s
    result = answer(f"allan {TRIAL} --from {start} --to {stop} --triads gyr")
    assert set(result) == {"file", "calibration", "gyr x", "gyr y", "gyr z"}
    assert max(densities(result)) < 1.1 * min(densities(result))
