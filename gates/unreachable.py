"""What nothing reaches: functions and classes at the top of modules that only tests and benchmarks use, if any.

Reached is what the command line, what ``plumbob`` offers, and what another face offers and the code of docs or README
names come to. A name reaches what its module defines or imports by it; an attribute or a string of one word, also one
in TOML, reaches everything of that name. So dead code with a living namesake is not seen.
"""

import ast
import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TypeVar

TABLES = {"__all__", "_HOME", "(__getattr__, __dir__)"}
DEFINITIONS = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef
T = TypeVar("T")
Unit = tuple[str, str]
"""A module, and a function or class in it; with '', the rest of the module."""


class Module:
    """A file of the package: what it defines, what it takes from others, and what it offers."""

    def __init__(self, file: str, body: Sequence[ast.stmt], nodes: Sequence[ast.AST]) -> None:
        self.file, self.body = file, body
        self.is_face = file.endswith("__init__.py")
        imports = [node for node in nodes if isinstance(node, ast.ImportFrom) and is_ours(node.module)]
        self.taken = {
            alias.asname or alias.name: (str(one.module), alias.name) for one in imports for alias in one.names
        }
        defined = (node for node in body if isinstance(node, DEFINITIONS) and not node.name.startswith("__"))
        self.definitions = {node.name: node for node in defined}
        tables = {ast.unparse(node.targets[0]): node.value for node in body if isinstance(node, ast.Assign)}
        self.offers: list[str] = ast.literal_eval(tables["__all__"]) if "__all__" in tables else []


class House(dict[str, Module]):
    """Modules by name."""

    def home(self, module: str, name: str) -> Unit:
        """Where that is defined which a module means by a name: a module in it, its own, or past all faces."""
        inner, one = f"{module}.{name}", self[module]
        is_own = one.taken.get(name, (module, name)) != (module, name) or name in one.definitions
        if inner in self and not is_own:
            return inner, ""
        return self.home(*one.taken[name]) if name in one.taken else (module, name)


def is_ours(module: str | None) -> bool:
    """Whether an import is of the package."""
    return str(module).split(".")[0] == "plumbob"


def unreachable(root: Path, house: House) -> dict[str, int]:
    """Lines by file and name that nothing reaches."""
    units: dict[Unit, list[ast.stmt]] = {}
    for module, one in house.items():
        units |= {(module, name): [node] for name, node in one.definitions.items()}
        own = one.definitions.values()
        units[module, ""] = [node for node in one.body if node not in own and not _is_table(node)]
    words: dict[str, set[Unit]] = defaultdict(set)
    for module, name in units:
        words[name or module.rpartition(".")[2]].add((module, name))
    doors = _doors(root, house, words)
    reached = closure(doors, lambda unit: _uses(house, words, unit, units[unit]) if unit in units else ())
    dead = {unit: nodes for unit, nodes in units.items() if unit not in reached and unit[1]}
    return {f"{house[m].file}:{name}": sum(map(lines, nodes)) for (m, name), nodes in dead.items()}


def closure(start: Iterable[T], following: Callable[[T], Iterable[T]]) -> set[T]:
    """All that these come to, themselves among them."""
    reached: set[T] = set()
    todo = list(start)
    while todo:
        place = todo.pop()
        if place not in reached:
            reached.add(place)
            todo.extend(following(place))
    return reached


def lines(node: ast.stmt) -> int:
    """How many lines a statement has."""
    return (node.end_lineno or node.lineno) - node.lineno + 1


def _is_table(node: ast.AST) -> bool:
    """Whether this lists what a face offers, which is not a use of it."""
    return isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) in TABLES


def _doors(root: Path, house: House, words: Mapping[str, set[Unit]]) -> Iterator[Unit]:
    yield from (("plumbob.__main__", ""), ("plumbob.cli.main", "main"))
    written = [root / "README.md", *(root / "docs").glob("*.md")]  # equations.md is made of the code
    pages = "".join(path.read_text("utf-8") for path in written if path.is_file() and path.name != "equations.md")
    documented = set(re.findall(r"\w+", " ".join(re.findall(r"```.*?```|`[^`]+`", pages, re.DOTALL))))
    for name, face in house.items():
        if face.is_face:
            offered = set(face.offers) if name == "plumbob" else documented & set(face.offers)
            yield from (house.home(name, one) for one in offered)
    for module, names in re.findall(r"^from (plumbob[\w.]*) import ([\w, ]+)", pages, re.MULTILINE):
        yield from (house.home(module, name) for name in names.split(", ") if module in house)
    for path in (root / "src").rglob("*.toml"):
        yield from (unit for word in re.findall(r'"(\w+)"', path.read_text("utf-8")) for unit in words.get(word, ()))


def _uses(house: House, words: Mapping[str, set[Unit]], unit: Unit, nodes: list[ast.stmt]) -> Iterator[Unit]:
    """The rest of its own module and its package, and what it names."""
    one = house[unit[0]]
    yield from ((unit[0], ""), (unit[0].rpartition(".")[0], ""))
    for node in (inner for whole in nodes for inner in ast.walk(whole)):
        if isinstance(node, ast.ImportFrom) and is_ours(node.module):
            yield str(node.module), ""
        elif isinstance(node, ast.Name) and node.id in one.taken:
            yield house.home(*one.taken[node.id])
        elif isinstance(node, ast.Name) and node.id in one.definitions:
            yield unit[0], node.id
        elif isinstance(node, ast.ClassDef):  # a result has its description under its name, core/result.py
            yield from words.get(node.name.lower(), ())
        elif isinstance(node, ast.Attribute):
            yield from words.get(node.attr, ())
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            named = re.fullmatch(r"[\w.]+", node.value) or "from plumbob" in node.value
            yield from (used for word in re.findall(r"\w+", node.value) if named for used in words.get(word, ()))
