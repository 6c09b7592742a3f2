"""Plant faults in the package, one at a time, and see whether the tests of `make test` find them.

First the tests run once and it is noted which functions each of them runs; then, for each fault, those tests that run
its function, the nearest and cheapest first, until one fails. A fault that none finds in 60 s of tests (``--budget``)
is a survivor, so that what is printed as found is a lower bound. Those that `known.toml` calls equivalent (no input can
tell them from the original) count neither way.

``python benchmarks/mutants`` writes into ``.mutants`` and goes on where it was stopped.
"""

import argparse
import concurrent.futures
import hashlib
import itertools
import json
import os
import queue
import re
import shutil
import subprocess
import sys
import time
import tomllib
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

from plant import Mutant, mutants_of

HERE = Path(__file__).parent
TOP = HERE.parents[1]
# By risk: how many faults each room gets of 172, and which folders or files it is, less what an earlier room has.
ROOMS = {
    "core and report": (8, "core reporting live/transports/transport.py"),
    "rotations": (7, "rotations"),
    "data and cards": (7, "data"),
    "time base": (8, "live/timing"),
    "smoother": (10, "filters/smoother"),
    "filters": (12, "filters"),
    "calibration": (12, "calibration"),
    "noise": (9, "noise"),
    "protocols": (8, "protocols"),
    "recordings": (7, "files/mcap"),
    "foreign files": (7, "files/foreign"),
    "files": (7, "files/*.py"),
    "array": (7, "arm/array"),
    "sessions": (7, "live/*.py live/transports door"),
    "evaluation": (7, "evaluation quality"),
    "simulation": (7, "simulation live/rigs"),
    "arm": (7, "arm"),
    "overview": (7, "overview"),
    "viewer": (7, "viewer"),
    "fleet": (7, "fleet"),
    "papers": (7, "papers"),
    "command line": (7, "cli"),
}
MINUTES = 15  # a fault that makes the tests hang is found
NOBODY = "nothing runs it"


def rooms(package: Path, seed: int, scale: float) -> dict[str, list[Mutant]]:
    """Faults of each room: kinds in turn, each function once. An edit elsewhere leaves the choice as it was."""

    def drawn(mutant: Mutant) -> bytes:
        return hashlib.sha256(f"{seed} {mutant.name}".encode()).digest()

    chosen: dict[str, list[Mutant]] = {}
    taken: set[Path] = set()
    for room, (count, places) in ROOMS.items():
        files = [file for place in places.split() for file in _files(package, place) if file not in taken]
        taken.update(files)
        by_kind = defaultdict(list)
        for file in files:
            for mutant in mutants_of(package, file):
                by_kind[mutant.kind].append(mutant)
        heaps = [sorted(by_kind[kind], key=drawn) for kind in sorted(by_kind)]
        chosen[room] = list(_in_turn(heaps, max(1, round(count * scale))))
    return chosen


def _files(package: Path, place: str) -> list[Path]:
    """Files of a folder with all that is below it, or those that a pattern names."""
    return sorted(package.glob(place if place.endswith(".py") else f"{place}/**/*.py"))


def _in_turn(heaps: list[list[Mutant]], count: int) -> Iterator[Mutant]:
    used: set[tuple[str, str]] = set()
    while count and any(heaps):
        for heap in heaps:
            fresh = next((m for m in heap if (m.path, m.function) not in used), None)
            heap[:] = heap[heap.index(fresh) + 1 :] if fresh else []
            if fresh and count:
                used.add((fresh.path, fresh.function))
                count -= 1
                yield fresh


class Tree:
    """A copy of the checkout, in which a fault may stand for a while."""

    def __init__(self, folder: Path, data: str) -> None:
        self.folder = folder
        shutil.rmtree(folder, ignore_errors=True)
        listed = subprocess.run(
            ["git", "ls-files", "-co", "--exclude-standard"], cwd=TOP, capture_output=True, text=True, check=True
        )
        built = (path.relative_to(TOP) for path in (TOP / "src/plumbob/web").rglob("*"))  # which git does not keep
        for name in (*listed.stdout.splitlines(), *built):
            if (TOP / name).is_file():
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(TOP / name, folder / name)
        self.package = folder / "src" / "plumbob"
        self.environment = {**os.environ, "PLUMBOB_DATA": data, "OMP_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1"}

    def path_with(self, *more: Path) -> str:
        """Where Python looks first: in this copy."""
        return os.pathsep.join(map(str, (*more, self.folder / "src", self.folder)))

    def pytest(self, *words: str, **environment: str) -> subprocess.CompletedProcess[str]:
        """Run tests of this copy."""
        env = {**self.environment, "PYTHONPATH": self.path_with(), **environment}
        command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *words]
        return subprocess.run(
            command, cwd=self.folder, env=env, capture_output=True, text=True, check=False, timeout=60.0 * MINUTES
            if "-x" in words else None,
        )  # fmt: skip


