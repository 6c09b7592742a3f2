"""The figures of the house beside their budgets: how large it is, how far a reader walks, what nothing reaches.

Sources are read as syntax. Only the verbs run, each in a process of its own, on recordings that are simulated here, and
once before it counts, which compiles its kernels. How the figures are judged:

only pass on
    Modules with nothing but a docstring, imports and ``__all__``; the ``__init__`` of a package may be so, as its face.
small, one importer
    Modules of 60 lines at most that a single other one imports, so that they could be a part of it. A name that comes
    through a face counts for the module that defines it, and the face is not an importer of what it passes on.
entered
    Files of which a function is called while the verb imports or works, on any thread. Bodies of modules and classes,
    with the comprehensions in them, are not functions.
circles, arrows up
    Imports in functions count, those under TYPE_CHECKING do not; nor does that a module runs the ``__init__`` of each
    package that it lies in. Rooms are what lies directly in ``plumbob``, in the layers of ``pyproject.toml``.
lines of a function
    From ``def`` to its end without the docstring; methods and inner functions are functions too.
unreachable
    Functions and classes at the top of modules that nothing reaches from the command line, from what ``plumbob``
    offers, from what another face offers and the code in docs or README names, or from what that code imports. A name
    reaches what its module defines or imports by it; an attribute or a string of one word, also one in TOML, reaches
    everything of that name. So tests and benchmarks alone use what is listed; dead code with a living namesake is not.

Run: python benchmarks/house.py [--list], which names what is counted. It measures: a missed budget is no failure.
"""

import argparse
import ast
import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
import tomllib
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple, TypeVar

ROOT = Path(__file__).resolve().parent.parent
HOUSE = ROOT / "src" / "plumbob"
TEXTS = {".py", ".toml", ".md", ".bib"}
TABLES = {"__all__", "_HOME", "(__getattr__, __dir__)"}
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
SMALL, LONG = 60, 60
SENSORS = ("--frame", "NED", "--sensors", "mpu6000+hmc5983", "--rate", "100Hz", "--unit")
INPUTS: tuple[tuple[str, ...], ...] = (
    ("sim", "buoy", *SENSORS, "calibrated", "--duration", "60s", "--out", "sea.parquet"),
    ("sim", "static", *SENSORS, "random", "--duration", "600s", "--out", "rest.parquet"),
    ("sim", "poses", *SENSORS, "random", "--out", "poses.parquet"),
    ("emulate", "buoy", "--seed", "1", "--duration", "3s", "--write", "sea.bin"),
)
VERBS: tuple[tuple[str, tuple[str, ...], int], ...] = (  # 'eval' reads what 'run' wrote
    ("run", ("run", "sea.parquet", "--filter", "mekf", "--out", "track.parquet", "--force"), 25),
    ("eval", ("eval", "track.parquet", "sea.parquet"), 22),
    ("allan", ("allan", "rest.parquet"), 30),
    ("calibrate mag", ("calibrate", "mag", "poses.parquet", "--out", "card.json", "--force"), 30),
    ("decode", ("decode", "sea.bin", "--format", "buoy", "--out", "sea.csv", "--force"), 14),
)
PROBE = """
import inspect, json, sys, threading

called = set()

def note(frame, event, _):
    code = frame.f_code
    inner = frame.f_back if code.co_name in ("<listcomp>", "<dictcomp>", "<setcomp>", "<genexpr>") else frame
    if event == "call" and inner and inner.f_code.co_flags & inspect.CO_OPTIMIZED:
        called.add(code.co_filename)

threading.setprofile(note)
sys.setprofile(note)
from plumbob.cli.main import main
code = main(sys.argv[2:])
sys.setprofile(None)
with open(sys.argv[1], "w") as file:
    json.dump([sorted(called), sorted(name for name in sys.modules if name.split(".")[0] == "plumbob")], file)
sys.exit(code)
"""

T = TypeVar("T")
Unit = tuple[str, str]
"""A module, and a function or class in it; with '', the rest of the module."""


