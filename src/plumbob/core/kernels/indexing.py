"""How a kernel indexes its arrays: how many axes they have, and which indices can be checked before a loop.

An index that the loop leaves alone, or that goes along a line with the loop's own name, is within an array in every
turn if it is in the first and the last. Only what every turn is sure to read or write counts: an index under a
condition is checked where it stands.
"""

import ast
import functools
from collections.abc import Iterator
from types import FunctionType

from plumbob.core.kernels.sources import Array, KernelSource, Several, UnsupportedError, read_source, signature

Same = list[tuple[str, str, int]]


@functools.cache
def count_axes(func: FunctionType) -> dict[str, int]:
    """Axes of each array of a kernel by its name, and of those in named tuples by 'name.field'.

    A subscript of k numbers has k axes; what is handed to a kernel has the axes that this one gives it.
    """
    source = read_source(func)
    counts, least, same = seen_in(source)
    spread(counts, least, same)
    for name, axes in least.items():
        if axes > 1:
            counts.setdefault(name, {axes})
    for name, seen_counts in counts.items():
        if len(seen_counts) > 1 or max(seen_counts) < least.get(name, 1):
            raise UnsupportedError(f"{source.where(source.tree)}: {name} is indexed with {sorted(seen_counts)} numbers")
    return {name: min(seen_counts) for name, seen_counts in counts.items()}


def seen_in(source: KernelSource) -> tuple[dict[str, set[int]], dict[str, int], Same]:
    """Axes that subscripts and calls show, least axes that they show, and which names are of the same numbers."""
    counts: dict[str, set[int]] = {}
    least: dict[str, int] = {}
    same: Same = []
    views = {id(array) for call in ast.walk(source.tree) if isinstance(call, ast.Call) for array in rows(call, source)}
    for node in ast.walk(source.tree):
        if isinstance(node, ast.Subscript) and (name := spelled(node.value)):
            if name.endswith(".shape") and isinstance(node.slice, ast.Constant):
                of = name.removesuffix(".shape")
                least[of] = max(least.get(of, 1), int(str(node.slice.value)) + 1)
            elif id(node) not in views and isinstance(node.slice, ast.Tuple):
                counts.setdefault(name, set()).add(len(node.slice.elts))
            elif id(node) not in views:
                least.setdefault(name, 1)
        elif isinstance(node, ast.Call):
            for name, axes in handed(node, source):
                counts.setdefault(name, set()).add(axes)
        elif isinstance(node, ast.Assign):
            same += (alias for target in node.targets for alias in aliases(target, node.value, source))
    return counts, least, same


def spread(counts: dict[str, set[int]], least: dict[str, int], same: Same) -> None:
    """Let names of the same numbers know each other's axes; last, what is indexed and nothing else has one axis."""
    for turn in range(2 * len(same) + 2):
        for view, array, more in same:
            if turn > len(same) and view in least and view not in counts and more:
                counts[view] = {least[view]}
            for k in counts.get(array, set()).copy():
                if k > more:
                    counts.setdefault(view, set()).add(k - more)
            for k in counts.get(view, set()).copy():
                counts.setdefault(array, set()).add(k + more)


def spelled(node: ast.expr) -> str:
    """A name, or names with dots; empty for anything else."""
    if isinstance(node, ast.Name):
        return node.id
    if isinstance(node, ast.Attribute) and (before := spelled(node.value)):
        return f"{before}.{node.attr}"
    return ""


def brackets(node: ast.Subscript) -> list[ast.expr]:
    """What stands in the brackets."""
    return list(node.slice.elts) if isinstance(node.slice, ast.Tuple) else [node.slice]


def part(node: ast.expr) -> tuple[str, int]:
    """Whose array an expression is, and how many axes fewer it has."""
    if isinstance(node, ast.Subscript):
        return spelled(node.value), sum(not isinstance(index, ast.Slice) for index in brackets(node))
    return spelled(node), 0