def trace(tree: Tree, work: Path, jobs: int) -> dict[str, dict[str, float]]:
    """Which tests run which function, and the seconds that each takes; all of them must pass."""
    kept = work / "trace.json"
    if kept.exists():
        return json.loads(kept.read_text(encoding="utf-8"))
    out = work / "traced"
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir()
    traced = {"PLUMBOB_TRACE": str(out), "PLUMBOB_TRACE_ROOT": str(tree.package)}
    words = ("-p", "traced", "-n", str(jobs), "--dist", "loadfile", "--durations=0", "--durations-min=0.001", "-vv")
    done = tree.pytest(*words, PYTHONPATH=tree.path_with(HERE / "trace"), **traced)
    if done.returncode:
        sys.exit(f"The tests fail without any fault:\n{done.stdout[-4000:]}")
    seconds = _durations(done.stdout)
    ran: dict[str, dict[str, float]] = defaultdict(dict)
    of_file: dict[str, set[str]] = defaultdict(set)  # functions that fixtures ran
    tests: dict[str, set[str]] = defaultdict(set)
    for file in out.glob("*.json"):
        for name, functions in json.loads(file.read_text(encoding="utf-8")).items():
            test, _, phase = name.rpartition(" ")
            test = test.partition("[")[0]
            tests[test.partition("::")[0]].add(test)
            if phase == "(setup)":
                of_file[test.partition("::")[0]].update(functions)
            else:
                for function in functions:
                    ran[function][test] = seconds.get(test, 0.0)
    for file, functions in of_file.items():
        for function in functions:
            for test in tests[file]:
                ran[function].setdefault(test, seconds.get(test, 0.0))
    kept.write_text(json.dumps(ran), encoding="utf-8")
    return ran


def _durations(text: str) -> dict[str, float]:
    found: dict[str, float] = defaultdict(float)
    for line in text.splitlines():
        words = line.split(maxsplit=2)
        if len(words) == 3 and words[0].endswith("s") and words[1] in {"call", "setup"}:
            found[words[2].partition("[")[0]] += float(words[0][:-1])
    return found


def order(tests: dict[str, float], mutant: Mutant, budget: float, before: str = "") -> list[str]:
    """The test of that name first, then the room's own, each the cheapest files first, as far as the budget goes."""
    room = mutant.path.partition("/")[0].removesuffix(".py")
    cost: dict[str, float] = defaultdict(float)
    for test, seconds in tests.items():
        cost[test.partition("::")[0]] += seconds

    def rank(test: str) -> tuple[bool, bool, float, str]:
        file, _, name = test.partition("::")
        return name != before, f"tests/{room}/" not in test, cost[file], file

    nearest = sorted(tests, key=rank)
    spent = itertools.accumulate((tests[test] for test in nearest), initial=0.0)
    return [test for test, before in zip(nearest, spent, strict=False) if before < budget]


def judge(tree: Tree, mutant: Mutant, tests: list[str], work: Path) -> dict[str, object]:
    """Plant it, run the tests, take it away again."""
    path = tree.package / mutant.path
    source = path.read_text(encoding="utf-8")
    listed = tree.folder / "tests.txt"
    listed.write_text("\n".join(tests), encoding="utf-8")
    chosen = {"PLUMBOB_SELECTED": str(listed), "PYTHONPATH": tree.path_with(HERE / "trace")}
    files = dict.fromkeys(test.partition("::")[0] for test in tests)
    started = time.monotonic()
    try:
        path.write_text(mutant.plant(source), encoding="utf-8")
        by = _first_failure(tree.pytest("-x", "-p", "selected", *files, **chosen)) if files else NOBODY
    except subprocess.TimeoutExpired:
        by = "it never ends"
    finally:
        path.write_text(source, encoding="utf-8")
    seconds = round(time.monotonic() - started, 1)
    return {"name": mutant.name, "row": mutant.row, "found": by not in {"", NOBODY}, "by": by, "seconds": seconds}


def _first_failure(done: subprocess.CompletedProcess[str]) -> str:
    if done.returncode == 0:
        return ""
    failed = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    return failed[0] if failed else f"pytest exits with {done.returncode}"


