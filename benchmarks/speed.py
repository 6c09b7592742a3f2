"""Time per sample of each filter beside its peers, in one run.

Thread CPU time, contenders in turn within every round, so that another job on the machine meets all of them alike. The
figure to quote is the ratio: the median over rounds of the ratio within a round. Peers come with the extra `bench`.

    python benchmarks/speed.py [--samples 1000000] [--rounds 7] [--json]
"""

import argparse
import json
import platform
import statistics
import sys
import time
from collections.abc import Callable

import numpy as np

from plumbob import Filter, Frame, ImuData, ImuSample
from plumbob.filters import filter_names

RATE = 100.0
SLOW_SAMPLES = 2000  # for peers that loop in Python
STREAM_CALLS = 20_000
BASE = {"batch": "vqf BasicVQF.updateBatch", "stream": "vqf VQF.update + getQuat9D"}

Contender = tuple[int, Callable[[], object]]


def recording(samples: int) -> ImuData:
    """9-axis data of a slowly turning, noisy unit; what they say does not change the time."""
    rng = np.random.default_rng(0)
    n = (samples, 3)
    return ImuData(
        t=np.arange(samples) / RATE,
        gyr=0.3 * rng.normal(size=n),
        acc=0.1 * rng.normal(size=n) + [0.0, 0.0, 9.81],
        mag=0.5 * rng.normal(size=n) + [0.0, 20.0, -43.0],
    )


def our_batch(data: ImuData) -> dict[str, Contender]:
    """Our filters, whole calls: what a user waits for, validation included, and the bare loop on checked arrays."""
    found: dict[str, Contender] = {}
    arrays = data.t_ns, data.flags, data.gyr, data.acc, data.mag, slice(0, 0)
    for name in filter_names():
        f = Filter(name, frame=Frame.ENU)
        found[f"plumbob {name} (loop)"] = len(data), lambda f=f: (f.reset(), f._batch(*arrays))
        found[f"plumbob {name} (process)"] = len(data), lambda f=f: (f.reset(), f.process(data))
    return found


def our_stream(data: ImuData) -> dict[str, Contender]:
    """Our filters, one sample a call from Python."""
    rows = zip(data.t_ns[:STREAM_CALLS].tolist(), data.gyr, data.acc, data.mag, strict=False)
    samples = [ImuSample(*row) for row in rows]

    def loop(f: Filter) -> None:
        f.reset()
        for sample in samples:
            f.update(sample)

    filters = {name: Filter(name, frame=Frame.ENU) for name in filter_names()}
    return {f"plumbob {name}.update": (STREAM_CALLS, lambda f=f: loop(f)) for name, f in filters.items()}


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
        "vqf VQF.updateBatch": (len(data), lambda: vqf.VQF(1 / RATE).updateBatch(gyr, acc, mag)),
        "vqf BasicVQF.updateBatch": (len(data), lambda: vqf.BasicVQF(1 / RATE).updateBatch(gyr, acc, mag)),
    }
    return batch, {"vqf VQF.update + getQuat9D": (STREAM_CALLS, stream)}


def imufusion_peers(data: ImuData) -> tuple[dict[str, Contender], dict[str, Contender]]:
    import imufusion

    gyr = np.degrees(data.gyr[:STREAM_CALLS])
    acc, mag = data.acc[:STREAM_CALLS] / 9.80665, np.array(data.mag[:STREAM_CALLS])

    def stream() -> None:
        f = imufusion.Ahrs()
        for g, a, m in zip(gyr, acc, mag, strict=True):
            f.update(g, a, m)
            f.get_quaternion()

    entry = (STREAM_CALLS, stream)
    return {"imufusion loop (it has no batch call)": entry}, {"imufusion update + get_quaternion": entry}


def ahrs_peers(data: ImuData) -> tuple[dict[str, Contender], dict[str, Contender]]:
    import ahrs

    gyr, acc, mag = (np.array(v[:SLOW_SAMPLES]) for v in (data.gyr, data.acc, data.mag))
    batch = {
        f"ahrs {kind.__name__}": (SLOW_SAMPLES, lambda k=kind: k(gyr=gyr, acc=acc, mag=mag, frequency=RATE))
        for kind in (ahrs.filters.Mahony, ahrs.filters.Madgwick)
    }
    return batch, {}


def measure(contenders: dict[str, Contender], rounds: int) -> dict[str, list[float]]:
    """Nanoseconds per sample of each contender in each round."""
    times: dict[str, list[float]] = {name: [] for name in contenders}
    for call in (c for _, c in contenders.values()):
        call()
    for _ in range(rounds):
        for name, (samples, call) in contenders.items():
            start = time.thread_time_ns()
            call()
            times[name].append((time.thread_time_ns() - start) / samples)
    return times


def table(times: dict[str, list[float]], base: str) -> list[dict[str, object]]:
    """Minimum and median of each contender, and its ratio to the base within the rounds."""
    rows: list[dict[str, object]] = []
    for name, values in times.items():
        against = times.get(base)
        ratio = statistics.median(a / b for a, b in zip(values, against, strict=True)) if against else None
        rows.append({"name": name, "min_ns": min(values), "median_ns": statistics.median(values), "ratio": ratio})
    return rows


def gather(data: ImuData) -> tuple[dict[str, Contender], dict[str, Contender], list[str]]:
    batch, stream, absent = our_batch(data), our_stream(data), []
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


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=1_000_000)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    data = recording(args.samples)
    batch, stream, absent = gather(data)
    result = {
        "machine": f"{platform.machine()}, {platform.system()}, Python {platform.python_version()}",
        "samples": args.samples,
        "rounds": args.rounds,
        "absent": absent,
        "batch": table(measure(batch, args.rounds), BASE["batch"]),
        "stream": table(measure(stream, args.rounds), BASE["stream"]),
    }
    if args.json:
        print(json.dumps(result, indent=2))
        return 0
    print(f"{result['machine']}; {args.samples} samples, {args.rounds} rounds, thread CPU time per sample")
    show("batch, one thread", result["batch"], BASE["batch"])
    show("one sample a call from Python", result["stream"], BASE["stream"])
    for line in absent:
        print(f"peer left out: {line}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
