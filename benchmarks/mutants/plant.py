"""Faults that a person makes, to be planted one at a time: sign, index, axis, unit, limit, guard and others."""

import ast
import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

UNITS = {"deg", "dps", "to_deg", "to_dps", "to_g", "to_si", "from_si", "radians", "degrees", "abs"}
TWINS = {"min": "max", "any": "all", "minimum": "maximum", "sin": "cos", "floor": "ceil", "argmin": "argmax"}
TWINS |= {after: before for before, after in TWINS.items()}
OTHERS = ast.FunctionDef | ast.ClassDef | ast.JoinedStr | ast.Raise | ast.arguments | ast.Import | ast.ImportFrom


@dataclass(frozen=True)
class Mutant:
    """A fault: which text of which function becomes which."""

    path: str  # below the package's folder
    function: str
    line: int  # of the function's definition, its decorators included, as its code object has it
    kind: str
    at: int  # characters from the start of the file
    before: str
    after: str
    row: int

    @property
    def name(self) -> str:
        """The same as long as the function and the text stay, whatever happens above them."""
        return f"{self.path}::{self.function} {self.kind}: {self.before!r} -> {self.after!r}"

    def plant(self, source: str) -> str:
        """Source with the fault."""
        return source[: self.at] + self.after + source[self.at + len(self.before) :]


class _Source:
    def __init__(self, text: str) -> None:
        self.text = text
        self.starts = [0]
        for line in text.splitlines(keepends=True):
            self.starts.append(self.starts[-1] + len(line))
        self.lines = text.splitlines()

    def span(self, node: ast.AST) -> tuple[int, int]:
        return self._at(node.lineno, node.col_offset), self._at(node.end_lineno, node.end_col_offset)

    def _at(self, line: int, octets: int) -> int:
        return self.starts[line - 1] + len(self.lines[line - 1].encode()[:octets].decode())

    def of(self, node: ast.AST) -> str:
        start, end = self.span(node)
        return self.text[start:end]


Edit = tuple[str, ast.AST | tuple[int, int], str]  # kind, what is replaced, by what


def _binary(node: ast.BinOp, source: _Source) -> Iterator[Edit]:
    gap = source.span(node.left)[1], source.span(node.right)[0]
    between = source.text[slice(*gap)]
    for type_, sign, other, kind in (
        (ast.Add, "+", "-", "sign"),
        (ast.Sub, "-", "+", "sign"),
        (ast.Mult, "*", "/", "unit"),
        (ast.Div, "/", "*", "unit"),
        (ast.BitAnd, "&", "|", "guard"),
        (ast.BitOr, "|", "&", "guard"),
    ):
        if isinstance(node.op, type_) and between.count(sign) == 1 and "#" not in between:
            at = gap[0] + between.index(sign)
            yield kind, (at, at + 1), other
    if isinstance(node.op, ast.Add | ast.Sub) and not isinstance(node.right, ast.Constant):
        yield "dropped term", node, f"({source.of(node.left)})"


def _compare(node: ast.Compare, source: _Source) -> Iterator[Edit]:
    if len(node.ops) != 1 or not isinstance(node.ops[0], ast.Lt | ast.Gt | ast.LtE | ast.GtE):
        return
    right = node.comparators[0]
    if isinstance(right, ast.Constant) and isinstance(right.value, int):
        yield "limit", right, str(right.value + 1)
    elif not isinstance(right, ast.Constant):
        yield "limit", right, f"(1.1 * ({source.of(right)}))"


def _subscript(node: ast.Subscript, source: _Source) -> Iterator[Edit]:
    parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
    for part in parts:
        if isinstance(part, ast.Constant) and isinstance(part.value, int) and not isinstance(part.value, bool):
            yield "index", part, str(part.value + 1 if part.value < 2 else part.value - 1)
        elif isinstance(part, ast.UnaryOp) and source.of(part) == "-1":
            yield "index", part, "0"


