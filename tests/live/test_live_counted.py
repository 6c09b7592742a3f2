"""Lines whose time is counted from their frames alone: a host that stalls, at any speed, changes no bit."""

import numpy as np
import pytest

from plumbob.core import flags
from plumbob.core.errors import DecodeError, ParameterError
from plumbob.core.event import Event
from plumbob.live.transports.transport import Received
from tests.helpers import live_samples
from tests.helpers.live_samples import FORMAT, SESSION, motion, reads, session, stream

SERIAL = '[source]\nkind = "serial"\nport = "/dev/null"\nbaud = 115200\nspeed = 60\n'
COUNTED = SESSION + SERIAL + 'time = "count"\n'
BARE = FORMAT.replace('role = "counter"', 'role = "status"').replace('role = "clock"\nunit = "us"', 'role = "status"')
"""The same frame with nothing that its line could tell time by."""


def through(items, text=COUNTED, form=FORMAT):
    return live_samples.through(items, session(text, **{"imu9.toml": form}))


def stalling(data, seed):
    """Reads of any length at any time: a host that stalls for seconds of sixty each, and a line that bursts."""
    rng = np.random.default_rng(seed)
    items, at, t_ns = [], 0, 7_000_000_000
    while at < len(data):
        end = at + int(rng.choice([1, 29, 150, 4096, 9000]))
        t_ns += int(rng.choice([0, 10**6, 10**8, 10**10, 10**11]))
        items.append(Received(t_ns, data[at:end]))
        at = end
    return items


@pytest.mark.parametrize("form", [FORMAT, BARE], ids=["clock and counter", "neither"])
def test_no_stall_of_the_host_changes_a_bit(form):
    quiet, stalled = (through(items, form=form) for items in (reads(stream()), stalling(stream(), 0)))
    truth = motion().imu
    for line, found in (quiet, stalled):
        assert found.t_ns.size == len(truth)
        np.testing.assert_array_equal(found.t_ns - found.t_ns[0], truth.t_ns)  # 5 ms are whole microseconds
        assert not (found.imu(calibrated=False).flags & np.uint32(flags.GAP | flags.TIME_FAULT)).any()
        assert (line.report()["time"]["mode"], line.time.report().inferred) == ("count", 0)
    np.testing.assert_array_equal(stalled[1].track().q_nb, quiet[1].track().q_nb)


def test_by_the_host_the_same_stalls_are_seconds_of_sea():
    """What counting is for: the same reads, led to the host, are minutes instead of ten seconds."""
    line, found = through(stalling(stream(), 0), text=SESSION + SERIAL, form=BARE)
    assert line.time.report().inferred > 0
    assert found.t_ns[-1] - found.t_ns[0] > 60e9


@pytest.mark.parametrize("form", [FORMAT, BARE], ids=["clock and counter", "neither"])
def test_damaged_frames_keep_their_time(form):
    data = bytearray(stream())
    for k in (300, 301, 700):
        data[30 * k + 12] ^= 1
    line, found = through(stalling(bytes(data), 1), form=form)
    np.testing.assert_array_equal(found.t_ns - found.t_ns[0], np.delete(motion().imu.t_ns, [300, 301, 700]))
    assert np.flatnonzero(found.imu(calibrated=False).flags & np.uint32(flags.GAP)).tolist() == [300, 698]
    assert (line.time.report().lost, line.time.report().inferred) == (3, 0)


@pytest.mark.parametrize("kind", ["dropped", "lost"])
def test_what_the_line_itself_lost_is_a_gap(kind):
    """Bytes are gone, and nothing in the frames says how long that was."""
    items = [Received(10**9, stream()[:3000]), Event(10**9, kind, "gone"), Received(2 * 10**9, stream()[6000:9000])]
    items[2:2] = [Event(10**9, "reopened", "back")] if kind == "lost" else []
    _, found = through(items, form=BARE)
    assert np.flatnonzero(found.imu(calibrated=False).flags & np.uint32(flags.GAP)).tolist() == [100]
    assert (np.diff(found.t_ns) > 0).all()


def test_a_rate_may_stand_beside_the_port_and_datagrams_cannot_be_counted():
    bare = BARE.replace('rate = "200 Hz"\n', "")
    _, found = through(reads(stream()), text=COUNTED + 'rate = "200 Hz"\n', form=bare)
    np.testing.assert_array_equal(found.t_ns - found.t_ns[0], motion().imu.t_ns)
    with pytest.raises(ParameterError, match=r"neither a clock nor a rate to count time by; give source\.rate"):
        session(COUNTED, **{"imu9.toml": bare})
    with pytest.raises(DecodeError, match="no key 'time'"):
        session(SESSION + '[source]\nkind = "udp"\nport = 4000\ntime = "count"\n')
