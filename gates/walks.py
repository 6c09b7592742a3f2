"""How far a reader walks with a verb: the functions that its second run in one process enters, and how deep.

``python gates/walks.py [FOLDER]`` prints, as JSON, for each walk its depth and the functions entered. FOLDER is a
checkout; that of this file without one. Bodies of modules, classes and comprehensions are not functions; compiled
kernels count as what is called from Python. Recordings are simulated, so that the walks need no data.
"""

import contextlib
import io
import json
import os
import sys
import tempfile
import threading
import warnings
from pathlib import Path

SENSORS = ("--frame", "NED", "--sensors", "mpu6000+hmc5983", "--rate", "100Hz", "--unit")
INPUTS = (
    ("sim", "buoy", *SENSORS, "calibrated", "--duration", "60s", "--out", "sea.parquet"),
    ("sim", "static", *SENSORS, "random", "--duration", "600s", "--out", "rest.parquet"),
    ("sim", "poses", *SENSORS, "random", "--out", "poses.parquet"),
    ("emulate", "buoy", "--seed", "1", "--duration", "3s", "--write", "sea.bin"),
)
WALKS = {  # 'eval' reads what 'run' wrote
    "run_smoother": ("run", "sea.parquet", "--filter", "smoother", "--out", "smoothed.parquet", "--force"),
    "run_mahony": ("run", "sea.parquet", "--filter", "mahony", "--out", "track.parquet", "--force"),
    "allan": ("allan", "rest.parquet"),
    "calibrate_mag": ("calibrate", "mag", "poses.parquet", "--out", "card.json", "--force"),
    "eval": ("eval", "track.parquet", "sea.parquet"),
    "report": ("report", "sea.parquet", "--out", "sea.html", "--force"),
    "decode": ("decode", "sea.bin", "--format", "buoy", "--out", "sea.csv", "--force"),
}
UNNAMED = {"<module>", "<listcomp>", "<dictcomp>", "<setcomp>", "<genexpr>"}


class Walk:
    """What a run enters, and how many functions of the package stand on each other at most."""

    def __init__(self, package: str) -> None:
        self.package, self.entered, self.depth = package + os.sep, set(), 0
        self._codes = {}

    def _is_function(self, code) -> bool:
        inside = self._codes.get(code)
        if inside is None:
            optimized = bool(code.co_flags & 1)  # inspect.CO_OPTIMIZED, which a body of a class lacks
            inside = code.co_filename.startswith(self.package) and code.co_name not in UNNAMED and optimized
            self._codes[code] = inside
            if inside:
                self.entered.add(f"{code.co_filename.removeprefix(self.package)}:{code.co_qualname}")
        return inside

    def note(self, frame, event, _) -> None:
        """Profile of one thread; a generator that goes on counts as a call."""
        if event == "call" and self._is_function(frame.f_code):
            depth, outer = 0, frame
            while outer is not None:
                depth += self._is_function(outer.f_code) if outer.f_code in self._codes else 0
                outer = outer.f_back
            self.depth = max(self.depth, depth)


def main(root: str = "") -> None:
    """Simulate, run each walk twice, and print what the second one enters."""
    source = Path(root or Path(__file__).parents[1]).resolve() / "src"
    sys.path.insert(0, str(source))
    from plumbob.cli import main as command

    found = {}
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder), warnings.catch_warnings(action="ignore"):
        for words in INPUTS:
            _run(command.main, words)
        for name, words in WALKS.items():
            if name == "report" and not has_pages(source):
                print("The walk 'report' is left out: the pages are not built ('make page').", file=sys.stderr)
                continue
            _run(command.main, words)
            walk = Walk(str(source / "plumbob"))
            threading.setprofile(walk.note)
            sys.setprofile(walk.note)
            try:
                _run(command.main, words)
            finally:
                sys.setprofile(None)
                threading.setprofile(None)
            found[name] = {"depth": walk.depth, "entered": sorted(walk.entered)}
    print(json.dumps(found))


def has_pages(source: Path) -> bool:
    """Whether the script of reports is built, which needs Node; without Plumbob's own room of reports nothing does."""
    return (source / "plumbob/web/report.js").is_file() or not (source / "plumbob/overview").is_dir()


def _run(command, words) -> None:
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()) as said:
        code = command(list(words))
    if code:
        sys.exit(f"plumbob {' '.join(words)} ended with {code}:\n{said.getvalue()}")


if __name__ == "__main__":
    main(*sys.argv[1:])
