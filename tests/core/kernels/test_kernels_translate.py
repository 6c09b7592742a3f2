"""What becomes C and how, and what is refused: file, line and reason."""

import importlib.util
import math
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from plumbob.core import kernels
from plumbob.core.check import Floats
from plumbob.core.kernels import build, emit, kernel
from plumbob.core.kernels.sources import UnsupportedError
from plumbob.core.kernels.translate import Translator
from tests.helpers.kernel_bits import Counted


class Pair(NamedTuple):
    level: float
    rows: Floats


@kernel
def arithmetic(a: float, b: float, i: int, j: int) -> tuple[float, float, float, float, int, int, int, bool]:
    whole = i // j if j else 0
    rest = i % j if j else 0
    return min(a, b), max(a, b), a % 7.0, abs(a) ** 2, whole, rest, (i << 3) ^ ~j, a < b <= 3.0 or i == j


@kernel
def bind(x: Floats, n: int) -> float:
    x[0], x[1] = x[1], x[0]
    total, step = 0.0, 2
    for k in range(n - 1, -1, -step):
        if k == 1:
            continue
        total += x[k]
    while total > 100.0:
        total *= 0.5
    return total


@kernel
def views(p: Pair, out: Floats) -> int:
    own, row = np.zeros((2, 3)), p.rows[1]
    for i in (2, 0, 1):
        own[1, i] = p.level * row[i]
    rest = p.rows[-1, 1:]
    out[:] = own[1, 2] + rest[0]
    return rest.shape[0] + len(out[1:5])


@kernel
def into(x: Floats) -> float:
    x[0] = 1.0
    return 2.0


@kernel
def places(x: Floats, y: Floats, n: int, at: int, step: int) -> float:
    total = (1.0, 2.0, 3.0)[at]
    for k in range(n):
        if k < x.shape[0]:
            total += x[k]
    for k in range(n - 1, -1, -2):
        for i in range(k):
            y[k - i, 1] += x[2 * at + i]
    for k in range(0, n, step):
        if x[k + at] > 0.5:
            break
        total += y[k, at]
    return total


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    """The kernels above in an extension of their own."""
    folder = tmp_path_factory.mktemp("kernels")
    room = "here"
    for name in ("python.h", "kernels.h", "door.h"):
        (folder / name).write_text((emit.HERE / name).read_text())
    (folder / "here.c").write_text(emit.unit(room, [one.py_func for one in (arithmetic, bind, views, places)]))
    (folder / "module.c").write_text(emit.module([room]))
    objects = [build.compiled(build.compiler(), folder / name) for name in ("here.c", "module.c")]
    build.link(build.compiler(), objects, folder / "_kernels.so")
    spec = importlib.util.spec_from_file_location("_kernels", folder / "_kernels.so")
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return lambda one: getattr(found, kernels.name_in_extension(one.py_func))


small = st.integers(-(2**40), 2**40)


@given(st.floats(allow_infinity=False, width=32) | st.just(math.nan), st.floats(), small, small)
def test_arithmetic_is_that_of_python(compiled, a, b, i, j):
    """Of 24 bits, so that squares are exact: else those of Python's floats are C's pow, of NumPy's numbers products."""
    assert repr(compiled(arithmetic)(a, b, i, j)) == repr(arithmetic.py_func(a, b, i, j))


@given(st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=9))
def test_names_are_bound_at_once_and_loops_end_where_they_do(compiled, values):
    ours, theirs = np.array(values), np.array(values)
    assert compiled(bind)(ours, ours.size) == bind.py_func(theirs, theirs.size)
    assert ours.tobytes() == theirs.tobytes()


def test_views_and_named_tuples(compiled):
    pair, ours, theirs = Pair(1.5, np.arange(12.0).reshape(4, 3)), np.zeros(7), np.zeros(7)
    assert compiled(views)(pair, ours) == views.py_func(pair, theirs) == 6
    assert ours.tobytes() == theirs.tobytes()


few = st.integers(0, 5)