class Figure(NamedTuple):
    """A number, the most that it may be where there is such a budget, and what it counts."""

    what: str
    value: int
    budget: int | None = None
    names: Iterable[str] = ()


class Module:
    """A file of the package, as syntax; `taken` has what it imports, by the names here, and `seen` where from."""

    def __init__(self, path: Path) -> None:
        self.name = _name(path)
        self.is_face = path.name == "__init__.py"
        text = path.read_text("utf-8")
        self.lines = len(text.splitlines())
        self.body = ast.parse(text).body
        self.nodes = [node for one in self.body for node in ast.walk(one)]
        typing = {id(inner) for one in self.nodes if _is_typing(one) for inner in ast.walk(one)}
        imports = [one for one in self.nodes if isinstance(one, ast.ImportFrom) and _is_ours(one.module)]
        self.seen = {(str(one.module), a.name) for one in imports if id(one) not in typing for a in one.names}
        self.taken = {a.asname or a.name: (str(one.module), a.name) for one in imports for a in one.names}
        defined = (one for one in self.body if isinstance(one, (*FUNCTIONS, ast.ClassDef)))
        self.definitions = {one.name: one for one in defined if not one.name.startswith("__")}
        tables = {ast.unparse(one.targets[0]): one.value for one in self.body if isinstance(one, ast.Assign)}
        self.offers = ast.literal_eval(tables["__all__"]) if "__all__" in tables else []

    @property
    def passes_on(self) -> bool:
        return not self.is_face and all(_is_passing(one) for one in self.body)


def _name(path: Path) -> str:
    return ".".join(path.relative_to(HOUSE.parent).with_suffix("").parts).removesuffix(".__init__")


def _is_ours(module: str | None) -> bool:
    return str(module).split(".")[0] == "plumbob"


def _is_typing(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"


def _is_passing(node: ast.stmt) -> bool:
    said = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    return said or isinstance(node, ast.Import | ast.ImportFrom) or _is_typing(node) or _is_table(node)


def _is_table(node: ast.AST) -> bool:
    """Whether this lists what a face offers, which is not a use of it."""
    return isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) in TABLES


class House(dict[str, Module]):
    """Modules by name."""

    def __init__(self) -> None:
        super().__init__((module.name, module) for module in map(Module, sorted(HOUSE.rglob("*.py"))))

    def named(self, module: str, name: str) -> Unit:
        """What a module means by a name that another takes from it: a module in it, or its own."""
        inner = f"{module}.{name}"
        is_own = self[module].taken.get(name, (module, name)) != (module, name) or name in self[module].definitions
        return (inner, "") if inner in self and not is_own else (module, name)

    def home(self, module: str, name: str) -> Unit:
        """Where that is defined, past all faces."""
        module, name = self.named(module, name)
        return self.home(*self[module].taken[name]) if name in self[module].taken else (module, name)


def sizes(house: House) -> Iterator[Figure]:
    """How much there is."""
    yield Figure("Python files", len(house), 280)
    yield Figure("lines of Python", sum(one.lines for one in house.values()), 48_000)
    wheel = [path for folder in (HOUSE, ROOT / "docs") for path in folder.rglob("*") if path.suffix in TEXTS]
    yield Figure("lines of text in the wheel", sum(len(path.read_text("utf-8").splitlines()) for path in wheel))
    passing = [one.name for one in house.values() if one.passes_on]
    yield Figure("files that only pass on", len(passing), 0, passing)
    importers: dict[str, set[str]] = defaultdict(set)
    for one in house.values():
        for local, taken in one.taken.items():
            if not (one.is_face and local in one.offers):
                importers[house.home(*taken)[0]].add(one.name)
    few = {house[name]: by for name, by in sorted(importers.items()) if len(by) == 1 and house[name].lines <= SMALL}
    names = [f"{one.lines:3} lines  {one.name}  <- {min(by)}" for one, by in few.items() if not one.is_face]
    yield Figure(f"files of <= {SMALL} lines, one importer", len(names), None, names)


