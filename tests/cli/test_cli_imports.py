"""What each verb may import: a run on a Parquet file pays for no serial port, plot or simulator.

Each verb runs on a small real input in a process of its own, forked from one that has imported nothing but the command
line. A verb that calls a kernel counts as one that imports `kernels`.
"""

import json
import os
import subprocess
import sys

import pytest

from plumbob.cli.verbs import VERBS
from tests.helpers import beside
from tests.helpers.commandline import table_of

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="the system cannot fork")

PACKAGES = ("h5py", "jinja2", "lz4", "matplotlib", "mcap", "numpy", "pandas", "pyarrow", "pygeomag", "rich", "scipy",
            "serial", "zstandard")  # fmt: skip
ROOMS = ("live.transports.serial_line", "live.transports.sockets", "live.timing.timebase", "calibration",
         "data.cards.calibration", "evaluation", "fleet.experiments", "files.mcap", "filters",
         "noise", "protocols", "reporting.drawing", "live.stream", "simulation",
         "live.rigs.rig")  # fmt: skip
PARTS = ("scipy.fft", "scipy.interpolate", "scipy.io", "scipy.optimize", "scipy.signal", "scipy.special", "scipy.stats",
         "pyarrow.csv", "pyarrow.parquet")  # fmt: skip
"""What is looked for: packages, parts of packages, and rooms of this one."""

PROBE = """
import gc, importlib, json, os, sys, traceback
from plumbob.cli.main import main

packages, rooms, parts, stages = json.load(sys.stdin)

def found():
    known = {m for m in sys.modules if m in packages or m in parts}
    known |= {m.removeprefix("plumbob.") for m in sys.modules if m.removeprefix("plumbob.") in rooms}
    door = sys.modules.get("plumbob.core.kernels")
    called = door and any(isinstance(k, door.Kernel) and k._compiled for k in gc.get_objects())
    return sorted(known | ({"kernels"} if called else set()))

def forked(work):  # what a process makes of its work, as JSON
    back, out = os.pipe()
    if os.fork() == 0:
        os.write(out, json.dumps(work()).encode())
        os._exit(0)
    os.close(out)
    answer = json.loads(open(back, "rb").read())
    os.wait()
    return answer

def run(words):
    with open("said.txt", "w") as said:
        os.dup2(said.fileno(), 1)
        os.dup2(said.fileno(), 2)
        try:
            code = main(words)
        except SystemExit as end:
            code = end.code or 0
        except BaseException:
            code = traceback.format_exc()
    return code, found()

def stage(modules, lines):  # that may all import these modules, which are imported once
    for module in modules:
        importlib.import_module(module)
    return {line: forked(lambda: run(line.split())) for line in lines}

told = {}
for modules, lines in stages:
    told |= forked(lambda: stage(modules, lines))
print(json.dumps(told))
"""

SETS = {
    "PARQUET": "numpy pyarrow pyarrow.parquet",
    "READ": "PARQUET filters",  # to open a recording, whose room imports what all filters share
    "SIMULATED": "PARQUET data.cards.calibration simulation kernels",
    "DRAWN": "matplotlib reporting.drawing scipy scipy.fft scipy.special",
    "RUN": "READ evaluation kernels",
    "FITS": "scipy scipy.fft scipy.interpolate scipy.optimize scipy.special",
    "VIEW": "live.timing.timebase calibration data.cards.calibration files.mcap filters mcap numpy protocols "
    "live.stream lz4 zstandard",
}
SENSORS = "--frame NED --sensors mpu6000+hmc5983 --unit"
LINES = beside(__file__, "imports.txt")
"""A command line, and what it may import. Each may read what those above it wrote, and of the stages before its own."""
STAGES = (["numpy"], ["numpy", "pyarrow.parquet", "plumbob.filters"], [])
"""What is imported before a line, of the largest that the line may import; lines that may import nothing run last."""


def allowed(words):
    """Names that a cell lists, and those of the sets in it."""
    return {name for word in words.split() for name in (allowed(SETS[word]) if word in SETS else {word})}


LISTED = {line: allowed(names) for line, names in table_of(LINES.replace("SENSORS", SENSORS))}


def stage_of(line):
    """Number of the largest stage of which a line may import everything."""
    fits = [n for n, names in enumerate(STAGES) if {name.removeprefix("plumbob.") for name in names} <= LISTED[line]]
    return max(fits, key=lambda n: len(STAGES[n]))


EVERYTHING = {"benchmark", "demo", "reproduce"}
"""Verbs whose task is to try all there is."""


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    """Exit code, and what was found, of every line; with a pandas that can be imported, which Arrow then would."""
    folder, bait = tmp_path_factory.mktemp("imports"), tmp_path_factory.mktemp("bait") / "pandas"
    bait.mkdir()
    (bait / "__init__.py").write_text('__version__ = "0.0"\n')
    path = os.pathsep.join([str(bait.parent), *filter(None, [os.environ.get("PYTHONPATH")])])
    staged = [(names, [line for line in LISTED if stage_of(line) == n]) for n, names in enumerate(STAGES)]
    given = json.dumps([PACKAGES, ROOMS, PARTS, staged])
    done = subprocess.run(
        [sys.executable, "-c", PROBE], input=given, cwd=folder, text=True,
        env={**os.environ, "PYTHONPATH": path}, capture_output=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.parametrize("line", LISTED)
def test_a_verb_imports_only_what_it_uses(told, line):
    code, found = told[line]
    assert code == (1 if " none." in line or "control" in line else 0)
    extra = sorted(set(found) - LISTED[line])
    assert not extra, (
        f"'plumbob {line}' imports {', '.join(extra)}, which it did not before. Import it where it is used; "
        "if the verb does need it, add it to what the verb may import."
    )


def test_every_verb_is_listed():
    assert {line.split()[0] for line in LISTED if line != "--help"} | EVERYTHING == VERBS.keys()
