"""A recording that is played: what is shown at a place is the file's sample at or before it."""

from dataclasses import replace

import numpy as np
import pytest

import plumbob
from plumbob import Recording, convert, files
from plumbob.core.errors import FrameError, ParameterError, ShapeError
from plumbob.core.units import to_deg
from plumbob.viewer.playback import Player, load
from tests.helpers import Clock, live_samples
from tests.helpers.outlets import Kept


@pytest.fixture(scope="module")
def line(tmp_path_factory):
    path = tmp_path_factory.mktemp("played") / "line.mcap"
    return path, live_samples.record(path, live_samples.reads(live_samples.stream(10.0)))


@pytest.fixture(scope="module")
def sea(tmp_path_factory):
    """Simulated recording with its truth, 100 s."""
    path = tmp_path_factory.mktemp("sea") / "sea.parquet"
    made = plumbob.simulate("buoy", frame="NED", sensors="mpu6000+hmc5983", unit="calibrated", seed=1, duration=100.0)
    files.write(path, Recording(imu=made.imu, track=made.truth, name="sea"))
    return path, made


@pytest.fixture(scope="module")
def vqf(sea):
    return plumbob.estimate(sea[0], "vqf").track


def row_at(imu, t):
    return max(0, np.searchsorted(imu.t, min(t, imu.t[-1]), side="right") - 1)


def player(path, clock=None, **options):
    outlet = Kept()
    return Player(load(path, **options), outlet, clock=clock or Clock()), outlet


def test_a_recorded_line_shows_its_own_estimate_samples_and_counts(line):
    path, found = line
    shown, outlet = player(path, clock := Clock())
    assert outlet.hellos[0].session == "line.mcap"
    assert not outlet.hellos[0].live
    assert [one.name for one in outlet.hellos[0].estimators] == ["mahony"]
    clock.on(20.0)
    shown.tick()
    np.testing.assert_array_equal(outlet.column("mahony.yaw"), to_deg(found.track().yaw))
    np.testing.assert_array_equal(outlet.column("acc.x"), found.imu(calibrated=True).acc[:, 0])
    keys = [column.key for column in outlet.hellos[0].raw]
    assert outlet.fields["raw"][keys.index("counter")] == 1999.0
    assert not shown.playing  # it has come to its end
    assert outlet.fields["playback"] == {"position": shown.duration, "speed": 1.0, "playing": False}


@pytest.mark.parametrize("position", [0.0, 3.0, 3.0049, 7.123456, 99.99, 1e9, -5.0])
def test_a_place_shows_the_sample_at_or_before_it(sea, vqf, position):
    path, made = sea
    shown, outlet = player(path, filter="vqf")
    shown.pause()
    shown.seek(position)
    row = row_at(made.imu, position)
    assert outlet.resets == 1
    assert outlet.rows("t")[-1] == made.imu.t[row]
    assert outlet.column("gyr.z")[-1] == pytest.approx(np.degrees(made.imu.gyr[row, 2]), rel=1e-15)
    assert outlet.column("vqf.roll")[-1] == to_deg(vqf.roll)[row]
    assert outlet.fields["attitudes"]["vqf"]["q_nb"] == vqf.q_nb[row].tolist()


def test_the_minute_before_a_place_comes_with_it_and_an_estimator_is_added_and_removed(sea):
    path, made = sea
    shown, outlet = player(path, filter="vqf")
    shown.pause()
    outlet.ready = False
    shown.seek(90.0)
    assert not outlet.batches
    outlet.ready = True
    shown.tick()
    t = made.imu.t
    np.testing.assert_array_equal(outlet.rows("t"), t[(t >= 30.0) & (t <= 90.0)])
    shown, outlet = player(sea[0], filter="vqf")
    shown.pause()
    shown.seek(40.0)
    shown.add("mahony")
    track = plumbob.estimate(sea[0], "mahony").track
    assert outlet.column("mahony.roll")[-1] == to_deg(track.roll)[row_at(sea[1].imu, 40.0)]
    assert shown.position == 40.0
    shown.remove("mahony")
    assert not any("mahony" in column.key for column in outlet.hellos[-1].columns)