def walks() -> Iterator[Figure]:
    """How many files a verb enters, and how many modules one loads."""
    with tempfile.TemporaryDirectory() as folder:
        for words in INPUTS:
            _run(folder, "-m", "plumbob", *words)
        for verb, words, budget in VERBS:
            _run(folder, "-m", "plumbob", *words)
            _run(folder, "-c", PROBE, "probe.json", *words)
            called, modules = json.loads((Path(folder) / "probe.json").read_text())
            files = [_name(Path(one)) for one in called if Path(one).is_relative_to(HOUSE)]
            yield Figure(f"files entered by {verb}", len(files), budget, files)
            if verb == "run":
                yield Figure("modules loaded by run", len(modules), 110, modules)


def _run(folder: str, *words: str) -> None:
    command, places = [sys.executable, *words], {**os.environ, "PYTHONPATH": str(HOUSE.parent)}
    done = subprocess.run(command, cwd=folder, env=places, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(words[-8:])} ended with {done.returncode}:\n{done.stderr}")


def arrows(house: House) -> Iterator[Figure]:
    """Circles, and what looks up."""
    files = {(one.name, house.named(*seen)[0]) for one in house.values() for seen in one.seen}
    inside = [(a, b) for a, b in files if _room(a) != _room(b) and "" not in (_room(a), _room(b))]
    for what, pairs in (("files", files), ("rooms", [(_room(a), _room(b)) for a, b in inside])):
        rings = [", ".join(ring) for ring in _circles(pairs)]
        yield Figure(f"circles of {what}", len(rings), 0, rings)
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    layers = settings["tool"]["importlinter"]["contracts"][0]["layers"]
    depth = {_room(room): at for at, layer in enumerate(layers) for room in re.findall(r"[\w.]+", layer)}
    apart = {_room(room) for layer in layers if "|" in layer for room in re.findall(r"[\w.]+", layer)}
    known = [(a, b, depth[_room(a)] - depth[_room(b)]) for a, b in inside if {_room(a), _room(b)} <= depth.keys()]
    up = sorted(f"{a} -> {b}" for a, b, rise in known if rise > 0 or (rise == 0 and _room(a) in apart))
    yield Figure("arrows up, or to a sibling", len(up), 0, up)


def _room(name: str) -> str:
    """What a module lies in directly below the package; the package itself, in nothing."""
    return "".join(name.split(".")[1:2])


def _circles(pairs: Iterable[tuple[str, str]]) -> list[list[str]]:
    """Sets of which each comes to all others along the arrows."""
    ahead: dict[str, set[str]] = defaultdict(set)
    for a, b in pairs:
        ahead[a].add(b)
    reach = {one: _reached(ahead, there) for one, there in ahead.items()}
    rings = {frozenset(b for b in there if one in reach.get(b, ())) for one, there in reach.items()}
    return sorted(sorted(ring) for ring in rings if len(ring) > 1)


def _reached(ahead: Mapping[T, set[T]], start: Iterable[T]) -> set[T]:
    seen: set[T] = set()
    todo = set(start)
    while todo:
        seen.add(one := todo.pop())
        todo |= ahead.get(one, set()) - seen
    return seen


