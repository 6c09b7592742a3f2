"""Whether tests fail by chance: three runs of all of them beside four busy loops, and one in random order.

``make loaded`` (BUSY=2 RUNS=1 SEED=7 for others). A plugin too: ``pytest -p gates.loaded --seed 7`` takes files in
random order, and the tests of each.
"""

import os
import random
import subprocess
import sys
import time

from gates import PYTEST

BUSY = (sys.executable, "-c", "while True: pass")


def pytest_addoption(parser):
    """Take the seed of an order."""
    parser.addoption("--seed", type=int, default=None, help="take files, and the tests of each, in a random order")


def pytest_collection_modifyitems(config, items):
    """Shuffle; a file's tests stay together, as its fixtures do."""
    seed = config.getoption("--seed")
    if seed is not None:
        order = random.Random(seed)
        files = {item.path: order.random() for item in items}
        items.sort(key=lambda item: (files[item.path], order.random()))


def run(title, busy, *words):
    """Run all tests beside some busy loops; print what failed, and return how many."""
    started = time.monotonic()
    loops = [subprocess.Popen(BUSY) for _ in range(busy)]
    try:
        done = subprocess.run(
            [*PYTEST, "-q", "-rfE", "-p", "no:cacheprovider", *words], capture_output=True, text=True, check=False
        )
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()
    failed = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    last = done.stdout.rstrip().rpartition("\n")[2]
    print(f"{title}: {last} ({(time.monotonic() - started) / 60.0:.1f} min)", *failed, sep="\n    ", flush=True)
    return len(failed) or done.returncode


def main():
    """Run them all; exit code 1 if a test failed in any."""
    busy, runs, seed = (int(os.environ.get(name, usual)) for name, usual in (("BUSY", 4), ("RUNS", 3), ("SEED", 1)))
    failures = [run(f"beside {busy} busy loops, {number + 1} of {runs}", busy) for number in range(runs)]
    failures.append(run(f"random order, seed {seed}", 0, "-p", "gates.loaded", "--seed", str(seed)))
    print(f"failures: {sum(failures)}")
    return int(any(failures))


if __name__ == "__main__":
    sys.exit(main())
