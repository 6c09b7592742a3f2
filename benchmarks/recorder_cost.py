"""What a recording costs: processor time, bytes, and the longest wait of the caller.

Rows as a live line gives them, 1000 small JSON messages of about 250 bytes and 200 raw messages of 40 bytes a second,
are written in real time, so that fsync, threads and the pace of chunks are those of a real recording. Processor time is
that of the whole process, less that of the same loop without a recorder.

    python -m benchmarks.recorder_cost [--seconds 20] [--folder .] [--json]
"""

import argparse
import json
import random
import sys
import tempfile
import time
from pathlib import Path

from plumbob.files.mcap import Recorder, Schema, verify

LIMIT = 4.0
"""Largest share of a core, %."""
RATE, RAW_EVERY = 1000, 5


def rows(count: int) -> list[bytes]:
    """JSON messages of numbers that hardly compress, as noise does."""
    rng = random.Random(1)
    names = ("gyr_x", "gyr_y", "gyr_z", "acc_x", "acc_y", "acc_z", "mag_x", "mag_y", "mag_z", "temp_c")
    return [json.dumps({name: rng.gauss(0, 1) for name in names}).encode()[:250] for _ in range(count)]


def run(recorder: Recorder | None, messages: list[bytes], seconds: float) -> tuple[float, float]:
    """Processor time of the process and longest time of a call, s."""
    numbers = (1, 2) if recorder is None else declare(recorder)
    raw = random.Random(2).randbytes(40)
    worst, start, spent = 0.0, time.monotonic_ns(), time.process_time()
    for i in range(round(seconds * RATE)):
        t_ns = start + i * (1_000_000_000 // RATE)
        if (wait := t_ns - time.monotonic_ns()) > 0:
            time.sleep(wait / 1e9)
        if recorder is None:
            continue
        before = time.perf_counter()
        recorder.write(numbers[0], t_ns, messages[i % len(messages)])
        if i % RAW_EVERY == 0:
            recorder.write(numbers[1], t_ns, raw)
        recorder.tick(t_ns)
        worst = max(worst, time.perf_counter() - before)
    return time.process_time() - spent, worst


def declare(recorder: Recorder) -> tuple[int, int]:
    schema = Schema("Sample", "jsonschema", json.dumps({"type": "object", "properties": {}}).encode())
    return recorder.channel("imu", "json", schema), recorder.channel("raw/imu", "application/octet-stream")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=20.0, help="of recording (default 20)")
    parser.add_argument("--folder", type=Path, help="where to record (default: the folder for temporary files)")
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    messages = rows(2000)
    idle, _ = run(None, messages, args.seconds)
    with tempfile.TemporaryDirectory(dir=args.folder) as folder:
        path = Path(folder) / "cost.mcap"
        with Recorder(path, epoch_offset_ns=0, reserve=0) as recorder:
            busy, worst = run(recorder, messages, args.seconds)
        size, verdict = path.stat().st_size, verify(path)
    found = {
        "seconds": args.seconds,
        "rows": recorder.written,
        "whole": verdict.whole and sum(verdict.rows.values()) == recorder.written,
        "core_percent": 100.0 * (busy - idle) / args.seconds,
        "idle_percent": 100.0 * idle / args.seconds,
        "longest_call_ms": 1e3 * worst,
        "bytes_per_second": size / args.seconds,
        "met": 100.0 * (busy - idle) / args.seconds <= LIMIT,
    }
    if args.json:
        print(json.dumps(found, indent=2))
    else:
        print(f"{found['rows']} rows in {args.seconds:g} s, read back whole: {found['whole']}")
        cost, idle_percent = found["core_percent"], found["idle_percent"]
        print(f"processor     {cost:.2f} % of a core (limit {LIMIT:g} %), beside {idle_percent:.2f} % for the loop")
        print(f"longest call  {found['longest_call_ms']:.3f} ms")
        print(f"file          {found['bytes_per_second'] / 1e3:.1f} kB/s")
    return 0 if found["met"] and found["whole"] else 1


if __name__ == "__main__":
    sys.exit(main())