def functions(house: House) -> Iterator[Figure]:
    """How long functions are."""
    nodes = [(one.name, node) for one in house.values() for node in one.nodes if isinstance(node, FUNCTIONS)]
    found = sorted((_lines(node) - _said(node), f"{module}.{node.name}") for module, node in nodes)
    lengths = [length for length, _ in found]
    long = [f"{length:3} lines  {name}" for length, name in found if length > LONG]
    yield Figure("lines of a function: median", statistics.median_high(lengths), 7)
    yield Figure("lines of a function: 95th percentile", lengths[len(lengths) * 95 // 100], 25)
    yield Figure("lines of a function: longest", lengths[-1], LONG, long)


def _lines(node: ast.stmt) -> int:
    return (node.end_lineno or node.lineno) - node.lineno + 1


def _said(node: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    return 0 if ast.get_docstring(node) is None else _lines(node.body[0])


def unreachable(house: House) -> Figure:
    """What nothing reaches, and whole modules where that is all of them."""
    units: dict[Unit, list[ast.stmt]] = {}
    for one in house.values():
        units |= {(one.name, name): [node] for name, node in one.definitions.items()}
        own = one.definitions.values()
        units[one.name, ""] = [node for node in one.body if node not in own and not _is_table(node)]
    words: dict[str, set[Unit]] = defaultdict(set)
    for module, name in units:
        words[name or module.rpartition(".")[2]].add((module, name))
    ahead = {unit: set(_uses(house, words, unit, nodes)) for unit, nodes in units.items()}
    dead = units.keys() - _reached(ahead, _doors(house, words))
    whole = [(house[module].lines, module) for module, name in dead if not name]
    parts = [(_lines(units[m, name][0]), f"{m}.{name}") for m, name in dead if name and (m, "") not in dead]
    found = sorted(whole + parts, reverse=True)
    return Figure("unreachable lines", sum(n for n, _ in found), 0, [f"{n:4} lines  {name}" for n, name in found])


def _doors(house: House, words: Mapping[str, set[Unit]]) -> Iterator[Unit]:
    yield from (("plumbob.__main__", ""), ("plumbob.cli.main", "main"))
    written = (
        path for path in (ROOT / "docs").glob("*.md") if path.name != "equations.md"
    )  # which is made of the code
    pages = "".join(path.read_text("utf-8") for path in (ROOT / "README.md", *written))
    documented = set(re.findall(r"\w+", " ".join(re.findall(r"```.*?```|`[^`]+`", pages, re.DOTALL))))
    for face in (one for one in house.values() if one.is_face):
        offered = set(face.offers) if face.name == "plumbob" else documented & set(face.offers)
        yield from (house.home(face.name, name) for name in offered)
    for module, names in re.findall(r"^from (plumbob[\w.]*) import ([\w, ]+)", pages, re.MULTILINE):
        yield from (house.home(module, name) for name in names.split(", "))
    for path in HOUSE.rglob("*.toml"):
        yield from (unit for word in re.findall(r'"(\w+)"', path.read_text("utf-8")) for unit in words.get(word, ()))


def _uses(house: House, words: Mapping[str, set[Unit]], unit: Unit, nodes: list[ast.stmt]) -> Iterator[Unit]:
    """The rest of its own module and its package, and what it names."""
    one = house[unit[0]]
    yield from ((one.name, ""), (one.name.rpartition(".")[0], ""))
    for node in (inner for whole in nodes for inner in ast.walk(whole)):
        if isinstance(node, ast.ImportFrom) and _is_ours(node.module):
            yield str(node.module), ""
        elif isinstance(node, ast.Name) and node.id in one.taken:
            yield house.home(*one.taken[node.id])
        elif isinstance(node, ast.Name) and node.id in one.definitions:
            yield one.name, node.id
        elif isinstance(node, ast.Attribute):
            yield from words.get(node.attr, ())
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            said = re.fullmatch(r"[\w.]+", node.value) or "from plumbob" in node.value
            yield from (used for word in re.findall(r"\w+", node.value) if said for used in words.get(word, ()))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--list", action="store_true", help="name what each figure counts")
    args = parser.parse_args()
    house = House()
    print(f"{'figure':40}{'value':>8}{'budget':>8}")
    for what, value, budget, names in (*sizes(house), *walks(), *arrows(house), *functions(house), unreachable(house)):
        verdict = "" if budget is None else f"{budget:8}  {'met' if value <= budget else 'missed'}"
        print(f"{what:40}{value:8}{verdict}")
        for name in names if args.list else ():
            print(f"    {name}")


if __name__ == "__main__":
    main()
