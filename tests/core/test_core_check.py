"""What public functions check, the errors they raise, and flags, whose words are those of both languages."""

import inspect
import math
import re

import numpy as np
import pytest

from plumbob.core import check, errors, flags
from plumbob.core.errors import ClockError, ParameterError, PlumbobError, ShapeError
from plumbob.core.params import Parameter, Spec, allowed, checked
from plumbob.core.text import counted, first_words, p_value
from plumbob.core.units import Quantity

MASKED = np.ma.masked_array([1.0, 2.0], [False, True])
ROWS = r"v must have shape \(N, 3\)"
LAST = r"v must have shape \(\.\.\., 3\), but its shape is"
TRUTH = r"score\[1\] = .*must be True or False"
WORD = r"flags\[1\] = .*, but flags are whole numbers from 0 to"


@pytest.mark.parametrize("value", [
    [1, 2, 3],
    (1.0, 2.0, 3.0),
    np.array([1, 2, 3], dtype=np.uint64),
    np.array([1, 2, 3], dtype=np.float16),
    np.array([1, 2, 3], dtype=">f8"),
    np.array([1, 2, 3], dtype=">i2"),
    np.array([3.0, 2.0, 1.0])[::-1],
    np.repeat([1.0, 2.0, 3.0], 2)[::2],
    memoryview(np.array([1.0, 2.0, 3.0])),
    range(1, 4),
], ids=lambda v: f"{type(v).__name__}-{getattr(v, 'dtype', '')}")  # fmt: skip
def test_numbers_in_any_dress(value):
    array = check.floats("x", value)
    assert array.dtype == np.float64
    assert array.dtype.isnative and array.flags.c_contiguous
    assert array.tolist() == [1.0, 2.0, 3.0]


def test_values_order_and_shapes_stay():
    table = np.arange(12.0).reshape(4, 3)
    for foreign in (np.asfortranarray(table), table.astype(">f8"), table[::-1][::-1], table.T.copy().T):
        assert np.array_equal(check.floats("x", foreign), table)
    assert check.floats("x", 5.0).shape == ()
    for shape in ((3,), (1, 3), (0, 3), (2, 4, 3)):
        assert check.last_axis("v", np.ones(shape), 3).shape == shape
    assert (check.rows("v", np.ones((5, 3)), 3, 5).shape, check.column("t", [1, 2], 2).shape) == ((5, 3), (2,))
    words = [0, 1, 2**31, 2**32 - 1]
    assert check.bits("flags", words, 4).tolist() == words
    assert check.bits("flags", np.array(words, dtype=np.uint32), 4).dtype == np.uint32
    for truth in ([True, False], [1, 0], [1.0, 0.0], np.array([1, 0], dtype=np.uint8)):
        assert check.mask("score", truth, 2).tolist() == [True, False]
    for t in ([0.0], [-1.0, 0.0, 1e-9], [0.0, 5e-324], [-1e308, 1e308]):
        check.increasing_time("t", np.array(t))
    assert check.one_of("order", "wxyz", ("wxyz", "xyzw")) == "wxyz"


def leaning(value):
    """Five unit quaternions, of which the fourth has another number at its second place."""
    q = np.tile([1.0, 0, 0, 0], (5, 1))
    q[3, 1] = value
    return q


def increasing(*t):
    return check.increasing_time, "t", np.array(t)


