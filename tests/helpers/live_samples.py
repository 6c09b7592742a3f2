"""A made-up unit with nine axes, a motion, its bytes, and sessions for them."""

import functools

import numpy as np

from plumbob import Frame, Stream, simulate
from plumbob.live.runner import run_stream
from plumbob.live.session import RecordSpec
from plumbob.live.session_toml import parse_session
from plumbob.live.sinks import Collected, RecordingSink
from plumbob.live.transports.transport import Received
from plumbob.protocols.decode import values_by_field
from plumbob.protocols.encode import encode
from plumbob.protocols.format_toml import parse_format
from tests.helpers import beside

RATE = 200.0
OFFSET = 1_700_000_000_000_000_000
FORMAT = beside(__file__, "imu9.toml")
SESSION = beside(__file__, "session.toml")
CHAIN = beside(__file__, "chain.toml")


@functools.cache
def motion(duration=10.0):
    return simulate(
        "buoy", frame=Frame.NED, sensors="mpu6000+hmc5983", unit="calibrated", seed=3, rate=RATE, duration=duration,
        mag_rate=RATE,
    )  # fmt: skip


@functools.cache
def form():
    return parse_format(FORMAT)


def stream(duration=10.0):
    """Bytes of the motion, one frame for each sample, with a device clock that starts near its end."""
    made = motion(duration)
    clock = (made.imu.t_ns // 1000 + 2**32 - 3_000_000) % 2**32
    return encode(form(), {**values_by_field(made.imu, form().message()), "clock": clock}).tobytes()


def reads(data, *, seed=0, size=30, period_ns=5_000_000):
    """Items as a line gives them: pieces of 1 to 120 bytes, each at the host's time of its last byte."""
    rng = np.random.default_rng(seed)
    items, at = [], 0
    while at < len(data):
        end = min(len(data), at + int(rng.integers(1, 120)))
        t_ns = 7_000_000_000 + end * period_ns // size + int(rng.exponential(300_000))
        items.append(Received(max(t_ns, items[-1].t_ns if items else 0), data[at:end]))
        at = end
    return items


def joined(parts, name):
    """A column of what was sensed, of all parts."""
    return np.concatenate([getattr(part.sensed, name) for part in parts])


def session(text=SESSION, **files):
    known = {"imu9.toml": FORMAT, **files}
    return parse_session(text, known.__getitem__, name="bench")


class Handed:
    name = "handed"

    def __init__(self, items):
        self._items, self.finished, self.closed = list(items), False, False

    def read(self, timeout):
        ready, self._items = self._items[:16], self._items[16:]
        self.finished = not self._items
        return ready

    def close(self):
        self.closed = True


def through(items, chosen=None, *sinks, source=None, recording=None, offset=OFFSET, **spec):
    """A line of a session, and what it made of items or of a source; `recording` is where all of it is recorded."""
    line, collected, spec = Stream(chosen or session()), Collected(), {"reserve": 0} | spec
    keeper = recording and RecordingSink(line.session, RecordSpec(str(recording), **spec), offset=lambda: offset)
    run_stream(line, source or Handed(items), sinks=[collected, *sinks], recording=keeper)
    return line, collected


def record(path, items, text=SESSION, **spec):
    """Items recorded at `path`, and what the line made of them."""
    return through(items, session(text), recording=path, **spec)[1]
