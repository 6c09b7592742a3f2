"""ImuData: what it takes, what it refuses and how, and that nothing can change it later."""

import copy
import pickle
from dataclasses import FrozenInstanceError, replace

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from plumbob.core import flags, units
from plumbob.core.errors import ClockError, FrameError, PlumbobError, ShapeError, UnitError
from plumbob.core.time import to_s
from plumbob.data import ENOUGH, TRIADS, ImuData, ImuMeta
from plumbob.rotations import Frame, North

N = 200
G = 9.80665


def parts(n=N, seed=3):
    """Arrays of a gently moving unit, in the units that Plumbob wants."""
    rng = np.random.default_rng(seed)
    return {
        "t": 0.01 * np.arange(n),
        "gyr": rng.normal(scale=0.3, size=(n, 3)),
        "acc": [0.0, 0.0, G] + rng.normal(scale=0.5, size=(n, 3)),
        "mag": [20.0, 0.0, -43.0] + rng.normal(scale=0.5, size=(n, 3)),
    }


def made(n=N, **changes):
    return ImuData(**(parts(n) | changes))


def flagged(data, bit):
    return np.flatnonzero(data.flags & bit).tolist()


class TestTaken:
    def test_plain(self):
        given_, data = parts(), made()
        for name in TRIADS:
            assert np.array_equal(getattr(data, name), given_[name])
        assert data.triads == TRIADS
        assert len(data) == N
        assert not data.flags.any()
        assert data.flags.dtype == np.uint32

    @pytest.mark.parametrize(
        "dress",
        [
            lambda a: a.tolist(),
            lambda a: tuple(map(tuple, a.tolist())),
            lambda a: a.astype(">f8"),
            np.asfortranarray,
            lambda a: a[::-1].copy()[::-1],
            lambda a: np.repeat(a, 2, axis=0)[::2],
            lambda a: np.concatenate((a, a), axis=1)[:, :3],
            memoryview,
        ],
        ids=["list", "tuple", "big-endian", "fortran", "negative stride", "strided", "column slice", "memoryview"],
    )
    def test_in_any_layout(self, dress):
        plain, data = made(), made(**{name: dress(parts()[name]) for name in TRIADS})
        for name in TRIADS:
            array = getattr(data, name)
            assert np.array_equal(array, getattr(plain, name))
            assert array.dtype == np.float64
            assert array.flags.c_contiguous

    def test_integers_and_single_precision(self):
        acc = np.tile([0, 0, 10], (N, 1))
        assert np.array_equal(made(acc=acc).acc, acc)
        gyr = parts()["gyr"].astype(np.float32)
        assert np.array_equal(made(gyr=gyr).gyr, gyr.astype(np.float64))

    @pytest.mark.parametrize("absent", [("gyr",), ("acc", "mag"), ("mag",)])
    def test_absent_triads(self, absent):
        data = made(**dict.fromkeys(absent))
        for name in TRIADS:
            bit = getattr(flags, f"{name.upper()}_ABSENT")
            assert len(flagged(data, bit)) == (N if name in absent else 0)
            assert (name in data.triads) is (name not in absent)
            assert np.isnan(data.usable(name)).all() == (name in absent)

    def test_one_sample(self):
        assert len(ImuData(t=[0.0], gyr=[[0.1, 0, 0]])) == 1

    def test_temperature(self):
        assert np.array_equal(made(temp_c=np.full(N, 21.5)).temp_c, np.full(N, 21.5))
        assert np.isnan(made(temp_c=np.full(N, np.nan)).temp_c).all()


