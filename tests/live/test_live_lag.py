"""The smoother with a lag on a stream: the attitudes of the recording, seconds later, and none of them is lost."""

from dataclasses import replace

import numpy as np
import pytest

import plumbob
from plumbob import Frame, flags, replay
from plumbob.core.errors import ParameterError
from plumbob.core.event import Event
from plumbob.filters.offline import Stage, run_stage
from plumbob.filters.smoother import FixedLag, Smoother
from plumbob.live.sinks import TextSink
from plumbob.live.stream import STARTED_AGAIN, Stream
from plumbob.live.transports.transport import Received
from tests.helpers.hand_motion import by_hand
from tests.helpers.live_samples import reads, session, stream, through

LAG = {"lag": "0.6 s"}


@pytest.fixture(autouse=True)
def short(monkeypatch):
    """Little of the past is smoothed with each part, so that its border moves through these few seconds."""
    for where in ("live", "samples", "smoothing"):  # live first: what is imported later would keep it
        monkeypatch.setattr(f"plumbob.filters.smoother.{where}.MARGIN", 2.0)


def lagged(**params):
    return replace(session(), stage=Stage("smoother", LAG | params))


def test_attitudes_are_those_of_the_recording_to_the_bit_and_none_is_lost():
    """They come by the lag later, and no more than a part beyond: reads bring up to some tens of samples."""
    line, found = through(reads(stream(4.0)), lagged())
    batch = run_stage(found.imu(calibrated=True), line.session.stage, frame=line.session.frame)
    for name in ("t", "q_nb", "bias_b", "cov_b", "flags"):
        np.testing.assert_array_equal(getattr(found.track(), name), getattr(batch, name))
    assert [part.t_ns.size for part in found.parts][-1] == 0  # the last ones come with the end of the stream
    np.testing.assert_array_equal(np.concatenate([part.track_ns for part in found.parts]), found.t_ns)
    late = [part.imu.t[-1] - part.track.t[0] for part in found.parts[:-1] if part.track is not None]
    assert len(late) > 3 and min(late) > 0.6 and max(late) < 0.8


def test_a_recording_of_it_is_replayed_to_the_bit_and_text_has_the_times_of_its_attitudes(tmp_path):
    chosen = lagged()
    _, live = through(reads(stream(4.0)), chosen, TextSink(tmp_path / "a.txt", 0.1), recording=tmp_path / "a.mcap")
    track, again = live.track(), replay(tmp_path / "a.mcap", session=chosen, check=True)
    assert again.comparison.equal
    assert again.comparison.compared == len(track)
    lines = [line.split("\t") for line in (tmp_path / "a.txt").read_text().splitlines() if line[0].isdigit()]
    for line in lines[:: len(lines) // 5]:
        place = int(np.searchsorted(track.t, float(line[0]) - 1e-6))
        roll = np.degrees(plumbob.rotations.euler_zyx_from_quat(track.q_nb[place]))[0]
        assert float(line[0]) == pytest.approx(track.t[place], abs=1e-6)
        assert float(line[3]) == pytest.approx(roll, abs=1e-4)


def test_what_waits_is_given_before_a_recorder_starts_again_and_where_a_stream_ends_at_once():
    items = reads(stream(4.0))
    half = len(items) // 2
    event = Event(items[half].t_ns, STARTED_AGAIN, "the recorder was away")
    later = [Received(item.t_ns + 10**9, item.data) for item in items[half:]]
    _, found = through([*items[:half], event, *later], lagged())
    track = found.track()
    np.testing.assert_array_equal(np.concatenate([part.track_ns for part in found.parts]), found.t_ns)
    first = int(np.argmax(np.diff(track.t))) + 1
    assert track.flags[first] & flags.GAP
    alone = run_stage(found.imu(calibrated=True)[:first], lagged().stage, frame=Frame.NED)
    np.testing.assert_array_equal(track.q_nb[:first], alone.q_nb)
    _, found = through(reads(stream(4.0))[:1], lagged())
    assert len(found.track()) == len(found.t_ns) > 0
    assert through([], lagged())[1].track() is None
    with pytest.raises(ParameterError, match="cannot wait for the end, but lag is off"):
        Stream(lagged(lag=None))


def test_without_a_lag_attitudes_come_with_their_samples_and_are_replayed_to_the_bit(tmp_path):
    chosen = lagged(lag="0 s")
    _, live = through(reads(stream(4.0)), chosen, recording=tmp_path / "a.mcap")
    for part in live.parts:
        np.testing.assert_array_equal(part.track_ns, part.t_ns)
    _, other = through(reads(stream(4.0), seed=3), chosen)
    np.testing.assert_array_equal(live.track().q_nb, other.track().q_nb)  # however it was read
    assert replay(tmp_path / "a.mcap", session=chosen, check=True).comparison.equal
    batch = run_stage(live.imu(calibrated=True), chosen.stage, frame=chosen.frame)
    np.testing.assert_array_equal(live.track().q_nb, batch.q_nb)


@pytest.mark.parametrize("lag", [0.3, 1.0, 100.0])
def test_it_does_not_matter_how_the_stream_is_cut_nor_where_it_has_gaps(lag):
    h = by_hand(8.0, seed=2)
    imu = h.rows((h.t < 3.0) | (h.t > 4.5)).imu()
    whole = Smoother(frame="ENU", params={"lag": lag}).process(imu)
    for size in (1, 7, 100, 5000):
        lagging, parts = FixedLag(frame="ENU", params={"lag": lag}), []
        for part in imu.chunks(size):
            ready = lagging.take(part)
            parts += [] if ready is None else [ready]
            waits = part.t[-1] - imu.t[min(sum(map(len, parts)), len(imu) - 1)]
            assert waits <= max(lag, 0.0) + 1e-9  # no attitude waits for longer than it must
        parts.append(lagging.finish())
        for name in ("t", "q_nb", "cov_b", "flags"):
            np.testing.assert_array_equal(np.concatenate([getattr(p, name) for p in parts]), getattr(whole, name))
        assert lagging.finish() is None
