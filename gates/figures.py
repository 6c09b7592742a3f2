"""Figures of the house, read from sources as syntax: its size, its names, its texts, and its circles of imports.

Each figure is a number by file, so that what raised it can be named. Circles count all imports, in functions and for
types alone too; that a package's ``__init__`` runs before each of its modules is not an import of theirs.
"""

import ast
import re
import warnings
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from gates.unreachable import House, Module, closure, is_ours, lines, unreachable

CODE = ("src", "tests", "benchmarks", "gates")
SUBJECTS = ("noise", "evaluation", "quality", "calibration", "filters")
"""Rooms of the library of which no file should come to what reads files, draws pages or listens to lines."""
# Words of which the issue of names says that they give the grammar and not the content.
VAGUE = {"found", "one", "known", "told", "left", "own", "whole", "seen", "kept", "asked"}
VAGUE_FUNCTIONS = {"told", "whole", "held", "turned", "followed", "beside", "of", "at"} | VAGUE
TEXTS = {
    "stdout",
    "stderr",
    "out",
    "err",
    "text",
    "notes",
    "remarks",
    "str",
    "repr",
    "refused",
    "refusal",
    "splitlines",
}
TEXT_METHODS = {"startswith", "endswith", "search", "match", "fullmatch", "issubset"}
PUBLIC_UNDERSCORED = {"_replace", "_fields", "_asdict", "_field_defaults", "_make", "_repr_html_", "_repr_mimebundle_"}
Nodes = Sequence[ast.AST]  # all of a file
Figure = dict[str, int]  # how much of a figure each file has


def figures(root: Path) -> dict[str, Figure]:
    """All of them, by the key that they have in house.toml."""
    sources = {path.relative_to(root).as_posix(): path for top in CODE for path in sorted((root / top).rglob("*.py"))}
    found: dict[str, Figure] = defaultdict(dict)
    package: dict[str, list[ast.AST]] = {}
    ahead: dict[str, list[tuple[str, str]]] = {}
    house = House()
    for name, path in sources.items():
        text = path.read_text(encoding="utf-8")
        for place in places(name):
            found[f"lines.{place}"][name] = len(text.splitlines())
            found[f"files.{place}"][name] = 1
        if name.startswith(("benchmarks/", "gates/")):
            continue
        with warnings.catch_warnings(action="ignore"):
            module = ast.parse(text)
        nodes = list(ast.walk(module))
        if name.startswith("src/"):
            package[name] = nodes
            house[_module(name)] = Module(name, module.body, nodes)
            ahead[_module(name)] = list(imports(nodes))
            found["functions.longer_than_60_lines"][name] = sum(map(is_long, functions(nodes)))
            found["names.vague"][name] = sum(1 for _ in vague(nodes))
            found["names.vague_functions"][name] = sum(1 for _ in vague_functions(nodes))
            found["text.strings_of_three_words"][name] = sum(1 for _ in sentences(nodes))
        else:
            found["tests.private"][name] = sum(1 for _ in private(nodes))
            found["tests.imports_of_tests"][name] = sum(1 for _ in imported_tests(nodes))
            found["tests.wording_alone"][name] = sum(map(is_wording, functions(nodes)))
    found["names.classes_of_one_name"] = twins(package)
    found["circles.files"] = circles(package)
    for subject in SUBJECTS:
        reached = closure(
            (module for module in house if module.startswith(f"plumbob.{subject}.")),
            lambda module: (house.home(*one)[0] for one in ahead.get(module, ()) if one[0] in house),
        )
        files = [house[module].file for module in reached if module in house]
        found[f"closures.{subject}"] = {file: found["lines.src"][file] for file in files}
    found["functions.unreachable_lines"] = unreachable(root, house)
    return dict(found)


def places(name: str) -> Iterator[str]:
    """Where a file counts: in its top folder, and of src in its room too."""
    parts = name.split("/")
    yield parts[0]
    if parts[0] == "src":
        yield parts[2] if len(parts) > 3 else "front_door"


def functions(nodes: Nodes) -> Iterator[ast.FunctionDef | ast.AsyncFunctionDef]:
    """Each function and method."""
    yield from (node for node in nodes if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef))


def is_long(node: ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
    """Whether a function has more than 60 lines without its docstring."""
    return lines(node) - (lines(node.body[0]) if ast.get_docstring(node, clean=False) is not None else 0) > 60


def vague(nodes: Nodes) -> Iterator[str]:
    """Variables and arguments that are called by a word that says nothing of them."""
    for node in nodes:
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store) and node.id.strip("_") in VAGUE:
            yield node.id
        elif isinstance(node, ast.arg) and node.arg.strip("_") in VAGUE:
            yield node.arg


def vague_functions(nodes: Nodes) -> Iterator[str]:
    """Functions that are a bare participle or preposition, or end in one."""
    for node in functions(nodes):
        bare = node.name.strip("_")
        if bare in VAGUE_FUNCTIONS or bare.endswith("_of"):
            yield node.name


def twins(package: Mapping[str, Nodes]) -> Figure:
    """Classes whose name another class has, each file's."""
    named = [(node.name, name) for name, nodes in package.items() for node in nodes if isinstance(node, ast.ClassDef)]
    times = Counter(title for title, _ in named)
    return dict(Counter(name for title, name in named if times[title] > 1))