class TestRefusedShapes:
    @pytest.mark.parametrize("name", TRIADS)
    @pytest.mark.parametrize(
        ("value", "says"),
        [
            (np.zeros((3, N)), r"must have shape \(N, 3\), but its shape is \(3, 200\); it looks transposed"),
            (np.zeros((N - 1, 3)), r"one row per time stamp \(200\), but it has 199"),
            (np.zeros((N, 4)), r"must have shape \(N, 3\), but its shape is \(200, 4\)"),
            (np.zeros(N), r"must have shape \(N, 3\), but its shape is \(200,\)"),
            (np.zeros((N, 3, 1)), r"must have shape \(N, 3\)"),
            (np.zeros((0, 3)), "but it has 0"),
            (0.0, r"must have shape \(N, 3\), but its shape is \(\)"),
            ([[0.0, 0.0, 0.0], [0.0]], "must be an array of numbers"),
            (np.ma.zeros((N, 3)), "is a masked array"),
            (np.zeros((N, 3), dtype=complex), "real numbers, but its type is complex128"),
            (np.full((N, 3), None), "type is object"),
            (np.full((N, 3), "0.0"), "type is <U3"),
            (np.full((N, 3), np.nan), r"is NaN in all 200 samples; pass \w+=None"),
            (np.full((N, 3), np.inf), "has no finite number in all 200 samples"),
        ],
    )
    def test_triads(self, name, value, says):
        with pytest.raises(ShapeError, match=f"{name}.*{says}"):
            made(**{name: value})

    @pytest.mark.parametrize(
        ("name", "value"),
        [
            ("temp_c", np.zeros(N + 1)),
            ("temp_c", np.zeros((N, 1))),
            ("temp_c", 21.0),
            ("flags", np.zeros(N - 1)),
            ("flags", np.full(N, -1)),
            ("flags", np.full(N, 0.5)),
            ("flags", np.full(N, np.nan)),
            ("flags", np.full(N, 2**32)),
            ("t", np.zeros((N, 1))),
            ("t", 0.0),
            ("t", []),
        ],
    )
    def test_columns(self, name, value):
        with pytest.raises(ShapeError, match=name):
            made(**{name: value})

    def test_no_triad(self):
        with pytest.raises(ShapeError, match="at least one of gyr, acc and mag"):
            ImuData(t=[0.0, 1.0])

    def test_unknown_names_are_refused(self):
        with pytest.raises(TypeError, match="gyro"):
            ImuData(t=[0.0], gyro=[[0, 0, 0]])


class TestRefusedTimes:
    @pytest.mark.parametrize(
        ("change", "says"),
        [
            ({5: 0.04}, r"t\[5\] = 0\.040000000 s comes after t\[4\] = 0\.040000000"),
            ({5: 0.01}, r"t\[5\] = 0\.010000000 s comes after"),
            ({5: np.nan}, r"t\[5\] = nan: time stamps must be finite"),
            ({N - 1: np.inf}, r"t\[199\] = inf"),
            ({5: 0.04 + 1e-10}, "rounded to nanoseconds"),
            ({N - 1: 1.7e9}, r"seconds count from the start.*put the start into meta\.t0_ns"),
        ],
    )
    def test_each(self, change, says):
        t = parts()["t"]
        t[list(change)] = list(change.values())
        with pytest.raises(ClockError, match=says):
            made(t=t)

    def test_reversed(self):
        with pytest.raises(ClockError, match=r"199 such places"):
            made(t=parts()["t"][::-1])

    def test_time_is_kept_to_the_nanosecond(self):
        t_ns = np.cumsum(np.random.default_rng(0).integers(1, 10**7, N))
        data = made(t=to_s(t_ns))
        assert np.array_equal(data.t_ns, t_ns)
        assert np.array_equal(made(t=data.t).t, data.t)


class TestGaps:
    def test_flagged_after_the_gap(self):
        t = 0.01 * np.arange(N)
        t[50:] += 1.0
        assert flagged(made(t=t), flags.GAP) == [50]


