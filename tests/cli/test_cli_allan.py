"""plumbob allan: real processes, real files."""

import json
import re

import numpy as np
import pytest

from plumbob import NoiseCard
from plumbob.cli import allan
from plumbob.core.units import dps, from_si, to_si
from plumbob.files.numbers import RAW
from plumbob.noise import KINDS
from tests.helpers.commandline import ok, refused
from tests.helpers.real_data import DATA, needs

L3GD20 = DATA / "static_l3gd20" / "gyro2_x.txt"
TRIAL = DATA / "broad" / "03_undisturbed_slow_rotation_C.hdf5"
needs_data = needs("static_l3gd20/gyro2_x.txt")
NUMBERS = ("--rate", "100Hz", "--scale", "1 deg/s")
SD = 0.2  # °/s of a sample at 100 Hz: N = 0.02 °/s/√Hz, 1.2 °/√h


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """White noise of one axis as text, of three as .npy and as raw values, and one smoothed."""
    folder = tmp_path_factory.mktemp("allan")
    rng = np.random.default_rng(0)
    one = SD * rng.standard_normal(20_000)
    three = SD * rng.standard_normal((20_000, 3))
    np.savetxt(folder / "one.txt", one, fmt="%.9f")
    np.save(folder / "three.npy", three)
    three.astype("<f4").tofile(folder / "three.f32")
    keep, smooth, state = np.exp(-0.1), np.empty_like(one), one[0]  # 0.1 s
    for i, x in enumerate(one):
        state += (1.0 - keep) * (x - state)
        smooth[i] = state
    np.savetxt(folder / "smooth.txt", smooth, fmt="%.9f")
    return folder


def test_white_noise_as_a_data_sheet_has_it(files):
    table = ok("allan", files / "one.txt", *NUMBERS).stdout
    line = next(row for row in table.splitlines() if row.startswith("N white noise [°/√h]"))
    value, _, half = line.split()[-3:]
    assert abs(float(value) - 1.2) <= 4.0 * float(half)
    bound = 1.2 / np.sqrt(2.0 * 20_000)  # of white noise alone; what Q and B may share of it comes on top
    assert 0.9 * bound < float(half) < 3.0 * bound
    assert "B is not observable" in table


def test_json_holds_what_the_table_says_in_both_units(files):
    found = json.loads(ok("allan", files / "three.npy", *NUMBERS, "--json").stdout)
    for axis in ("gyr x", "gyr y", "gyr z"):
        n = found[axis]["coefficients"]["N"]
        assert n["lo"]["deg/rth"] < n["value"]["deg/rth"] < n["hi"]["deg/rth"]
        assert to_si(n["value"]["deg/rth"], "deg/rth") == pytest.approx(n["value"]["rad/s/rtHz"], rel=1e-12)
        assert n["value"]["rad/s/rtHz"] == pytest.approx(dps(0.02), rel=0.03)
        curve = found[axis]["curve"]
        assert curve["tau_s"][0] == 0.01
        assert curve["dev"]["deg/h"][0] == pytest.approx(SD * 3600.0, rel=0.03)


def test_raw_values_and_npy_agree(files):
    words = (*NUMBERS, "--json")
    npy = json.loads(ok("allan", files / "three.npy", *words).stdout)
    raw = json.loads(ok("allan", files / "three.f32", "--columns", 3, *words).stdout)
    for axis in ("gyr x", "gyr z"):
        a, b = (found[axis]["coefficients"]["N"]["value"]["deg/rth"] for found in (npy, raw))
        assert a == pytest.approx(b, rel=1e-6)


def test_what_is_left_out_is_told(tmp_path):
    """The magnetometer comes with three of four samples."""
    unit = ("--frame", "NED", "--sensors", "mpu6000+hmc5983", "--unit", "calibrated")
    ok("sim", "static", *unit, "--duration", "60s", "--out", tmp_path / "s.parquet")
    assert "s.parquet: mag left out: comes unevenly" in ok("allan", tmp_path / "s.parquet").stderr


def test_averaging_times_on_demand(files):
    words = ("allan", files / "one.txt", *NUMBERS, "--json")
    some = json.loads(ok(*words, "--taus", "0.1,1,50").stdout)["one"]["curve"]
    assert some["tau_s"] == pytest.approx([0.1, 1.0, 50.0])
    every = json.loads(ok(*words, "--taus", "all").stdout)["one"]["curve"]
    assert len(every["n"]) == 10_000
    assert every["dev"]["rad/s"][9] == pytest.approx(some["dev"]["rad/s"][0], rel=1e-12)


def test_other_deviations(files):
    found = json.loads(ok("allan", files / "one.txt", *NUMBERS, "--deviation", "mdev", "--taus", "1", "--json").stdout)
    assert found["one"]["kind"] == "mdev"
    expected = 0.02 * np.sqrt(0.5) * 3600.0  # [Riley2008] Table 5: half of the Allan variance, for n ≫ 1
    assert found["one"]["dev"]["deg/h"][0] == pytest.approx(expected, rel=0.1)


