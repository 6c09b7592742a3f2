"""Every gate of the project, each whatever the others say, and what they cost.

``make test`` runs all of them, ``make lint`` those that only read. Those run beside the tests, which leave a core idle
now and then; what they say comes last.
"""

import os
import shutil
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import NamedTuple

BIN = Path(sys.executable).parent
CODE = ("src", "tests", "benchmarks", "examples", "website")
PYTEST = (sys.executable, "-m", "pytest", "-n", os.environ.get("JOBS", "2"), "--dist", "worksteal")
READERS = {
    "format": (BIN / "ruff", "format", "--check", *CODE),
    "lint": (BIN / "ruff", "check", *CODE),
    "types": (BIN / "mypy",),
    "layers": (BIN / "lint-imports",),
    "house": (sys.executable, "-m", "tests.gates.house"),
}
RUNNERS = {
    "tests": PYTEST,
    # the kernels as plain Python: what no other gate compares with the compiled ones
    "plain Python": (*PYTEST, "-q", "tests/rotations", "tests/calibration/test_calibration_ellipsoid_fit.py"),
}
if shutil.which("npm") and Path("web/node_modules").is_dir():
    RUNNERS["page"] = ("npm", "--prefix", "web", "--silent", "test")
# The smoother's recordings take hours as plain Python; its sweeps, which are what is compiled, take a minute.
SMOOTHED = [f"--ignore=tests/filters/smoother/test_smoother_{name}.py" for name in ("behaviour", "claims", "door")]
LONG = {
    "long tests": (*PYTEST, "-m", "long or hypothesis", "--hypothesis-profile", "long"),
    "plain Python": (*PYTEST, "-q", "tests/filters", *SMOOTHED, "tests/rotations", "tests/noise", "tests/protocols",
                     "tests/calibration/test_calibration_ellipsoid_fit.py",
                     "tests/calibration/test_calibration_autocorrelation.py"),
}  # fmt: skip
SETS = {"test": (READERS, RUNNERS), "lint": (READERS, {}), "long": ({}, LONG)}


class Outcome(NamedTuple):
    """What a gate came to."""

    name: str
    code: int
    cpu: float
    wall: float
    text: str


def run(name, words, *, shown):
    """Run a gate, its output shown or kept; CPU time is that of the process and of all that it waited for."""
    started = time.monotonic()
    env = {**os.environ, "NUMBA_DISABLE_JIT": "1"} if name == "plain Python" else None
    with subprocess.Popen(words, env=env, stdout=None if shown else subprocess.PIPE, stderr=subprocess.STDOUT) as child:
        text = "" if shown else child.stdout.read().decode(errors="replace")
        _, status, used = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
    return Outcome(name, child.returncode, used.ru_utime + used.ru_stime, time.monotonic() - started, text)


def main(which="test"):
    """Run a set of gates; exit code 1 if one of them does not pass."""
    readers, runners = SETS[which]
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
