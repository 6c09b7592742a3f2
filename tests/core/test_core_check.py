"""Validators: what passes, passes as float64; what does not is named with rule, expectation, finding and place."""

import numpy as np
import pytest

from plumbob.core import check
from plumbob.core.errors import ClockError, PlumbobError, ShapeError


class TestFloats:
    @pytest.mark.parametrize(
        "value",
        [
            [1, 2, 3],
            (1.0, 2.0, 3.0),
            np.array([1, 2, 3], dtype=np.int16),
            np.array([1, 2, 3], dtype=np.uint64),
            np.array([1, 2, 3], dtype=np.float32),
            np.array([1, 2, 3], dtype=np.float16),
            np.array([1, 2, 3], dtype=">f8"),
            np.array([1, 2, 3], dtype=">i2"),
            np.array([3.0, 2.0, 1.0])[::-1],
            np.arange(6.0)[1:6][::1][:3],
            np.repeat([1.0, 2.0, 3.0], 2)[::2],
            memoryview(np.array([1.0, 2.0, 3.0])),
            range(1, 4),
        ],
        ids=lambda v: f"{type(v).__name__}-{getattr(v, 'dtype', '')}",
    )
    def test_numbers_in_any_dress(self, value):
        array = check.floats("x", value)
        assert array.dtype == np.float64
        assert array.dtype.isnative
        assert array.flags.c_contiguous
        assert array.shape == (3,)
        assert set(np.abs(np.diff(array))) == {1.0}

    def test_values_and_order_survive_a_foreign_layout(self):
        table = np.arange(12.0).reshape(4, 3)
        for foreign in (np.asfortranarray(table), table.astype(">f8"), table[::-1][::-1], table.T.copy().T):
            assert np.array_equal(check.floats("x", foreign), table)

    @pytest.mark.parametrize(
        ("value", "says"),
        [
            (np.ma.masked_array([1.0, 2.0], [False, True]), r"x is a masked array; .*x\.filled\(np\.nan\)"),
            ([np.ma.masked_array([1.0, 2.0], [False, True])], "masked array"),
            ([False, False, True], "x must hold real numbers, but its type is bool"),
            (True, "type is bool"),
            (np.zeros((2, 3), dtype=bool), "type is bool"),
            ([1 + 2j], "real numbers, but its type is complex128"),
            (["1.0"], "real numbers, but its type is <U3"),
            ([b"1.0"], r"type is \|S3"),
            ([1.0, None], "type is object"),
            (None, "type is object"),
            ({"a": 1}, "type is object"),
            (np.array(["2024-01-01"], dtype="M8[ns]"), r"type is datetime64\[ns\]"),
            ([[1.0, 2.0], [3.0]], "x must be an array of numbers"),
        ],
    )
    def test_refused(self, value, says):
        with pytest.raises(ShapeError, match=says):
            check.floats("x", value)

    def test_shape_of_a_scalar_stays(self):
        assert check.floats("x", 5.0).shape == ()


class TestTables:
    def test_last_axis(self):
        for shape in ((3,), (1, 3), (0, 3), (2, 4, 3)):
            assert check.last_axis("v", np.ones(shape), 3).shape == shape
        for shape in ((), (2,), (3, 1), (0,), (3, 4)):
            with pytest.raises(ShapeError, match=r"v must have shape \(\.\.\., 3\), but its shape is"):
                check.last_axis("v", np.ones(shape), 3)

    def test_rows(self):
        assert check.rows("v", np.ones((5, 3)), 3, 5).shape == (5, 3)
        with pytest.raises(
            ShapeError, match=r"v must have shape \(N, 3\), but its shape is \(3, 5\); it looks transp.*v\.T"
        ):
            check.rows("v", np.ones((3, 5)), 3)
        with pytest.raises(ShapeError, match=r"v must have one row per time stamp \(4\), but it has 5"):
            check.rows("v", np.ones((5, 3)), 3, 4)
        for shape in ((3,), (5, 4), (1, 5, 3), ()):
            with pytest.raises(ShapeError, match=r"v must have shape \(N, 3\)"):
                check.rows("v", np.ones(shape), 3)

    def test_column(self):
        assert check.column("t", [1, 2], 2).shape == (2,)
        with pytest.raises(ShapeError, match=r"t must have one entry per time stamp \(3\), but it has 2"):
            check.column("t", [1, 2], 3)
        for value in (np.ones((2, 1)), 1.0):
            with pytest.raises(ShapeError, match=r"t must have shape \(N,\)"):
                check.column("t", value)


class TestBits:
    def test_all_32_bits_pass(self):
        words = [0, 1, 2**31, 2**32 - 1]
        assert check.bits("flags", words, 4).tolist() == words
        assert check.bits("flags", np.array(words, dtype=np.uint32), 4).dtype == np.uint32

    @pytest.mark.parametrize("bad", [-1, 0.5, 2.0**32, np.nan, np.inf])
    def test_refused(self, bad):
        with pytest.raises(ShapeError, match=r"flags\[1\] = .*, but flags are whole numbers from 0 to"):
            check.bits("flags", [0, bad], 2)