class TestLostSamples:
    """NaN or infinity anywhere: the sample is flagged, its neighbours and the other triads are not."""

    @pytest.mark.parametrize("name", TRIADS)
    @pytest.mark.parametrize("row", [0, 77, N - 1])
    @pytest.mark.parametrize("axis", [0, 1, 2, slice(None)])
    @pytest.mark.parametrize(("value", "word"), [(np.nan, "ABSENT"), (np.inf, "INVALID"), (-np.inf, "INVALID")])
    def test_one(self, name, row, axis, value, word):
        triad = parts()[name]
        triad[row, axis] = value
        data = made(**{name: triad})
        assert flagged(data, getattr(flags, f"{name.upper()}_{word}")) == [row]
        assert np.count_nonzero(data.flags) == 1
        assert np.array_equal(getattr(data, name), triad, equal_nan=True)  # nothing is lost
        usable = data.usable(name)
        assert np.isnan(usable[row]).all()
        assert np.isfinite(np.delete(usable, row, axis=0)).all()

    @pytest.mark.parametrize("name", TRIADS)
    def test_a_burst_of_infinities_is_no_question_of_units(self, name):
        triad = parts()[name]
        triad[20:120] = np.inf
        data = made(**{name: triad})
        assert flagged(data, getattr(flags, f"{name.upper()}_INVALID")) == list(range(20, 120))

    @pytest.mark.parametrize("name", TRIADS)
    @pytest.mark.parametrize("value", [1e30, 1e300, -1e30])
    def test_impossible_values(self, name, value):
        triad = parts()[name]
        triad[[10, 60], 1] = value
        data = made(**{name: triad})
        assert flagged(data, getattr(flags, f"{name.upper()}_INVALID")) == [10, 60]
        assert np.isnan(data.usable(name)[[10, 60]]).all()

    def test_a_slow_magnetometer(self):
        mag = parts()["mag"]
        mag[np.arange(N) % 10 != 0] = np.nan
        data = made(mag=mag)
        assert len(flagged(data, flags.MAG_ABSENT)) == 180
        assert np.shares_memory(data.usable("mag"), data.mag)

    def test_usable_is_read_only_in_every_case(self):
        """A compiled loop is compiled once more for writable arrays: a stall in the middle of a live stream."""
        broken = parts()["gyr"]
        broken[3] = np.inf
        for data in (made(), made(gyr=broken), made(gyr=None)):
            assert not data.usable("gyr").flags.writeable


class TestRanges:
    FULL = units.dps(2000.0)

    def test_clipping(self):
        gyr = parts()["gyr"]
        gyr[10, 0], gyr[11, 2] = self.FULL, -self.FULL
        gyr[12, 1] = 0.9995 * self.FULL  # the last code of 16 bits, 32767/32768, and of 12 bits, 2047/2048
        gyr[13, 1] = 0.99 * self.FULL
        data = made(gyr=gyr, meta=ImuMeta(gyr_range=self.FULL))
        assert flagged(data, flags.GYR_CLIPPED) == [10, 11, 12]
        assert not flagged(data, flags.GYR_INVALID)
        assert np.array_equal(data.usable("gyr"), gyr)

    def test_beyond_the_range_is_invalid_and_not_clipped(self):
        gyr = parts()["gyr"]
        gyr[10, 0] = 1.2 * self.FULL
        data = made(gyr=gyr, meta=ImuMeta(gyr_range=self.FULL))
        assert flagged(data, flags.GYR_INVALID) == [10]
        assert not flagged(data, flags.GYR_CLIPPED)

    def test_each_axis_has_its_own_range(self):
        """As the bionic fin's: two gyroscopes of ±100 °/s about x and y, one of ±300 °/s about z."""
        gyr = parts()["gyr"]
        gyr[:, 2] = units.dps(250.0)
        gyr[10, 0], gyr[11, 2], gyr[12, 1], gyr[13, 2] = units.dps(np.array([100.0, -300.0, -110.0, 320.0]))
        data = made(gyr=gyr, meta=ImuMeta(gyr_range=units.dps(np.array([100.0, 100.0, 300.0]))))
        assert flagged(data, flags.GYR_CLIPPED) == [10, 11]
        assert flagged(data, flags.GYR_INVALID) == [12, 13]
        live = ImuData.live(data.t_ns, {"gyr": gyr}, flags=np.zeros(N, dtype=np.uint32), meta=data.meta)
        judged = np.uint32(flags.GYR_CLIPPED | flags.GYR_INVALID)
        np.testing.assert_array_equal(live.flags & judged, data.flags & judged)

    def test_a_refusal_names_the_range_of_the_axis(self):
        gyr = parts()["gyr"]
        gyr[:, 0] = units.dps(250.0)
        with pytest.raises(UnitError, match=r"gyr\[0, 0\] = .* range is ±1\.74533 rad/s \(100 °/s\)"):
            made(gyr=gyr, meta=ImuMeta(gyr_range=units.dps(np.array([100.0, 100.0, 300.0]))))

    def test_equal_ranges_are_one_number(self):
        assert ImuMeta(gyr_range=[2.0, 2.0, 2.0]).gyr_range == 2.0
        assert ImuMeta(gyr_range=np.array([1.0, 2.0, 3.0])).gyr_range == (1.0, 2.0, 3.0)
        assert hash(ImuMeta(gyr_range=np.array([1.0, 2.0, 3.0])))
        np.testing.assert_array_equal(ImuMeta(acc_range=5.0).full_scale("acc"), [5.0, 5.0, 5.0])
        assert ImuMeta().full_scale("acc") is None

    @pytest.mark.parametrize("bad", [[1.0, 2.0], [[1.0, 2.0, 3.0]], "2000 dps", True])
    def test_a_range_is_one_number_or_three(self, bad):
        with pytest.raises(ShapeError, match="gyr_range must"):
            ImuMeta(gyr_range=bad)

    @pytest.mark.parametrize("bad", [0.0, -1.0, np.nan])
    @pytest.mark.parametrize("name", TRIADS)
    def test_a_range_is_positive(self, name, bad):
        with pytest.raises(UnitError, match=f"{name}_range must be a positive full scale"):
            ImuMeta(**{f"{name}_range": bad})

    @pytest.mark.parametrize(("name", "largest"), [("gyr", 100.0), ("acc", 2e4), ("mag", 1e5)])
    def test_a_range_up_to_what_parts_measure(self, name, largest):
        """5730 °/s, 2000 g and 100 mT: the bounds that plumbob.core.constants gives with their parts."""
        assert getattr(ImuMeta(**{f"{name}_range": largest}), f"{name}_range") == largest
        with pytest.raises(UnitError, match="no MEMS part measures beyond"):
            ImuMeta(**{f"{name}_range": 1.001 * largest})

    def test_a_range_in_another_unit(self):
        with pytest.raises(UnitError, match=r"gyr_range = 2000 rad/s, but no MEMS part.*units\.dps"):
            ImuMeta(gyr_range=2000)
        with pytest.raises(UnitError, match="gyr_range = inf"):
            ImuMeta(gyr_range=np.inf)


