"""The feed: its numbers are those of the estimate, whatever came when; a fault in it costs the view alone."""

import functools
from pathlib import Path

import numpy as np
import pytest

import plumbob
from plumbob import find_format
from plumbob.arm import JointTrack, Program
from plumbob.core.constants import G0
from plumbob.core.errors import ParameterError
from plumbob.core.units import to_deg, to_dps
from plumbob.data.chain import chain_text
from plumbob.live.rigs.rig import PLANS, make_rig
from plumbob.live.runner import run_stream
from plumbob.live.session import RecordSpec
from plumbob.live.session_toml import parse_session
from plumbob.live.sinks import Collected, RecordingSink
from plumbob.live.stream import Stream
from plumbob.live.transports.transport import Received
from plumbob.rotations import Frame, North, quat_from_euler_zyx
from plumbob.viewer.charts import euler_deg
from plumbob.viewer.feed import Feed, FlagWatch
from plumbob.viewer.playback import Player, load
from plumbob.viewer.rows import Attitudes, RowLayout, shown_estimator
from plumbob.viewer.switch import Switch, TaughtJoints
from tests.helpers import Clock, live_samples, until
from tests.helpers.outlets import Kept

PLAIN = live_samples.SESSION.partition("[estimate]")[0]


def text_of(estimate):
    return f"{PLAIN}[estimate]\n{estimate}"


@functools.cache
def shown(estimate='filter = "mekf"', also=()):
    """What a feed shows of a stream, and the parts that it gave."""
    stream = Stream(live_samples.session(text_of(estimate) if estimate else PLAIN), covariance=True)
    outlet, found = Kept(), Collected()
    feed = Feed(stream, outlet, also=also)
    source = live_samples.Handed(live_samples.reads(live_samples.stream(10.0)))
    run_stream(stream, source, sinks=[found, feed], each=feed.tick)
    assert not feed.failed, feed.failed
    return outlet, found


@pytest.mark.parametrize("name", ["mekf", "vqf", "mahony"])
def test_angles_bias_and_sd_are_those_of_an_estimate_also_beside_another(name):
    outlet, found = shown(also=("mahony", "vqf", "smoother"))
    assert [one.name for one in outlet.hellos[-1].estimators] == ["mekf", "mahony", "vqf", "smoother"]
    assert np.isfinite(outlet.column("smoother.roll")).all()
    imu = found.imu(calibrated=True)
    track = plumbob.estimate(imu, name, frame="NED").track
    assert len(outlet.rows("t")) == len(imu) == 2000
    yaw, pitch, roll = to_deg(track.euler_zyx).T
    for angle, true in (("roll", roll), ("pitch", pitch), ("yaw", yaw)):
        np.testing.assert_array_equal(outlet.column(f"{name}.{angle}"), true)
    np.testing.assert_allclose(outlet.column(f"{name}.bias.x"), np.degrees(track.bias_b[:, 0]), rtol=1e-15)
    if track.cov_b is not None:  # at this small tilt that of the yaw is that of the heading, to first order
        from plumbob.rotations.frames import claimed_sd

        heading = np.degrees(claimed_sd(track.q_nb, track.cov_b)[1])
        np.testing.assert_allclose(outlet.column(f"{name}.sd.yaw")[100:], heading[100:], rtol=0.05)


