"""How long command lines take to start and end, beside `import pyarrow.parquet` alone, in one run.

CPU seconds (user and system) of whole processes, in turn within every round, so that another job on the machine meets
all of them alike; the figure to quote is the median over rounds of the ratio within a round. Bytecode is kept, and
files are in memory, before the first round that counts.

    python -m benchmarks.startup [--rounds 7] [--only run,info] [--json]
"""

import argparse
import json
import os
import platform
import resource
import statistics
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

AS_USERS = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
IMPORTS = "import pyarrow.parquet"
SENSORS = ("--frame", "NED", "--sensors", "mpu6000+hmc5983", "--unit", "calibrated")


@dataclass(frozen=True)
class Line:
    """A command line and the most that it may take, as a multiple of the imports."""

    what: str
    words: tuple[str, ...]
    bar: float


def files(folder: Path) -> dict[str, Path]:
    """Recordings of 10 minutes of sea, and of an hour and two minutes at rest, at 100 Hz."""
    made = {name: folder / f"{name}.parquet" for name in ("sea", "bare", "hour", "minutes")}
    for name, scenario, duration in (
        ("sea", "buoy", "600s"),
        ("hour", "static", "3600s"),
        ("minutes", "static", "120s"),
    ):
        words = ("sim", scenario, *SENSORS, "--duration", duration, "--out", str(made[name]))
        subprocess.run([sys.executable, "-m", "plumbob", *words], check=True, capture_output=True)
    without_reference(made["sea"], made["bare"])
    return made


def without_reference(source: Path, target: Path) -> None:
    from plumbob import read, write

    write(target, read(source).imu)


def lines(made: dict[str, Path]) -> list[Line]:
    sea, bare = str(made["sea"]), str(made["bare"])
    out = str(made["sea"].with_name("track.parquet"))
    return [
        Line("run", ("run", sea), 3.3),
        Line("run mekf", ("run", sea, "--filter", "mekf"), 3.3),
        Line("run mekf --out", ("run", sea, "--filter", "mekf", "--out", out, "--force"), 3.3),
        Line("run mahony", ("run", sea, "--filter", "mahony"), 3.3),
        Line("run without a reference", ("run", bare, "--filter", "mekf"), 3.3),
        Line("run, refused", ("run", str(made["sea"].with_name("none.parquet")), "--filter", "mekf"), 0.5),
        Line("info", ("info", sea), 1.2),
        Line("filters", ("list", "filters"), 0.3),
        Line("allan, 2 minutes", ("allan", str(made["minutes"])), 3.0),
        Line("allan, 1 hour", ("allan", str(made["hour"])), 3.0),
    ]


def cpu(*words: str) -> float:
    """CPU seconds of a process."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, *words], check=False, capture_output=True, env=AS_USERS)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def measure(wanted: list[Line], rounds: int) -> tuple[float, list[dict[str, object]]]:
    base: list[float] = []
    times: dict[str, list[float]] = {line.what: [] for line in wanted}
    for count in range(rounds + 1):
        imports = cpu("-c", IMPORTS)
        taken = {line.what: cpu("-m", "plumbob", *line.words) for line in wanted}
        if count:  # the first round compiles
            base.append(imports)
            for what, seconds in taken.items():
                times[what].append(seconds)
    return statistics.median(base), [row(line, times[line.what], base) for line in wanted]


def row(line: Line, times: list[float], base: list[float]) -> dict[str, object]:
    ratio = statistics.median(own / imports for own, imports in zip(times, base, strict=True))
    seconds = statistics.median(times)
    return {"what": line.what, "seconds": seconds, "ratio": ratio, "bar": line.bar, "met": ratio <= line.bar}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--only", default="", metavar="A,B", help="lines that begin so (default all)")
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        starts = tuple(args.only.split(","))
        wanted = [line for line in lines(files(Path(folder))) if line.what.startswith(starts)]
        base, rows = measure(wanted, args.rounds)
    machine = f"{platform.machine()}, {platform.system()}, Python {platform.python_version()}"
    if args.json:
        print(json.dumps({"machine": machine, "rounds": args.rounds, "imports": base, "lines": rows}, indent=2))
        return 0
    print(f"{machine}; {args.rounds} rounds, CPU seconds of processes, medians")
    print(f"{'imports alone':28}{base:8.3f} s")
    for found in rows:
        verdict = f"<= {found['bar']:g}: {'met' if found['met'] else 'MISSED'}"
        print(f"{found['what']:28}{found['seconds']:8.3f} s{found['ratio']:8.2f} times the imports  {verdict}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