def test_time_runs_with_the_speed_and_stands_in_a_pause(sea):
    path, _ = sea
    clock = Clock()
    shown, outlet = player(path, clock, filter="vqf")
    clock.on(1.0)
    shown.tick()
    assert shown.position == pytest.approx(1.0)
    shown.set_speed(10.0)
    clock.on(2.0)
    shown.tick()
    assert shown.position == pytest.approx(21.0)
    shown.pause()
    clock.on(5.0)
    shown.tick()
    assert shown.position == pytest.approx(21.0)
    assert outlet.rows("t")[-1] <= 21.0
    shown.play()
    clock.on(0.1)
    shown.tick()
    assert shown.position == pytest.approx(22.0)
    assert np.all(np.diff(outlet.rows("t")) > 0.0)
    clock.on(100.0)
    shown.tick()
    assert not shown.playing
    shown.play()  # from its beginning again
    assert shown.position == 0.0


def test_what_cannot_be_played_is_refused(sea, vqf, tmp_path):
    path, bare, track = sea[0], tmp_path / "bare.parquet", tmp_path / "track.parquet"
    imu = sea[1].imu
    files.write(bare, Recording(imu=imu.corrected(meta=replace(imu.meta, frame=None)), name="bare"))
    assert load(bare, frame="NED", filter="vqf").frame == "NED"
    plumbob.estimate(path, "vqf", out=track)
    shown, _ = player(path, filter="vqf")
    for error, call, says in (
        *((ParameterError, lambda v=v: shown.set_speed(v), r"from 0\.1 to 100") for v in (0.0, -1.0, 101.0, np.nan)),
        (ParameterError, lambda: shown.seek(np.nan), "number of seconds"),
        (FrameError, lambda: load(bare), "--frame"),
        (ParameterError, lambda: load(path, filter="vqf", also=["vqf"]), "asked for twice"),
        (ShapeError, lambda: load(track, "vqf"), "nothing to estimate from"),
        *((ParameterError, lambda n=n: shown.remove(n), "was not added") for n in ("vqf", "mahony")),
    ):
        with pytest.raises(error, match=says):
            call()
    convert(Recording(imu=imu, track=vqf), tmp_path / "both.mcap")
    for kept in (track, tmp_path / "both.mcap"):  # a track is shown, alone and beside samples
        shown, outlet = player(kept)
        shown.seek(10.0)
        row = row_at(imu, 10.0)
        assert [one.name for one in outlet.hellos[0].estimators] == ["recorded"]
        assert outlet.column("recorded.pitch")[-1] == pytest.approx(to_deg(vqf.pitch)[row])


def test_without_a_filter_it_is_smoothed_and_the_truth_is_the_reference(sea):
    path, made = sea
    shown, outlet = player(path, also=["mahony"])
    assert [one.name for one in outlet.hellos[0].estimators] == ["smoother", "mahony", "reference"]
    shown.seek(60.0)
    result = plumbob.estimate(path)
    errors = plumbob.evaluate(result.track, made.truth, declination="0 deg").errors
    row = row_at(made.imu, 60.0)
    labels = {column.key: column.label for column in outlet.hellos[0].columns}
    quantity = "total" if labels["smoother.error"] == "error" else "inclination"
    assert outlet.column("smoother.error")[-1] == pytest.approx(np.degrees(errors[quantity][row]))


def test_events_come_at_their_time(tmp_path):
    from plumbob.core.event import Event

    path = tmp_path / "e.mcap"
    items = live_samples.reads(live_samples.stream(5.0))
    middle = len(items) // 2
    event = Event(items[middle].t_ns, "mark", "half way")
    live_samples.record(path, [*items[:middle], event, *items[middle:]])
    clock = Clock()
    shown, outlet = player(path, clock)
    clock.on(1.0)
    shown.tick()
    assert not outlet.events
    clock.on(4.0)
    shown.tick()
    ((t, kind, text),) = outlet.events
    assert (kind, text) == ("mark", "half way")
    assert 2.0 < t < 3.0
    shown.seek(t - 0.1)
    shown.play()
    clock.on(0.2)
    shown.tick()
    assert len(outlet.events) == 2
