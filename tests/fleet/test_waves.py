"""`plumbob waves`: from recordings of a simulated buoy to heights, periods, directions and a NetCDF file."""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

import plumbob as pb
from plumbob.core.errors import DecodeError, ParameterError
from plumbob.quality.waves import WaveSettings, sea_state

T0_NS = 1_790_000_000_000_000_000  # 2026-09-21 14:13:20 UTC
SEA = {"height": "1.5 m", "period": "8 s", "spread": "25 deg", "waves_to": "45 deg"}


def buoy(seed, duration=1200.0, t0_ns=T0_NS):
    """Simulated buoy, and its recording, which knows when it was."""
    made = pb.simulate("buoy", frame="NED", sensors="icm20948", unit="calibrated", seed=seed, rate=10.0,
                       duration=duration, **SEA)  # fmt: skip
    return made, pb.Recording(imu=made.imu.corrected(meta=replace(made.imu.meta, t0_ns=t0_ns)), name=f"buoy-{seed}")


@pytest.fixture(scope="module")
def sea():
    """Two bursts of one recording, and what was true."""
    return buoy(3, 2400.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with two recordings of a burst each, and a file that is none."""
    home = tmp_path_factory.mktemp("sea")
    for seed in (1, 2):
        pb.write(home / f"burst-{seed}.parquet", buoy(seed, t0_ns=T0_NS + seed * 10**13)[1].imu)
    (home / "broken.parquet").write_bytes(b"PAR1 and nothing behind it")
    return home


def test_heights_periods_and_directions_are_those_of_the_buoys_way(sea):
    made, recording = sea
    waves = pb.waves(recording)
    axes = np.stack((made.truth.frame.east, made.truth.frame.north, made.truth.frame.up), axis=1)
    assert len(waves.bursts) == 2
    for number, burst in enumerate(waves.bursts):
        rows = slice(12_000 * number, 12_000 * (number + 1))
        true = sea_state(made.imu.t[rows], made.kinematics.acc_n[rows] @ axes, step=0.1, segment=256.0,
                         settings=WaveSettings(low=burst["low_hz"]), heading_sd=0.0)  # fmt: skip
        assert burst["hm0_m"] == pytest.approx(true.hm0, rel=0.005)
        assert burst["tm02_s"] == pytest.approx(true.tm02, rel=0.005)
        assert burst["direction_deg"] == pytest.approx(np.degrees(true.direction), abs=2.0)
        assert burst["spread_deg"] == pytest.approx(np.degrees(true.spread), abs=3.0)
        assert burst["flag"] == 1
    # from where the waves come that travel to 45°
    assert waves.bursts[0]["direction_deg"] == pytest.approx(225.0, abs=4.0 * waves.bursts[0]["direction_sd_deg"])
    assert [burst["begin_utc"] for burst in waves.bursts] == ["2026-09-21T14:13:20Z", "2026-09-21T14:33:20Z"]
    assert "223" in waves.text() or "224" in waves.text() or "225" in waves.text()


def test_the_netcdf_file_is_one_by_the_cf_conventions_and_opens_in_wavespectra(sea, tmp_path):
    import wavespectra
    import xarray
    from compliance_checker.runner import CheckSuite, ComplianceChecker

    target = tmp_path / "waves.nc"
    waves = pb.waves(sea[1], place="45.8,13.5", out=target)
    CheckSuite.load_all_available_checkers()
    report = tmp_path / "report.json"
    ComplianceChecker.run_checker(str(target), ["cf:1.11"], 0, "normal", output_filename=str(report),
                                  output_format="json")  # fmt: skip
    found = json.loads(report.read_text())["cf:1.11"]
    assert found["high_priorities"] and not [each["msgs"] for each in found["high_priorities"] if each["msgs"]]
    with xarray.open_dataset(target) as file:
        assert file.hm0.attrs["standard_name"] == "sea_surface_wave_significant_height"
        assert file.time.values[0] == np.datetime64("2026-09-21T14:23:20")
        assert float(file.lat) == 45.8
        assert file.hm0.values == pytest.approx([burst["hm0_m"] for burst in waves.bursts])
    spectra = wavespectra.read_netcdf(target).efth.fillna(0.0)
    assert spectra.spec.hs().values == pytest.approx(waves.columns()["hm0 [m]"], rel=1e-6)
    assert spectra.spec.tm02().values == pytest.approx(waves.columns()["tm02 [s]"], rel=1e-6)
    with pytest.raises(ParameterError, match="exists"):
        waves.save(target)


def test_a_folder_gives_what_its_recordings_give_and_so_does_a_dataset(folder, tmp_path):
    said = []
    waves = pb.waves(folder, jobs=1, note=said.append)
    assert [burst["recording"] for burst in waves.bursts] == ["burst-1.parquet", "burst-2.parquet"]
    assert [note.code for note in waves.notes] == ["waves.left_out"]
    alone = pb.waves(folder / "burst-2.parquet")
    assert {**alone.bursts[0], "spectrum": None} == {**waves.bursts[1], "spectrum": None}
    run = pb.batch(folder, tmp_path / "set", waves=True, jobs=1)
    assert run.counts["done"] == 2
    again = pb.waves(tmp_path / "set", out=tmp_path / "waves.csv")
    assert again.bursts == waves.bursts
    rows = {row["recording"]: row for row in run.rows()}
    assert rows["burst-1.parquet"]["hm0_m"] == waves.bursts[0]["hm0_m"]
    text = (tmp_path / "waves.csv").read_text().splitlines()
    assert text[0].startswith("time_utc [s],hm0 [m],") and len(text) == 3


def test_a_hull_that_follows_short_waves_less_is_allowed_for(sea, tmp_path):
    """The simulated buoy follows by 1 / (1 + (2.2 s · f)²): a critically damped oscillator of 2.2 s."""
    f = np.linspace(0.0, 1.0, 101)
    table = tmp_path / "response.csv"
    table.write_text("frequency,response\n" + "\n".join(f"{x:.3f},{1.0 / (1.0 + (2.2 * x) ** 2):.6f}" for x in f))
    plain, whole = pb.waves(sea[1]), pb.waves(sea[1], response=table)
    assert plain.bursts[0]["hm0_m"] == pytest.approx(1.35, abs=0.05)
    assert whole.bursts[0]["hm0_m"] == pytest.approx(1.5, rel=0.03)  # Hs that was simulated
    table.write_text("frequency,response\n0.1;1\n")
    with pytest.raises(DecodeError, match="two columns"):
        pb.waves(sea[1], response=table)
    with pytest.raises(ParameterError, match="rising"):
        pb.waves(sea[1], response=([0.2, 0.1], [1.0, 1.0]))


def test_what_cannot_be_is_refused_before_anything_is_read(tmp_path):
    with pytest.raises(ParameterError, match=r"\.nc"):
        pb.waves(tmp_path / "none.parquet", out=tmp_path / "waves.xlsx")
    with pytest.raises(ParameterError, match="low frequency"):
        pb.waves(tmp_path / "none.parquet", low="2 Hz")
    with pytest.raises(ParameterError, match="does not exist"):
        pb.waves(tmp_path / "none.parquet")


def test_the_report_has_waves_where_they_are_asked_for(sea, tmp_path):
    page = pb.report(sea[1], waves=True)
    assert "Waves" in page.report().text()
    assert page.summary()["recordings"][0]["bursts"][0]["waves"]["hm0_m"] == pytest.approx(1.35, abs=0.05)
    assert "waves" not in pb.report(sea[1]).summary()["recordings"][0]["bursts"][0]
    for name in ("waves", "wavespectrum", "waverose"):
        made = pb.plot(sea[1], tmp_path / f"{name}.svg", what=name)
        assert made.stat().st_size > 10_000


def test_the_verb_prints_a_line_for_each_burst(folder):
    command = [sys.executable, "-m", "plumbob", "waves", str(folder / "burst-1.parquet")]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "Hm0 [m]" in done.stdout and "pass" in done.stdout and "2026-09-21T17:00:00Z" in done.stdout


def test_heave_of_a_run_is_the_buoys_way(sea):
    made, recording = sea
    way = pb.estimate(recording).acceleration().displacement(low="0.04 Hz")
    known = np.isfinite(way.way_n[:, 2])
    true = made.kinematics.pos_n[:, 2] - made.kinematics.pos_n[:, 2].mean()
    assert known.mean() > 0.98
    assert np.std(way.way_n[known, 2] - true[known]) < 0.03  # m, of waves of 1.35 m
