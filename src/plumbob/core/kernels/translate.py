"""One kernel from Python to C: the same operations on the same numbers in the same order, so the same bits.

What is not in the subset is refused with file, line and reason. The subset: numbers, arrays that are indexed, views of
rows, tuples, named tuples, loops over ``range`` or over constants, ``while``, conditions, other kernels, and of the
library ``math`` and ``abs``, ``min``, ``max``, ``int``, ``float``, ``bool``, ``len``.

C leaves open in which order the parts of an expression are computed. So a kernel that writes into an array may stand in
an expression only where nothing beside it reads an array.
"""

import ast
import functools
import math
import re
from collections.abc import Callable, Iterator
from enum import Enum
from types import FunctionType
from typing import Any

import numpy as np

from plumbob.core.kernels import bare
from plumbob.core.kernels.indexing import brackets, checked_before, count_axes, names, spelled
from plumbob.core.kernels.sources import (
    DOUBLE,
    INTEGER,
    ITEMS,
    LOADED,
    NOTHING,
    TRUTH,
    WORD,
    Array,
    KernelSource,
    Several,
    Type,
    UnsupportedError,
    joined,
    name_in_c,
    of_annotation,
    read_source,
    signature,
)

BINARY = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.BitAnd: "&", ast.BitOr: "|", ast.BitXor: "^", ast.RShift: ">>",
    ast.LShift: "<<", ast.Div: "/", ast.FloorDiv: "//", ast.Mod: "%", ast.Pow: "**",
}  # fmt: skip
NAMED = {"//": "py_floor_div", "%": "py_floor_mod", "**": "pow"}
COMPARED = {ast.Eq: "==", ast.NotEq: "!=", ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">="}
OF_MATH = {name: name for name in ("sqrt", "exp", "log", "sin", "cos", "atan2", "hypot", "expm1", "log1p", "isnan")}
OF_MATH |= {"radians": "py_radians", "degrees": "py_degrees", "isfinite": "isfinite", "fabs": "fabs"}
CAST = {
    "int": ("(int64_t)", INTEGER), "float": ("(double)", DOUBLE), "bool": ("(bool)", TRUTH),
    "math.floor": ("(int64_t)floor", INTEGER), "np.float32": ("(double)(float)", DOUBLE),
}  # fmt: skip
TAKEN = {"auto", "break", "case", "char", "const", "default", "do", "double", "enum", "extern", "float", "goto", "int",
         "inline", "long", "register", "restrict", "short", "signed", "sizeof", "static", "struct", "switch", "typedef",
         "union", "unsigned", "void", "volatile", "bool", "true", "false", "near", "far", "I"}  # fmt: skip

Coded = tuple[str, Type]


@functools.cache
def writes(func: FunctionType) -> frozenset[str]:
    """Parameters that are arrays, or hold some, into which a kernel writes, by itself or through another."""
    source, written = read_source(func), set()
    aka: dict[str, str] = {}

    def root(node: ast.expr) -> str:
        while isinstance(node, ast.Subscript | ast.Attribute):
            node = node.value
        name = node.id if isinstance(node, ast.Name) else ""
        return aka.get(name, name)

    for node in ast.walk(source.tree):  # what a name was given once, it may be anywhere
        if isinstance(node, ast.Assign):
            for target in node.targets:
                pairs = [(target, node.value)]
                if isinstance(target, ast.Tuple):
                    values = node.value.elts if isinstance(node.value, ast.Tuple) else [node.value] * len(target.elts)
                    pairs = list(zip(target.elts, values, strict=False))
                for bound, value in pairs:
                    if isinstance(bound, ast.Name) and isinstance(value, ast.Subscript | ast.Attribute | ast.Name):
                        aka[bound.id] = root(value)
    for node in ast.walk(source.tree):
        if isinstance(node, ast.Subscript) and isinstance(node.ctx, ast.Store):
            written.add(root(node))
        elif isinstance(node, ast.Call) and (callee := source.kernel(node.func)) and callee is not func:
            inner = writes(callee)
            for given, name in zip(node.args, signature(callee)[0], strict=False):
                if name in inner:
                    stripped = given.args[0] if isinstance(given, ast.Call) else given  # bare(x)
                    written.add(root(stripped))
    return frozenset(written & set(signature(func)[0]))


def with_axes(kind: Type, name: str, axes: dict[str, int]) -> Type:
    """A type whose arrays have their axes."""
    if isinstance(kind, Array):
        return Array(kind.item, axes.get(name, 1))
    if isinstance(kind, Several) and kind.maker:
        items = (of_field(kind, field, axes.get(f"{name}.{field}")) for field in kind.names)
        return Several(tuple(items), kind.names, kind.maker)
    return kind