def sentences(nodes: Nodes) -> Iterator[str]:
    """Strings of three words or more, no docstrings nor types; the constant parts of an f-string are one string."""
    said = {id(getattr(node, of, None)) for node in nodes for of in ("annotation", "returns")}
    said |= {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
    inner = {
        id(part) for node in nodes if isinstance(node, ast.JoinedStr) for part in ast.walk(node) if part is not node
    }
    for node in nodes:
        if id(node) in said or id(node) in inner:
            continue
        if isinstance(node, ast.JoinedStr):
            text = " ".join(part.value for part in node.values if isinstance(part, ast.Constant))
        else:
            text = node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else ""
        if len(re.findall(r"[^\W\d_]{2,}", text)) >= 3:
            yield text


def imports(nodes: Nodes) -> Iterator[tuple[str, str]]:
    """What a file takes from the package as it runs, in functions too: module and name."""
    for_types = {
        id(inner) for node in nodes if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
        for inner in ast.walk(node)
    }  # fmt: skip
    for node in nodes:
        if isinstance(node, ast.ImportFrom) and is_ours(node.module) and id(node) not in for_types:
            yield from ((str(node.module), alias.name) for alias in node.names)


def private(nodes: Nodes) -> Iterator[str]:
    """What a test takes from inside another's object or module: attributes, imports, and names given to monkeypatch."""
    for node in nodes:
        if isinstance(node, ast.Attribute):
            own = isinstance(node.value, ast.Name) and node.value.id in {"self", "cls"}
            names = [] if own else [node.attr]
        elif isinstance(node, ast.ImportFrom):
            names = [part for alias in node.names for part in (alias.name, *str(node.module).split("."))]
        elif isinstance(node, ast.Call) and called(node) in {"setattr", "getattr", "delattr"}:
            words = (arg.value for arg in node.args[:2] if isinstance(arg, ast.Constant) and isinstance(arg.value, str))
            names = [word.split(".")[-1] for word in words]
        else:
            continue
        yield from (name for name in names if re.match(r"_[a-zA-Z]", name) and name not in PUBLIC_UNDERSCORED)


def called(node: ast.Call) -> str:
    """Last name of what is called."""
    return node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")


def imported_tests(nodes: Nodes) -> Iterator[str]:
    """Names that are imported from a file of tests."""
    for node in nodes:
        if isinstance(node, ast.ImportFrom) and str(node.module).startswith("tests"):
            yield from (alias.name for alias in node.names if "test_" in f"{node.module}.{alias.name}")


def is_wording(node: ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
    """Whether a test checks texts alone: each assertion is about text, each expected error is matched."""
    if not node.name.startswith("test_"):
        return False
    asserted = [inner.test for inner in ast.walk(node) if isinstance(inner, ast.Assert)]
    calls = [inner for inner in ast.walk(node) if isinstance(inner, ast.Call)]
    names = list(map(called, calls))
    raises = [call for call, name in zip(calls, names, strict=True) if name in {"raises", "warns"}]
    matched = all(any(word.arg == "match" for word in call.keywords) for call in raises)
    refusals = raises or any(name.startswith(("refuse", "says", "said")) for name in names)
    numbers = any(name.startswith("assert_") for name in names)
    return matched and bool(asserted or refusals) and not numbers and all(map(_on_text, asserted))


def _on_text(test: ast.expr) -> bool:
    match test:
        case ast.BoolOp(values=values):
            return all(map(_on_text, values))
        case ast.UnaryOp(operand=operand):
            return _on_text(operand)
        case ast.Compare(left=left, comparators=others):
            return any(map(_is_text, [left, *others]))
        case ast.Call(func=ast.Name(id="all" | "any"), args=[ast.GeneratorExp(elt=inner)]):
            return _on_text(inner)
        case ast.Call(func=ast.Attribute(attr=name)):
            return name in TEXT_METHODS
    return False


def _is_text(node: ast.expr) -> bool:
    match node:
        case ast.JoinedStr() | ast.Constant(value=str()):
            return True
        case ast.Tuple(elts=parts) | ast.List(elts=parts) | ast.Set(elts=parts):
            return bool(parts) and all(map(_is_text, parts))
        case ast.BinOp(left=left, right=right):
            return _is_text(left) or _is_text(right)
        case ast.Attribute(attr=name) | ast.Call(func=ast.Attribute(attr=name) | ast.Name(id=name)):
            return name in TEXTS
        case ast.Subscript(value=value):
            return _is_text(value)
    return False


def circles(package: Mapping[str, Nodes]) -> Figure:
    """Sets of files of which each comes to all others along imports; a set stands under its first file."""
    modules = {_module(name): name for name in package}
    ahead: dict[str, set[str]] = defaultdict(set)
    for name, nodes in package.items():
        for node in nodes:
            if isinstance(node, ast.ImportFrom) and node.module:
                for alias in node.names:
                    home = modules.get(f"{node.module}.{alias.name}") or modules.get(node.module)
                    if home and home != name:
                        ahead[name].add(home)
    reach = {start: closure(after, lambda place: ahead.get(place, ())) for start, after in ahead.items()}
    rings = {frozenset(there for there in reach[start] if start in reach.get(there, ())) for start in reach}
    return {", ".join(sorted(ring)): 1 for ring in rings if len(ring) > 1}


def _module(name: str) -> str:
    return ".".join(Path(name).with_suffix("").parts[1:]).removesuffix(".__init__")
