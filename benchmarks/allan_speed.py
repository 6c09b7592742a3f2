"""Allan deviation beside allantools, in one run: time of a grid, of every averaging factor, and of a long file.

Thread CPU time, contenders in turn within every round, so that another job on the machine meets all of them alike; the
figure to quote is the median over rounds of the ratio within a round. What is timed is the whole call on plain samples:
checks, mean and running sum included. The file is read by processes of their own, which report their peak memory,
imports and all; it is compared with reading the same blocks, converting and summing them. allantools comes with the
extra `bench`.

    python -m benchmarks.allan_speed [--samples 1000000,10000000] [--every 100000] [--alone 1000000]
                                     [--rows 100000000] [--rounds 5] [--json]
"""

import argparse
import contextlib
import io
import json
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from plumbob.cli.main import main as plumbob
from plumbob.noise import AllanStream, deviation, every_adev, log_factors, stream_factors

GRID = 100  # points from 1 to N / 2, of which about 92 are different whole numbers
BLOCK = 2**20  # samples that are read together
FASTER, FASTER_EVERY, MEGABYTES = 16.0, 40.0, 300.0
Row = dict[str, object]


def cpu(call: Callable[[], object]) -> float:
    start = time.thread_time()
    call()
    return time.thread_time() - start


def compare(calls: dict[str, Callable[[], object]], rounds: int) -> dict[str, list[float]]:
    """Seconds of each call in each round, after one that is not counted."""
    for call in calls.values():
        call()
    times: dict[str, list[float]] = {name: [] for name in calls}
    for _ in range(rounds):
        for name, call in calls.items():
            times[name].append(cpu(call))
    return times


def versus(what: str, ours: Callable[[], object], theirs: Callable[[], object], bar: float, rounds: int) -> Row:
    times = compare({"ours": ours, "theirs": theirs}, rounds)
    ratio = statistics.median(b / a for a, b in zip(times["ours"], times["theirs"], strict=True))
    seconds = {name: statistics.median(values) for name, values in times.items()}
    return {"what": what, **seconds, "ratio": ratio, "bar": f">= {bar:g} times as fast", "met": ratio >= bar}


def alone(what: str, call: Callable[[], object], rounds: int) -> Row:
    return {"what": what, "ours": statistics.median(compare({"ours": call}, rounds)["ours"])}


