"""Time per sample of each filter beside its peers, in one run, and whether the project's targets are met.

Thread CPU time, contenders in turn within every round, so that another job on the machine meets all of them alike. The
figure to quote is the ratio: the median over rounds of the ratio within a round. Only what two threads gain is measured
on the wall clock; what a hash gains beside it is what the machine has to give just then. Peers come with the extra
`bench`.

    python -m benchmarks.speed [--samples 1000000] [--rounds 7] [--only mahony,mekf] [--json]
"""

import argparse
import hashlib
import json
import platform
import statistics
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from plumbob import Filter, Frame, ImuData, ImuSample
from plumbob.filters import filter_names, load

RATE = 100.0
SLOW_SAMPLES = 2000  # for peers that loop in Python
STREAM_CALLS = 20_000
VQF, BASIC, VQF_STREAM = "vqf VQF.updateBatch", "vqf BasicVQF.updateBatch", "vqf VQF.update + getQuat9D"
FUSION_STREAM = "imufusion update + get_quaternion"
BASE = {"batch": BASIC, "stream": VQF_STREAM}
TWICE = ("mahony", "mekf", "vqf")
TWO_THREADS = 1.6
HASH = "sha256: what the machine gives"

Contender = tuple[int, Callable[[], object]]
Times = dict[str, list[float]]


class Target(NamedTuple):
    """A time that must be at most so many times another's; without a bound it is only told."""

    table: str
    name: str
    base: str
    bound: float | None


TARGETS = (
    Target("batch", "plumbob mekf (loop)", VQF, 0.42),
    Target("batch", "plumbob mahony (loop)", BASIC, 0.31),
    Target("batch", "plumbob vqf (loop)", VQF, 0.8),
    Target("batch", "plumbob ekf7 (loop)", VQF, 0.55),
    *(
        Target("stream", f"plumbob {name}.update{read}", base, bound)
        for base, limit in ((VQF_STREAM, 0.6), (FUSION_STREAM, 0.75))
        for read, bound in (("", limit), (" + q_nb", None))
        for name in TWICE
    ),
)


def recording(samples: int, seed: int = 0) -> ImuData:
    """9-axis data of a slowly turning, noisy unit; what they say does not change the time."""
    rng = np.random.default_rng(seed)
    n = (samples, 3)
    return ImuData(
        t=np.arange(samples) / RATE,
        gyr=0.3 * rng.normal(size=n),
        acc=0.1 * rng.normal(size=n) + [0.0, 0.0, 9.81],
        mag=0.5 * rng.normal(size=n) + [0.0, 20.0, -43.0],
    )


def loop(f: Filter, t_ns: np.ndarray, data: ImuData) -> tuple[np.ndarray, np.ndarray]:
    """Run a filter's compiled loop over checked arrays alone; attitudes (N, 4), biases (N, 3)."""
    q_nb, bias_b, words = np.empty((len(data), 4)), np.empty((len(data), 3)), np.empty(len(data), dtype=np.uint32)
    outs = q_nb.ravel(), bias_b.ravel(), words, 0, np.empty((0, 2))  # no covariance
    f._loops.batch.compiled(f._c, f._x, t_ns, data.flags, *map(np.ravel, (data.gyr, data.acc, data.mag)), *outs)
    return q_nb, bias_b


def our_batch(data: ImuData, names: Sequence[str]) -> dict[str, Contender]:
    """Our filters, whole calls: what a user waits for, validation included, and the bare loop on checked arrays."""
    found: dict[str, Contender] = {}
    for name in names:
        f = Filter(name, frame=Frame.ENU)
        found[f"plumbob {name} (loop)"] = len(data), lambda f=f: (f.reset(), loop(f, data.t_ns, data))
        found[f"plumbob {name} (process)"] = len(data), lambda f=f: (f.reset(), f.process(data))
    return found


def our_stream(data: ImuData, names: Sequence[str]) -> dict[str, Contender]:
    """Our filters, one sample a call from Python; then with the attitude read after each, as peers are asked for it."""
    rows = zip(data.t_ns[:STREAM_CALLS].tolist(), data.gyr, data.acc, data.mag, strict=False)
    samples = [ImuSample(*row) for row in rows]

    def update(f: Filter) -> None:
        f.reset()
        for sample in samples:
            f.update(sample)

    def update_and_read(f: Filter) -> None:
        f.reset()
        for sample in samples:
            f.update(sample)
            f.q_nb  # noqa: B018 - reading it copies the attitude

    found: dict[str, Contender] = {}
    for name in names:
        f = Filter(name, frame=Frame.ENU)
        found[f"plumbob {name}.update"] = len(samples), lambda f=f: update(f)
        found[f"plumbob {name}.update + q_nb"] = len(samples), lambda f=f: update_and_read(f)
    return found