class TestMask:
    @pytest.mark.parametrize("value", [[True, False], [1, 0], [1.0, 0.0], np.array([1, 0], dtype=np.uint8)])
    def test_truth_values(self, value):
        assert check.mask("score", value, 2).tolist() == [True, False]

    @pytest.mark.parametrize(
        ("value", "says"),
        [
            (np.ma.masked_array([True, False], [False, True]), "masked array"),
            (["yes", "no"], "real numbers"),
            (True, r"shape \(N,\)"),
            ([True], r"one entry per time stamp \(2\)"),
        ],
    )
    def test_what_is_no_column_of_truth_values(self, value, says):
        with pytest.raises(ShapeError, match=f"score .*{says}"):
            check.mask("score", value, 2)

    @pytest.mark.parametrize("bad", [2, -1, np.nan, 0.5])
    def test_refused(self, bad):
        with pytest.raises(ShapeError, match=r"score\[1\] = .*must be True or False"):
            check.mask("score", [1, bad], 2)


class TestIncreasingTime:
    @pytest.mark.parametrize("t", [[0.0], [-1.0, 0.0, 1e-9], [0.0, 5e-324], [-1e308, 1e308]])
    def test_passes(self, t):
        check.increasing_time("t", np.array(t))

    @pytest.mark.parametrize(
        ("t", "error", "says"),
        [
            ([], ShapeError, "t is empty"),
            ([0.0, np.nan], ClockError, r"t\[1\] = nan: time stamps must be finite"),
            ([0.0, np.inf], ClockError, r"t\[1\] = inf"),
            ([-np.inf, 0.0], ClockError, r"t\[0\] = -inf"),
            ([0.0, 1.0, 1.0], ClockError, r"t\[2\] = 1\.0+ s comes after t\[1\] = 1\.0+ s \(1 such places\)\. Sort"),
            ([0.0, 2.0, 1.0, 3.0, 2.5], ClockError, r"t\[2\] = 1\.0+ s comes after t\[1\] = 2\.0+ s \(2 such"),
        ],
    )
    def test_refused(self, t, error, says):
        with pytest.raises(error, match=says):
            check.increasing_time("t", np.array(t, dtype=float))


class TestUnitNorm:
    def test_names_the_row(self):
        q = np.tile([1.0, 0, 0, 0], (5, 1))
        q[3, 1] = 0.1
        with pytest.raises(ShapeError, match=r"q\[3\] has norm 1\.00498756, but a rotation needs norm 1 ± 1e-06"):
            check.unit_norm("q", q)
        check.unit_norm("q", q, tolerance=0.01)

    def test_a_single_one_has_no_index(self):
        with pytest.raises(ShapeError, match=r"^q has norm 2, but"):
            check.unit_norm("q", np.array([2.0, 0, 0, 0]))

    def test_absent_rows_pass_and_infinite_ones_do_not(self):
        check.unit_norm("q", np.array([[np.nan] * 4, [0, 1.0, 0, 0]]))
        with pytest.raises(ShapeError, match=r"q\[0\] has norm inf"):
            check.unit_norm("q", np.array([[np.inf, 0, 0, 0]]))
        with pytest.raises(ShapeError, match=r"q\[0\] has norm inf"):
            check.unit_norm("q", np.array([[1e200, 0, 0, 0]]))


def test_one_of():
    assert check.one_of("order", "wxyz", ("wxyz", "xyzw")) == "wxyz"
    with pytest.raises(PlumbobError, match="order must be one of wxyz, xyzw, but it is 'zyxw'"):
        check.one_of("order", "zyxw", ("wxyz", "xyzw"))


class TestReadOnly:
    def test_what_could_still_be_written_is_copied(self):
        mine = np.arange(6.0)
        for given in (mine, mine[:3], mine[::2], mine.reshape(2, 3)):
            frozen = check.read_only(given)
            assert not np.shares_memory(frozen, mine)
            assert np.array_equal(frozen, given)
        assert mine.flags.writeable

    def test_a_read_only_view_of_writable_memory_is_copied_too(self):
        mine = np.arange(6.0)
        view = mine.view()
        view.flags.writeable = False
        assert not np.shares_memory(check.read_only(view), mine)

    def test_frozen_memory_is_shared(self):
        mine = np.arange(6.0)
        mine.flags.writeable = False
        for given in (mine, mine[2:], np.frombuffer(bytes(16))):
            assert np.shares_memory(check.read_only(given), given)

    def test_the_flag_cannot_be_set_back(self):
        frozen = check.read_only(np.arange(3.0))
        with pytest.raises(ValueError, match="read-only"):
            frozen[0] = 1.0
        with pytest.raises(ValueError, match="WRITEABLE"):
            frozen.flags.writeable = True
