"""Bare addresses and inlining: the same bits as with arrays and calls, and no reference counting left."""

import re

import numpy as np
import pytest

from plumbob.core._jit import bare, njit, njit_reassociated, specialise
from plumbob.rotations.kernels import quat_exp, quat_mul
from tests.helpers import in_the_other_mode, jit_disabled


@njit
def step(i, x, rate, t_ns, seen):
    """All that a step does with its arrays: reads three types at an index, reads and writes a state."""
    if seen[i] & 8:
        return 8
    dt = float(t_ns[i + 1] - t_ns[i]) / 1e9
    weight = 0.5 if seen[i] & 4 else 1.0
    e0, e1, e2, e3 = quat_exp(weight * dt * rate[3 * i], weight * dt * rate[3 * i + 1], weight * dt * rate[3 * i + 2])
    x[0], x[1], x[2], x[3] = quat_mul(x[0], x[1], x[2], x[3], e0, e1, e2, e3)
    if x[0] < 0.0:
        return 1
    return 0


@njit
def row(i, x, rate, t_ns, seen, found):
    found[i] = step(i, x, rate, t_ns, seen)


@njit
def with_arrays(x, rate, t_ns, seen, found):
    for i in range(seen.shape[0]):
        row(i, x[2:], rate, t_ns, seen, found)


@njit
def with_addresses(x, rate, t_ns, seen, found):
    for i in range(seen.shape[0]):
        row(i, bare(x[2:]), bare(rate), bare(t_ns), bare(seen), bare(found))


def arrays(read_only):
    rng = np.random.default_rng(4)
    x = np.array([-1.0, -2.0, 1.0, 0.0, 0.0, 0.0, -3.0])  # the state begins at a third number, as in a streamed call
    rate = rng.normal(size=(50, 3))
    t_ns = np.cumsum(rng.integers(1, 10**9, 51))
    seen = rng.integers(0, 2**32, 50, dtype=np.uint32)
    for array in (rate, t_ns, seen):
        array.flags.writeable = not read_only
    return x, rate.ravel(), t_ns, seen, np.empty(50, dtype=np.uint32)


def states(read_only=True):
    """What the loop leaves behind, called with arrays and with addresses, as bytes in hex."""
    found = []
    for loop in (with_arrays, with_addresses):
        x, *rest = arrays(read_only)
        loop(x, *rest)
        assert (x[:2].tolist(), x[6]) == ([-1.0, -2.0], -3.0)
        assert abs(np.linalg.norm(x[2:6]) - 1.0) < 50 * np.finfo(float).eps  # 50 products of unit quaternions
        found.append(x.tobytes().hex() + rest[-1].tobytes().hex())
    return found


def test_arrays_and_addresses_give_the_same_bits():
    for read_only in (True, False):
        by_array, by_address = states(read_only)
        assert by_array == by_address


def test_plain_python_gives_the_same_bits_and_bare_is_then_the_array_itself():
    code = "from tests.core.test_core_jit_bare import states; given = states()"
    assert in_the_other_mode(code, warnings="error") == states()
    x = np.zeros(3)
    assert bare.py_func(x) is x


@njit
def long_callee(a, b, c, d, x):
    """Too long and called too often for the compiler to inline it by itself."""
    for _ in range(3):
        e0, e1, e2, e3 = quat_exp(x, 0.5 * x, 0.25 * x)
        a, b, c, d = quat_mul(a, b, c, d, e0, e1, e2, e3)
        e0, e1, e2, e3 = quat_exp(0.5 * x, x, 0.25 * x)
        a, b, c, d = quat_mul(a, b, c, d, e0, e1, e2, e3)
    return a, b, c, d


@njit
def caller(x):
    a, b, c, d = long_callee(1.0, 0.0, 0.0, 0.0, x)
    a, b, c, d = long_callee(a, b, c, d, 0.5 * x)
    a, b, c, d = long_callee(d, a, b, c, 0.1 * x)
    return a + b + c + d


def _sum(x):
    total = 0.0
    for k in range(x.shape[0]):
        total += x[k]
    return total


in_order, in_any_order = njit(_sum), njit_reassociated(_sum)


@njit
def both_sums(x):
    return in_order(x), in_any_order(x)


@njit
def rest_of_sum(a, b):
    return (a + b) - a


@njit_reassociated
def sum_of_rests(x):
    total = 0.0
    for value in x:
        total += rest_of_sum(1.0, value)
    return total


def code_of(kernel, *args):
    """What the compiler made of a kernel, without the wrappers that Python and C call."""
    kernel(*args)
    dispatcher = kernel.compiled
    text = dispatcher.inspect_llvm(dispatcher.signatures[0])
    name = dispatcher.overloads[dispatcher.signatures[0]].fndesc.llvm_func_name
    return re.search(rf"^define [^\n]*@\"?{re.escape(name)}\"?\(.*?^}}", text, re.MULTILINE | re.DOTALL).group()


@pytest.mark.skipif(jit_disabled(), reason="plain Python has no machine code")
class TestMachineCode:
    def test_callees_are_inlined_addresses_are_not_counted_and_a_kernel_keeps_its_order(self):
        """Arrays are: two atomic operations for each that a kernel hands on."""
        assert "long_callee" not in re.sub(r"NumbaEnv\S*", "", code_of(caller, 0.1))
        assert "NRT_" in code_of(with_arrays, *arrays(True))
        assert "NRT_" not in code_of(with_addresses, *arrays(True))
        # 1 + 2⁻⁶⁰ is 1 in float64, so nothing is left; in another order 2⁻⁶⁰ would be
        assert sum_of_rests(np.full(8, 2.0**-60)) == 0.0

    def test_only_marked_kernels_add_in_any_order(self):
        """Also when they are specialised; and NaN stays NaN."""
        x = np.array([1.0, np.nan, 2.0])
        for kernel in (in_any_order, specialise(in_any_order, "copy")):
            assert "fadd reassoc" in code_of(kernel, x)
            assert "nnan" not in code_of(kernel, x)
        assert "reassoc" not in code_of(in_order, x)
        both = code_of(both_sums, x)
        assert "fadd reassoc" in both
        assert re.search(r"fadd double", both)
        assert np.isnan(both_sums(x)).all()