def test_before_and_after(files):
    page, picture = files / "change.html", files / "change.png"
    words = ("allan", files / "one.txt", "--after", files / "smooth.txt", *NUMBERS)
    ok(*words, "--html", page, "--plot", picture)
    assert page.read_text(encoding="utf-8").count("<svg") == 1
    assert picture.stat().st_size > 10_000
    found = json.loads(ok(*words, "--json").stdout)["one"]
    assert found["time_constant_s"] == pytest.approx(0.1, rel=0.05)
    assert len(found["ratio"]) == len(found["before"]["n"])


def test_cards_pages_and_imu_yaml(files):
    recording = files / "static.parquet"
    ok("sim", "static", "--frame", "NED", "--sensors", "mpu6000", "--unit", "random", "--rate", "50Hz",
       "--duration", "120s", "--out", recording)  # fmt: skip
    card, yaml, page, picture = (files / f"noise.{suffix}" for suffix in ("json", "yaml", "html", "png"))
    outputs = ("--card", card, "--kalibr", yaml, "--html", page, "--plot", picture)
    ok("allan", recording, *outputs, "--device", "unit 7")
    assert picture.stat().st_size > 10_000
    noise = NoiseCard.load(card)
    assert noise.device == "unit 7"
    # sheet of the MPU-6000: 0.005 °/s/√Hz and 400 µg/√Hz; 6000 samples tell them to 0.9 %, 4 of which are allowed
    assert from_si(noise.gyr.n_rpsd, "deg/s/rtHz") == pytest.approx([0.005] * 3, rel=0.04)
    assert from_si(noise.acc.n_rpsd, "ug/rtHz") == pytest.approx([400.0] * 3, rel=0.04)
    assert "gyroscope_noise_density: 8." in yaml.read_text(encoding="utf-8")
    assert "unit 7" in page.read_text(encoding="utf-8")
    report = json.loads(
        ok("run", recording, "--filter", "mekf", "--params", "mag=off", "--noise", card, "--json").stdout
    )
    assert report["noise_card"].startswith("unit 7")


def test_the_help_names_the_types_that_there_are():
    assert tuple(RAW) == allan.RAW_TYPES
    assert set(allan.KINDS) == set(KINDS)


def test_the_fin_paper_s_table(files):
    """Of three axes; the paper's own percentages, as papers of metrology recompute them, stand below."""
    report = ok("allan", files / "three.npy", *NUMBERS, "--paper", "fin").stdout
    line = next(row for row in report.splitlines() if row.startswith('"R" = N'))
    assert line.count("±") == 3


def test_what_is_no_static_record_gets_a_word_and_no_picture(tmp_path):
    np.save(tmp_path / "x.npy", np.random.default_rng(3).standard_normal(20_000) + 20.0 * (np.arange(20_000) > 9000))
    why = refused("allan", tmp_path / "x.npy", "--rate", "100Hz", "--scale", "1", "--plot", tmp_path / "x.png")
    assert ("moved" in why, (tmp_path / "x.png").exists()) == (True, False)


@needs_data
def test_a_real_gyroscope_on_one_line():
    """ST's L3GD20: 0.03 °/s/√Hz, data sheet table 4; the rate of the record is not known, 100 Hz is an assumption."""
    found = json.loads(ok("allan", L3GD20, *NUMBERS, "--json").stdout)["gyro2_x"]
    assert from_si(found["coefficients"]["N"]["value"]["rad/s/rtHz"], "deg/s/rtHz") == pytest.approx(0.03, rel=0.6)
    assert found["step"]["rad/s"] == pytest.approx(dps(0.00875), rel=1e-4)


@needs_data
def test_disturbed_seconds_are_skipped_on_their_own_or_on_demand(tmp_path):
    t = np.arange(60_000) * 0.01
    values = SD * (np.random.default_rng(6).standard_normal(t.size) + 9.0 * np.exp(-0.5 * ((t - 300.0) / 0.1) ** 2))
    np.save(tmp_path / "bump.npy", values)
    own = ok("allan", tmp_path / "bump.npy", *NUMBERS, "--json").stdout
    asked = ok("allan", tmp_path / "bump.npy", *NUMBERS, "--json", "--skip", "295s..305s").stdout
    for told, where in (
        (own, r"is skipped there: 29[0-9.]+ to 30[0-9.]+ s"),
        (asked, "is skipped there: 295 to 305 s"),
    ):
        found = json.loads(told)["bump"]
        assert re.search(where, " ".join(found["notes"]))
        assert found["coefficients"]["N"]["value"]["rad/s/rtHz"] == pytest.approx(dps(0.02), rel=0.02)


@needs("broad")
def test_a_trial_that_moves_is_refused_and_its_still_start_is_not():
    told = refused("allan", TRIAL)
    start, stop = re.search(r"the longest still stretch is --from (\S+) --to (\S+)\.$", told.strip()).groups()
    assert (start, float(stop.removesuffix("s"))) == ("0s", pytest.approx(44.5, abs=1.2))  # it begins to move at 45.7 s
    found = json.loads(ok("allan", TRIAL, "--from", start, "--to", stop, "--triads", "gyr", "--json").stdout)
    assert set(found) == {"file", "calibration", "gyr x", "gyr y", "gyr z"}
    densities = [found[f"gyr {a}"]["coefficients"]["N"]["value"]["deg/rth"] for a in "xyz"]
    assert max(densities) < 1.1 * min(densities)