def against_allantools(samples: list[int], every: int, rounds: int) -> list[Row]:
    import allantools

    def theirs(rate: np.ndarray, n: np.ndarray) -> object:
        return allantools.oadev(rate, rate=1.0, data_type="freq", taus=n.astype(float))

    rows = []
    for count in samples:
        rate, n = noise(count), np.unique(np.round(np.geomspace(1, count // 2, GRID)))
        what = f"{n.size} n of {count} samples"
        rows.append(versus(what, lambda: deviation(rate, n), lambda: theirs(rate, n), FASTER, rounds))  # noqa: B023
    rate, n = noise(every), np.arange(1, every // 2 + 1)
    what = f"every n of {every} samples"
    rows.append(versus(what, lambda: every_adev(rate), lambda: theirs(rate, n), FASTER_EVERY, rounds))
    return rows


def noise(count: int) -> np.ndarray:
    return np.random.default_rng(0).standard_normal(count)


def write(path: Path, rows: int) -> None:
    rng = np.random.default_rng(0)
    with path.open("wb") as file:
        for start in range(0, rows, BLOCK):
            rng.standard_normal(min(BLOCK, rows - start), dtype=np.float32).tofile(file)


def stream(path: Path) -> Row:
    """Every block of a file of float32 through a stream."""
    found = AllanStream(stream_factors(log_factors(10**10)), channels=1)
    each_block(path, found.feed)
    result = found.result()
    return {"n": result.n.size, "adev": result.dev[0, 0]}


def merely_read(path: Path) -> Row:
    """Every block converted and summed, and nothing else."""
    sums: list[float] = []
    each_block(path, lambda block: sums.append(float(np.sum(block.astype(np.float64)))))
    return {"sum": sum(sums)}


def whole_analysis(path: Path) -> Row:
    """What a user runs: the file checked, in one pass, then read again and analysed with all methods and verdicts."""
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        code = plumbob(["allan", str(path), "--columns", "1", "--rate", "1000Hz", "--scale", "1 deg/s"])
    assert code == 0, printed.getvalue()
    return {}


def each_block(path: Path, take: Callable[[np.ndarray], object]) -> None:
    with path.open("rb") as file:
        while (block := np.fromfile(file, np.float32, BLOCK)).size:
            take(block)


JOBS = {"stream": stream, "read": merely_read, "whole": whole_analysis}


def job(name: str, path: Path) -> Row:
    """Run a job in this process and tell its time and the peak memory of the process."""
    import resource

    AllanStream([1], channels=1).feed(np.zeros(BLOCK))  # kernels come from the cache, or are compiled, before the clock
    wall, start = time.perf_counter(), time.thread_time()
    found = JOBS[name](path)
    seconds, wall = time.thread_time() - start, time.perf_counter() - wall
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
    return {**found, "seconds": seconds, "wall": wall, "megabytes": peak / 1e6}


def in_a_process(name: str, path: Path) -> Row:
    words = [sys.executable, __file__, "--job", name, "--file", str(path)]
    return json.loads(subprocess.run(words, check=True, capture_output=True, text=True).stdout)


def from_a_file(rows: int, rounds: int) -> Row:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "rate.f32"
        write(path, rows)
        in_a_process("stream", path)  # fills the cache of kernels, so that no round compiles them
        in_a_process("whole", path)
        pairs = [(in_a_process("stream", path), in_a_process("read", path)) for _ in range(rounds)]
        whole = in_a_process("whole", path)
    median = {key: statistics.median(ours[key] for ours, _ in pairs) for key in ("seconds", "wall")}
    peak = max(whole["megabytes"], *(ours["megabytes"] for ours, _ in pairs))
    return {
        "what": f"{pairs[0][0]['n']} n of a file of {rows} float32",
        "ours": median["seconds"],
        "wall": median["wall"],
        "read": statistics.median(read["seconds"] for _, read in pairs),
        "times_reading": statistics.median(ours["seconds"] / read["seconds"] for ours, read in pairs),
        "whole": whole["seconds"],
        "megabytes": max(ours["megabytes"] for ours, _ in pairs),
        "megabytes_whole": whole["megabytes"],
        "megabytes_reading": max(read["megabytes"] for _, read in pairs),
        "bar": f"<= {MEGABYTES:g} MB of memory",
        "met": peak <= MEGABYTES,
    }


def show(result: dict[str, object]) -> None:
    print(f"{result['machine']}; {result['rounds']} rounds, thread CPU time, medians")
    print(f"\n{'':42}{'ours s':>10}{'allantools s':>14}{'ratio':>8}")
    for row in (*result["versus"], *result["alone"]):
        other = f"{row['theirs']:14.3f}{row['ratio']:8.1f}" if "ratio" in row else f"{'–':>14}{'–':>8}"
        print(f"{row['what']:42}{row['ours']:10.4f}{other}  {verdict(row)}")
    row = result["file"]
    print(f"\n{row['what']}: {row['ours']:.2f} s ({row['wall']:.2f} s wall), peak {row['megabytes']:.0f} MB")
    print(f"merely read, converted and summed: {row['read']:.2f} s, peak {row['megabytes_reading']:.0f} MB")
    print(f"plumbob allan on it, two passes: {row['whole']:.2f} s, peak {row['megabytes_whole']:.0f} MB")
    print(f"the stream takes {row['times_reading']:.1f} times as long as reading; {verdict(row)}")
    for line in result["absent"]:
        print(f"peer left out: {line}")


def verdict(row: Row) -> str:
    return f"{row['bar']}: {'met' if row['met'] else 'MISSED'}" if "bar" in row else ""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", default="1000000,10000000", metavar="A,B", help="records of a grid of factors")
    parser.add_argument("--every", type=int, default=100_000, help="samples of the record with every factor")
    parser.add_argument("--alone", type=int, default=1_000_000, help="the same without allantools, which takes minutes")
    parser.add_argument("--rows", type=int, default=100_000_000, help="samples of the file")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--job", choices=JOBS, help=argparse.SUPPRESS)
    parser.add_argument("--file", type=Path, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.job:
        print(json.dumps(job(args.job, args.file)))
        return 0
    absent, rows = [], []
    file = from_a_file(args.rows, args.rounds)  # first: a new process inherits its parent's peak of memory
    try:
        rows = against_allantools([int(word) for word in args.samples.split(",")], args.every, args.rounds)
    except ImportError as error:
        absent.append(str(error))
    long = noise(args.alone)
    result = {
        "machine": f"{platform.machine()}, {platform.system()}, Python {platform.python_version()}",
        "rounds": args.rounds,
        "versus": rows,
        "alone": [alone(f"every n of {args.alone} samples", lambda: every_adev(long), args.rounds)],
        "file": file,
        "absent": absent,
    }
    if args.json:
        print(json.dumps(result, indent=2))
    else:
        show(result)
    return 0


if __name__ == "__main__":
    sys.exit(main())
