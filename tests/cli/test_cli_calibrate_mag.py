"""plumbob calibrate mag on files."""

import re

import numpy as np
import pytest

from plumbob import CalibrationCard, ImuData, ImuMeta
from plumbob import files as io
from plumbob.rotations import quat_from_rotvec, quat_multiply
from tests.helpers.commandline import answer, typed
from tests.helpers.mag_scene import Unit, attitudes, field, force, heading_rms, rates, trajectory, tumbling, unit_of

COUNT = 300


@pytest.fixture(scope="module")
def unit():
    return unit_of(np.random.default_rng(31))


@pytest.fixture(scope="module")
def files(tmp_path_factory, unit):
    """A capture through all attitudes, and one of turning level."""
    folder = tmp_path_factory.mktemp("mag")
    rng = np.random.default_rng(32)
    for name, tilt in (("all", None), ("level", np.radians(1.0))):
        q_nb = attitudes(rng, COUNT, tilt)
        meta = ImuMeta(device="SN7")
        imu = ImuData(t=0.05 * np.arange(COUNT), acc=force(rng, q_nb), mag=field(rng, unit, q_nb), meta=meta)
        io.write(folder / f"{name}.parquet", imu)
    return folder


def test_a_card_is_written_and_used(files, unit, tmp_path):
    card = tmp_path / "card.json"
    typed(f"calibrate mag all.parquet --strength '500 mgauss' --out {card}", cwd=files)
    found = CalibrationCard.load(card)
    assert found.device == "SN7"
    assert found.mag.reference == 50.0
    assert np.degrees(heading_rms(found.mag, unit)) < 0.25  # 0.05° at 1000 poses, by the root 0.09°


def test_a_smaller_shape_may_be_asked_for_and_turning_level_is_refused(files, tmp_path):
    told = answer("calibrate mag all.parquet --shape sphere --tilt 10deg", cwd=files)
    assert told["card"]["mag"]["method"] == "magnetometer alone: sphere, 4 parameters"
    assert told["card"]["mag"]["quality"]["tilt_range"] == pytest.approx(np.radians(10.0))
    card = tmp_path / "card.json"
    refusal = answer(f"calibrate mag level.parquet --out {card}", cwd=files, code=1)
    assert (refusal["refused"][0]["kind"], card.exists()) == ("level-ring", False)


def test_a_place_tells_the_strength(files):
    pytest.importorskip("pygeomag", reason="the extra geomag is not installed")
    mag = answer("calibrate mag all.parquet --place 42.283,-71.35,1000", cwd=files)["card"]["mag"]
    assert any(re.search(r"declination -13\.\d\d deg, by WMM-2025", remark["text"]) for remark in mag["remarks"])
    # 51.4 µT in 2025 and 50.9 in 2029 by the World Magnetic Model; the recording has no date, so today's counts
    assert mag["reference"] == pytest.approx(51.2, abs=0.5)


def test_a_card_that_would_rather_harm_needs_force(tmp_path):
    rng = np.random.default_rng(41)
    t, q_nb, _ = tumbling(rng, duration=15.0)
    perfect = field(rng, Unit(np.eye(3), np.zeros(3)), q_nb)
    io.write(tmp_path / "perfect.parquet", ImuData(t=t, mag=perfect, meta=ImuMeta(device="SN7")))
    card, words = tmp_path / "card.json", "calibrate mag perfect.parquet --out card.json"
    assert answer(words, cwd=tmp_path, code=1)["refused"][0]["kind"] == "no-gain"
    assert not card.exists()
    typed(f"{words} --force", cwd=tmp_path)
    assert str(CalibrationCard.load(card).mag.remarks[0]).startswith("DO NOT USE")


@pytest.fixture(scope="module")
def deployed(tmp_path_factory, unit):
    """Ten minutes of a vessel with inclinations up to 15°, in a field that turns by 4° a minute, too much for one."""
    rng = np.random.default_rng(51)
    t, q_nb, true = trajectory(rng, duration=600.0, rate=10.0)
    about = quat_from_rotvec(np.radians(4.0) * t[:, None] / 60.0 * np.array([0.0, 0.0, -1.0]))
    seen = field(rng, unit, quat_multiply(about, q_nb))
    gyr = rates(rng, true, rate=10.0, gain_sd=0.002)
    file = tmp_path_factory.mktemp("deployed") / "deployed.parquet"
    io.write(file, ImuData(t=t, acc=force(rng, q_nb), gyr=gyr, mag=seen, meta=ImuMeta(device="SN7")))
    return file


def test_a_unit_at_work_is_calibrated_in_use_and_a_long_record_that_nobody_turned_told_of_it(deployed, unit, tmp_path):
    card = tmp_path / "card.json"
    done = typed(f"calibrate mag {deployed} --in-use --out card.json", cwd=tmp_path)
    assert "150 windows of 4 s in 10 min" in done.stdout
    found = CalibrationCard.load(card).mag
    # no card of the gyroscope: its axes may turn the whole by 0.25° about each of three, and turn it by less here
    assert np.degrees(heading_rms(found, unit)) < 2.0 * np.degrees(found.quality.heading_sd) < 2.0
    rng = np.random.default_rng(52)
    for duration, told in ((100.0, False), (400.0, True)):
        t, q_nb, true = trajectory(rng, duration=duration, rate=10.0, tilt=np.radians(4.0))
        imu = ImuData(t=t, gyr=rates(rng, true, rate=10.0), mag=field(rng, unit, q_nb), meta=ImuMeta(device="SN7"))
        io.write(tmp_path / f"{told}.parquet", imu)
        assert ("--in-use" in typed(f"calibrate mag {told}.parquet", cwd=tmp_path, code=1).stderr) is told
