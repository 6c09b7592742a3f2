"""Kill a recording process at random instants: which rows are gone?

The child records 2,000 rows a second and keeps its counters in shared memory, which outlive it. A row is acknowledged
once the write of its chunk has returned. What a repair makes of the file is read by the MCAP library, with its checks.

    python -m benchmarks.recorder_kill [--kills 50] [--folder .] [--json]
"""

import argparse
import json
import mmap
import random
import signal
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from plumbob.files.mcap import open_log, repair

COUNTERS = struct.Struct("<QQQ")  # acknowledged, written, time of the last row
LIMIT_MS = 100.0
SLACK_MS = 20.0
"""A chunk is due at 100 ms; packing and writing it, on a machine with other work, comes on top."""

CHILD = """
import mmap, struct, sys, time
from plumbob.files.mcap import Recorder
with open(sys.argv[2], "r+b") as file:
    shared = mmap.mmap(file.fileno(), 24)
r = Recorder(sys.argv[1], epoch_offset_ns=0, reserve=0)
n = r.channel("a", "x")
with r:
    while True:
        t_ns = time.monotonic_ns()
        r.write(n, t_ns, b"%d" % t_ns)
        r.tick(t_ns)
        shared[:] = struct.pack("<QQQ", r.acknowledged, r.written, t_ns)
        time.sleep(0.0005)
"""


def kill_once(folder: Path, after: float) -> dict[str, float]:
    """Start a child, kill it, and compare its file with what it had said."""
    path, counters = folder / "a.mcap", folder / "counters"
    counters.write_bytes(bytes(COUNTERS.size))
    with counters.open("r+b") as file, mmap.mmap(file.fileno(), COUNTERS.size) as shared:
        child = subprocess.Popen([sys.executable, "-c", CHILD, str(path), str(counters)])
        while not COUNTERS.unpack(shared[:])[1]:
            time.sleep(0.001)
        time.sleep(after)
        child.send_signal(signal.SIGKILL)
        child.wait()
        acknowledged, written, last_ns = COUNTERS.unpack(shared[:])
    log = open_log(path)
    rows = list(log)
    wrong = sum(row.data != b"%d" % row.t_ns or row.sequence != i for i, row in enumerate(rows))
    found = {
        "acknowledged": acknowledged,
        "acknowledged_lost": max(0, acknowledged - len(rows)),
        "unacknowledged_ms": (last_ns - rows[-1].t_ns) / 1e6 if rows else (last_ns and LIMIT_MS),
        "written": written,
        "read": len(rows),
        "wrong": wrong,
        "torn": sum(damage.size for damage in log.damage),
        "repaired": repair(path, folder / "b.mcap").lost == {} and by_library(folder / "b.mcap") == len(rows),
    }
    for file in folder.iterdir():
        file.unlink()
    return found


def by_library(path: Path) -> int:
    """Rows that the MCAP library reads, with all its checks; it refuses a file that is not complete."""
    from mcap.reader import NonSeekingReader

    with path.open("rb") as file:
        return sum(1 for _ in NonSeekingReader(file, validate_crcs=True).iter_messages(log_time_order=False))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--folder", type=Path, help="where to record (default: the folder for temporary files)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    rng = random.Random(args.seed)
    with tempfile.TemporaryDirectory(dir=args.folder) as folder:
        all_found = [kill_once(Path(folder), rng.uniform(0.0, 1.5)) for _ in range(args.kills)]
    found = {
        "kills": args.kills,
        "rows_acknowledged": sum(one["acknowledged"] for one in all_found),
        "acknowledged_lost": sum(one["acknowledged_lost"] for one in all_found),
        "wrong_rows": sum(one["wrong"] for one in all_found),
        "longest_unacknowledged_ms": max(one["unacknowledged_ms"] for one in all_found),
        "files_with_a_torn_end": sum(one["torn"] > 0 for one in all_found),
        "repaired": sum(one["repaired"] for one in all_found),
    }
    met = (
        found["acknowledged_lost"] == found["wrong_rows"] == 0
        and found["repaired"] == args.kills
        and found["longest_unacknowledged_ms"] <= LIMIT_MS + SLACK_MS
    )
    if args.json:
        print(json.dumps(found | {"met": met}, indent=2))
    else:
        print(f"{args.kills} kills, {found['rows_acknowledged']} rows acknowledged before them")
        print(f"acknowledged rows lost   {found['acknowledged_lost']}")
        print(f"wrong rows               {found['wrong_rows']}")
        longest = found["longest_unacknowledged_ms"]
        print(f"longest unacknowledged   {longest:.1f} ms (limit {LIMIT_MS:g} + {SLACK_MS:g} ms)")
        print(f"files with a torn end    {found['files_with_a_torn_end']}")
        print(f"repaired and readable    {found['repaired']} of {args.kills}")
    return 0 if met else 1


if __name__ == "__main__":
    sys.exit(main())