FLOATS = [
    (MASKED, r"x is a masked array; .*x\.filled\(np\.nan\)"), ([MASKED], "masked array"),
    ([False, False, True], "x must hold real numbers, but its type is bool"), (True, "type is bool"),
    (np.zeros((2, 3), dtype=bool), "type is bool"), ([1 + 2j], "real numbers, but its type is complex128"),
    (["1.0"], "real numbers, but its type is <U3"), ([b"1.0"], r"type is \|S3"), ([1.0, None], "type is object"),
    ({"a": 1}, "type is object"), (np.array(["2024-01-01"], dtype="M8[ns]"), r"type is datetime64\[ns\]"),
    ([[1.0, 2.0], [3.0]], "x must be an array of numbers"),
]  # fmt: skip
SHAPES = [
    *((check.last_axis, "v", np.ones(shape), 3, LAST) for shape in ((), (2,), (3, 1), (0,), (3, 4))),
    (check.rows, "v", np.ones((3, 5)), 3, rf"{ROWS}, but its shape is \(3, 5\); it looks transp.*v\.T"),
    (check.rows, "v", np.ones((5, 3)), 3, 4, r"v must have one row per time stamp \(4\), but it has 5"),
    *((check.rows, "v", np.ones(shape), 3, ROWS) for shape in ((3,), (5, 4), (1, 5, 3), ())),
    (check.column, "t", [1, 2], 3, r"t must have one entry per time stamp \(3\), but it has 2"),
    *((check.column, "t", value, r"t must have shape \(N,\)") for value in (np.ones((2, 1)), 1.0)),
    *((check.bits, "flags", [0, bad], 2, WORD) for bad in (-1, 0.5, 2.0**32, np.nan, np.inf)),
    (check.mask, "score", np.ma.masked_array([True, False], [False, True]), 2, "score .*masked array"),
    (check.mask, "score", ["yes", "no"], 2, "score .*real numbers"),
    (check.mask, "score", [True], 2, r"score .*one entry per time stamp \(2\)"),
    *((check.mask, "score", [1, bad], 2, TRUTH) for bad in (2, -1, np.nan, 0.5)),
    (check.unit_norm, "q", leaning(0.1), r"q\[3\] has norm 1\.00498756, but a rotation needs norm 1 ± 1e-06"),
    (check.unit_norm, "q", np.array([2.0, 0, 0, 0]), r"^q has norm 2, but"),
    (check.unit_norm, "q", leaning(np.inf), r"q\[3\] has norm inf"),
    (check.unit_norm, "q", leaning(1e200), r"q\[3\] has norm inf"),
    (*increasing(), "t is empty"),
]
TIMES = [
    (*increasing(0.0, np.nan), r"t\[1\] = nan: time stamps must be finite"),
    (*increasing(0.0, np.inf), r"t\[1\] = inf"),
    (*increasing(-np.inf, 0.0), r"t\[0\] = -inf"),
    (*increasing(0.0, 1.0, 1.0), r"t\[2\] = 1\.0+ s comes after t\[1\] = 1\.0+ s \(1 such places\)\. Samples keep"),
    (*increasing(0.0, 2.0, 1.0, 3.0, 2.5), r"t\[2\] = 1\.0+ s comes after t\[1\] = 2\.0+ s \(2 such"),
]
REFUSED = [
    *((ShapeError, check.floats, ("x", value), says) for value, says in FLOATS),
    *((ShapeError, call, given, says) for call, *given, says in SHAPES),
    *((ClockError, call, given, says) for call, *given, says in TIMES),
    (
        PlumbobError,
        check.one_of,
        ("order", "zyxw", ("wxyz", "xyzw")),
        "order must be one of wxyz, xyzw, but it is 'zyxw'",
    ),
]


@pytest.mark.parametrize(("error", "call", "given", "says"), REFUSED)
def test_refused(error, call, given, says):
    with pytest.raises(error, match=says):
        call(*given)


def test_a_norm_is_right_within_its_tolerance_and_where_a_row_is_absent():
    check.unit_norm("q", leaning(0.1), tolerance=0.01)
    check.unit_norm("q", np.array([[np.nan] * 4, [0, 1.0, 0, 0]]))


class TestReadOnly:
    def test_what_could_still_be_written_is_copied_and_frozen_memory_is_shared(self):
        mine = np.arange(6.0)
        for given in (mine, mine[:3], mine[::2], mine.reshape(2, 3)):
            frozen = check.read_only(given)
            assert not np.shares_memory(frozen, mine) and np.array_equal(frozen, given)
            with pytest.raises(ValueError, match="read-only"):
                frozen[0] = 1.0
            with pytest.raises(ValueError, match="WRITEABLE"):
                frozen.flags.writeable = True
        assert mine.flags.writeable
        view = mine.view()
        view.flags.writeable = False  # of memory that is still writable
        assert not np.shares_memory(check.read_only(view), mine)
        mine.flags.writeable = False
        for given in (mine, mine[2:], np.frombuffer(bytes(16))):
            assert np.shares_memory(check.read_only(given), given)


