"""Every gate of the project, each whatever the others say, and what they cost.

``make test`` runs all of them, ``make lint`` those that only read. Those run beside the tests, which leave a core idle
now and then; what they say comes last. Tests of a group run where its files changed since the upstream branch, or in
the last commit where that is the same, and always with ``--all``.
"""

import os
import re
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import NamedTuple

from gates import PYTEST
from gates.house import ROOT, git

BIN = Path(sys.executable).parent
CODE = ("src", "tests", "benchmarks", "examples", "gates", "website")
GROUPS = {  # folders and files, the tests among them
    "papers": ("src/plumbob/papers", "tests/papers", "docs/papers.md"),
    "rigs": ("src/plumbob/live/rigs", "src/plumbob/protocols/rigs", "tests/live/rigs"),
    "page": ("src/plumbob/viewer", "web", "tests/viewer"),
    "arm": ("src/plumbob/arm", "tests/arm"),
}
READERS = {
    "format": (BIN / "ruff", "format", "--check", *CODE),
    "lint": (BIN / "ruff", "check", *CODE),
    "types": (BIN / "mypy",),
    "layers": (BIN / "lint-imports",),
    "house": (sys.executable, "-m", "gates.house"),
}
# Where Pythons differ: texts of argparse and errors, processes, threads, sockets, archives, what dataclasses show.
# All files of tests that need recordings run there too, since the other Python runs without them.
SECOND = ("tests/cli", "tests/core", "tests/data", "tests/files", "tests/fleet", "tests/live/test_*.py", "tests/viewer")
RECORDED = re.compile("real_data|real_motion|broad_folder")
PLAIN = ("tests/rotations", "tests/calibration/test_calibration_ellipsoid_fit.py")

LAST = 3  # commits whose rooms the long tests look at, where the upstream branch has them all; --all: every room


class Outcome(NamedTuple):
    """What a gate came to."""

    name: str
    code: int
    cpu: float
    wall: float
    text: str


def changed(commits: int = 1) -> set[str] | None:
    """Files that differ from the upstream branch, or from some commits before; None where git cannot say."""
    base = git(ROOT, "merge-base", "HEAD", "@{upstream}")
    if not base or base == git(ROOT, "rev-parse", "HEAD"):
        base = git(ROOT, "rev-parse", "--verify", f"HEAD~{commits}")
    if not base:
        return None
    names = git(ROOT, "diff", "--name-only", base.strip()) + git(ROOT, "ls-files", "--others", "--exclude-standard")
    return set(names.splitlines())


def is_in(name: str, places: Collection[str]) -> bool:
    """Whether a file is one of these, or lies in one of these folders."""
    return any(name == place or name.startswith(f"{place}/") for place in places)


def left_out(files: Iterable[str] | None) -> dict[str, list[str]]:
    """Groups of which none of these files is a part, and where their tests lie."""
    idle = {} if files is None else {k: v for k, v in GROUPS.items() if not any(is_in(name, v) for name in files)}
    return {name: [place for place in places if place.startswith("tests/")] for name, places in idle.items()}


def touched(files: Iterable[str] | None) -> list[str]:
    """Folders of tests of the rooms in which these files lie, and the pages' code; all where git cannot say."""
    if files is None:
        return ["tests"]
    parts = [Path(name.removeprefix("src/")).parts for name in files if name.startswith(("src/plumbob/", "tests/"))]
    rooms = {"docs", *(one[1] for one in parts if len(one) > 2)} - {"helpers", "gates"}
    return sorted(f"tests/{room}" for room in rooms if Path("tests", room).is_dir())


def gates(which: str, is_all: bool) -> tuple[dict, dict]:
    """Gates that read and gates that run, by name."""
    if which == "lint":
        return READERS, {}
    if which == "second":
        chosen = sorted(path.as_posix() for place in SECOND for path in Path().glob(place))
        tests = (path for path in sorted(Path("tests").rglob("test_*.py")) if not is_in(path.as_posix(), chosen))
        more = (str(path) for path in tests if RECORDED.search(path.read_text(encoding="utf-8")))
        return {"types": READERS["types"], "layers": READERS["layers"]}, {"tests": (*PYTEST, *chosen, *more)}
    if which == "long":
        places = ["tests"] if is_all else touched(changed(LAST))
        runs = {"long tests": (*PYTEST, "-m", "long or hypothesis", "--hypothesis-profile", "long", *places)}
        return {}, runs
    idle = {} if is_all else left_out(changed())
    for name, folders in idle.items():
        print(f"{name}: nothing of it changed, so {' and '.join(folders)} are left out; 'make test-all' runs them.")
    ignored = [f"--ignore={folder}" for folders in idle.values() for folder in folders]
    runs = {"tests": (*PYTEST, *ignored), "plain Python": (*PYTEST, "-q", *PLAIN)}
    if "page" not in idle and shutil.which("npm") and Path("web/node_modules").is_dir():
        runs["page"] = ("npm", "--prefix", "web", "--silent", "test")
    if which == "costs":
        return {}, {"tests": (*runs["tests"], "-p", "gates.costs")}
    return READERS, runs


def run(name, words, *, shown):
    """Run a gate, its output shown or kept; CPU time is that of the process and of all that it waited for."""
    started = time.monotonic()
    env = {**os.environ, "PLUMBOB_KERNELS": "python"} if name == "plain Python" else None
    with subprocess.Popen(words, env=env, stdout=None if shown else subprocess.PIPE, stderr=subprocess.STDOUT) as child:
        text = "" if shown else child.stdout.read().decode(errors="replace")
        _, status, used = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
    return Outcome(name, child.returncode, used.ru_utime + used.ru_stime, time.monotonic() - started, text)


def main(which="test", *options):
    """Run a set of gates; exit code 1 if one of them does not pass."""
    readers, runners = gates(which, "--all" in options)
    started, read = time.monotonic(), []
    reading = threading.Thread(target=lambda: read.extend(run(n, words, shown=False) for n, words in readers.items()))
    reading.start()
    outcomes = [run(name, words, shown=True) for name, words in runners.items()]
    reading.join()
    for outcome in read:
        if outcome.code:
            print(f"\n=== {outcome.name}\n{outcome.text}", end="")
    outcomes = read + outcomes
    print("\ngate           result    CPU s   min")
    for outcome in outcomes:
        result = "FAILED" if outcome.code else "passed"
        print(f"{outcome.name:14} {result:8} {outcome.cpu:6.0f} {outcome.wall / 60.0:5.1f}")
    minutes = (time.monotonic() - started) / 60.0
    print(f"together       {'':8} {sum(outcome.cpu for outcome in outcomes):6.0f} {minutes:5.1f}", flush=True)
    return int(any(outcome.code for outcome in outcomes))


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
