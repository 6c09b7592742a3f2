"""One sample: what is taken, what is refused, and a recording taken apart into samples."""

import numpy as np
import pytest

from plumbob import Filter, Frame, ImuData, ImuMeta, ImuSample, flags
from plumbob.core.errors import ClockError, ParameterError, ShapeError
from tests.helpers.motion import noisy

TRIADS = ("gyr", "acc", "mag")
NINE = np.arange(1.0, 10.0)


def same(a, b):
    return np.array_equal(a, b, equal_nan=True)


WRONG = [
    *((ClockError, {"t_ns": t}, "whole number of nanoseconds, but it is") for t in (0.5, "0", None, np.float64(3.0))),
    *((ClockError, {"t_ns": t}, "t_ns must lie within") for t in (2**63, -(2**63) - 1, 2**70)),
    *((ParameterError, {"flags": word}, "flags must be") for word in (1.5, "1", None, -1, 2**32, 2**70)),
    (ShapeError, {"gyr": [False, False, True]}, "gyr must hold real numbers, but its type is bool"),
    (ShapeError, {"acc": [1j, 0, 0]}, "acc must hold real numbers, but its type is complex128"),
    (ShapeError, {"mag": ["1", "2", "3"]}, "mag must hold real numbers"),
    (ShapeError, {"gyr": [1.0, None, 3.0]}, "gyr must hold real numbers, but its type is object"),
    (ShapeError, {"acc": np.ma.masked_array([1.0, 2.0, 3.0], [0, 1, 0])}, "acc .*masked array"),
    (ShapeError, {"mag": [[1.0], [2.0, 3.0], [4.0]]}, "mag must be an array of numbers"),
    *(
        (ShapeError, {"values": bad}, r"values of a sample must have shape \(9,\), but their shape is")
        for bad in (np.zeros(8), np.zeros((3, 3)), np.zeros((9, 1)), 0.0, [])
    ),
    (ShapeError, {"values": np.zeros(9, dtype=bool)}, "values must hold real numbers, but its type is bool"),
]


class TestImuSample:
    @pytest.mark.parametrize(("error", "wrong", "says"), WRONG)
    def test_what_is_no_sample_is_refused_by_name(self, error, wrong, says):
        for make, own in ((ImuSample, set(TRIADS)), (ImuSample.packed, {"values"})):
            if set(wrong) <= {"t_ns", "flags"} | own:
                with pytest.raises(error, match=says):
                    make(**({"t_ns": 0} | ({"values": NINE} if "values" in own else {}) | wrong))

    def test_what_is_put_in_comes_out_and_the_largest_time_and_word_are_taken(self):
        for make in (ImuSample, lambda t_ns, **k: ImuSample.packed(t_ns, NINE, **k)):
            sample = make(np.int64(2**63 - 1), flags=np.uint32(2**32 - 1))
            assert (sample.t_ns, sample.flags) == (2**63 - 1, 2**32 - 1)
        s = ImuSample(5, gyr=[1.0, 2.0, 3.0], mag=(7, 8, 9))
        assert same(s.values, [1, 2, 3, np.nan, np.nan, np.nan, 7, 8, 9])
        assert (s.t_ns, s.temp_c, s.flags) == (5, None, 0)
        assert same(ImuSample(0).values, np.full(9, np.nan))
        apart = ImuSample(-7, NINE[:3], NINE[3:6], NINE[6:], temp_c=21.5, flags=flags.GAP)
        packed = ImuSample.packed(-7, NINE, 21.5, flags.GAP)
        for s in (apart, packed):
            assert (s.t_ns, s.temp_c, s.flags) == (-7, 21.5, flags.GAP)
            assert s.values.tobytes() == NINE.tobytes()
            assert [getattr(s, name).tolist() for name in TRIADS] == [[1, 2, 3], [4, 5, 6], [7, 8, 9]]
        shown = repr(ImuSample(12, gyr=[0.5, 0.0, -0.5], temp_c=20.0, flags=3))
        none = "[nan, nan, nan]"
        assert shown == f"ImuSample(t_ns=12, gyr=[0.5, 0.0, -0.5], acc={none}, mag={none}, temp_c=20.0, flags=3)"

    @pytest.mark.parametrize("dress", [np.array([1, 2, 3], dtype=">i2"), np.array([3.0, 2.0, 1.0])[::-1], range(1, 4)])
    @pytest.mark.parametrize("triad", TRIADS)
    def test_numbers_in_any_dress(self, triad, dress):
        s = ImuSample(0, **{triad: dress})
        assert s.values.dtype == np.float64
        assert s.values.dtype.isnative
        assert getattr(s, triad).tolist() == [1.0, 2.0, 3.0]

    def test_the_numbers_are_its_own_and_cannot_be_written(self):
        mine = NINE.copy()
        for s in (ImuSample.packed(0, mine), ImuSample(0, mine[:3], mine[3:6], mine[6:])):
            mine[:] = -1.0
            assert s.values.tolist() == NINE.tolist()
            mine[:] = NINE
            for view in (s.values, s.gyr, s.acc, s.mag):
                with pytest.raises(ValueError, match="read-only"):
                    view[0] = 0.0


class TestSamplesOfARecording:
    def test_put_together_again_they_are_the_recording(self):
        plain = noisy(300)
        gyr = plain.gyr.copy()
        gyr[7] = 30.0
        temp_c = np.linspace(20.0, 21.0, 300)
        meta = ImuMeta(gyr_range=30.0)  # so that a sample is clipped, which only its flags say
        data = ImuData(t=plain.t, gyr=gyr, acc=plain.acc, mag=plain.mag, temp_c=temp_c, meta=meta)
        samples = list(data.samples())
        again = ImuData(
            t=[s.t_ns / 1e9 for s in samples], **{name: [getattr(s, name) for s in samples] for name in TRIADS},
            temp_c=[s.temp_c for s in samples], flags=[s.flags for s in samples],
        )  # fmt: skip
        assert [s.t_ns for s in samples] == data.t_ns.tolist()
        assert again.t.tobytes() == data.t.tobytes()
        for name in TRIADS:
            assert getattr(again, name).tobytes() == getattr(data, name).tobytes()
        assert again.temp_c.tobytes() == data.temp_c.tobytes()
        assert again.flags.tolist() == data.flags.tolist()
        assert again.flags[7] & flags.GYR_CLIPPED

    @pytest.mark.parametrize("has", TRIADS)
    def test_a_triad_that_the_unit_lacks_is_nan(self, has):
        data = ImuData(t=[0.0, 0.1], **{has: [[1.0, 2.0, 9.0]] * 2})
        for s in data.samples():
            assert s.temp_c is None
            for name in TRIADS:
                assert same(getattr(s, name), [1.0, 2.0, 9.0] if name == has else [np.nan] * 3)

    def test_samples_outlive_the_recording_and_its_parts_keep_times_and_flags(self):
        data = noisy(50)
        whole, part = list(data.samples())[20:30], list(data[20:30].samples())
        assert [(s.t_ns, s.flags, s.values.tobytes()) for s in part] == [
            (s.t_ns, s.flags, s.values.tobytes()) for s in whole
        ]
        samples = list(noisy(20).samples())
        before = [s.values.tobytes() for s in samples]
        f = Filter("mahony", frame=Frame.ENU)
        for s in samples:
            f.update(s)
        assert [s.values.tobytes() for s in samples] == before