_FIELDS: dict[tuple[Any, str], int] = {}


def of_field(kind: Several, field: str, axes: int | None) -> Type:
    """A field's type; it has the axes that any kernel has seen."""
    kind_of = kind.items[kind.names.index(field)]
    if isinstance(kind_of, Several) and kind_of.maker:
        return Several(tuple(of_field(kind_of, inner, None) for inner in kind_of.names), kind_of.names, kind_of.maker)
    if not isinstance(kind_of, Array):
        return kind_of
    before = _FIELDS.get((kind.maker, field))
    if axes and before and axes != before:
        raise UnsupportedError(f"{kind}.{field} has {before} axes in one kernel and {axes} in another")
    if axes:
        _FIELDS[kind.maker, field] = axes
    return Array(kind_of.item, axes or before or 1)


@functools.cache
def typed(func: FunctionType) -> tuple[dict[str, Type], Type]:
    """Types of a kernel's parameters and of its answer, with the axes of arrays."""
    types, answer = signature(func)
    axes = count_axes(func)
    return {name: with_axes(kind, name, axes) for name, kind in types.items()}, with_axes(answer, "", {})


class Translator:
    """Writes one kernel in C."""

    def __init__(self, func: FunctionType) -> None:
        self.source: KernelSource = read_source(func)
        self.func = func
        self.name = name_in_c(func)
        self.parameters, self.answer = typed(func)
        self.types: dict[str, Type] = dict(self.parameters)
        self.callees: dict[FunctionType, None] = {}
        self.structs: dict[str, Several] = {}
        self._memory: dict[str, str] = {}
        self._lines: list[str] = []
        self._number = 0
        self._within: frozenset[str] = frozenset()
        self.written = ""

    # --- the whole ---------------------------------------------------------------------------------------------

    def head(self) -> str:
        """Declaration."""
        given = ", ".join(f"{self.struct(kind)} {self.mangled(name)}" for name, kind in self.parameters.items())
        attributes = "__attribute__((flatten)) " if self.func.__dict__.get("is_inlined") else ""
        attributes += "WIDE " if self.func.__dict__.get("is_wide") else ""
        return f"{attributes}static {self.struct(self.answer)} {self.name}({given or 'void'})"

    def text(self) -> None:
        """Write the function in C."""
        for _ in range(6):  # until the types of all variables are known
            before = dict(self.types)
            self._lines, self._number, self._memory = [], 0, {}
            for statement in self.source.tree.body:
                self.statement(statement, 1)
            if before == self.types:
                break
        variables = [(name, kind) for name, kind in self.types.items() if name not in self.parameters]
        declared = [
            f"    {self.struct(kind)} {self.mangled(name)} = {{0}};" for name, kind in variables if kind != NOTHING
        ]
        self.written = "\n".join([f"{self.head()} {{", *self._memory.values(), *declared, *self._lines, "}"])

    def refuse(self, node: ast.AST, why: str) -> UnsupportedError:
        """What to raise."""
        code = ast.unparse(node) if isinstance(node, ast.expr | ast.stmt) else type(node).__name__
        return UnsupportedError(f"{self.source.where(node)}: in {self.func.__qualname__}: {why}: {code[:120]}")

    def struct(self, kind: Type) -> str:
        """Name of a type in C, whose struct is remembered."""
        if isinstance(kind, Several):
            for item in kind.items:
                self.struct(item)
            self.structs[str(kind)] = kind
        return str(kind)

    @staticmethod
    def mangled(name: str) -> str:
        """A name that C does not use itself."""
        return f"{name}_" if name in TAKEN else name

    def fresh(self, word: str) -> str:
        """A name that is not there yet."""
        self._number += 1
        return f"{word}{self._number}_"

    def put(self, depth: int, *lines: str) -> None:
        """Write lines."""
        self._lines += ["    " * depth + line for line in lines]

    # --- statements --------------------------------------------------------------------------------------------

    def statement(self, node: ast.stmt, depth: int) -> None:
        """Write a statement."""
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            return  # docstring
        self.put(depth, f"/* {self.source.line(node).replace('*/', '* /')} */")
        write: Callable[..., None] | None = getattr(self, f"_{type(node).__name__.lower()}", None)
        if write is None:
            raise self.refuse(node, f"{type(node).__name__} is not in the subset")
        try:
            write(node, depth)
        except UnsupportedError as error:
            if ".py:" in str(error):
                raise
            raise self.refuse(node, str(error)) from None

    def body(self, statements: list[ast.stmt], depth: int) -> None:
        """Write statements."""
        for statement in statements:
            self.statement(statement, depth)

    def _pass(self, node: ast.Pass, depth: int) -> None:
        """Nothing."""

    def _expr(self, node: ast.Expr, depth: int) -> None:
        self.put(depth, f"{self.expression(node.value)[0]};")

    def _if(self, node: ast.If, depth: int) -> None:
        self.put(depth, f"if ({self.test(node.test)}) {{")
        self.body(node.body, depth + 1)
        if node.orelse:
            self.put(depth, "} else {")
            self.body(node.orelse, depth + 1)
        self.put(depth, "}")

    def _while(self, node: ast.While, depth: int) -> None:
        self.put(depth, f"while ({self.test(node.test)}) {{")
        self.body(node.body, depth + 1)
        self.put(depth, "}")

    def _break(self, node: ast.Break, depth: int) -> None:
        self.put(depth, "break;")

    def _continue(self, node: ast.Continue, depth: int) -> None:
        self.put(depth, "continue;")

    def _for(self, node: ast.For, depth: int) -> None:
        if node.orelse or not isinstance(node.target, ast.Name):
            raise self.refuse(node, "a loop has one name and no else")
        if isinstance(node.iter, ast.Tuple):
            return self._each(node, node.iter, depth)
        if not (isinstance(node.iter, ast.Call) and spelled(node.iter.func) == "range"):
            raise self.refuse(node.iter, "a loop goes over range(…) or a tuple of numbers")
        given = [self.integer(bound) for bound in node.iter.args]
        start, stop = ("0LL", given[0]) if len(given) == 1 else given[:2]
        step = self.source.constant(node.iter.args[2]) if len(given) == 3 else 1
        at, end = self.fresh("at"), self.fresh("end")
        self.assign(node.target, ("", INTEGER), depth, declare=True)
        if step is None:
            step = self.fresh("step")
            self.put(depth, f"const int64_t {step} = {given[2]};")
            goes_on = f"{step} > 0 ? {at} < {end} : {at} > {end}"
        else:
            goes_on = f"{at} {'<' if step > 0 else '>'} {end}"
        self.put(depth, f"int64_t {at} = {start};", f"const int64_t {end} = {stop};")
        before = self._within
        if isinstance(step, int):
            self.before(node, at, f"{at} + ({end} - {at} - {1 if step > 0 else -1}) / {step} * {step}", goes_on, depth)
        self.put(depth, f"for (; {goes_on}; {at} += {step}) {{")
        self.put(depth + 1, f"{self.mangled(node.target.id)} = {at};")
        self.body(node.body, depth + 1)
        self.put(depth, "}")
        self._within = before
        return None

    def before(self, node: ast.For, first: str, last: str, goes_on: str, depth: int) -> None:
        """Check the indices of a loop at its first and its last turn, if it has one."""
        assert isinstance(node.target, ast.Name)
        loop = checked_before(node)
        places = [place for place in loop if ast.unparse(place) not in self._within and self.is_known(place.value)]
        if not places:
            return
        self.put(depth, f"if ({goes_on}) {{")
        for turn in (last, first):
            self.put(depth + 1, f"{self.mangled(node.target.id)} = {turn};")
            for place in places:
                code, _ = self.expression(place.value)
                for axis, index in enumerate(brackets(place)):
                    if not isinstance(index, ast.Slice) and (turn == last or node.target.id in names(index)):
                        self.put(depth + 1, f"{self.index(code, axis, index)};")
        self.put(depth, "}")
        self._within = self._within | {ast.unparse(place) for place in places}

    def _each(self, node: ast.For, each: ast.Tuple, depth: int) -> None:
        values = [self.expression(item) for item in each.elts]
        kind = functools.reduce(joined, (kind for _, kind in values))
        assert isinstance(node.target, ast.Name)
        self.assign(node.target, ("", kind), depth, declare=True)
        at, row = self.fresh("at"), self.fresh("each")
        self.put(depth, f"const {kind} {row}[] = {{{', '.join(code for code, _ in values)}}};")
        self.put(depth, f"for (int64_t {at} = 0; {at} < {len(values)}; {at} += 1) {{")
        self.put(depth + 1, f"{self.mangled(node.target.id)} = {row}[{at}];")
        self.body(node.body, depth + 1)
        self.put(depth, "}")

    def _return(self, node: ast.Return, depth: int) -> None:
        if node.value is None:
            self.put(depth, "return;")
        elif isinstance(node.value, ast.Tuple) and isinstance(self.answer, Several):
            self.alone(node.value)
            parts = [self.expression(item)[0] for item in node.value.elts]
            self.put(depth, f"return ({self.struct(self.answer)}){{{', '.join(parts)}}};")
        else:
            self.put(depth, f"return {self.converted(self.expression(node.value), self.answer, node)};")

    def _assign(self, node: ast.Assign, depth: int) -> None:
        value = node.value
        if len(node.targets) > 1:  # a = b = value
            code, kind = self.expression(value)
            held = self.fresh("same")
            self.put(depth, f"const {self.struct(kind)} {held} = {code};")
            for target in node.targets:
                self.assign(target, (held, kind), depth)
            return
        (target,) = node.targets
        if isinstance(target, ast.Name) and self._room(target.id, value, depth):
            return
        if isinstance(target, ast.Subscript) and any(isinstance(index, ast.Slice) for index in brackets(target)):
            self._fill(target, value, depth)
        elif isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
            pairs = zip(target.elts, value.elts, strict=True)
            self._at_once(
                [(a, b) for a, b in pairs if not (isinstance(a, ast.Name) and self._room(a.id, b, depth))], depth
            )
        else:
            self.assign(target, self.expression(value), depth)

    def _at_once(self, pairs: list[tuple[ast.expr, ast.expr]], depth: int) -> None:
        """Several assignments: all values are known before the first name is bound."""
        held = []
        for _, side in pairs:
            code, kind = self.expression(side)
            name = self.fresh("now")
            self.put(depth, f"const {self.struct(kind)} {name} = {code};")
            held.append((name, kind))
        for (side, _), coded in zip(pairs, held, strict=True):
            self.assign(side, coded, depth)

    def _annassign(self, node: ast.AnnAssign, depth: int) -> None:
        if node.value is None or not isinstance(node.target, ast.Name):
            raise self.refuse(node, "an annotated variable has a value")
        kind = of_annotation(self.source.constant(node.annotation) or _builtin(node.annotation))
        self.assign(node.target, (self.converted(self.expression(node.value), kind, node), kind), depth)

    def _augassign(self, node: ast.AugAssign, depth: int) -> None:
        read = ast.parse(ast.unparse(node.target), mode="eval").body
        both = ast.copy_location(ast.BinOp(read, node.op, node.value), node)
        ast.fix_missing_locations(both)
        self.assign(node.target, self.expression(both), depth)

    def assign(self, target: ast.expr, coded: Coded, depth: int, *, declare: bool = False) -> None:
        """Bind a name, write into an array, or take a tuple apart."""
        code, kind = coded
        if isinstance(target, ast.Name):
            before = self.types.get(target.id)
            if kind == NOTHING:
                raise self.refuse(target, "a kernel that returns nothing has no value")
            self.types[target.id] = kind if before is None else joined(before, kind)
            if target.id in self.parameters and self.types[target.id] != self.parameters[target.id]:
                raise self.refuse(target, f"a parameter {before} is given {kind}")
            if not declare:
                code = self.converted(coded, self.types[target.id], target)
                self.put(depth, f"{self.mangled(target.id)} = {code};")
        elif isinstance(target, ast.Subscript):
            place, item = self.place(target)
            self.put(depth, f"{place} = ({ITEM_IN_C[item]})({code});")
        elif isinstance(target, ast.Tuple) and isinstance(kind, Several) and len(kind.items) == len(target.elts):
            held = self.fresh("parts")
            self.put(depth, f"const {self.struct(kind)} {held} = {code};")
            for name, field, of in zip(target.elts, kind.fields, kind.items, strict=True):
                self.assign(name, (f"{held}.{field}", of), depth)
        else:
            raise self.refuse(target, f"{kind} cannot be assigned to this")

    def _room(self, name: str, value: ast.expr, depth: int) -> bool:
        """Memory on the stack for a small array of constant size; whether that is what is assigned."""
        maker = spelled(value.func) if isinstance(value, ast.Call) else ""
        if maker not in ("np.zeros", "np.empty") or not isinstance(value, ast.Call):
            return False
        shape = self.source.constant(value.args[0])
        sizes = (shape,) if isinstance(shape, int) else shape
        if not isinstance(sizes, tuple) or math.prod(sizes) > 4096:
            raise self.refuse(value, "the size of a kernel's own array is a constant of at most 4096 numbers")
        wanted = [keyword.value for keyword in value.keywords if keyword.arg == "dtype"] + value.args[1:]
        item = ITEMS[self.source.constant(wanted[0]) if wanted else np.float64]
        kind = Array(item, len(sizes))
        memory = f"{name}_memory"
        self._memory[name] = f"    {ITEM_IN_C[item]} {memory}[{math.prod(sizes)}] = {{0}};"
        self.types[name] = joined(self.types.get(name, kind), kind)
        if maker == "np.zeros":
            self.put(depth, f"memset({memory}, 0, sizeof {memory});")
        self.put(depth, f"{self.mangled(name)} = ({kind}){{{memory}, {', '.join(map(str, sizes))}}};")
        return True

    def _fill(self, target: ast.Subscript, value: ast.expr, depth: int) -> None:
        """Give all numbers of a view one value."""
        view, kind = self.view(target)
        code, of = self.expression(value)
        if not isinstance(kind, Array) or isinstance(of, Array | Several):
            raise self.refuse(target, "a view is filled with one number; write a loop")
        at, row = self.fresh("at"), self.fresh("row")
        size = " * ".join(f"{row}.n{axis}" for axis in range(kind.axes))
        self.put(depth, f"{{ const {kind} {row} = {view};",
                 f"  for (int64_t {at} = 0; {at} < {size}; {at} += 1) {row}.p[{at}] = {code}; }}")  # fmt: skip

    # --- expressions -------------------------------------------------------------------------------------------

    def expression(self, node: ast.expr) -> Coded:
        """C of an expression, and its type."""
        self.alone(node)
        value = self.source.constant(node)
        if isinstance(value, tuple) and not isinstance(node, ast.Tuple):
            parts = [number(item, lambda why: self.refuse(node, why)) for item in value]
            kind = Several(tuple(of for _, of in parts))
            return f"({self.struct(kind)}){{{', '.join(code for code, _ in parts)}}}", kind
        if isinstance(value, bool | int | float | np.integer | np.floating | Enum):
            return number(value, lambda why: self.refuse(node, why))
        write: Callable[..., Coded] | None = getattr(self, f"_{type(node).__name__.lower()}_code", None)
        if write is None:
            raise self.refuse(node, f"{type(node).__name__} is not in the subset")
        return write(node)

    def test(self, node: ast.expr) -> str:
        """C of a condition."""
        code, kind = self.expression(node)
        if isinstance(kind, Array | Several):
            raise self.refuse(node, f"{kind} is not a condition")
        return code if kind == TRUTH else f"({code}) != 0"

    def integer(self, node: ast.expr) -> str:
        """C of what must be a whole number."""
        code, kind = self.expression(node)
        if kind not in (INTEGER, TRUTH):
            raise self.refuse(node, f"a whole number is needed, not {kind}")
        return code

    def converted(self, coded: Coded, kind: Type, node: ast.AST) -> str:
        """C of a value as another type, where that loses nothing."""
        code, had = coded
        if had == kind or (kind in (DOUBLE, INTEGER) and had in (INTEGER, TRUTH)):
            return code
        if isinstance(kind, Several) and isinstance(had, Several) and kind.items == had.items:
            self.struct(kind)
            held = f"({code})"
            return f"({kind}){{{', '.join(f'{held}.{field}' for field in had.fields)}}}" if "(" not in code else code
        raise self.refuse(node, f"{had} where {kind} is needed")

    def _name_code(self, node: ast.Name) -> Coded:
        if node.id not in self.types:
            raise self.refuse(node, "a name without a value, or not a number")
        return self.mangled(node.id), self.types[node.id]

    def _attribute_code(self, node: ast.Attribute) -> Coded:
        if node.attr == "size":
            code, kind = self.expression(node.value)
            if isinstance(kind, Array):
                return " * ".join(f"{code}.n{i}" for i in range(kind.axes)), INTEGER
        code, kind = self.expression(node.value)
        if isinstance(kind, Several) and node.attr in kind.names:
            return f"{code}.{node.attr}", kind.items[kind.names.index(node.attr)]
        raise self.refuse(node, "neither a number nor a part of a named tuple")

    def _tuple_code(self, node: ast.Tuple) -> Coded:
        parts = [self.expression(item) for item in node.elts]
        kind = Several(tuple(of for _, of in parts))
        return f"({self.struct(kind)}){{{', '.join(code for code, _ in parts)}}}", kind

    def _unaryop_code(self, node: ast.UnaryOp) -> Coded:
        if isinstance(node.op, ast.Not):
            return f"!({self.test(node.operand)})", TRUTH
        code, kind = self.expression(node.operand)
        sign = {ast.USub: "-", ast.UAdd: "+", ast.Invert: "~"}[type(node.op)]
        return f"({sign}({code}))", INTEGER if kind == TRUTH else kind

    def _binop_code(self, node: ast.BinOp) -> Coded:
        sign = BINARY.get(type(node.op), type(node.op).__name__)
        (left, a), (right, b) = self.expression(node.left), self.expression(node.right)
        if isinstance(a, Array | Several) or isinstance(b, Array | Several):
            raise self.refuse(node, f"no arithmetic with {a} and {b}: write a loop")
        kinds = {a, b}
        if WORD in kinds and kinds != {WORD}:
            raise self.refuse(node, "unsigned 64-bit numbers go with each other only")
        kind = WORD if kinds == {WORD} else DOUBLE if DOUBLE in kinds else INTEGER
        if sign in ("+", "-", "*") or (kind == WORD and sign in ("//", "%")):
            return f"({'(int64_t)' if kinds == {TRUTH} else ''}{left} {sign[0]} {right})", kind
        if sign == "/":
            return f"((double)({left}) / (double)({right}))", DOUBLE
        if sign == "**" and self.source.constant(node.right) == 2:
            return (f"py_square({left})", DOUBLE) if kind == DOUBLE else (f"({left} * {left})", INTEGER)
        if sign in NAMED and (sign != "//" or kind == INTEGER):
            name = NAMED[sign] + ("_f" if kind == DOUBLE and sign == "%" else "")
            return f"{name}({left}, {right})", DOUBLE if sign == "**" else kind
        if sign in (">>", "<<") and kind != DOUBLE and self.source.constant(node.right) not in range(64):
            return f"py_shift_{'left' if sign == '<<' else 'right'}{'_u' * (kind == WORD)}({left}, {right})", kind
        if sign in ("&", "|", "^", ">>", "<<") and kind != DOUBLE:
            return f"({left} {sign} {right})", TRUTH if kinds == {TRUTH} and sign in "&|^" else kind
        raise self.refuse(node, f"{sign} of {a} and {b} is not in the subset")

    def _compare_code(self, node: ast.Compare) -> Coded:
        values = [self.expression(side) for side in (node.left, *node.comparators)]
        if any(isinstance(kind, Array | Several) for _, kind in values):
            raise self.refuse(node, "only numbers can be compared")
        parts = []
        for (left, _), op, (right, _) in zip(values, node.ops, values[1:], strict=False):
            if type(op) not in COMPARED:
                raise self.refuse(node, f"{type(op).__name__} is not in the subset")
            parts.append(f"({left} {COMPARED[type(op)]} {right})")
        return parts[0] if len(parts) == 1 else f"({' && '.join(parts)})", TRUTH

    def _boolop_code(self, node: ast.BoolOp) -> Coded:
        values = [self.test(side) for side in node.values]
        return "(" + (" && " if isinstance(node.op, ast.And) else " || ").join(values) + ")", TRUTH

    def _ifexp_code(self, node: ast.IfExp) -> Coded:
        (yes, a), (no, b) = self.expression(node.body), self.expression(node.orelse)
        kind = joined(a, b)
        if isinstance(kind, str) and kind != NOTHING:
            return f"({self.test(node.test)} ? ({kind})({yes}) : ({kind})({no}))", kind
        if a == b:
            return f"({self.test(node.test)} ? {yes} : {no})", kind
        if isinstance(kind, Several) and isinstance(node.body, ast.Tuple) and isinstance(node.orelse, ast.Tuple):
            self.struct(kind)
            sides = [", ".join(self.expression(item)[0] for item in side.elts) for side in (node.body, node.orelse)]
            return f"({self.test(node.test)} ? ({kind}){{{sides[0]}}} : ({kind}){{{sides[1]}}})", kind
        raise self.refuse(node, f"{a} or {b}")

    # --- arrays ------------------------------------------------------------------------------------------------

    def _subscript_code(self, node: ast.Subscript) -> Coded:
        if isinstance(node.value, ast.Attribute) and node.value.attr == "shape":
            code, kind = self.expression(node.value.value)
            axis = self.source.constant(node.slice)
            if isinstance(kind, Array) and isinstance(axis, int) and 0 <= axis < kind.axes:
                return f"{code}.n{axis}", INTEGER
            raise self.refuse(node, "not an axis of an array")
        table = self.source.constant(node.value)
        if isinstance(table, tuple) and self.source.constant(node.slice) is None:
            parts = [number(item, lambda why: self.refuse(node, why)) for item in table]
            of = functools.reduce(joined, (kind for _, kind in parts))
            index = f"py_at({self.integer(node.slice)}, {len(parts)})"
            return f"((const {of}[]){{{', '.join(code for code, _ in parts)}}})[{index}]", of
        code, kind = self.expression(node.value)
        if isinstance(kind, Several):
            at = self.source.constant(node.slice)
            if isinstance(at, int) and 0 <= at < len(kind.items):
                return f"{code}.{kind.fields[at]}", kind.items[at]
            raise self.refuse(node, "a part of a tuple is named by a constant")
        if not isinstance(kind, Array):
            raise self.refuse(node, f"{kind} has no parts")
        if kind.axes > len(brackets(node)) or any(isinstance(index, ast.Slice) for index in brackets(node)):
            return self.view(node)
        place, item = self.place(node)
        return (place if item in ("f64", "i64", "u64") else f"({LOADED[item]}){place}"), LOADED[item]

    def place(self, node: ast.Subscript) -> tuple[str, str]:
        """C of one number of an array, and what kind it is."""
        code, kind = self.expression(node.value)
        indices = brackets(node)
        if not isinstance(kind, Array) or len(indices) != kind.axes:
            raise self.refuse(node, f"one number of {kind} needs an index for each axis")
        return f"{code}.p[{self.offset(code, indices, is_open=ast.unparse(node) not in self._within)}]", kind.item

    def counted(self, code: str, axis: int, node: ast.expr) -> str:
        """C of an index, counted from the first."""
        value = self.source.constant(node)
        return f"{code}.n{axis} + {value}" if isinstance(value, int) and value < 0 else self.integer(node)

    def index(self, code: str, axis: int, node: ast.expr) -> str:
        """C of an index that is checked."""
        return f"py_at({self.counted(code, axis, node)}, {code}.n{axis})"

    def offset(self, code: str, indices: list[ast.expr], *, is_open: bool) -> str:
        """Where the number is, counted from the first; `is_open` where no loop has checked that before."""
        total = ""
        for axis, node in enumerate(indices):
            here = self.index(code, axis, node) if is_open else self.counted(code, axis, node)
            total = f"({total}) * {code}.n{axis} + {here}" if total else here
        return total

    def view(self, node: ast.Subscript) -> Coded:
        """C of a part of an array whose numbers stand one behind the other."""
        code, kind = self.expression(node.value)
        assert isinstance(kind, Array)
        indices = brackets(node)
        numbers = [index for index in indices if not isinstance(index, ast.Slice)]
        slices = indices[len(numbers) :]
        if any(isinstance(index, ast.Slice) for index in indices[: len(numbers)]):
            raise self.refuse(node, "numbers of a column do not stand one behind the other")
        if any(index.lower or index.upper or index.step for index in slices[1:] if isinstance(index, ast.Slice)):
            raise self.refuse(node, "only the first axis of a view may be cut")
        rest = kind.axes - len(numbers)
        out = Array(kind.item, rest)
        sizes = [f"{code}.n{axis}" for axis in range(kind.axes)]
        start = self.offset(code, numbers, is_open=ast.unparse(node) not in self._within) if numbers else "0LL"
        first = slices[0] if slices else None
        length, begin = sizes[len(numbers)], "0LL"
        if isinstance(first, ast.Slice):
            if first.step:
                raise self.refuse(node, "a view has no step")
            begin = f"py_bound({self.integer(first.lower)}, {length})" if first.lower else "0LL"
            end = f"py_bound({self.integer(first.upper)}, {length})" if first.upper else length
            length = end if begin == "0LL" else f"py_length({begin}, {end})"
        start = f"({start}) * {sizes[len(numbers)]} + {begin}" if numbers else begin
        for size in sizes[len(numbers) + 1 :]:
            start = f"({start}) * {size}"
        others = [length, *sizes[len(numbers) + 1 :]]
        return f"({out}){{{code}.p + {start}, {', '.join(others)}}}", out

    # --- calls -------------------------------------------------------------------------------------------------

    def _call_code(self, node: ast.Call) -> Coded:
        if node.keywords or any(isinstance(argument, ast.Starred) for argument in node.args):
            raise self.refuse(node, "arguments must be given by position, without stars or names")
        if callee := self.source.kernel(node.func):
            return self.kernel_call(callee, node)
        name = spelled(node.func)
        meant = self.func.__globals__.get(name)
        if meant is bare:
            code, kind = self.expression(node.args[0])
            if isinstance(kind, Array) and kind.axes > 1:
                return f"(({kind.item}_1){{{code}.p, {' * '.join(f'{code}.n{i}' for i in range(kind.axes))}}})", Array(
                    kind.item, 1
                )
            return code, kind
        if isinstance(meant, type) and issubclass(meant, tuple):
            return self.named(of_annotation(meant), node)
        given = [self.expression(argument) for argument in node.args]
        if any(isinstance(kind, Several) or kind == NOTHING for _, kind in given):
            raise self.refuse(node, "numbers only")
        return self.built_in(name, given, node)

    def built_in(self, name: str, given: list[Coded], node: ast.Call) -> Coded:
        """A function of Python or of math."""
        codes, kinds = [code for code, _ in given], [kind for _, kind in given]
        word = name.removeprefix("math.")
        if name.startswith("math.") and word in OF_MATH:
            return f"{OF_MATH[word]}({', '.join(f'(double)({c})' for c in codes)})", TRUTH if "is" in word else DOUBLE
        if name in ("min", "max") and len(codes) > 1:
            kind = functools.reduce(joined, kinds)
            of = f"py_{name}_{'f' if kind == DOUBLE else 'i'}"
            return functools.reduce(lambda a, b: f"{of}({a}, {b})", codes), kind
        if name == "abs":
            return (f"fabs({codes[0]})", DOUBLE) if kinds[0] == DOUBLE else (f"llabs({codes[0]})", INTEGER)
        if name == "len" and isinstance(kinds[0], Array):
            return f"{codes[0]}.n0", INTEGER
        if name in CAST and not isinstance(kinds[0], Array):
            return f"({CAST[name][0]}({codes[0]}))", CAST[name][1]
        raise self.refuse(node, "neither a kernel nor a function of the subset")

    def named(self, kind: Type, node: ast.Call) -> Coded:
        """A named tuple is made."""
        assert isinstance(kind, Several)
        kind = Several(tuple(of_field(kind, name, None) for name in kind.names), kind.names, kind.maker)
        given = [
            self.converted(self.expression(argument), of, node)
            for argument, of in zip(node.args, kind.items, strict=True)
        ]
        return f"({self.struct(kind)}){{{', '.join(given)}}}", kind

    def kernel_call(self, callee: FunctionType, node: ast.Call) -> Coded:
        """Another kernel is called."""
        parameters, answer = typed(callee)
        self.callees[callee] = None
        defaults = [number(value, lambda why: self.refuse(node, why)) for value in callee.__defaults__ or ()]
        given = [self.expression(argument) for argument in node.args]
        given += defaults[len(defaults) - (len(parameters) - len(given)) :] if len(given) < len(parameters) else []
        if len(given) != len(parameters):
            raise self.refuse(node, f"{len(parameters)} arguments are needed")
        codes = [self.converted(coded, kind, node) for coded, kind in zip(given, parameters.values(), strict=True)]
        return f"{name_in_c(callee)}({', '.join(codes)})", answer

    # --- order -------------------------------------------------------------------------------------------------

    def alone(self, node: ast.expr) -> None:
        """Refuse a kernel that writes beside what reads or writes an array, as C leaves open which comes first."""
        parts: list[ast.expr] = []
        if isinstance(node, ast.BinOp):
            parts = [node.left, node.right]
        elif isinstance(node, ast.Compare):
            parts = [node.left, *node.comparators]
        elif isinstance(node, ast.Call):
            parts = node.args
        elif isinstance(node, ast.Tuple):
            parts = node.elts
        written = [self.is_writing(part) for part in parts]
        if any(written) and sum(wrote or self.is_reading(part) for wrote, part in zip(written, parts, strict=True)) > 1:
            raise self.refuse(node, "a kernel that writes stands beside what reads an array: give its result a name")

    def is_known(self, node: ast.expr) -> bool:
        """Whether a name means an array already."""
        try:
            return isinstance(self.expression(node)[1], Array)
        except UnsupportedError:
            return False

    def is_writing(self, node: ast.expr) -> bool:
        """Whether an expression writes into an array."""
        calls = (call for call in ast.walk(node) if isinstance(call, ast.Call))
        return any(writes(callee) for call in calls if (callee := self.source.kernel(call.func)))

    def is_reading(self, node: ast.expr) -> bool:
        """Whether an expression reads an array."""
        return any(isinstance(part, ast.Subscript) and "shape" not in ast.unparse(part) for part in ast.walk(node))