NO_VALUES = {errors.PlumbobError: Exception, errors.MissingExtraError: ImportError, errors.LineError: OSError}
TREE = [
    c for _, c in inspect.getmembers(errors, inspect.isclass) if issubclass(c, Exception) and not issubclass(c, Warning)
]


@pytest.mark.parametrize("error", TREE)
def test_all_descend_from_one_say_what_they_are_and_are_one_of_pythons_own(error):
    """Who does not know this project catches ValueError."""
    assert issubclass(error, errors.PlumbobError) and issubclass(error, NO_VALUES.get(error, ValueError))
    assert re.match(r"[A-Z].*\.$", error.__doc__, re.DOTALL)


BITS = {name: value for name, value in vars(flags).items() if name.isupper() and name != "MEANING"}


def test_each_flag_is_one_bit_of_32_and_has_its_name_and_a_meaning():
    assert sorted(BITS.values()) == sorted(flags.MEANING)
    assert len(set(BITS.values())) == len(BITS)
    for name, value in BITS.items():
        assert value.bit_count() == 1
        assert value < 2**32
        assert flags.MEANING[value][0] == name.lower().replace("_", "-")
        assert flags.MEANING[value][1]
    # Bits never move: recordings on disk hold these numbers, and a new flag takes a new bit.
    assert [flags.MEANING[1 << i][0] for i in range(16)] == [
        "gyr-absent", "acc-absent", "mag-absent", "gyr-clipped", "acc-clipped", "mag-clipped",
        "gyr-invalid", "acc-invalid", "mag-invalid", "gap", "time-fault", "acc-gated", "mag-gated", "gyr-held",
        "not-converged", "heading-free",
    ]  # fmt: skip
    assert (flags.names(0), flags.names(flags.GAP | flags.GYR_ABSENT)) == ((), ("gyr-absent", "gap"))
    assert len(flags.names(0xFFFF)) == 16
    words = np.array([flags.GAP, flags.GAP | flags.GYR_ABSENT, 0], dtype=np.uint32)
    assert (flags.counts(words), flags.counts(words[2:])) == ({"gyr-absent": 1, "gap": 2}, {})


def parameter(quantity, low=-math.inf, high=math.inf, **kind):
    return Parameter("p", Spec(quantity, "", low, high), 0.0, **{"optional": False, "switch": False, **kind})


def test_counts_agree_with_their_noun_and_probabilities_end_where_their_use_does():
    assert [counted(n, "sample") for n in (0, 1, 2)] == ["0 samples", "1 sample", "2 samples"]
    assert [counted(n, "stretch", "stretches") for n in (1, 2)] == ["1 stretch", "2 stretches"]
    assert [p_value(p) for p in (0.0321, 0.001, 1e-138)] == ["p = 0.032", "p = 0.001", "p < 0.001"]
    assert [first_words(["a", "b", "c"], n) for n in (2, 3)] == ["a, b and 1 more", "a, b, c"]


@pytest.mark.parametrize(("one", "text"), [
    (parameter(Quantity.ANGLE, -math.pi, math.pi, optional=True), "-180 to 180 deg, or off"),
    (parameter(Quantity.RATE, 1e-9, 1.0), "5.8e-08 to 57 deg/s"),  # 5.73e-8 and 57.3, rounded inward
    (parameter(Quantity.RATE, 0.0, 10.0), "0 to 570 deg/s"),
    (parameter(Quantity.RATIO, 0.0, 6.75), "0 to 6.75"),
    (parameter(Quantity.TIME, 0.0), "0 s or more"),
    (parameter(Quantity.TIME, high=1.0), "at most 1 s"),
    (parameter(Quantity.TIME), "any number"),
    (parameter(Quantity.RATIO, switch=True), "on or off"),
])  # fmt: skip
def test_a_range_is_printed_as_it_is_declared_or_inside(one, text):
    assert allowed(one) == text
    if one.spec.high == 10.0:
        with pytest.raises(ParameterError, match=r"^f: p must be 0 to 570 deg/s, but it is 859\.437 deg/s\.$"):
            checked("f", one, 15.0)  # 15 rad/s
