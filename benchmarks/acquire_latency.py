"""A serial line under load: what is lost, how late bytes are, how often the reader wakes, what it costs.

A child process writes frames of 40 bytes to a pseudo-terminal, on deadlines that do not drift, each with its number and
the monotonic time right before it was written. This process reads them with `SerialSource`. The latency of a frame is
from that time to the stamp of the read that ended it; it holds the scheduler, and no UART.

    python -m benchmarks.acquire_latency [--seconds 20] [--rate 1000] [--gather-ms 2] [--json]
"""

import argparse
import json
import os
import resource
import struct
import subprocess
import sys
import tempfile
import time
import tty
from pathlib import Path

from plumbob.live.transports.serial_line import SerialSource
from plumbob.live.transports.transport import Received

FRAME = struct.Struct("<qq24x")
WRITER = """
import os, struct, sys, time
fd, rate, count = int(sys.argv[1]), float(sys.argv[2]), int(sys.argv[3])
frame, start = struct.Struct("<qq24x"), time.monotonic_ns() + 100_000_000
for i in range(count):
    left = start + round(i * 1e9 / rate) - time.monotonic_ns()
    if left > 0:
        time.sleep(left / 1e9)
    os.write(fd, frame.pack(i, time.monotonic_ns()))
"""


def measure(rate: float, seconds: float, gather: float) -> dict[str, float]:
    count = round(rate * seconds)
    master, slave = os.openpty()
    tty.setraw(slave)
    with tempfile.TemporaryDirectory() as folder:
        link = Path(folder) / "tty"
        link.symlink_to(os.ttyname(slave))
        with SerialSource(str(link), 115200, gather=gather) as source:
            source.read(0)
            child = subprocess.Popen(
                [sys.executable, "-c", WRITER, str(master), str(rate), str(count)], pass_fds=[master]
            )
            found = collect(source, count)
            child.wait()
    os.close(master)
    os.close(slave)
    return found


def collect(source: SerialSource, count: int) -> dict[str, float]:
    latencies, rest, reads, events = [], b"", 0, 0
    start = None
    until = time.monotonic() + 5.0
    while len(latencies) < count and time.monotonic() < until:
        for item in source.read(0.5):
            if not isinstance(item, Received):
                events += 1
                continue
            if start is None:
                start = time.monotonic(), resource.getrusage(resource.RUSAGE_SELF)
            until = time.monotonic() + 5.0
            reads += 1
            rest += item.data
            whole = len(rest) - len(rest) % FRAME.size
            latencies += [item.t_ns - sent for _, sent in FRAME.iter_unpack(rest[:whole])]
            rest = rest[whole:]
    assert start is not None, "nothing has come"
    return figures(latencies, count, reads, events, start)


def figures(latencies: list[int], count: int, reads: int, events: int, start: tuple) -> dict[str, float]:
    (then, before), now, after = start, time.monotonic(), resource.getrusage(resource.RUSAGE_SELF)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    ordered = sorted(latencies)
    return {
        "frames": count,
        "lost": count - len(latencies),
        "events": events,
        "reads_per_s": reads / (now - then),
        "wakes_per_s": (after.ru_nvcsw - before.ru_nvcsw) / (now - then),
        "cpu_percent": 100.0 * cpu / (now - then),
        "p50_ms": ordered[len(ordered) // 2] / 1e6,
        "p99_ms": ordered[len(ordered) * 99 // 100] / 1e6,
        "worst_ms": ordered[-1] / 1e6,
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--rate", type=float, default=1000.0, help="frames per second (default 1000)")
    parser.add_argument("--gather-ms", type=float, default=2.0, help="least time between reads (default 2)")
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    found = measure(args.rate, args.seconds, args.gather_ms / 1e3)
    if args.json:
        print(json.dumps(found, indent=2))
    else:
        load = f"{args.rate:g} frames of {FRAME.size} bytes per second for {args.seconds:g} s"
        print(f"{load}, gather {args.gather_ms:g} ms")
        print("".join(f"{key.replace('_per_s', '/s').replace('_', ' '):>13}" for key in found))
        print("".join(f"{value:>13.4g}" for value in found.values()))
    return 0 if found["lost"] == 0 else 1


if __name__ == "__main__":
    sys.exit(main())
