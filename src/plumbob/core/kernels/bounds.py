"""Which indices of a loop can be checked before it, so that what it does over and over checks nothing.

An index that the loop leaves alone, or that goes along a line with the loop's own name, is within an array in every
turn if it is in the first and the last. Only what every turn is sure to read or write counts: an index under a
condition is checked where it stands.
"""

import ast
from collections.abc import Iterator

from plumbob.core.kernels.axes import brackets


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