class TestDeclinationAndStart:
    @pytest.mark.parametrize("bad", [12.0, -3.2, np.nan, np.inf])
    def test_declination_is_in_rad(self, bad):
        with pytest.raises(UnitError, match=r"declination must be an angle in rad from −π to π"):
            ImuMeta(declination=bad)

    @pytest.mark.parametrize("bad", ["3 deg", True, [0.1], 1j])
    def test_declination_is_a_number(self, bad):
        with pytest.raises(ShapeError, match="declination must be a number in rad"):
            ImuMeta(declination=bad)

    @pytest.mark.parametrize("good", [0, -np.pi, np.pi, np.float64(0.1), np.float32(0.5)])
    def test_declination_becomes_a_float(self, good):
        assert ImuMeta(declination=good).declination == good
        assert type(ImuMeta(declination=good).declination) is float

    @pytest.mark.parametrize("bad", [1.5, 2.0, "3", None, True, np.nan])
    def test_start_is_whole_nanoseconds(self, bad):
        with pytest.raises(ShapeError, match="t0_ns must be an int"):
            ImuMeta(t0_ns=bad)

    def test_start_of_numpy_becomes_an_int(self):
        assert type(ImuMeta(t0_ns=np.int64(5)).t0_ns) is int


class TestWrongUnits:
    """A recording that fits its unit nowhere on Earth is refused with what it looks like and what to do."""

    @staticmethod
    def fast():
        """A second of turns at up to 600 °/s, °/s."""
        return 600.0 * np.sin(np.linspace(0, 20, N))[:, np.newaxis] * [1.0, 0.3, -0.2]

    def test_dps_with_a_range(self):
        with pytest.raises(
            UnitError, match=r"gyr\[\d+, 0\] = .*range is ±34\.9066 rad/s \(2000 °/s\).*units\.dps\(gyr\)"
        ):
            made(gyr=self.fast(), meta=ImuMeta(gyr_range=units.dps(2000)))
        assert made(gyr=units.dps(self.fast()), meta=ImuMeta(gyr_range=units.dps(2000)))

    def test_dps_without_a_range(self):
        with pytest.raises(UnitError, match=r"limit is 100 rad/s.*of 200 samples exceed it.*units\.dps\(gyr\)"):
            made(gyr=self.fast())

    @pytest.mark.parametrize(
        ("name", "factor", "looks_like", "advice"),
        [
            ("acc", 1 / G, "looks like g", r"units\.g\(acc\)"),
            ("acc", 1000 / G, "looks like mg", r"units\.g\(acc\)"),
            ("acc", 16384 / G, "looks like raw counts", r"units\.g\(acc\)"),  # MPU-6000 at ±2 g: 16384 LSB/g
            ("mag", 0.01, "looks like gauss", r"units\.gauss\(mag\)"),
            ("mag", 1000.0, "looks like nT or raw counts", r"units\.gauss\(mag\)"),
            ("mag", 1e-6, "looks like tesla", r"units\.gauss\(mag\)"),
        ],
    )
    def test_typical_size(self, name, factor, looks_like, advice):
        with pytest.raises(UnitError, match=rf"\|{name}\| is .*{looks_like}\. .*{advice}"):
            made(**{name: factor * parts()[name]})

    def test_the_largest_axis_is_named_whatever_its_sign(self):
        with pytest.raises(UnitError, match=r"gyr\[0, 0\] = -600 rad/s"):
            made(gyr=np.tile([-600.0, 1.0, 2.0], (N, 1)))

    def test_a_weak_field_in_gauss_is_told_as_such(self):
        """The hint reaches down to 0.1 gauss, half of the weakest field on Earth."""
        with pytest.raises(UnitError, match="looks like gauss"):
            made(mag=np.tile([0.105, 0.0, 0.0], (N, 1)))

    @pytest.mark.parametrize("name", ["acc", "mag"])
    def test_zeros_are_no_unit(self, name):
        values = parts()[name]
        values[50:] = 0.0
        with pytest.raises(UnitError, match=rf"\|{name}\| is exactly zero in 150 of 200 samples") as caught:
            made(**{name: values})
        assert "looks like" not in str(caught.value)
        assert "holds" not in str(caught.value)
        assert made(**{name: values}, meta=ImuMeta(unit_check=False))

    def test_few_zeros_do_not_hide_the_unit(self):
        acc = parts()["acc"] / G
        acc[:80] = 0.0
        with pytest.raises(UnitError, match="looks like g"):
            made(acc=acc)

    def test_raw_counts_of_a_gyroscope(self):
        with pytest.raises(UnitError, match=r"gyr\[\d+, \d\]"):
            made(gyr=np.round(parts()["gyr"] * 180 / np.pi * 16.4))  # MPU-6000 at ±2000 °/s: 16.4 LSB/(°/s)

    def test_g_with_a_range(self):
        with pytest.raises(UnitError, match="looks like g"):
            made(acc=parts()["acc"] / G, meta=ImuMeta(acc_range=units.g(16.0)))

    def test_free_fall_and_centrifuge_say_so(self):
        for acc in (np.full((N, 3), 0.01), np.full((N, 3), 500.0)):
            with pytest.raises(UnitError, match=r"acc.*unit_check=False"):
                made(acc=acc)
            assert made(acc=acc, meta=ImuMeta(unit_check=False))

    def test_a_short_recording_is_not_judged_by_its_size(self):
        few = ENOUGH - 1
        assert ImuData(t=0.01 * np.arange(few), acc=np.full((few, 3), 0.01))

    def test_a_few_spikes_are_spikes(self):
        """1 % of the samples may be impossible before the unit is called wrong."""
        gyr = parts()["gyr"]
        gyr[[5, 9], 0] = 1e4
        assert len(flagged(made(gyr=gyr), flags.GYR_INVALID)) == 2
        gyr[11, 0] = 1e4
        with pytest.raises(UnitError, match="3 of 200 samples exceed it"):
            made(gyr=gyr)

    @given(st.floats(22.0, 67.0), st.floats(-1, 1))
    def test_every_field_on_earth_passes(self, field, slope):
        """The field at the surface lies between 22 and 67 µT (NOAA/NCEI, World Magnetic Model 2020)."""
        mag = np.tile([field * np.sqrt(1 - slope**2), 0.0, field * slope], (N, 1))
        assert made(mag=mag)


