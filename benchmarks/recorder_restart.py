"""Kill a recorder again and again, and start it anew by the same words: is every acknowledged row in its parts?

A unit of six axes sends 200 frames a second over TCP, each with its number; nobody keeps what it sends while no
recorder listens. `plumbob record` with `next_part` records it, estimates, and is killed at random moments. A row is
acknowledged once the write of its chunk has returned: the recorder's count is kept in memory that outlives it.
Afterwards all parts are read as one recording.

    python -m benchmarks.recorder_restart [--seconds 600] [--kills 50] [--folder .] [--json]
"""

import argparse
import json
import mmap
import random
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from plumbob.files.mcap import open_log, verify
from plumbob.files.mcap.layout import existing_parts
from plumbob.live.replay import replay
from plumbob.protocols.encode import encode
from plumbob.protocols.format_toml import parse_format

RATE = 200
FORMAT = """
kind = "plumbob format"
version = 1
name = "imu6"
title = "made-up unit of six axes with a frame number"
byte_order = "little"

[frame]
sync = "A5 5A"
length = 20
rate = "200 Hz"
checksum = { kind = "crc16-ccitt-false", at = -2, from = 2 }

[[field]]
name = "counter"
type = "u32"
role = "counter"

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
"""
SESSION = """
kind = "plumbob session"
version = 1
source = {{ kind = "tcp", host = "127.0.0.1", port = {port} }}
format = {{ file = "imu6.toml" }}
imu = {{ frame = "NED" }}
estimate = {{ filter = "mahony" }}
record = {{ path = "unit.mcap", next_part = true, rotate = "1 min", reserve = 0 }}
"""
COUNTERS = struct.Struct("<Q")
# What `plumbob record` runs; beside it, the count of acknowledged rows is kept where it outlives the process.
CHILD = """
import mmap, sys, threading, time
from plumbob.cli.main import main
from plumbob.live import sinks as keep

class Watched(keep.RecordingSink):
    def __init__(self, *args, **options):
        super().__init__(*args, **options)
        threading.Thread(target=self.publish, daemon=True).start()

    def publish(self):
        with open(sys.argv[1], "r+b") as file:
            shared = mmap.mmap(file.fileno(), 8)
        while True:
            shared[:] = self.recorder.acknowledged.to_bytes(8, "little")
            time.sleep(0.001)

keep.RecordingSink = Watched
sys.exit(main(["record", "session.toml"]))
"""


