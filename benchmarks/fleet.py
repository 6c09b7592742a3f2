"""A thousand recordings, one in twenty damaged: processes, a cluster that loses a worker, and what it costs.

``python -m benchmarks.fleet``. The recordings are simulated once: some scenarios and seeds, and copies of them with
noise of their own. Every attitude must have the same bits from this process, from two, and from the workers of a Dask
scheduler, of which one is killed in the middle. How much faster two are than one is measured with these short
recordings and with some of a quarter of an hour, on a machine that does nothing else: processor time says what it would
be where others take their share.
"""

import argparse
import math
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import plumbob
from benchmarks.harness.bar import Bar, bar_lines
from plumbob.files.formats import read
from plumbob.fleet.batch import BatchRun, batch

SCENARIOS = (("buoy", 20.0), ("buoy", 40.0), ("buoy", 60.0), ("static", 30.0), ("coning", 20.0))
MEMORY = 500.0
"""Of a child with recordings of a quarter of an hour, MiB."""


def recordings(folder: Path, count: int) -> dict[str, str]:
    """Write the short recordings, and say which of them are damaged, and how."""
    damaged = {}
    for k, file, rng in copies(folder, count, [(name, t, seed) for name, t in SCENARIOS for seed in (1, 2)]):
        if k % 20 == 7:
            damaged[f"{file.parent.name}/{file.stem}"] = _damage(file, k // 20 % 6, rng)
    return damaged


def copies(
    folder: Path, count: int, scenarios: list[tuple[str, float, int]]
) -> Iterator[tuple[int, Path, np.random.Generator]]:
    """Simulate scenarios, and write copies of them with noise of their own; the number, file and noise of each."""
    how = {"frame": "NED", "sensors": "mpu6000+hmc5983", "unit": "calibrated"}
    base = [plumbob.simulate(name, duration=t, seed=seed, **how) for name, t, seed in scenarios]
    for k in range(count):
        one, rng = base[k % len(base)], np.random.default_rng(k)
        noisy = one.imu.gyr + 1e-4 * rng.standard_normal(one.imu.gyr.shape)
        imu = one.imu.corrected(gyr=noisy, meta=replace(one.imu.meta, device=f"unit {k % 50}"))
        file = folder / f"{k // 100:02d}" / f"r{k:04d}.parquet"
        file.parent.mkdir(exist_ok=True, parents=True)
        plumbob.write(file, plumbob.Recording(imu=imu, track=one.truth))
        yield k, file, rng


def _damage(file: Path, how: int, rng: np.random.Generator) -> str:
    whole = file.read_bytes()
    if how == 0:
        file.write_bytes(whole[: rng.integers(10, len(whole) - 10)])
        return "cut"
    if how == 1:
        at = int(rng.integers(100, len(whole) // 2))
        file.write_bytes(whole[:at] + bytes(255 - b for b in whole[at : at + 8]) + whole[at + 8 :])
        return "flipped"
    if how == 2:
        file.write_bytes(b"")
        return "empty"
    if how == 3:
        file.rename(file.with_suffix(".csv"))
        return "wrong suffix"
    return _table(file, "nan" if how == 4 else "time")


def _table(file: Path, what: str) -> str:
    """The samples as CSV with its profile, one column NaN throughout or one time before the one in front of it."""
    recording = read(file)
    file.unlink()
    table = file.with_suffix(".csv")
    plumbob.write(table, recording.imu)
    lines = table.read_text().splitlines()
    if what == "time":
        lines[-1], lines[-5] = lines[-5], lines[-1]
    else:
        first = next(i for i, line in enumerate(lines) if line.startswith("t ["))
        head = lines[first].split(",")
        places = [i for i, name in enumerate(head) if name.startswith(("gyr", "acc"))]
        rows = [row.split(",") for row in lines[first + 1 :]]
        lines[first + 1 :] = [",".join("nan" if i in places else v for i, v in enumerate(row)) for row in rows]
    table.write_text("\n".join(lines) + "\n")
    return {"nan": "NaN columns", "time": "not increasing"}[what]


def parts(root: Path) -> dict[str, bytes]:
    return {path.parent.name: path.read_bytes() for path in root.glob("attitude/*/part.parquet")}


def timed(folder: Path, out: Path, **how: object) -> tuple[BatchRun, float]:
    began = time.perf_counter()
    done = batch(folder, out, filter="mekf", **how)  # type: ignore[arg-type]
    return done, time.perf_counter() - began


@dataclass
class Compared:
    """One process and two on the same recordings."""

    one: BatchRun
    parts: dict[str, bytes]
    lines: list[str]
    bars: list[Bar]


def compared(folder: Path, root: Path, what: str) -> Compared:
    """Time this process alone and two children, which have the same bits to write, and look at their memory."""
    cpu, peaks = [_cpu()], {}
    one, t1 = timed(folder, root / "one", jobs=1)
    cpu.append(_cpu())
    with sampled(peaks):
        t2 = timed(folder, root / "two", jobs=2)[1]
    cpu.append(_cpu())
    c1, c2 = cpu[1] - cpu[0], cpu[2] - cpu[1]
    expected = parts(root / "one")
    most = max(peaks.values(), default=math.nan) / 1024.0
    lines = [
        f"{what}: one process {t1:.1f} s, two {t2:.1f} s; processor time {c1:.1f} and {c2:.1f} s, which alone would be "
        f"{2.0 * c1 / c2:.2f} times as fast (load average {os.getloadavg()[0]:.1f})",
        f"{what}: peak memory of a child {most:.0f} MiB, of {len(peaks)} of them",
    ]
    bars = [
        Bar(f"{what}: two processes over one (quiet machine)", t1 / t2, 1.7, math.inf),
        Bar(f"{what}: parts of two processes that differ", _differ(expected, parts(root / "two")), 0, 0),
        Bar(f"{what}: peak memory of a child, MiB", most, 0.0, MEMORY),
    ]
    return Compared(one, expected, lines, bars)


def _cpu() -> float:
    """Processor time of this process and of children that have ended, s."""
    return sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))


def _high_water(pid: int) -> float:
    """Most memory that a process has had, KiB: what getrusage says of a child begins with that of its parent."""
    try:
        return float(Path(f"/proc/{pid}/status").read_text().split("VmHWM:")[1].split()[0])
    except (OSError, IndexError):
        return 0.0


@contextmanager
def sampled(peaks: dict[int, float]) -> Iterator[None]:
    """Follow the memory of the children of this process, KiB."""
    over = threading.Event()

    def look() -> None:
        while not over.wait(0.05):
            for path in Path("/proc/self/task").glob("*/children"):
                with suppress(OSError):
                    for pid in map(int, path.read_text().split()):
                        peaks[pid] = max(peaks.get(pid, 0.0), _high_water(pid))

    looking = threading.Thread(target=look)
    looking.start()
    try:
        yield
    finally:
        over.set()
        looking.join()


def reading_alone(folder: Path) -> float:
    began = time.perf_counter()
    for path in sorted(folder.rglob("*.parquet")):
        with suppress(plumbob.PlumbobError):
            read(path)
    return time.perf_counter() - began


def cluster(folder: Path, out: Path) -> tuple[BatchRun, float, int]:
    """By a scheduler and two workers, one of which is killed when a quarter is done; records that were there then."""
    from distributed import LocalCluster

    then: list[int] = []
    with LocalCluster(n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0") as local:
        pid, total = local.workers[0].process.pid, sum(1 for path in folder.rglob("*") if path.is_file())

        def killed() -> None:
            while (found := len(list(out.glob("_jobs/*.json")))) < total // 4:
                time.sleep(0.02)
            os.kill(pid, signal.SIGKILL)
            then.append(found)

        threading.Thread(target=killed, daemon=True).start()
        done, spent = timed(folder, out, cluster=local.scheduler_address)
    return done, spent, then[0] if then else 0


def killed_run(folder: Path, out: Path) -> int:
    """A run of its own process, killed in the middle; records that it left."""
    words = [sys.executable, "-m", "plumbob", "batch", str(folder), "--out", str(out), "--filter", "mekf"]
    child = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    while child.poll() is None and len(list(out.glob("_jobs/*.json"))) < 100:
        time.sleep(0.02)
    child.send_signal(signal.SIGKILL)
    child.wait()
    return len(list(out.glob("_jobs/*.json")))


def measured(root: Path, count: int, *, dask: bool) -> Iterator[str]:
    folder = root / "in"
    damaged = recordings(folder, count)
    size = sum(path.stat().st_size for path in folder.rglob("*.parquet"))
    yield f"{count} recordings, {size / 2**20:.0f} MiB, {len(damaged)} damaged: {dict(Counter(damaged.values()))}"
    timed(folder / "00", root / "warm", jobs=1)
    alone = reading_alone(folder)
    short = compared(folder, root / "short", f"{count} short")
    found, bars = {row["recording"].rpartition(".")[0]: row for row in short.one.rows()}, short.bars
    yield from short.lines
    yield f"reading the files of the short ones alone: {alone:.1f} s"
    bars.append(Bar("recordings without a verdict", count - len(found), 0, 0))
    for how in sorted(set(damaged.values())):
        rows = [found[name] for name, why in damaged.items() if why == how]
        verdicts = dict(Counter(row["verdict"] for row in rows))
        yield f"  {how}: {verdicts}, as: {(rows[0]['reason'] or rows[0]['flags'])[:80]}"
    bars.append(Bar("whole recordings that are not done", sum(
        row["verdict"] != "done" for name, row in found.items() if name not in damaged), 0, 0))  # fmt: skip
    for _ in copies(root / "quarters", max(2, count // 25), [("buoy", 900.0, 1)]):
        pass
    long = compared(root / "quarters", root / "long", f"{max(2, count // 25)} of 15 min")
    yield from long.lines
    bars += long.bars
    left = killed_run(folder, root / "killed")
    again = timed(folder, root / "killed", jobs=2)[0]
    yield f"killed with {left} records, then {again.skipped} of {again.recordings} were not made again"
    bars += [Bar("parts after a kill that differ", _differ(short.parts, parts(root / "killed")), 0, 0),
             Bar("records made again", max(0, left - again.skipped), 0, 0)]  # fmt: skip
    if dask:
        done, t3, then = cluster(folder, root / "cluster")
        yield f"two workers of Dask, one killed after {then} records: {t3:.1f} s, {done.counts}"
        bars += [Bar("parts of the cluster that differ", _differ(short.parts, parts(root / "cluster")), 0, 0),
                 Bar("recordings without a verdict of the cluster", count - done.recordings, 0, 0)]  # fmt: skip
    yield ""
    yield from bar_lines(bars)


def _differ(one: dict[str, bytes], other: dict[str, bytes]) -> int:
    return sum(one.get(name) != other.get(name) for name in one.keys() | other.keys())


def main() -> int:
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--count", type=int, default=1000, help="recordings (1000)")
    p.add_argument("--no-dask", action="store_true", help="processes alone")
    args = p.parse_args()
    root = Path(tempfile.mkdtemp(prefix="plumbob-fleet-"))
    failed = False
    try:
        for line in measured(root, args.count, dask=not args.no_dask):
            failed |= line.endswith("MISSED")
            print(line, flush=True)
    finally:
        shutil.rmtree(root, ignore_errors=True)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
