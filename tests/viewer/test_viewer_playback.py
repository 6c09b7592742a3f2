"""A recording that is played: what is shown at a place is the file's sample at or before it."""

import numpy as np
import pytest

import plumbob
from plumbob import files
from plumbob.core.errors import FrameError, ParameterError, ShapeError
from plumbob.core.units import to_deg
from plumbob.viewer.playback import Player, load
from tests.helpers import live_samples
from tests.helpers.outlets import Clock, Kept


@pytest.fixture(scope="module")
def line(tmp_path_factory):
    """Recording of a line, and what the line made of it."""
    path = tmp_path_factory.mktemp("played") / "line.mcap"
    return path, live_samples.record(path, live_samples.reads(live_samples.stream(10.0)))


@pytest.fixture(scope="module")
def sea(tmp_path_factory):
    """Simulated recording with its truth, 100 s."""
    path = tmp_path_factory.mktemp("sea") / "sea.parquet"
    made = plumbob.simulate("buoy", frame="NED", sensors="mpu6000+hmc5983", unit="calibrated", seed=1, duration=100.0)
    files.write(path, files.Recording(imu=made.imu, track=made.truth, name="sea"))
    return path, made


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
def test_a_place_shows_the_sample_at_or_before_it(sea, position):
    path, made = sea
    shown, outlet = player(path, filter="vqf")
    shown.pause()
    shown.seek(position)
    t = made.imu.t
    row = max(0, np.searchsorted(t, min(position, t[-1]), side="right") - 1)
    assert outlet.resets == 1
    assert outlet.rows("t")[-1] == t[row]
    assert outlet.column("gyr.z")[-1] == pytest.approx(np.degrees(made.imu.gyr[row, 2]), rel=1e-15)
    track = plumbob.estimate(path, "vqf").track
    assert outlet.column("vqf.roll")[-1] == to_deg(track.roll)[row]
    assert outlet.fields["attitudes"]["vqf"]["q_nb"] == track.q_nb[row].tolist()


def test_the_minute_before_a_place_comes_with_it(sea):
    path, made = sea
    shown, outlet = player(path, filter="vqf")
    shown.pause()
    shown.seek(90.0)
    t = made.imu.t
    np.testing.assert_array_equal(outlet.rows("t"), t[(t >= 30.0) & (t <= 90.0)])


def test_what_is_not_taken_yet_waits_for_room(sea):
    path, made = sea
    shown, outlet = player(path, filter="vqf")
    outlet.ready = False
    shown.pause()
    shown.seek(50.0)
    assert not outlet.batches
    outlet.ready = True
    shown.tick()
    assert outlet.rows("t")[-1] == made.imu.t[np.searchsorted(made.imu.t, 50.0, side="right") - 1]


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


@pytest.mark.parametrize("speed", [0.0, -1.0, 101.0, float("nan")])
def test_other_speeds_are_refused(sea, speed):
    shown, _ = player(sea[0], filter="vqf")
    with pytest.raises(ParameterError, match=r"from 0\.1 to 100"):
        shown.set_speed(speed)
    with pytest.raises(ParameterError, match="number of seconds"):
        shown.seek(float("nan"))


def test_without_a_filter_it_is_smoothed_and_the_truth_is_the_reference(sea):
    path, made = sea
    shown, outlet = player(path, also=["mahony"])
    assert [one.name for one in outlet.hellos[0].estimators] == ["smoother", "mahony", "reference"]
    shown.seek(60.0)
    result = plumbob.estimate(path)
    errors = plumbob.evaluate(result.track, made.truth, declination="0 deg").errors
    row = np.searchsorted(made.imu.t, 60.0, side="right") - 1
    labels = {column.key: column.label for column in outlet.hellos[0].columns}
    quantity = "total" if labels["smoother.error"] == "error" else "inclination"
    assert outlet.column("smoother.error")[-1] == pytest.approx(np.degrees(errors[quantity][row]))


def test_an_estimator_is_added_and_removed(sea):
    shown, outlet = player(sea[0], filter="vqf")
    shown.pause()
    shown.seek(40.0)
    shown.add("mahony")
    assert (
        outlet.column("mahony.roll")[-1]
        == to_deg(plumbob.estimate(sea[0], "mahony").track.roll)[np.searchsorted(sea[1].imu.t, 40.0, side="right") - 1]
    )
    assert shown.position == 40.0
    shown.remove("mahony")
    assert not any("mahony" in column.key for column in outlet.hellos[-1].columns)
    for name in ("vqf", "mahony"):
        with pytest.raises(ParameterError, match="was not added"):
            shown.remove(name)


def test_a_track_alone_is_shown(tmp_path, sea):
    path = tmp_path / "track.parquet"
    plumbob.estimate(sea[0], "vqf", out=path)
    shown, outlet = player(path)
    shown.seek(10.0)
    assert [one.name for one in outlet.hellos[0].estimators] == ["recorded"]
    assert outlet.column("recorded.pitch")[-1] == pytest.approx(
        to_deg(plumbob.estimate(sea[0], "vqf").track.pitch)[np.searchsorted(sea[1].imu.t, 10.0, side="right") - 1]
    )
    with pytest.raises(ShapeError, match="nothing to estimate from"):
        load(path, "vqf")


def test_events_come_at_their_time(tmp_path):
    from plumbob.acquisition.transport import Event

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


def test_a_recording_without_a_frame_asks_for_one(tmp_path, sea):
    from dataclasses import replace

    path = tmp_path / "bare.parquet"
    imu = sea[1].imu
    files.write(path, files.Recording(imu=imu.corrected(meta=replace(imu.meta, frame=None)), name="bare"))
    with pytest.raises(FrameError, match="--frame"):
        load(path)
    assert load(path, frame="NED", filter="vqf").frame == "NED"


def test_one_estimator_is_not_shown_twice(sea):
    with pytest.raises(ParameterError, match="asked for twice"):
        load(sea[0], filter="vqf", also=["vqf"])


def test_a_chain_that_is_played_stands_as_it_did(tmp_path):
    """The hand of the machine `teach` against its true angles: 1° is 10 mm at the end of an arm of 0.6 m."""
    from plumbob.arm.angles import JointTrack
    from plumbob.data.chain_toml import load_chain
    from plumbob.rotations import Frame, change_frame
    from plumbob.session.emulated import chain_files

    truth = tmp_path / "t.parquet"
    plumbob.emulate("teach", write=tmp_path / "t.bin", truth=truth, duration="10s", seed=1, unit="calibrated")
    plumbob.record(capture=tmp_path / "t.bin", format="teach", unit="all", frame="NED", filter="mekf",
                   out=tmp_path / "t.mcap")  # fmt: skip
    table, known, _ = chain_files(truth)
    chain, angles = load_chain(known), JointTrack.load(table)
    clock = Clock()
    outlet = Kept()
    shown = Player(load(tmp_path / "t.mcap", chain=chain), outlet, chain=chain, clock=clock)
    shown.pause()
    for at in (2.0, 5.0, 9.0):
        shown.seek(at)
        row = int(np.searchsorted(angles.t, at + 1e-9, side="right")) - 1
        true = np.array([[angles.angles[row, angles.names.index(name)] for name in chain.angles]])
        base = change_frame(np.array([1.0, 0.0, 0.0, 0.0]), to=Frame.NED, from_=Frame.NWU)
        hand = chain.hand_at(chain.postures(true, base))[0]
        points = dict(zip(outlet.hellos[-1].skeleton.points, outlet.fields["points"], strict=True))
        assert np.linalg.norm(np.array(points["hand"]) - hand) < 0.01