def test_sensors_and_raw_counts_are_those_of_the_samples_in_the_units_that_are_shown():
    outlet, found = shown(also=("mahony", "vqf", "smoother"))
    imu, sensed = found.imu(calibrated=True), found.imu(calibrated=False)
    np.testing.assert_allclose(outlet.column("gyr.y"), np.degrees(imu.gyr[:, 1]), rtol=1e-15)
    np.testing.assert_array_equal(outlet.column("acc.z"), imu.acc[:, 2])
    np.testing.assert_array_equal(outlet.column("mag.x"), imu.mag[:, 0])
    np.testing.assert_array_equal(outlet.column("temp"), imu.temp_c)
    np.testing.assert_allclose(outlet.column("acc.excess"), np.linalg.norm(imu.acc, axis=1) - G0, atol=1e-12)
    np.testing.assert_array_equal(outlet.rows("sensed")[:, 3:6], sensed.acc)
    np.testing.assert_array_equal(outlet.rows("flags") & 0x1FF, imu.flags & 0x1FF)
    assert {column.key: column.unit for column in outlet.hellos[-1].columns}["gyr.x"] == "°/s"

    names = [column.key for column in outlet.hellos[-1].raw]
    raw = dict(zip(names, outlet.fields["raw"], strict=True))
    assert raw["counter"] == 1999  # one for each frame, from 0
    imu = live_samples.motion().imu
    assert raw["acc.z"] == round(imu.acc[-1, 2] / 9.80665 * 8192)  # 8192 counts are 1 g in this format
    assert raw["temp_c"] == round(100.0 * imu.temp_c[-1])


def test_with_a_lag_rows_wait_and_agree_with_their_attitude_and_without_a_filter_the_sensors_are_shown():
    outlet, found = shown('filter = "smoother"\nparams = { lag = "2 s" }')
    track, imu = found.track(), found.imu(calibrated=True)
    np.testing.assert_array_equal(outlet.rows("t"), imu.t)
    np.testing.assert_array_equal(track.t, imu.t)
    np.testing.assert_array_equal(outlet.column("gyr.x"), to_dps(imu.gyr[:, 0]))
    np.testing.assert_array_equal(outlet.column("smoother.roll"), to_deg(track.euler_zyx[:, 2]))
    outlet, _ = shown(None)
    assert (outlet.hellos[-1].frame, outlet.hellos[-1].estimators) == ("NED", [])
    assert len(outlet.column("gyr.x")) == 2000


def test_with_a_lag_nothing_is_shown_before_its_attitude_is_there():
    stream = Stream(live_samples.session(text_of('filter = "smoother"\nparams = { lag = "2 s" }')))
    outlet, clock, known = Kept(), Clock(), -1.0
    feed = Feed(stream, outlet, clock=clock)
    for item in live_samples.reads(live_samples.stream(10.0)):
        part = stream.feed(item)
        if part is not None:
            clock.on(1.0)  # so that something is due each time
            feed.on_part(part)
            known = known if part.track is None else part.track.t[-1]
            last = outlet.rows("t")[-1] if outlet.batches and len(outlet.rows("t")) else -1.0
            assert last <= known
            assert part.imu.t[-1] - last < 3.1  # a stretch of half the lag may wait for its end
    assert known > 6.0
    assert np.isfinite(outlet.column("smoother.roll")).all()
    assert not feed.failed
    stream.finish()


