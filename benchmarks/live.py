"""A unit of nine axes at 1 kHz on a pseudo-terminal, through the whole line with its recorder: loss, load, latency.

A second process writes each frame when it is due and puts its monotonic time into it; this one records, decodes,
estimates with mekf, and takes the age of every sample at the moment its attitude is there. Afterwards the recording is
replayed and compared with what was live.

    python -m benchmarks.live --duration 600
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
import tty
from pathlib import Path

import numpy as np

from plumbob.live.sinks import Sink

RATE = 1000
FORMAT = """
kind = "plumbob format"
version = 1
name = "imu9"
title = "made-up unit with nine axes"
byte_order = "little"

[frame]
sync = "A5 5A"
length = 28
rate = "1000 Hz"
checksum = { kind = "crc16-ccitt-false", at = -2, from = 2 }

[[field]]
name = "counter"
type = "u16"
role = "counter"

[[field]]
name = "clock"
type = "u32"
role = "clock"
unit = "us"

[[field]]
name = "gyr"
axes = "xyz"
type = "s16"
counts = 65.5
unit = "deg/s"

[[field]]
name = "acc"
axes = "xyz"
type = "s16"
counts = 8192
unit = "g"

[[field]]
name = "mag"
axes = "xyz"
type = "s16"
counts = 10
unit = "uT"
"""
SESSION = """
kind = "plumbob session"
version = 1
[source]
kind = "serial"
port = "{port}"
baud = 921600
[format]
file = "imu9.toml"
[imu]
frame = "NED"
[estimate]
filter = "mekf"
"""


def emit(seconds: float) -> None:
    """Be the unit: print the port, wait for a word, and write each frame when it is due."""
    from plumbob import Frame, simulate
    from plumbob.protocols.decode import values_by_field
    from plumbob.protocols.encode import encode
    from plumbob.protocols.format_toml import parse_format

    form = parse_format(FORMAT)
    made = simulate("buoy", frame=Frame.NED, sensors="mpu6000+hmc5983", unit="calibrated", seed=1, rate=RATE,
                    duration=30.0, mag_rate=RATE)  # fmt: skip
    count = round(seconds * RATE)
    there_and_back = {k: np.concatenate([v, v[::-1]]) for k, v in values_by_field(made.imu, form.message()).items()}
    master, slave = os.openpty()
    tty.setraw(slave)
    print(os.ttyname(slave), flush=True)
    sys.stdin.readline()
    start = time.monotonic_ns() + 100_000_000
    due = start + np.arange(count) * (1_000_000_000 // RATE)
    columns = {name: np.resize(values, count) for name, values in there_and_back.items()}
    data = encode(form, {**columns, "clock": due // 1000 % 2**32}).tobytes()
    size, at = form.framing.length, 0
    while at < count:
        end = min(count, int(np.searchsorted(due, time.monotonic_ns(), side="right")))
        if end > at:
            os.write(master, data[at * size : end * size])
            at = end
        else:
            time.sleep(max(0.0, (due[at] - time.monotonic_ns()) / 1e9))
    sys.stdin.readline()


class Ages(Sink):
    """Sink: age of every sample when its attitude is there, µs."""

    def __init__(self) -> None:
        self.ages: list[np.ndarray] = []

    def on_part(self, part) -> None:
        now = time.monotonic_ns() // 1000
        self.ages.append((now - part.frames.columns["clock"]) % 2**32)

    def on_event(self, event) -> None:
        print(f"event        {event.kind}: {event.text}", flush=True)


def run(seconds: float, folder: Path) -> int:
    """Measure, and print."""
    from plumbob.live.replay import open_recording, replay
    from plumbob.live.runner import run_stream
    from plumbob.live.session import RecordSpec
    from plumbob.live.session_toml import parse_session
    from plumbob.live.sinks import RecordingSink
    from plumbob.live.sources import open_source
    from plumbob.live.stream import Stream

    me = [sys.executable, __file__, "--emit", "--duration", str(seconds)]
    with subprocess.Popen(me, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as unit:
        port = unit.stdout.readline().strip()
        session = parse_session(SESSION.format(port=port), {"imu9.toml": FORMAT}.__getitem__, name="live")
        line, ages = Stream(session), Ages()
        recording_sink = RecordingSink(session, RecordSpec(str(folder / "live.mcap")))
        source = open_source(session.source)
        unit.stdin.write("go\n")
        unit.stdin.flush()
        cpu, wall = time.process_time(), time.monotonic()
        run_stream(line, source, sinks=[ages], recording=recording_sink, duration=seconds + 0.6)
        cpu, wall = time.process_time() - cpu, time.monotonic() - wall
        unit.stdin.write("end\n")
        unit.stdin.flush()
    age = np.concatenate(ages.ages) / 1000.0
    expected, told = round(seconds * RATE), line.report()
    quantiles = ", ".join(f"p{q:g} {np.percentile(age, q):.2f}" for q in (50, 90, 99, 99.9))
    print(f"samples      {age.size} of {expected}, lost {expected - age.size}, junk bytes {told['bytes']['junk']}")
    parts = len(ages.ages) / wall
    print(f"load         {100.0 * cpu / wall:.1f} % of one core over {wall:.0f} s, in {parts:.0f} parts a second")
    print(f"latency      sample to attitude, ms: {quantiles}, largest {age.max():.1f}")
    print(f"recorder     {recording_sink.recorder.acknowledged} of {recording_sink.recorder.written} rows on disk, "
          f"{(folder / 'live.mcap').stat().st_size / age.size:.0f} bytes per sample")  # fmt: skip
    print(f"memory       at most {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MiB")
    log, again = open_recording(folder / "live.mcap")
    result = replay(log, session=again, check=True).comparison
    print(f"replay       {result.compared} attitudes compared, {result.different} different to the bit")
    return 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--duration", type=float, default=60.0, help="s (default 60)")
    parser.add_argument("--emit", action="store_true", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.emit:
        emit(args.duration)
        return 0
    with tempfile.TemporaryDirectory() as folder:
        return run(args.duration, Path(folder))


if __name__ == "__main__":
    sys.exit(main())