def known(kind: str) -> dict[str, str]:
    """Faults that no input can tell from the original (`equivalent`), or that tests do not find (`left`), and why."""
    table = tomllib.loads((HERE / "known.toml").read_text(encoding="utf-8"))
    return {one["name"]: one["why"] for one in table[kind]}


def show(chosen: dict[str, list[Mutant]], results: dict[str, dict[str, object]]) -> bool:
    """Print found and missed by room; True where the bars are met."""
    same, left, met, total = known("equivalent"), known("left"), True, [0, 0]
    print(f"\n{'room':16}{'planted':>8}{'same':>6}{'found':>7}{'missed':>8}{'share':>8}")
    for room, mutants in chosen.items():
        real = [results[m.name] for m in mutants if m.name in results and m.name not in same]
        found = sum(bool(one["found"]) for one in real)
        total = [total[0] + found, total[1] + len(real)]
        share = found / len(real) if real else 1.0
        met &= share >= 0.85
        print(f"{room:16}{len(mutants):8}{len(mutants) - len(real):6}{found:7}{len(real) - found:8}{share:8.0%}")
    share = total[0] / max(1, total[1])
    print(f"{'together':16}{'':14}{total[0]:7}{total[1] - total[0]:8}{share:8.1%}   (bars: 92 %, each room 85 %)\n")
    for mutant in (m for mutants in chosen.values() for m in mutants):
        result = results.get(mutant.name)
        if result and not result["found"]:
            why = same.get(mutant.name) or left.get(mutant.name) or result["by"] or "no test fails"
            verdict = "same  " if mutant.name in same else "MISSED"
            print(f"{verdict} {mutant.path}:{mutant.row} {mutant.name}\n       {why}")
    return met and share >= 0.92


def main() -> int:
    """Run it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scale", type=float, default=1.0, help="share of the 172 faults of the table in this file")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--budget", type=float, default=60.0, metavar="S", help="seconds of tests for each fault")
    parser.add_argument("--work", type=Path, default=TOP / ".mutants", help="folder for copies, traces and results")
    parser.add_argument(
        "--first", type=Path, metavar="FILE", help="results.jsonl of other tests: what found a fault goes first"
    )
    parser.add_argument("--again", action="store_true", help="judge survivors once more, with fresh traces")
    parser.add_argument("--list", action="store_true", help="only print what would be planted")
    args = parser.parse_args()
    work = args.work.resolve()
    chosen = rooms(TOP / "src" / "plumbob", args.seed, args.scale)
    if args.list:
        print(*(f"{m.path}:{m.row} {m.name}" for mutants in chosen.values() for m in mutants), sep="\n")
        return 0
    work.mkdir(exist_ok=True)
    kept = work / "results.jsonl"
    lines = kept.read_text(encoding="utf-8").splitlines() if kept.exists() else []
    results = {one["name"]: one for one in map(json.loads, lines)}
    if args.again:
        results = {name: one for name, one in results.items() if one["found"]}
        (work / "trace.json").unlink(missing_ok=True)
    earlier = [json.loads(line) for line in args.first.read_text("utf-8").splitlines()] if args.first else []
    finders = {one["name"]: "".join(re.findall(r"^\w+ [^: ]+::([^\[ ]+)", str(one["by"]))) for one in earlier}
    data = str(Path(os.environ.get("PLUMBOB_DATA", TOP.parent / "shared" / "data")).resolve())
    trees: queue.Queue[Tree] = queue.Queue()
    for number in range(args.jobs):
        trees.put(Tree(work / f"tree{number}", data))
    ran = trace(trees.queue[0], work, args.jobs)

    def one(mutant: Mutant) -> dict[str, object]:
        tree = trees.get()
        try:
            tests = ran.get(f"{mutant.path}:{mutant.line}", {})
            return judge(tree, mutant, order(tests, mutant, args.budget, finders.get(mutant.name, "")), work)
        finally:
            trees.put(tree)

    todo = [m for mutants in chosen.values() for m in mutants if m.name not in results]
    with concurrent.futures.ThreadPoolExecutor(args.jobs) as pool, kept.open("a", encoding="utf-8") as file:
        for done in concurrent.futures.as_completed([pool.submit(one, mutant) for mutant in todo]):
            result = done.result()
            results[str(result["name"])] = result
            file.write(json.dumps(result) + "\n")
            file.flush()
            verdict = "found " if result["found"] else "MISSED"
            print(f"{verdict} {result['seconds']:6.1f} s  {result['name']}  {result['by']}"[:240], flush=True)
    return 0 if show(chosen, results) else 1


if __name__ == "__main__":
    sys.exit(main())