def test_an_added_estimator_goes_on_from_the_attitude_now_and_a_removed_one_is_gone():
    stream = Stream(live_samples.session(text_of('filter = "mekf"')), covariance=True)
    outlet, clock = Kept(), Clock()
    feed = Feed(stream, outlet, clock=clock)
    items = live_samples.reads(live_samples.stream(10.0))

    def take(some):
        for item in some:
            part = stream.feed(item)
            if part is not None:
                clock.on(1.0)
                feed.on_part(part)

    def runs():
        clock.on(1.0)
        feed.tick()
        return "mahony" in feed.overlays

    take(items[: len(items) // 2])
    for call, name, says in (
        (feed.add, "mekf", "is already running"),
        (feed.add, "nothing", "there is no estimator"),
        (feed.remove, "mahony", "was not added"),
    ):
        with pytest.raises(ParameterError, match=says):
            call(name)
    feed.add("mahony")
    until(runs, "it was not added")
    before = len(outlet.rows("t"))
    take(items[len(items) // 2 : -50])
    apart = (outlet.column("mahony.yaw") - outlet.column("mekf.yaw"))[before + 1 :]
    assert abs(apart[0]) < 0.2  # one sample of 5 ms at rates of some 10 °/s
    feed.remove("mahony")
    take(items[-50:])
    assert not runs()
    assert not any("mahony" in column.key for column in outlet.hellos[-1].columns)
    assert not feed.failed


def test_residuals_are_the_angles_that_were_planted():
    """A unit that is level and points to magnetic North, seen by an estimate that is off by 5° and 7°."""
    acc, mag = np.array([[0.0, 0.0, -G0]]), np.array([[20.0, 0.0, 40.0]])
    imu = plumbob.ImuData(t=[0.0], acc=acc, mag=mag)
    layout = RowLayout(("acc", "mag"), False, (shown_estimator("a", "mahony", "a", primary=True),))
    keys = [column.key for column in layout.columns]

    def residual(key, yaw, roll, north=North.MAGNETIC, declination=None):
        q = quat_from_euler_zyx(np.radians([[yaw, 0.0, roll]]))
        values = layout.values(imu, 1, {"a": Attitudes(q, Frame.NED, north, declination)}, None)
        return values[0, keys.index(f"a.{key}")]

    assert residual("force_angle", 0.0, 5.0) == pytest.approx(5.0)
    assert residual("field_angle", 7.0, 0.0) == pytest.approx(7.0)
    # a heading that is true by 3° of declination says 3° where the field points to magnetic North
    assert residual("field_angle", 3.0, 0.0, North.TRUE, np.radians(3.0)) == pytest.approx(0.0, abs=1e-12)
    assert np.isnan(residual("field_angle", 3.0, 0.0, North.FREE))


@pytest.mark.parametrize(("declination", "quantity", "label"), [("0 deg", "total", "error"),
                                                                 (None, "inclination", "inclination")])  # fmt: skip
def test_the_error_is_that_of_an_evaluation(declination, quantity, label):
    """Of the inclination alone, where the estimate's heading is magnetic and the truth's is true."""
    told = f'declination = "{declination}"\n' if declination else ""
    stream = Stream(live_samples.session(f'{PLAIN}{told}[estimate]\nfilter = "mahony"'), covariance=True)
    truth, outlet, found = live_samples.motion().truth, Kept(), Collected()
    feed = Feed(stream, outlet, truth=truth)
    source = live_samples.Handed(live_samples.reads(live_samples.stream(10.0)))
    run_stream(stream, source, sinks=[found, feed], each=feed.tick)
    errors = plumbob.evaluate(found.track(), truth, declination="0 deg").errors[quantity]
    known = np.isfinite(errors)
    assert known.sum() > 500
    # the stream's times are those that the reads told, some µs off those of the truth
    np.testing.assert_allclose(outlet.column("mahony.error")[known], np.degrees(errors)[known], atol=1e-6)
    assert outlet.hellos[-1].estimators[-1].name == "reference"
    assert next(one.label for one in outlet.hellos[-1].columns if one.key == "mahony.error") == label
    assert outlet.fields["attitudes"]["mahony"]["error"] == pytest.approx(outlet.column("mahony.error")[-1])


def test_flags_that_rise_and_fall_are_events_and_angles_are_roll_pitch_yaw_in_degrees():
    watch, t = FlagWatch(), np.arange(0.0, 1.0, 0.1)
    word = np.full(10, plumbob.flags.GYR_CLIPPED, dtype=np.uint32)
    assert [text.partition(":")[0] for _, text in watch.changes(t, word)] == ["gyr-clipped"]
    assert not list(watch.changes(t + 1.0, word))
    assert not list(watch.changes(t + 2.0, 0 * word))  # not before it has been away for 2 s
    assert list(watch.changes(t + 4.0, 0 * word)) == [(pytest.approx(1.9), "gyr-clipped has ended")]
    slow = np.where(np.arange(10) % 4, plumbob.flags.MAG_ABSENT, 0).astype(np.uint32)
    assert not watch.shown(t, slow).any()  # a field at a quarter of the rate is there; after 1 s it is absent
    assert watch.shown(t + 1.0, slow | plumbob.flags.MAG_ABSENT).astype(bool).tolist() == [False] * 8 + [True] * 2
    np.testing.assert_allclose(euler_deg(quat_from_euler_zyx([[-1.0, 0.2, 0.3]])), np.degrees([[0.3, 0.2, -1.0]]))


class Broken(Kept):
    def batch(self, batch):
        raise RuntimeError("planted")


def test_a_fault_of_the_view_ends_the_view_and_not_the_recording(tmp_path):
    session = live_samples.session(text_of('filter = "mekf"'))
    stream, outlet, notes = Stream(session, covariance=True), Broken(), []
    feed, found = Feed(stream, outlet, note=notes.append), Collected()
    sink = RecordingSink(session, RecordSpec(str(tmp_path / "a.mcap")))
    source = live_samples.Handed(live_samples.reads(live_samples.stream(5.0)))
    run_stream(stream, source, sinks=[feed, found], recording=sink, each=feed.tick)
    assert sink.recorder.acknowledged == sink.recorder.written > 0
    assert len(found.imu(calibrated=True)) == 1000
    assert notes == [feed.failed]
    assert "planted" in feed.failed
    assert [kind for _, kind, _ in outlet.events if kind != "flag"] == ["view"]


def test_a_chain_is_shown_and_taught_where_a_button_of_the_device_says_so(tmp_path):
    """The counter of the frames stands in for the button: it is 0 in the first one alone."""
    plan, chain = PLANS["teach"], PLANS["teach"].scenario.chain
    data = make_rig(plan, find_format("teach"), seed=1, duration=6.0, unit="calibrated").frames.tobytes()
    items = [Received(5_000_000_000 + at * 10_000_000 // 130, data[at : at + 390]) for at in range(0, len(data), 390)]
    text, outlet = live_samples.CHAIN + 'button = "counter"\n', Kept()
    stream = Stream(parse_session(text, lambda _: chain_text(chain), name="teach"))
    feed, switch, joints = Feed(stream, outlet), Switch(stream, tmp_path), TaughtJoints()
    run_stream(stream, live_samples.Handed(items), sinks=[feed, joints], recording=switch, each=feed.tick)
    assert not feed.failed, feed.failed
    (facts,) = switch.recordings
    assert plumbob.replay(facts["path"], check=True).comparison.equal
    live, program = joints.track(), Program.load(Path(facts["path"]).with_suffix(".csv"))
    np.testing.assert_allclose(program.angles[-1], JointTrack.load(facts["path"]).angles[-1], atol=np.radians(1.0))
    played, taken = Kept(), JointTrack.load(facts["path"])
    Player(load(Path(facts["path"])), played).seek(3.0)
    np.testing.assert_array_equal(played.column("joint.j2"), to_deg(taken.angles[: len(played.rows("t")), 1]))
    shown_angles, t = outlet.column("joint.j2"), outlet.rows("t")
    at = np.searchsorted(live.t, t - 0.2, "right") - 1
    assert (at >= 0).sum() > 400
    np.testing.assert_array_equal(shown_angles[at >= 0][-200:], to_deg(live.angles[at[at >= 0], 1])[-200:])
    points = dict(zip(outlet.hellos[-1].skeleton.points, outlet.fields["points"], strict=True))
    hand = chain.hand_at(chain.postures(live.angles[-1:]))[0] * [1.0, -1.0, -1.0]  # the page's axes are NED
    np.testing.assert_allclose(points["hand"], hand, atol=0.02)


def test_samples_sent_twice_have_no_attitude():
    from plumbob.viewer.overlays import Overlay

    imu = plumbob.simulate("buoy", duration=0.05, seed=1, frame="NED", sensors="ideal", unit="calibrated").imu
    overlay = Overlay("smoother", Frame.NED, imu.meta)
    assert np.isfinite(overlay.take(imu).q_nb).all()
    found = overlay.take(imu)
    assert found.frame is Frame.NED and np.isnan(found.q_nb).all() and len(found.q_nb) == len(imu)