def rows(call: ast.Call, source: KernelSource) -> Iterator[ast.expr]:
    """Arguments of a call that are arrays."""
    callee = source.kernel(call.func)
    if callee is not None:
        for given, kind in zip(call.args, signature(callee)[0].values(), strict=False):
            if isinstance(kind, Array):
                yield given


def handed(call: ast.Call, source: KernelSource) -> Iterator[tuple[str, int]]:
    """Axes of what a call hands on, by those of the kernel's parameters."""
    callee = source.kernel(call.func)
    if callee is None:
        return
    inner, (types, _) = count_axes(callee), signature(callee)
    for given, (name, kind) in zip(call.args, types.items(), strict=False):
        outer, fewer = part(given)
        if outer and isinstance(kind, Array):
            yield outer, inner.get(name, 1) + fewer
        elif outer and isinstance(kind, Several):
            for field in kind.names:
                if f"{name}.{field}" in inner:
                    yield f"{outer}.{field}", inner[f"{name}.{field}"]


def aliases(target: ast.expr, value: ast.expr, source: KernelSource) -> Iterator[tuple[str, str, int]]:
    """Names that an assignment gives to arrays: the new one, whose it is, and how many axes it has fewer."""
    if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
        for name, meant in zip(target.elts, value.elts, strict=True):
            yield from aliases(name, meant, source)
    elif isinstance(target, ast.Tuple) and isinstance(value, ast.Name):
        for name, field in zip(target.elts, source.fields(value.id), strict=False):
            yield spelled(name), f"{value.id}.{field}", 0
    elif isinstance(target, ast.Name) and isinstance(value, ast.Subscript | ast.Name | ast.Attribute):
        of, fewer = part(value)
        if of:
            yield target.id, of, fewer


def checked_before(loop: ast.For) -> list[ast.Subscript]:
    """Parts of arrays that each turn of a loop reads or writes, with indices that its first and last turn bound."""
    if any(isinstance(inner, ast.Break | ast.Return) for inner in ast.walk(loop)):
        return []  # its last turn may never come
    stored = [inner.id for inner in ast.walk(loop) if isinstance(inner, ast.Name) and isinstance(inner.ctx, ast.Store)]
    bound = set(stored)
    name = loop.target.id if isinstance(loop.target, ast.Name) and stored.count(loop.target.id) == 1 else ""
    checked = {}
    for node in (node for node in sure(loop.body) if isinstance(node, ast.Subscript)):
        lines = (isinstance(index, ast.Slice) or is_line(index, name, bound) for index in brackets(node))
        if not names(node.value) & bound and all(lines):
            checked[ast.unparse(node)] = node
    return list(checked.values())


def sure(body: list[ast.stmt]) -> Iterator[ast.AST]:
    """What a block of statements computes whatever its conditions say."""
    for statement in body:
        yield from parts(statement)
        if any(isinstance(inner, ast.Continue) for inner in ast.walk(statement)):
            return


def parts(node: ast.AST) -> Iterator[ast.AST]:
    """Parts of a statement or expression that are computed whenever it is."""
    yield node
    inner: list[ast.AST] = list(ast.iter_child_nodes(node))
    if isinstance(node, ast.If | ast.While | ast.IfExp):
        inner = [node.test]
    elif isinstance(node, ast.For):
        inner = [node.iter]
    elif isinstance(node, ast.BoolOp):
        inner = [node.values[0]]
    elif isinstance(node, ast.Compare):
        inner = [node.left, node.comparators[0]]
    for part in inner:
        yield from parts(part)


def names(node: ast.AST) -> set[str]:
    """Names in an expression."""
    return {inner.id for inner in ast.walk(node) if isinstance(inner, ast.Name)}


def is_line(node: ast.expr, name: str, bound: set[str]) -> bool:
    """Whether an index is a sum of what the loop leaves alone and of its name, once."""
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Sub | ast.Mult):
        once = name not in names(node.left) & names(node.right)
        steady = not isinstance(node.op, ast.Mult) or name not in names(node)
        return once and steady and is_line(node.left, name, bound) and is_line(node.right, name, bound)
    return isinstance(node, ast.Constant) or (isinstance(node, ast.Name) and (node.id == name or node.id not in bound))
