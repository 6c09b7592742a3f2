"""plumbob report, plot and run --report: files of every kind, options, numbers, and what is refused."""

import json

import numpy as np
import pytest

import plumbob
from plumbob.overview import report_entry as subject
from tests.helpers.commandline import answer, is_built, typed

SIM = {"frame": "NED", "sensors": "mpu6000+hmc5983", "unit": "calibrated"}
BUILT = pytest.mark.skipif(not is_built(), reason="the pages are not built: run 'make page'")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A recording, its track, and a recorded line with its card and a filter."""
    place = tmp_path_factory.mktemp("overview")
    made = plumbob.simulate("buoy", duration=30.0, seed=1, **SIM)
    plumbob.write(place / "sea.parquet", made.imu)
    plumbob.estimate(made.imu, "mekf").save(place / "track.parquet")
    plumbob.emulate("buoy", seed=1, duration=20.0, write=place / "b.bin", truth=place / "t.parquet")
    card = plumbob.CalibrationCard.load(place / "t.card.json")
    for name, options in (("line", {"calibration": card, "device": card.device}), ("bare", {})):
        plumbob.record(
            capture=place / "b.bin", format="buoy", frame="NED", filter="mekf", out=place / f"{name}.mcap", **options
        )
    return place


@BUILT
def test_report_and_run_write_the_page(folder, tmp_path):
    done = typed(f"report sea.parquet --filter mekf --burst '10 s' --out {tmp_path}/a.html", cwd=folder)
    assert done.stdout.splitlines()[-1].split() == ["page", str(tmp_path / "a.html")]
    for number, out in enumerate(("", f"--out {tmp_path}/track.parquet", f"--out {tmp_path}/track.csv")):
        done = typed(f"run sea.parquet --filter mekf {out} --report {tmp_path}/{number}.html", cwd=folder)
        assert f"page         {tmp_path}/{number}.html" in done.stdout
    assert min((tmp_path / f"{name}.html").stat().st_size for name in "a012") > 100_000


def test_json_has_all_numbers(folder):
    (one,) = answer("report sea.parquet --filter mekf --burst '10 s'", cwd=folder)["recordings"]
    ours = plumbob.report(folder / "sea.parquet", filter="mekf", burst=10.0).summary()["recordings"][0]
    for report in (one, ours):
        report["provenance"] = [fact for fact in report["provenance"] if fact[0] != "made by"]
    assert one == json.loads(json.dumps(ours))
    assert len(one["bursts"]) == 3
    assert one["tilt"]["roll"]["std_deg"] == pytest.approx(3.5, abs=2.0)
    assert sum(one["heading"]["share_by_10_deg"]) == pytest.approx(1.0)
    assert set(one["spectra"]["density"]) >= {"roll [°²/Hz]", "vertical [(m/s²)²/Hz]"}
    assert one["bursts"][0]["quality"]["gyr"]["flag"] == 1
    assert one["estimate"]["filter"].startswith("mekf")


def test_the_page_of_run_is_of_its_own_estimate(folder):
    """Estimated once, with the numbers that report has."""
    from plumbob.overview.streaming_stats import Gatherer
    from plumbob.reporting import overview

    gatherer = Gatherer(burst=10.0)
    result = plumbob.estimate(folder / "sea.parquet", "mekf", follow=gatherer)
    made = overview.of_estimate(result, gatherer, folder / "sea.parquet").summary()["recordings"][0]
    other = plumbob.report(folder / "sea.parquet", filter="mekf", burst=10.0).summary()["recordings"][0]
    for key in ("tilt", "heading", "spectra", "bursts", "flags", "remarks", "grade"):
        assert made[key] == other[key]


def test_estimating_without_keeping_holds_the_last_attitude(folder):
    whole = plumbob.estimate(folder / "sea.parquet", "mekf")
    lean = plumbob.estimate(folder / "sea.parquet", "mekf", keep=False)
    assert lean.summary() == whole.summary()
    assert len(lean.track) == 1
    assert np.array_equal(lean.track.q_nb[-1], whole.track.q_nb[-1])


def test_a_track_is_taken_as_it_is(folder):
    """And of samples with an attitude beside them, that attitude where it is asked for."""
    page = plumbob.report(folder / "track.parquet")
    alone = page.subjects[0]
    assert alone.gathered.triads == ()
    imu, track = plumbob.read(folder / "sea.parquet").imu, plumbob.read(folder / "track.parquet").track
    roll, pitch = np.degrees(np.std([track.roll, track.pitch], axis=1, ddof=1))
    assert page.facts() == {
        "recordings": alone.name, "duration": "30 s", "roll": f"std {roll:.2f}°", "pitch": f"std {pitch:.2f}°"
    }  # fmt: skip
    both = plumbob.report(plumbob.Recording(imu=imu, track=track, name="both"), filter="track").subjects[0]
    made = plumbob.report(folder / "sea.parquet", filter="mekf").subjects[0]
    for one in (alone, both):
        assert one.gathered.tilt.roll.sd == pytest.approx(made.gathered.tilt.roll.sd, rel=1e-9)
    assert both.gathered.triads == ("gyr", "acc", "mag")
    assert "as the file holds it: mekf" in dict(both.facts)["estimate"]
    numbers = plumbob.report(folder / "sea.parquet", filter="none").summary()["recordings"][0]["sensors"]
    for axis, rate in zip("xyz", np.degrees(imu.gyr.T), strict=True):
        expected = {"mean": rate.mean(), "std": rate.std(), "least": rate.min(), "greatest": rate.max()}
        assert numbers[f"gyr_{axis} [°/s]"] == pytest.approx({**expected, "samples": len(rate)}, rel=1e-9)


def test_a_recorded_line_takes_its_card_and_needs_no_frame_for_sensors_alone(folder):
    found = plumbob.report(folder / "bare.mcap", filter="none").subjects[0]
    assert found.gathered.tilt is None and found.gathered.spectra is None
    assert dict(found.facts)["estimate"] == "none"
    card = plumbob.CalibrationCard.load(folder / "t.card.json")
    with_card = plumbob.report(folder / "line.mcap", filter="mekf").subjects[0]
    assert with_card.calibrated and dict(with_card.facts)["calibration"] == card.name
    bare = plumbob.report(folder / "bare.mcap", filter="mekf").subjects[0]
    assert not bare.calibrated
    live = plumbob.report(folder / "line.mcap", filter="track").subjects[0].gathered
    again = plumbob.replay(folder / "line.mcap").track
    assert live.tilt.roll.samples == len(again)
    assert live.tilt.inclination.greatest == pytest.approx(np.max(np.arccos(np.cos(again.roll) * np.cos(again.pitch))))


def test_a_large_recorded_line_is_decoded_to_a_file_with_the_same_numbers(folder, monkeypatch):
    small = plumbob.report(folder / "line.mcap", filter="mekf").summary()["recordings"][0]
    monkeypatch.setattr(subject, "LARGE", (folder / "line.mcap").stat().st_size - 1)
    monkeypatch.setattr("plumbob.live.recorded.read_recorded", None)  # which takes all into memory
    large = plumbob.report(folder / "line.mcap", filter="mekf").summary()["recordings"][0]
    for key in ("tilt", "heading", "spectra", "bursts", "flags", "remarks", "time", "sensors"):
        assert large[key] == small[key], key


def test_damage_is_said(folder, tmp_path, monkeypatch):
    raw = bytearray((folder / "line.mcap").read_bytes())
    at = len(raw) // 2
    raw[at : at + 40] = bytes(40)
    (tmp_path / "bad.mcap").write_bytes(raw[: len(raw) * 9 // 10])
    for large in (subject.LARGE, 0):
        monkeypatch.setattr(subject, "LARGE", large)
        notes = []
        damaged = plumbob.report(tmp_path / "bad.mcap", filter="mekf", note=notes.append).subjects[0]
        assert damaged.gathered.samples < 2000
        assert [any("damaged: " in str(line) for line in lines) for lines in (notes, damaged.remarks)] == [True, True]


def test_a_tilt_limit_is_a_limit_and_what_does_not_go_together_is_refused(folder):
    found = plumbob.report(folder / "track.parquet", tilt_limit="3 deg").subjects[0].gathered.tilt.inclination
    assert found.limit == pytest.approx(np.radians(3.0))
    assert found.beyond > 0
    before = sorted(folder.iterdir())
    for words, why in (
        ("--filter track", "holds no attitude, which filter 'track' takes"),
        ("--burst '0 s'", "above 0"),
    ):
        assert why in typed(f"report sea.parquet --out a.html {words}", cwd=folder, code=1).stderr
    assert sorted(folder.iterdir()) == before


def test_plot_is_plot_and_pictures_of_little_have_axes(folder, tmp_path):
    pytest.importorskip("matplotlib")
    words = "--filter mekf --from 5s --to 20s"
    typed(f"report sea.parquet --figure angles {words} --out {tmp_path}/a.svg", cwd=folder)
    plumbob.plot(folder / "sea.parquet", tmp_path / "b.svg", what="angles", filter="mekf", begin="5s", end="20s")
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()
    # of time around a single sample, of frequency in a narrow band: a warning of an axis without a length is an error
    plumbob.plot(folder / "sea.parquet", tmp_path / "c.svg", what="rates", filter="none", begin="29.985 s")
    assert (tmp_path / "c.svg").is_file()
    made = plumbob.simulate("buoy", duration=0.03, seed=1, **SIM)
    plumbob.plot(made.imu, tmp_path / "d.svg", what="spectrum", filter="mekf")
    assert "mathdefault" not in (tmp_path / "d.svg").read_text()


def test_the_claimed_band_breaks_at_a_gap(monkeypatch, tmp_path):
    axes = pytest.importorskip("matplotlib.axes")
    drawn, draw = [], axes.Axes.fill_between

    def watched(ax, t, low, high, **how):
        drawn.append((t, low, high))
        return draw(ax, t, low, high, **how)

    monkeypatch.setattr(axes.Axes, "fill_between", watched)
    imu = plumbob.simulate("buoy", duration=18.0, seed=1, **SIM).imu  # a column for each sample
    keep = (imu.t < 8.0) | (imu.t > 12.0)
    with_gap = plumbob.ImuData(imu.t[keep], imu.gyr[keep], imu.acc[keep], imu.mag[keep])
    plumbob.plot(with_gap, tmp_path / "a.svg", what="angles", filter="mekf", frame="NED")
    assert len(drawn) == 3
    for t, low, high in drawn:
        behind = np.searchsorted(t, 10.0)
        assert np.isnan(low[behind - 1]) and np.isnan(low).mean() < 0.01
        assert np.nanmin(high - low) > 0.0  # twice the standard deviation