class TestFrozen:
    def test_fields_and_arrays(self):
        data = made(temp_c=np.full(N, 20.0))
        with pytest.raises(FrozenInstanceError):
            data.t = None
        for name in ("t", "temp_c", "flags", *TRIADS):
            with pytest.raises(ValueError, match="read-only"):
                getattr(data, name)[0] = 1
            with pytest.raises(ValueError, match="WRITEABLE"):
                getattr(data, name).flags.writeable = True

    def test_who_keeps_the_arrays_cannot_change_the_recording(self):
        mine = parts() | {"temp_c": np.full(N, 20.0), "flags": np.zeros(N, dtype=np.uint32)}
        data = ImuData(**mine)
        before = {name: getattr(data, name).copy() for name in mine}
        for array in mine.values():
            array[:] = 7
        for name, expected in before.items():
            assert np.array_equal(getattr(data, name), expected)

    def test_and_the_recording_does_not_touch_them(self):
        mine = parts()
        before = {name: array.copy() for name, array in mine.items()}
        ImuData(**mine)
        for name, array in mine.items():
            assert np.array_equal(array, before[name])
            assert array.flags.writeable

    def test_large_arrays_can_be_handed_over_without_a_copy(self):
        gyr = parts()["gyr"]
        gyr.flags.writeable = False
        assert np.shares_memory(made(gyr=gyr).gyr, gyr)

    def test_copies_and_pickles_stay_frozen(self):
        data = made(temp_c=np.full(N, 20.0))
        for twin in (pickle.loads(pickle.dumps(data)), copy.copy(data), copy.deepcopy(data)):  # noqa: S301
            for name in ("t", "temp_c", "flags", *TRIADS):
                assert np.array_equal(getattr(twin, name), getattr(data, name))
                assert not getattr(twin, name).flags.writeable
            assert twin.meta == data.meta

    def test_replace_validates_anew_and_shares_the_rest(self):
        data = made()
        assert np.shares_memory(replace(data, mag=None).gyr, data.gyr)
        with pytest.raises(ShapeError, match="gyr"):
            replace(data, gyr=np.zeros((N, 4)))

    def test_absence_is_read_from_the_values(self):
        """A triad that is put in later is not absent any more; one that is taken out is."""
        data = replace(made(mag=None), mag=parts()["mag"])
        assert not flagged(data, flags.MAG_ABSENT)
        assert len(flagged(replace(data, mag=None), flags.MAG_ABSENT)) == N

    def test_known_flags_are_kept(self):
        known = np.zeros(N, dtype=np.uint32)
        known[9] = flags.ACC_CLIPPED | 1 << 31
        data = made(flags=known)
        assert data.flags[9] == known[9]
        assert np.count_nonzero(data.flags) == 1
        assert replace(data, temp_c=np.zeros(N)).flags[9] == known[9]

    def test_a_sample_that_the_decoder_called_invalid_is_not_usable(self):
        known = np.zeros(N, dtype=np.uint32)
        known[9] = flags.ACC_INVALID
        assert np.flatnonzero(np.isnan(made(flags=known).usable("acc")).all(axis=1)).tolist() == [9]