def _call(node: ast.Call, source: _Source) -> Iterator[Edit]:
    name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
    if name in UNITS and node.args:
        yield "unit", node, f"({source.of(node.args[0])})"
    if name in TWINS:
        end = source.span(node.func)[1]
        yield "limit", (end - len(name), end), TWINS[name]
    named = [arg for arg in node.args if isinstance(arg, ast.Name | ast.Attribute)]
    for one, other in itertools.pairwise(named):
        (start, end), (then, stop) = source.span(one), source.span(other)
        if source.of(one)[:-1] == source.of(other)[:-1]:  # gx, gy
            yield "axis", (start, stop), source.of(other) + source.text[end:then] + source.of(one)
            break
    for keyword in node.keywords:
        if keyword.arg == "axis" and source.of(keyword.value) in {"0", "1", "-1"}:
            yield "axis", keyword.value, "1" if source.of(keyword.value) == "0" else "0"
        elif isinstance(keyword.value, ast.Constant) and isinstance(keyword.value.value, bool):
            yield "guard", keyword.value, str(not keyword.value.value)


def _condition(node: ast.If | ast.IfExp | ast.While, source: _Source) -> Iterator[Edit]:
    if not isinstance(node, ast.While):
        yield "guard", node.test, f"not ({source.of(node.test)})"
    leaves = isinstance(node, ast.If) and isinstance(node.body[-1], ast.Raise | ast.Return | ast.Continue)
    if leaves and not node.orelse:
        yield "early return", node.test, "False"


def _others(node: ast.AST, source: _Source) -> Iterator[Edit]:
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub) and not isinstance(node.operand, ast.Constant):
        yield "sign", node, f"({source.of(node.operand)})"
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        yield "guard", node, f"({source.of(node.operand)})"
    if isinstance(node, ast.BoolOp):
        yield "dropped term", node, f"({source.of(node.values[0])})"
    if isinstance(node, ast.Constant) and isinstance(node.value, float) and node.value not in (0.0, 1.0):
        yield "x 1.1", node, repr(1.1 * node.value)
    if isinstance(node, ast.AugAssign) and isinstance(node.op, ast.Add | ast.Sub):
        start = source.span(node.target)[1]
        at = start + source.text[start:].index("=") - 1
        yield "sign", (at, at + 1), "-" if isinstance(node.op, ast.Add) else "+"
    dropped = isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)
    if dropped or (isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Attribute | ast.Subscript)):
        yield "dropped term", node, "pass"


OPERATORS: dict[type, Callable[..., Iterator[Edit]]] = {
    ast.BinOp: _binary,
    ast.Compare: _compare,
    ast.Subscript: _subscript,
    ast.Call: _call,
    ast.If: _condition,
    ast.IfExp: _condition,
    ast.While: _condition,
}


def _inside(node: ast.AST) -> Iterator[ast.AST]:
    """What a statement computes: no nested function, text of a message, annotation or default."""
    if isinstance(node, OTHERS):
        return
    yield node
    for name, value in ast.iter_fields(node):
        if name != "annotation":
            for child in value if isinstance(value, list) else [value]:
                if isinstance(child, ast.AST):
                    yield from _inside(child)


def _functions(node: ast.AST, owner: str = "") -> Iterator[tuple[str, ast.FunctionDef]]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.FunctionDef):
            yield owner + child.name, child
        if isinstance(child, ast.FunctionDef | ast.ClassDef):
            yield from _functions(child, f"{owner}{child.name}.")


def mutants_of(root: Path, path: Path) -> Iterator[Mutant]:
    """Every fault that can be planted in a file."""
    source = _Source(path.read_text(encoding="utf-8"))
    for name, function in _functions(ast.parse(source.text)):
        first = min([function.lineno, *(one.lineno for one in function.decorator_list)])
        for node in (node for statement in function.body for node in _inside(statement)):
            edits = list(OPERATORS[type(node)](node, source)) if type(node) in OPERATORS else []
            for kind, what, after in [*edits, *_others(node, source)]:
                start, end = what if isinstance(what, tuple) else source.span(what)
                before = source.text[start:end]
                if "\n" not in before and before != after:
                    row = source.text.count("\n", 0, start) + 1
                    yield Mutant(path.relative_to(root).as_posix(), name, first, kind, start, before, after, row)