def twice(data: ImuData, names: Sequence[str]) -> dict[str, list[Callable[[], object]]]:
    """Two calls on two recordings for each that is to run on two threads; the peer where it is installed."""
    text = bytes(100 * len(data))  # takes about as long as a filter; a hash needs neither the GIL nor memory of its own
    found: dict[str, list[Callable[[], object]]] = {HASH: 2 * [lambda: hashlib.sha256(text).digest()]}
    recordings = [data, recording(len(data), seed=1)]
    for name in (name for name in TWICE if name in names):
        filters = [Filter(name, frame=Frame.ENU) for _ in recordings]
        found[f"plumbob {name}.process"] = [
            lambda f=f, d=d: f.process(d) for f, d in zip(filters, recordings, strict=True)
        ]
    try:
        import vqf
    except ImportError:
        return found
    writable = [tuple(np.array(v) for v in (d.gyr, d.acc, d.mag)) for d in recordings]
    found[VQF] = [lambda arrays=arrays: vqf.VQF(1 / RATE).updateBatch(*arrays) for arrays in writable]
    return found


def vqf_peers(data: ImuData) -> tuple[dict[str, Contender], dict[str, Contender]]:
    import vqf

    gyr, acc, mag = (np.array(v) for v in (data.gyr, data.acc, data.mag))
    rows = list(zip(gyr[:STREAM_CALLS], acc[:STREAM_CALLS], mag[:STREAM_CALLS], strict=True))

    def stream() -> None:
        f = vqf.VQF(1 / RATE)
        for g, a, m in rows:
            f.update(g, a, m)
            f.getQuat9D()

    batch = {
        VQF: (len(data), lambda: vqf.VQF(1 / RATE).updateBatch(gyr, acc, mag)),
        BASIC: (len(data), lambda: vqf.BasicVQF(1 / RATE).updateBatch(gyr, acc, mag)),
    }
    return batch, {VQF_STREAM: (len(rows), stream)}


def imufusion_peers(data: ImuData) -> tuple[dict[str, Contender], dict[str, Contender]]:
    import imufusion

    gyr = np.degrees(data.gyr[:STREAM_CALLS])
    acc, mag = data.acc[:STREAM_CALLS] / 9.80665, np.array(data.mag[:STREAM_CALLS])

    def stream() -> None:
        f = imufusion.Ahrs()
        for g, a, m in zip(gyr, acc, mag, strict=True):
            f.update(g, a, m)
            f.get_quaternion()

    entry = (len(gyr), stream)
    return {"imufusion loop (it has no batch call)": entry}, {FUSION_STREAM: entry}


def ahrs_peers(data: ImuData) -> tuple[dict[str, Contender], dict[str, Contender]]:
    import ahrs

    gyr, acc, mag = (np.array(v[:SLOW_SAMPLES]) for v in (data.gyr, data.acc, data.mag))
    batch = {
        f"ahrs {kind.__name__}": (SLOW_SAMPLES, lambda k=kind: k(gyr=gyr, acc=acc, mag=mag, frequency=RATE))
        for kind in (ahrs.filters.Mahony, ahrs.filters.Madgwick)
    }
    return batch, {}


def measure(contenders: dict[str, Contender], rounds: int) -> Times:
    """Nanoseconds per sample of each contender in each round."""
    times: Times = {name: [] for name in contenders}
    for call in (c for _, c in contenders.values()):
        call()
    for _ in range(rounds):
        for name, (samples, call) in contenders.items():
            start = time.thread_time_ns()
            call()
            times[name].append((time.thread_time_ns() - start) / samples)
    return times


def ratio_of(times: Times, name: str, base: str) -> float | None:
    """Median over the rounds of the ratio within a round; None where one of the two did not run."""
    if name not in times or base not in times:
        return None
    return statistics.median(a / b for a, b in zip(times[name], times[base], strict=True))


def gains(pairs: dict[str, list[Callable[[], object]]], rounds: int) -> list[dict[str, object]]:
    """Wall time of two recordings one after the other over that of both at once, in each round."""
    found: dict[str, list[float]] = {name: [] for name in pairs}
    with ThreadPoolExecutor(2) as pool:
        for calls in pairs.values():
            list(pool.map(lambda call: call(), calls))
        for _ in range(rounds):
            for name, calls in pairs.items():
                start = time.perf_counter()
                for call in calls:
                    call()
                middle = time.perf_counter()
                list(pool.map(lambda call: call(), calls))
                found[name].append((middle - start) / (time.perf_counter() - middle))
    return [{"name": name, "median": statistics.median(v), "best": max(v)} for name, v in found.items()]