class TestCut:
    @pytest.fixture
    def data(self):
        t = 0.01 * np.arange(N)
        t[100:] += 1.0
        mag = parts()["mag"]
        mag[50:150] = np.nan
        return made(t=t, mag=mag, temp_c=np.linspace(20, 21, N), meta=ImuMeta(device="x"))

    def test_slices_keep_times_flags_and_meta_and_copy_nothing(self, data):
        part = data[90:110]
        assert len(part) == 20
        assert part.meta is data.meta
        for name in ("t", "temp_c", "flags", *TRIADS):
            assert np.array_equal(getattr(part, name), getattr(data, name)[90:110], equal_nan=True)
            assert np.shares_memory(getattr(part, name), getattr(data, name))
            assert not getattr(part, name).flags.writeable
        assert flagged(part, flags.GAP) == [10]
        assert len(data[-5:]) == len(data[195:1000]) == 5

    @pytest.mark.parametrize("size", [1, 7, 64, N, 10 * N])
    def test_chunks_are_the_whole(self, data, size):
        chunks = list(data.chunks(size))
        assert [len(c) for c in chunks[:-1]] == [size] * (len(chunks) - 1)
        for name in ("t", "flags", "gyr", "mag"):
            whole = np.concatenate([getattr(c, name) for c in chunks])
            assert whole.tobytes() == getattr(data, name).tobytes()

    def test_a_chunk_without_a_magnetic_sample_is_still_one(self, data):
        chunk = data[60:140]
        assert np.isnan(chunk.mag).all()
        assert "mag" in chunk.triads

    @pytest.mark.parametrize(
        "rows", [slice(5, 5), slice(9, 3), slice(None, None, 2), slice(None, None, -1), slice(N, None)]
    )
    def test_refused_slices(self, data, rows):
        with pytest.raises(ShapeError, match=r"non-empty slice of step 1, but slice\(.* selects \d+ of 200"):
            data[rows]

    @pytest.mark.parametrize("rows", [0, np.arange(3), "gyr", (slice(0, 3), 0), None])
    def test_refused_keys(self, data, rows):
        with pytest.raises(ShapeError, match=r"cut by a slice, as in data\[10:20\]"):
            data[rows]

    @pytest.mark.parametrize("size", [0, -3])
    def test_refused_sizes(self, data, size):
        with pytest.raises(ShapeError, match="size must be a whole number from 1 on"):
            list(data.chunks(size))


