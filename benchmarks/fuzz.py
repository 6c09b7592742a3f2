"""Mutate files of every format that is read, and look how the command line ends.

Flipped bits, cuts, pieces moved, repeated, zeroed, huge numbers, and in texts other words, values, lines and brackets;
and files whose content is wrong though their checksums hold. Each case must end with exit code 0, 1 or 3, without a
traceback, in 10 s of one core, and with at most 300 MiB above what imports and whole files take. Those that do not are
kept.

    python -m benchmarks.fuzz [--cases 5000] [--only parquet,mcap] [--seed 1] [--out bench-out/fuzz] [--json]
"""

import argparse
import json
import os
import queue
import resource
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from random import Random
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "benchmarks")]

GOOD = (0, 1, 3)
SECONDS = 10.0
MEBIBYTES = 300
STALL = 120.0
"""Time without a word after which a worker is given up, s."""
ADDRESSES = 6 << 30
"""Address space that a worker may take beyond its own, so that a bomb ends the case and not the machine."""


def work(name: str, first: int, count: int, seed: int, folder: Path) -> None:
    """Run cases of one format in this process, and print one line of JSON for each."""
    from benchmarks.fuzz_targets import make
    from tests.helpers.commandline import call

    told = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # whatever libraries print there
    target = make(name, folder)
    os.chdir(folder)
    for path in target.seeds * 2:  # what one case leaves behind must not stop the next
        done = call(*target.words(path))
        assert done.returncode in GOOD[::2], (path, done.stdout, done.stderr)
    base = _resident()
    soft = _address_space() + ADDRESSES
    resource.setrlimit(resource.RLIMIT_AS, (soft, resource.RLIM_INFINITY))
    for case in range(first, first + count):
        path = target.write(Random(f"{seed} {name} {case}"), case)
        print(json.dumps({"begins": case, "file": str(path)}), file=told, flush=True)
        _forget_peak()
        started = time.process_time()
        done = call(*target.words(path))
        found = {
            "case": case,
            "file": str(path),
            "code": done.returncode,
            "seconds": round(time.process_time() - started, 3),
            "mebibytes": max(0, (_peak() - base) >> 20),
            "traceback": "Traceback" in done.stderr,
            "says": done.stderr[-2000:] if done.returncode not in GOOD else "",
        }
        if not held(found):  # the next case takes its place
            found["file"] = str(path.rename(path.with_name(f"bad{case}{path.suffix}")))
        print(json.dumps(found), file=told, flush=True)


def _forget_peak() -> None:
    """Let the largest resident size be that of now; without this file it is that of all cases so far."""
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")


def _peak() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss << 10


def _resident() -> int:
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * resource.getpagesize()


def _address_space() -> int:
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0]) * resource.getpagesize()


def held(found: dict[str, Any]) -> bool:
    """Whether a case ended as it must."""
    within = found["seconds"] <= SECONDS and found["mebibytes"] <= MEBIBYTES
    return found["code"] in GOOD and not found["traceback"] and within


class Tally:
    """How the cases of one format ended."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.ends: dict[str, int] = {}
        self.seconds = 0.0
        self.mebibytes = 0
        self.bad: list[dict[str, Any]] = []

    def take(self, found: dict[str, Any]) -> bool:
        """Count a case, and say whether it is as it must be."""
        code = str(found["code"]) if found["code"] in GOOD else "other"
        self.ends[code] = self.ends.get(code, 0) + 1
        self.seconds = max(self.seconds, found["seconds"])
        self.mebibytes = max(self.mebibytes, found["mebibytes"])
        if not held(found):
            self.bad.append(found)
        return held(found)

    def row(self) -> dict[str, Any]:
        """For the table and for JSON."""
        ends = {end: self.ends.get(end, 0) for end in ("0", "1", "3", "other")}
        worst = {"worst_s": round(self.seconds, 2), "worst_mib": self.mebibytes}
        return {"format": self.name, "cases": sum(ends.values()), **ends, **worst, "bad": len(self.bad)}


def run(name: str, cases: int, seed: int, out: Path) -> Tally:
    """All cases of one format, in as many processes as it takes: one that stalls or dies is followed by another."""
    tally, first = Tally(name), 0
    with tempfile.TemporaryDirectory() as folder:
        while first < cases:
            begun = None
            for said in _said(name, first, cases - first, seed, Path(folder)):
                if "begins" in said:
                    begun = said
                    continue
                begun, first = None, said["case"] + 1
                if not tally.take(said):
                    _keep(said, out / name)
            if begun is None and first < cases:
                raise SystemExit(f"{name}: the worker did not start; see above")
            if begun is not None:
                dead = {"code": "stalled or died", "seconds": 0.0, "mebibytes": 0, "traceback": True, "says": ""}
                said = {"case": begun["begins"], "file": begun["file"], **dead}
                tally.take(said)
                _keep(said, out / name)
                first = said["case"] + 1
    return tally


def _said(name: str, first: int, count: int, seed: int, folder: Path) -> Iterator[dict[str, Any]]:
    """What a worker says, until it ends or has said nothing for too long."""
    words = [sys.executable, "-m", "benchmarks.fuzz", "--worker", name, str(first), str(count), str(seed), str(folder)]
    lines: queue.Queue[str | None] = queue.Queue()
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as child:

        def listen() -> None:
            for line in child.stdout or ():
                lines.put(line)
            lines.put(None)

        threading.Thread(target=listen, daemon=True).start()
        with suppress(queue.Empty):
            while (line := lines.get(timeout=STALL)) is not None:
                yield json.loads(line)
        child.kill()


def _keep(found: dict[str, Any], folder: Path) -> None:
    """Keep a file that did not end well, and what was said."""
    folder.mkdir(parents=True, exist_ok=True)
    path = Path(found["file"])
    with suppress(FileNotFoundError):
        (folder / f"{found['case']}{path.suffix}").write_bytes(path.read_bytes())
    (folder / f"{found['case']}.json").write_text(json.dumps(found, indent=1), encoding="utf-8")


def main() -> int:
    if sys.argv[1:2] == ["--worker"]:
        name, *numbers, folder = sys.argv[2:]
        work(name, *map(int, numbers), Path(folder))
        return 0
    from benchmarks.fuzz_targets import NAMES

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=5000, help="of each format")
    parser.add_argument("--only", metavar="A,B", help=f"of {', '.join(NAMES)}; the beginning of a name is enough")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, default=ROOT / "bench-out" / "fuzz", help="where bad files are kept")
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    wanted = tuple((args.only or "").split(","))
    rows = []
    for name in (name for name in NAMES if name.startswith(wanted)):
        rows.append(run(name, args.cases, args.seed, args.out).row())
        if not args.json:
            if len(rows) == 1:
                print("".join(f"{key:>{26 if key == 'format' else 10}}" for key in rows[0]))
            print("".join(f"{value:>{26 if key == 'format' else 10}}" for key, value in rows[-1].items()), flush=True)
    if args.json:
        print(json.dumps(rows))
    return 1 if any(row["bad"] for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