def gates(times: dict[str, Times], threads: list[dict[str, object]]) -> Iterator[dict[str, object]]:
    """Each target with what was measured; `met` is None where nothing was, or nothing is asked."""
    for table_, name, base, bound in TARGETS:
        ratio = ratio_of(times[table_], name, base)
        met = None if ratio is None or bound is None else ratio <= bound
        yield {"name": name, "base": base, "target": bound, "measured": ratio, "met": met}
    for row in (row for row in threads if row["name"] not in {HASH, VQF}):
        met = row["median"] >= TWO_THREADS
        base = "one thread: gain, at least"
        yield {"name": row["name"], "base": base, "target": TWO_THREADS, "measured": row["median"], "met": met}


def table(times: Times, base: str) -> list[dict[str, object]]:
    """Minimum and median of each contender, and its ratio to the base within the rounds."""
    rows: list[dict[str, object]] = []
    for name, values in times.items():
        ratio = ratio_of(times, name, base)
        rows.append({"name": name, "min_ns": min(values), "median_ns": statistics.median(values), "ratio": ratio})
    return rows


def gather(data: ImuData, names: Sequence[str]) -> tuple[dict[str, Contender], dict[str, Contender], list[str]]:
    batch, stream, absent = our_batch(data, names), our_stream(data, names), []
    for peers in (vqf_peers, imufusion_peers, ahrs_peers):
        try:
            more_batch, more_stream = peers(data)
        except ImportError as error:
            absent.append(str(error))
            continue
        batch |= more_batch
        stream |= more_stream
    return batch, stream, absent


def show(title: str, rows: list[dict[str, object]], base: str) -> None:
    print(f"\n{title}\n{'':46}{'min ns':>10}{'median ns':>11}{'ratio':>9}")
    for row in rows:
        ratio = f"{row['ratio']:9.3f}" if row["ratio"] is not None else f"{'–':>9}"
        print(f"{row['name']:46}{row['min_ns']:10.0f}{row['median_ns']:11.0f}{ratio}")
    print(f"ratio: to {base}, within each round")


def show_threads(rows: list[dict[str, object]]) -> None:
    print(f"\ntwo recordings, two threads against one, wall clock\n{'':46}{'median gain':>12}{'best':>9}")
    for row in rows:
        print(f"{row['name']:46}{row['median']:12.2f}{row['best']:9.2f}")


def show_gates(rows: list[dict[str, object]]) -> None:
    print("\ntargets: at most so many times the other's time, but for gains")
    print(f"{'':32}{'of':36}{'target':>9}{'measured':>10}")
    for row in rows:
        target, measured = (f"{v:.2f}" if v is not None else "–" for v in (row["target"], row["measured"]))
        verdict = {True: "met", False: "MISSED", None: ""}[row["met"]]
        print(f"{row['name']:32}{row['base']:36}{target:>9}{measured:>10}  {verdict}")


def chosen_names(only: str | None) -> tuple[str, ...]:
    """Filters of a comma list, all without one."""
    if only is None:
        return filter_names()
    names = tuple(name.strip() for name in only.split(","))
    for name in names:
        load(name)
    return names


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=1_000_000)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--only", metavar="A,B", help="these of our filters only")
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    names, data = chosen_names(args.only), recording(args.samples)
    batch, stream, absent = gather(data, names)
    times = {"batch": measure(batch, args.rounds), "stream": measure(stream, args.rounds)}
    threads = gains(twice(data, names), args.rounds)
    result = {
        "machine": f"{platform.machine()}, {platform.system()}, Python {platform.python_version()}",
        "samples": args.samples,
        "rounds": args.rounds,
        "absent": absent,
        **{kind: table(times[kind], BASE[kind]) for kind in times},
        "threads": threads,
        "gates": list(gates(times, threads)),
    }
    if args.json:
        print(json.dumps(result, indent=2))
        return 0
    print(f"{result['machine']}; {args.samples} samples, {args.rounds} rounds, thread CPU time per sample")
    show("batch, one thread", result["batch"], BASE["batch"])
    show("one sample a call from Python", result["stream"], BASE["stream"])
    show_threads(result["threads"])
    show_gates(result["gates"])
    for line in absent:
        print(f"peer left out: {line}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