@given(few, few, st.integers(-1, 6), few, st.integers(1, 3), st.integers(0, 99))
def test_an_index_is_refused_where_python_refuses_it_and_nowhere_else(compiled, rows, others, n, at, step, seed):
    """Indices that a loop checks before it begins are those, and only those, that it is sure to come to."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(-1.0, 1.0, rows), rng.uniform(size=(others, 3))
    ours, theirs = y.copy(), y.copy().view(Counted)
    try:
        expected = places.py_func(x.view(Counted), theirs, n, at, step)
    except IndexError:
        with pytest.raises(IndexError, match=r"places: index -?\d+ is outside an axis of \d+ numbers"):
            compiled(places)(x, ours, n, at, step)
        return
    assert compiled(places)(x, ours, n, at, step) == expected
    assert ours.tobytes() == theirs.tobytes()


def test_other_threads_run_while_a_kernel_loops_over_numbers():
    for one, lets in ((bind, True), (arithmetic, False)):
        assert ("PyEval_SaveThread" in emit.unit("here", [one.py_func])) == lets


def test_what_is_given_to_c_is_looked_at_first(compiled):
    call = compiled(bind)
    strided, single = np.zeros(8)[::2], np.zeros(4, dtype=np.float32)
    for wrong in (np.zeros((2, 2)), single, np.zeros(4, dtype=np.int64), strided, [0.0, 1.0], None):
        with pytest.raises((TypeError, ValueError, BufferError)):
            call(wrong, 2)
    fixed = np.zeros(4)
    fixed.setflags(write=False)
    for words in ((fixed, 2), (np.zeros(4),), (np.zeros(4), 2, 3), (np.zeros(4), 1.5), (np.zeros(4), 2**70)):
        with pytest.raises((TypeError, ValueError, OverflowError)):
            call(*words)
    with pytest.raises(TypeError, match="takes a tuple of 2"):
        compiled(views)((1.0,), np.zeros(3))


@kernel
def untyped(a, b: float) -> float:
    return b


@kernel
def text(a: str) -> float:
    return 0.0


@kernel
def mixed(flag: bool) -> float:
    return 1.0 if flag else (1.0, 2.0)


@kernel
def library(x: Floats) -> float:
    return float(np.median(x))


@kernel
def column(x: Floats) -> float:
    y = x[:, 0]
    return y[0]


@kernel
def every_second(x: Floats) -> float:
    y = x[0, ::2]
    return y[0]


@kernel
def stepped(x: Floats) -> float:
    y = x[:, ::2]
    return y[0, 0]


@kernel
def growing(n: int) -> float:
    x = np.zeros(n)
    return x[0]


@kernel
def unordered(x: Floats) -> float:
    return into(x) + x[0]


@kernel
def vectors(x: Floats, y: Floats) -> float:
    z = x + y
    return z[0]


@kernel
def two_ways(x: Floats) -> float:
    return x[0, 0] + x[0, 0, 0]


@kernel
def catching(x: float) -> float:
    try:
        return x
    except ValueError:
        return 0.0


@kernel
def unsigned(x: NDArray[np.uint64], i: int) -> int:
    return int(x[0] + i)


REFUSED = {
    untyped: "no annotation of a", text: "is not a type of a kernel", mixed: "one name for double and",
    library: "neither a kernel nor a function of the subset", column: "do not stand one behind the other",
    every_second: "a view has no step", stepped: "only the first axis",
    growing: "is a constant of at most", unordered: "give its result a name", vectors: "write a loop",
    two_ways: r"indexed with \[2, 3\] numbers", catching: "Try is not in the subset", unsigned: "go with each other",
}  # fmt: skip


@pytest.mark.parametrize("one", REFUSED, ids=lambda one: one.py_func.__name__)
def test_what_is_no_c_is_refused_with_its_place(one):
    with pytest.raises(UnsupportedError, match=rf"test_kernels_translate\.py:\d+: .*({REFUSED[one]})"):
        Translator(one.py_func).text()