class TestCorrected:
    def test_flags_stay_and_nothing_is_judged_anew(self):
        acc = parts()["acc"]
        acc[4] = units.g(2.0)
        data = made(acc=acc, meta=ImuMeta(acc_range=units.g(2.0)))
        corrected = data.corrected(meta=replace(data.meta, calibration="card"), acc=10.0 * data.acc)
        assert flagged(corrected, flags.ACC_CLIPPED) == [4]
        assert not flagged(corrected, flags.ACC_INVALID)
        assert np.array_equal(corrected.acc, 10.0 * data.acc)
        assert np.shares_memory(corrected.gyr, data.gyr)
        assert corrected.meta.calibration == "card"
        assert data.meta.calibration is None

    def test_values_that_are_lost_become_absent(self):
        acc = parts()["acc"]
        acc[4, 1] = np.nan
        assert flagged(made().corrected(meta=ImuMeta(), acc=acc), flags.ACC_ABSENT) == [4]

    def test_refused(self):
        with pytest.raises(ShapeError, match="no mag to correct, only gyr, acc"):
            made(mag=None).corrected(meta=ImuMeta(), mag=parts()["mag"])
        with pytest.raises(ShapeError, match="acc must have one row per time stamp"):
            made().corrected(meta=ImuMeta(), acc=np.zeros((3, 3)))


class TestMeta:
    @pytest.mark.parametrize("wrong", [{"frame": "XYZ"}, {"north": "grid"}, {"frame": North.TRUE}, {"frame": 5}])
    def test_frames_are_frames(self, wrong):
        with pytest.raises(FrameError, match="known are"):
            ImuMeta(**wrong)
        assert ImuMeta(frame="NED", north="true") == ImuMeta(frame=Frame.NED, north=North.TRUE)
        assert ImuMeta(frame="NED").frame is Frame.NED

    def test_axes_are_axes(self):
        with pytest.raises(FrameError, match="left-handed"):
            ImuMeta(axes="x y -z")

    @pytest.mark.parametrize("rate", [0.0, -100.0, np.nan, np.inf])
    def test_rate(self, rate):
        with pytest.raises(ShapeError, match="rate_nominal must be a positive number"):
            ImuMeta(rate_nominal=rate)


HOSTILE = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=3),
    st.lists(st.floats(), max_size=4), st.lists(st.lists(st.floats(), min_size=3, max_size=3), max_size=4),
    st.lists(st.lists(st.one_of(st.none(), st.integers(), st.text(max_size=2)), max_size=4), max_size=4),
)  # fmt: skip


@given(HOSTILE, HOSTILE, HOSTILE, HOSTILE)
def test_whatever_comes_is_taken_or_refused_by_name(t, gyr, acc, known):
    try:
        data = ImuData(t=t, gyr=gyr, acc=acc, flags=known)
    except PlumbobError as error:
        assert str(error).endswith((".", "]", ")")) or "NumPy" in str(error)
    else:
        assert len(data) == data.t.size > 0


def test_gyroscope_of_one_axis_is_a_recording_that_no_filter_mistakes_for_three():
    gyr = np.full((N, 3), np.nan)
    gyr[:, 2] = 0.1
    imu = ImuData(t=np.arange(N) * 0.01, gyr=gyr)
    np.testing.assert_array_equal(imu.gyr[:, 2], 0.1)
    assert ((imu.flags & flags.GYR_ABSENT) != 0).all()
    assert np.isnan(imu.usable("gyr")).all()