ITEM_IN_C = {
    "f64": "double", "i64": "int64_t", "u64": "uint64_t", "u32": "uint32_t", "u8": "uint8_t", "truth": "uint8_t",
}  # fmt: skip


def _builtin(node: ast.expr) -> Any:
    return {"float": float, "int": int, "bool": bool}.get(spelled(node))


def number(value: Any, refuse: Callable[[str], UnsupportedError]) -> Coded:
    """A constant in C."""
    value = value.value if isinstance(value, Enum) else value
    if isinstance(value, bool | np.bool_):
        return ("true" if value else "false"), TRUTH
    if isinstance(value, np.uint64):
        return f"{int(value)}ULL", WORD
    if isinstance(value, int | np.integer):
        return (f"{int(value)}LL" if value >= 0 else f"({int(value)}LL)"), INTEGER
    if isinstance(value, float):
        if math.isnan(value):
            return "NAN", DOUBLE
        text = "INFINITY" if math.isinf(value) else re.sub(r"^(\d+)$", r"\1.0", repr(abs(value)))
        return (f"(-{text})" if math.copysign(1.0, value) < 0.0 else text), DOUBLE
    raise refuse(f"{value!r} is not a number")


def order(funcs: list[FunctionType]) -> Iterator[Translator]:
    """Translate kernels, each behind those that it calls."""
    done: dict[FunctionType, Translator] = {}

    def visit(func: FunctionType) -> Iterator[Translator]:
        if func in done:
            return
        translator = Translator(func)
        translator.text()
        done[func] = translator
        for callee in translator.callees:
            yield from visit(callee)
        yield translator

    for func in funcs:
        yield from visit(func)