class Unit(threading.Thread):
    """Sends numbered frames when they are due, to whoever listens."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        form, block = parse_format(FORMAT), 1 << 16
        columns = {f"{triad}.{axis}": np.zeros(block) for triad in ("gyr", "acc") for axis in "xyz"}
        columns["acc.z"] -= 9.8
        self._frames = lambda start: encode(form, {**columns, "counter": np.arange(start, start + block)})
        self._server = socket.create_server(("127.0.0.1", 0))
        self._server.setblocking(False)
        self.port = self._server.getsockname()[1]
        self.sent, self._size, self._block = 0, form.framing.length or 0, block

    def run(self) -> None:
        """Send until the process ends."""
        start, client, data = time.monotonic(), None, b""
        while True:
            at = self.sent % self._block
            if at == 0:
                data = self._frames(self.sent).tobytes()
            client = self._listener(client)
            if client is not None:
                client = self._send(client, data[at * self._size : (at + 1) * self._size])
            self.sent += 1
            time.sleep(max(0.0, start + self.sent / RATE - time.monotonic()))

    def _listener(self, client: socket.socket | None) -> socket.socket | None:
        """The latest who came."""
        try:
            found, _ = self._server.accept()
        except BlockingIOError:
            return client
        if client is not None:
            client.close()
        return found

    def _send(self, client: socket.socket, frame: bytes) -> socket.socket | None:
        try:
            client.sendall(frame)
        except OSError:
            client.close()
            return None
        return client


def record_once(folder: Path, until: float, last: bool) -> dict[str, Any]:
    """Start the recorder, and end it at that time, by SIGKILL unless it is the last; what it had said by then."""
    counters = folder / "counters"
    counters.write_bytes(bytes(COUNTERS.size))
    with counters.open("r+b") as file, mmap.mmap(file.fileno(), COUNTERS.size) as shared:
        child = subprocess.Popen(
            [sys.executable, "-c", CHILD, str(counters)], cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
        )
        deadline = time.monotonic() + 120.0
        while COUNTERS.unpack(shared[:])[0] < RATE and time.monotonic() < deadline and child.poll() is None:
            time.sleep(0.001)  # a busy machine may start slowly; what is killed is a recorder that records
        time.sleep(max(0.0, until - time.monotonic()))
        ended_ns = time.monotonic_ns()
        child.send_signal(signal.SIGTERM if last else signal.SIGKILL)
        _, notes = child.communicate()
        return {
            "acknowledged": COUNTERS.unpack(shared[:])[0],
            "ended_ns": ended_ns,
            "code": child.returncode,
            "notes": notes.decode(),
        }


def judge(path: Path, starts: list[dict[str, Any]], sent: int) -> dict[str, Any]:
    """Compare what the parts hold, read as one recording, with what the recorder had said."""
    rows = list(open_log(path))
    in_order = {topic: [row.sequence for row in rows if row.topic == topic] for topic in {row.topic for row in rows}}
    times = [row.t_ns for row in rows if row.topic == "raw"]
    replayed = replay(path, check=True)
    numbers = np.concatenate([part.frames.columns["counter"].astype(np.int64) for part in replayed.found.parts])
    steps = np.diff(numbers)
    ends = [max(t for t in times if t <= start["ended_ns"]) for start in starts]
    verdict = verify(path)
    return {
        "parts": len(existing_parts(path)),
        "starts": open_log(path).starts,
        "rows_acknowledged": sum(start["acknowledged"] for start in starts),
        "rows_read": len(rows),
        "acknowledged_lost": max(0, sum(start["acknowledged"] for start in starts) - len(rows)),
        "rows_out_of_order": sum(found != list(range(len(found))) for found in in_order.values())
        + sum(b < a for a, b in pairwise(times)),
        "frames_sent": sent,
        "frames_read": len(numbers),
        "frames_twice_or_back": int(np.count_nonzero(steps <= 0)),
        "gaps": int(np.count_nonzero(steps > 1)),
        "longest_gap_s": float(steps.max(initial=1)) / RATE,
        "longest_unwritten_ms": max((start["ended_ns"] - end) / 1e6 for start, end in zip(starts, ends, strict=True)),
        "lossy": bool(verdict.lost),
        "replay_equal": replayed.comparison.equal,
        "ended_well": starts[-1]["code"] == 0,
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--folder", type=Path, help="where to record (default: the folder for temporary files)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    rng, unit = random.Random(args.seed), Unit()
    unit.start()
    with tempfile.TemporaryDirectory(dir=args.folder) as name:
        folder = Path(name)
        (folder / "imu6.toml").write_text(FORMAT)
        (folder / "session.toml").write_text(SESSION.format(port=unit.port))
        begun, each = time.monotonic(), args.seconds / (args.kills + 1)
        ends = [begun + each * (i + rng.uniform(0.5, 1.5)) for i in range(args.kills)]
        starts = [record_once(folder, until, last=False) for until in ends]
        starts.append(record_once(folder, begun + args.seconds, last=True))
        seconds = time.monotonic() - begun
        found = {"kills": args.kills, "seconds": seconds, **judge(folder / "unit.mcap", starts, unit.sent)}
    met = (
        found["acknowledged_lost"] == found["rows_out_of_order"] == found["frames_twice_or_back"] == 0
        and found["starts"] == args.kills + 1
        and found["replay_equal"]
        and found["ended_well"]
        and not found["lossy"]
    )
    if args.json:
        print(json.dumps(found | {"met": met}, indent=2))
        return 0 if met else 1
    print(f"{args.kills} kills in {seconds:.0f} s at {RATE} Hz: {found['starts']} starts, {found['parts']} parts")
    print(f"rows acknowledged        {found['rows_acknowledged']}, read {found['rows_read']}")
    print(f"acknowledged rows lost   {found['acknowledged_lost']}")
    print(f"rows out of order        {found['rows_out_of_order']}")
    print(
        f"frames                   {found['frames_read']} of {found['frames_sent']} sent; the rest while none listened"
    )
    print(f"frames twice or back     {found['frames_twice_or_back']}")
    print(f"gaps                     {found['gaps']}, the longest {found['longest_gap_s']:.2f} s")
    print(f"longest unwritten        {found['longest_unwritten_ms']:.1f} ms before a kill")
    print(f"replay of all parts      {'EQUAL to the bit' if found['replay_equal'] else 'NOT equal'} to what was live")
    if not met:
        print("\n".join(start["notes"] for start in starts), file=sys.stderr)
    return 0 if met else 1


if __name__ == "__main__":
    sys.exit(main())
