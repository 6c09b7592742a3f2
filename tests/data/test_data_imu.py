"""ImuData: what it takes, what it refuses and how, and that nothing can change it later."""

import copy
import pickle
from dataclasses import FrozenInstanceError, replace

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from plumbob import Frame, North, flags, units
from plumbob.core.errors import ClockError, FrameError, PlumbobError, ShapeError, UnitError
from plumbob.core.time import to_s
from plumbob.data import ENOUGH, TRIADS, ImuData, ImuMeta
from tests.helpers import examples

N = 200
G = 9.80665
FULL = units.dps(2000.0)
FIN = units.dps(np.array([100.0, 100.0, 300.0]))  # the bionic fin's gyroscopes: ±100 °/s about x and y, ±300 about z


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


def changed(name, rows, value):
    """An array of `parts` with another value at some places."""
    array = parts()[name]
    array[rows] = value
    return {name: array}


def flagged(data, bit):
    return np.flatnonzero(data.flags & bit).tolist()


def bit_of(name, word):
    return getattr(flags, f"{name.upper()}_{word}")


class TestTaken:
    @pytest.mark.parametrize("dress", [np.copy, np.ndarray.tolist, np.asfortranarray, memoryview])
    def test_in_any_layout(self, dress):
        data = made(**{name: dress(parts()[name]) for name in TRIADS})
        for name in TRIADS:
            array = getattr(data, name)
            assert np.array_equal(array, parts()[name])
            assert array.dtype == np.float64
            assert array.flags.c_contiguous
        assert data.triads == TRIADS
        assert len(data) == N
        assert not data.flags.any()
        assert data.flags.dtype == np.uint32

    def test_numbers_of_other_types_are_taken_and_a_gyroscope_of_one_axis_is_none_of_three(self):
        acc = np.tile([0, 0, 10], (N, 1))
        assert np.array_equal(made(acc=acc).acc, acc)
        gyr = parts()["gyr"].astype(np.float32)
        assert np.array_equal(made(gyr=gyr).gyr, gyr.astype(np.float64))
        assert len(ImuData(t=[0.0], gyr=[[0.1, 0, 0]])) == 1
        assert np.array_equal(made(temp_c=np.full(N, 21.5)).temp_c, np.full(N, 21.5))
        assert np.isnan(made(temp_c=np.full(N, np.nan)).temp_c).all()
        gyr = np.full((N, 3), np.nan)
        gyr[:, 2] = 0.1
        imu = ImuData(t=np.arange(N) * 0.01, gyr=gyr)
        np.testing.assert_array_equal(imu.gyr[:, 2], 0.1)
        assert len(flagged(imu, flags.GYR_ABSENT)) == N
        assert np.isnan(imu.usable("gyr")).all()

    @pytest.mark.parametrize("absent", [("gyr",), ("acc", "mag"), ("mag",)])
    def test_absent_triads(self, absent):
        data = made(**dict.fromkeys(absent))
        for name in TRIADS:
            assert len(flagged(data, bit_of(name, "ABSENT"))) == (N if name in absent else 0)
            assert (name in data.triads) is (name not in absent)
            assert np.isnan(data.usable(name)).all() == (name in absent)

    def test_time_is_kept_to_the_nanosecond_and_a_gap_is_flagged_behind_it(self):
        t_ns = np.cumsum(np.random.default_rng(0).integers(1, 10**7, N))
        data = made(t=to_s(t_ns))
        assert np.array_equal(data.t_ns, t_ns) and np.array_equal(made(t=data.t).t, data.t)
        assert flagged(made(t=parts()["t"] + (np.arange(N) >= 50)), flags.GAP) == [50]

    @given(st.floats(22.0, 67.0), st.floats(-1, 1))
    @examples(0.3)
    def test_every_field_on_earth_passes(self, field, slope):
        """The field at the surface lies between 22 and 67 µT (NOAA/NCEI, World Magnetic Model 2020)."""
        assert made(mag=np.tile([field * np.sqrt(1 - slope**2), 0.0, field * slope], (N, 1)))


FAST = 600.0 * np.sin(np.linspace(0, 20, N))[:, np.newaxis] * [1.0, 0.3, -0.2]  # turns at up to 600 °/s, in °/s
REFUSED = [
    *(
        (ShapeError, {name: np.zeros((3, N))}, rf"{name} must .* its shape is \(3, 200\); it looks transposed")
        for name in TRIADS
    ),
    *(
        (ShapeError, {name: np.full((N, 3), np.nan)}, rf"{name} is NaN in all 200 samples; pass {name}=None")
        for name in TRIADS
    ),
    (ShapeError, {"acc": np.zeros((N - 1, 3))}, r"acc .*one row per time stamp \(200\), but it has 199"),
    (ShapeError, {"mag": np.full((N, 3), np.inf)}, "mag has no finite number in all 200 samples"),
    (ShapeError, {"temp_c": np.zeros(N + 1)}, "temp_c"),
    (ShapeError, {"temp_c": np.zeros((N, 1))}, "temp_c"),
    (ShapeError, {"flags": np.zeros(N - 1)}, "flags"),
    (ShapeError, {"flags": np.full(N, -1)}, "flags"),
    (ShapeError, {"t": np.zeros((N, 1))}, "t must"),
    (ShapeError, {"t": []}, "t is empty"),
    (ShapeError, dict.fromkeys(TRIADS), "at least one of gyr, acc and mag"),
    (TypeError, {"gyro": [[0, 0, 0]]}, "gyro"),
    (ClockError, changed("t", 5, 0.04), r"t\[5\] = 0\.040000000 s comes after t\[4\] = 0\.040000000"),
    (ClockError, {"t": parts()["t"][::-1]}, "199 such places"),
    (ClockError, changed("t", 5, np.nan), r"t\[5\] = nan: time stamps must be finite"),
    (ClockError, changed("t", 5, 0.04 + 1e-10), "rounded to nanoseconds"),
    (ClockError, changed("t", N - 1, 1.7e9), r"seconds count from the start.*put the start into meta\.t0_ns"),
    # A recording that fits its unit nowhere on Earth is refused with what it looks like and what to do.
    (
        UnitError,
        {"gyr": FAST, "meta": ImuMeta(gyr_range=FULL)},
        r"gyr\[\d+, 0\] = .*range is ±34\.9066 rad/s \(2000 °/s\).*units\.dps\(gyr\)",
    ),
    (UnitError, {"gyr": FAST}, r"limit is 100 rad/s.*of 200 samples exceed it.*units\.dps\(gyr\)"),
    (UnitError, {"gyr": np.tile([-600.0, 1.0, 2.0], (N, 1))}, r"gyr\[0, 0\] = -600 rad/s"),
    (
        UnitError,
        {**changed("gyr", np.s_[:, 0], units.dps(250.0)), "meta": ImuMeta(gyr_range=FIN)},
        r"gyr\[0, 0\] = .* range is ±1\.74533 rad/s \(100 °/s\)",
    ),
    (UnitError, changed("gyr", np.s_[[5, 9, 11], 0], 1e4), "3 of 200 samples exceed it"),
    (UnitError, {"acc": parts()["acc"] / G}, r"\|acc\| is .*looks like g\. .*units\.g\(acc\)"),
    (UnitError, {"acc": parts()["acc"] / G * (np.arange(N) >= 80)[:, np.newaxis]}, "looks like g"),
    (UnitError, {"acc": parts()["acc"] * 1000 / G}, r"looks like mg\. .*units\.g\(acc\)"),
    (UnitError, {"acc": parts()["acc"] * 16384 / G}, "looks like raw counts"),  # MPU-6000 at ±2 g: 16384 LSB/g
    (UnitError, {"mag": parts()["mag"] * 0.01}, r"\|mag\| is .*looks like gauss\. .*units\.gauss\(mag\)"),
    (UnitError, {"mag": np.tile([0.105, 0.0, 0.0], (N, 1))}, "looks like gauss"),  # down to half of the weakest field
    (UnitError, {"mag": parts()["mag"] * 1000.0}, r"looks like nT or raw counts\. .*units\.gauss\(mag\)"),
    (UnitError, {"mag": parts()["mag"] * 1e-6}, r"looks like tesla\. .*units\.gauss\(mag\)"),
]
DECLINATION = "declination must be an angle in rad from −π to π"
META = [
    (ShapeError, {"gyr_range": [1.0, 2.0]}, "gyr_range must"),
    (ShapeError, {"gyr_range": "2000 dps"}, "gyr_range must"),
    (ShapeError, {"gyr_range": True}, "gyr_range must"),
    (UnitError, {"gyr_range": 0.0}, "gyr_range must be a positive full scale"),
    (UnitError, {"acc_range": -1.0}, "acc_range must be a positive full scale"),
    (UnitError, {"mag_range": np.nan}, "mag_range must be a positive full scale"),
    (UnitError, {"gyr_range": 2000}, r"gyr_range = 2000 rad/s, but no MEMS part measures beyond.*units\.dps"),
    (UnitError, {"gyr_range": np.inf}, "gyr_range = inf"),
    *((UnitError, {"declination": bad}, DECLINATION) for bad in (12.0, -3.2, np.nan, np.inf)),
    *((ShapeError, {"declination": bad}, "declination must be a number in rad") for bad in ("3 deg", True, [0.1], 1j)),
    *((ShapeError, {"t0_ns": bad}, "t0_ns must be an int") for bad in (1.5, 2.0, "3", None, True, np.nan)),
    *(
        (FrameError, bad, "known:")
        for bad in ({"frame": "XYZ"}, {"north": "grid"}, {"frame": North.TRUE}, {"frame": 5})
    ),
    (FrameError, {"axes": "x y -z"}, "left-handed"),
    *((ShapeError, {"rate_nominal": bad}, "rate_nominal must be a positive") for bad in (0.0, -100.0, np.nan, np.inf)),
]


@pytest.mark.parametrize(
    ("make", "error", "wrong", "says"), [*((made, *row) for row in REFUSED), *((ImuMeta, *row) for row in META)]
)
def test_refused(make, error, wrong, says):
    with pytest.raises(error, match=says):
        make(**wrong)


class TestMeta:
    def test_ranges_are_of_each_axis_and_numbers_of_numpy_and_texts_of_frames_will_do(self):
        assert ImuMeta(gyr_range=[2.0, 2.0, 2.0]).gyr_range == 2.0
        assert ImuMeta(gyr_range=np.array([1.0, 2.0, 3.0])).gyr_range == (1.0, 2.0, 3.0)
        assert hash(ImuMeta(gyr_range=np.array([1.0, 2.0, 3.0])))
        np.testing.assert_array_equal(ImuMeta(acc_range=5.0).full_scale("acc"), [5.0, 5.0, 5.0])
        assert ImuMeta().full_scale("acc") is None
        for good in (0, -np.pi, np.pi, np.float64(0.1), np.float32(0.5)):
            assert ImuMeta(declination=good).declination == good
            assert type(ImuMeta(declination=good).declination) is float
        assert type(ImuMeta(t0_ns=np.int64(5)).t0_ns) is int
        assert ImuMeta(frame="NED", north="true") == ImuMeta(frame=Frame.NED, north=North.TRUE)
        assert ImuMeta(frame="NED").frame is Frame.NED

    @pytest.mark.parametrize(("name", "largest"), [("gyr", 100.0), ("acc", 2e4), ("mag", 1e5)])
    def test_a_range_up_to_what_parts_measure(self, name, largest):
        """5730 °/s, 2000 g and 100 mT: the bounds that plumbob.core.constants gives with their parts."""
        assert getattr(ImuMeta(**{f"{name}_range": largest}), f"{name}_range") == largest
        with pytest.raises(UnitError, match="no MEMS part measures beyond"):
            ImuMeta(**{f"{name}_range": 1.001 * largest})


class TestLostSamples:
    """NaN, infinity or an impossible number: the sample is flagged, its neighbours and the other triads are not."""

    @pytest.mark.parametrize("name", TRIADS)
    @pytest.mark.parametrize("row", [0, 77, N - 1])
    @pytest.mark.parametrize("axis", [0, 1, 2, slice(None)])
    def test_one(self, name, row, axis):
        for value, word in ((np.nan, "ABSENT"), (np.inf, "INVALID"), (-np.inf, "INVALID"), (-1e30, "INVALID")):
            triad = changed(name, (row, axis), value)
            data = made(**triad)
            assert flagged(data, bit_of(name, word)) == [row]
            assert np.count_nonzero(data.flags) == 1
            assert np.array_equal(getattr(data, name), triad[name], equal_nan=True)  # nothing is lost
            usable = data.usable(name)
            assert np.isnan(usable[row]).all() and np.isfinite(np.delete(usable, row, axis=0)).all()

    @pytest.mark.parametrize("name", TRIADS)
    def test_bursts_and_a_few_spikes_are_no_question_of_units(self, name):
        """1 % of the samples may be impossible before the unit is called wrong, and any number infinite."""
        assert flagged(made(**changed(name, np.s_[20:120], np.inf)), bit_of(name, "INVALID")) == list(range(20, 120))
        for value in (1e30, 1e300, -1e30):
            data = made(**changed(name, np.s_[[10, 60], 1], value))
            assert flagged(data, bit_of(name, "INVALID")) == [10, 60]
            assert np.isnan(data.usable(name)[[10, 60]]).all()

    def test_a_slow_magnetometer_and_read_only_values_in_every_case(self):
        data = made(**changed("mag", np.arange(N) % 10 != 0, np.nan))
        assert len(flagged(data, flags.MAG_ABSENT)) == 180
        assert np.shares_memory(data.usable("mag"), data.mag)
        # A compiled loop is compiled once more for writable arrays: a stall in the middle of a live stream
        for data in (made(), made(**changed("gyr", 3, np.inf)), made(gyr=None)):
            assert not data.usable("gyr").flags.writeable


class TestRanges:
    def test_the_ends_are_clipped_what_is_beyond_is_invalid_and_each_axis_has_its_own_range(self):
        gyr = parts()["gyr"]
        gyr[10, 0], gyr[11, 2] = FULL, -FULL
        gyr[12, 1] = 0.9995 * FULL  # the last code of 16 bits, 32767/32768, and of 12 bits, 2047/2048
        gyr[13, 1] = 0.99 * FULL
        data = made(gyr=gyr, meta=ImuMeta(gyr_range=FULL))
        assert flagged(data, flags.GYR_CLIPPED) == [10, 11, 12]
        assert not flagged(data, flags.GYR_INVALID) and np.array_equal(data.usable("gyr"), gyr)
        data = made(**changed("gyr", (10, 0), 1.2 * FULL), meta=ImuMeta(gyr_range=FULL))
        assert flagged(data, flags.GYR_INVALID) == [10]
        assert not flagged(data, flags.GYR_CLIPPED)
        gyr = parts()["gyr"]
        gyr[:, 2] = units.dps(250.0)
        gyr[10, 0], gyr[11, 2], gyr[12, 1], gyr[13, 2] = units.dps(np.array([100.0, -300.0, -110.0, 320.0]))
        data = made(gyr=gyr, meta=ImuMeta(gyr_range=FIN))
        assert (flagged(data, flags.GYR_CLIPPED), flagged(data, flags.GYR_INVALID)) == ([10, 11], [12, 13])
        live = ImuData.live(data.t_ns, {"gyr": gyr}, flags=np.zeros(N, dtype=np.uint32), meta=data.meta)
        judged = np.uint32(flags.GYR_CLIPPED | flags.GYR_INVALID)
        np.testing.assert_array_equal(live.flags & judged, data.flags & judged)


class TestUnits:
    def test_right_units_pass_and_free_fall_and_centrifuge_say_so(self):
        assert made(gyr=units.dps(FAST), meta=ImuMeta(gyr_range=FULL))
        assert flagged(made(**changed("gyr", np.s_[[5, 9], 0], 1e4)), flags.GYR_INVALID) == [5, 9]
        few = ENOUGH - 1
        assert ImuData(t=0.01 * np.arange(few), acc=np.full((few, 3), 0.01))
        for acc in (np.full((N, 3), 0.01), np.full((N, 3), 500.0)):
            with pytest.raises(UnitError, match=r"acc.*unit_check=False"):
                made(acc=acc)
            assert made(acc=acc, meta=ImuMeta(unit_check=False))

    @pytest.mark.parametrize("name", ["acc", "mag"])
    def test_zeros_are_no_unit(self, name):
        values = changed(name, np.s_[50:], 0.0)
        with pytest.raises(UnitError, match=rf"\|{name}\| is exactly zero in 150 of 200 samples") as caught:
            made(**values)
        assert "looks like" not in str(caught.value)
        assert made(**values, meta=ImuMeta(unit_check=False))


class TestFrozen:
    def test_fields_and_arrays_that_nobody_can_change_from_outside(self):
        data = made(temp_c=np.full(N, 20.0))
        with pytest.raises(FrozenInstanceError):
            data.t = None
        for name in ("t", "temp_c", "flags", *TRIADS):
            with pytest.raises(ValueError, match="read-only"):
                getattr(data, name)[0] = 1
            with pytest.raises(ValueError, match="WRITEABLE"):
                getattr(data, name).flags.writeable = True
        mine = parts() | {"temp_c": np.full(N, 20.0), "flags": np.zeros(N, dtype=np.uint32)}
        given_ = {name: array.copy() for name, array in mine.items()}
        data = ImuData(**mine)
        before = {name: getattr(data, name).copy() for name in mine}
        for name, array in mine.items():
            assert np.array_equal(array, given_[name]) and array.flags.writeable
            array[:] = 7
        for name, expected in before.items():
            assert np.array_equal(getattr(data, name), expected)

    def test_large_arrays_are_handed_over_without_a_copy_and_copies_and_pickles_stay_frozen(self):
        gyr = parts()["gyr"]
        gyr.flags.writeable = False
        assert np.shares_memory(made(gyr=gyr).gyr, gyr)
        data = made(temp_c=np.full(N, 20.0))
        for twin in (pickle.loads(pickle.dumps(data)), copy.copy(data), copy.deepcopy(data)):  # noqa: S301
            for name in ("t", "temp_c", "flags", *TRIADS):
                assert np.array_equal(getattr(twin, name), getattr(data, name))
                assert not getattr(twin, name).flags.writeable
            assert twin.meta == data.meta

    def test_replace_validates_anew_and_reads_absence_from_the_values(self):
        """A triad that is put in later is not absent any more; one that is taken out is."""
        data = made()
        assert np.shares_memory(replace(data, mag=None).gyr, data.gyr)
        with pytest.raises(ShapeError, match="gyr"):
            replace(data, gyr=np.zeros((N, 4)))
        data = replace(made(mag=None), mag=parts()["mag"])
        assert not flagged(data, flags.MAG_ABSENT)
        assert len(flagged(replace(data, mag=None), flags.MAG_ABSENT)) == N

    def test_flags_that_were_given_are_kept_and_followed(self):
        given_ = np.zeros(N, dtype=np.uint32)
        given_[9] = flags.ACC_CLIPPED | 1 << 31
        data = made(flags=given_)
        assert data.flags[9] == given_[9]
        assert np.count_nonzero(data.flags) == 1
        assert replace(data, temp_c=np.zeros(N)).flags[9] == given_[9]
        given_[9] = flags.ACC_INVALID
        assert np.flatnonzero(np.isnan(made(flags=given_).usable("acc")).all(axis=1)).tolist() == [9]


class TestCut:
    @pytest.fixture
    def data(self):
        t = 0.01 * np.arange(N)
        t[100:] += 1.0
        return made(
            t=t, temp_c=np.linspace(20, 21, N), meta=ImuMeta(device="x"), **changed("mag", np.s_[50:150], np.nan)
        )

    def test_slices_keep_times_flags_and_meta_and_copy_nothing(self, data):
        part = data[90:110]
        assert len(part) == 20
        assert part.meta is data.meta
        for name in ("t", "temp_c", "flags", *TRIADS):
            assert np.array_equal(getattr(part, name), getattr(data, name)[90:110], equal_nan=True)
            assert np.shares_memory(getattr(part, name), getattr(data, name))
            assert not getattr(part, name).flags.writeable
        assert flagged(part, flags.GAP) == [10]
        assert np.isnan(part.mag).all()
        assert "mag" in part.triads  # a chunk without a magnetic sample is still one of nine axes
        assert len(data[-5:]) == len(data[195:1000]) == 5

    @pytest.mark.parametrize("size", [1, 7, 64, N, 10 * N])
    def test_chunks_are_the_whole(self, data, size):
        chunks = list(data.chunks(size))
        assert [len(c) for c in chunks[:-1]] == [size] * (len(chunks) - 1)
        for name in ("t", "flags", "gyr", "mag"):
            together = np.concatenate([getattr(c, name) for c in chunks])
            assert together.tobytes() == getattr(data, name).tobytes()

    def test_what_is_no_part_is_refused(self, data):
        for rows in (slice(5, 5), slice(9, 3), slice(None, None, 2), slice(None, None, -1), slice(N, None)):
            with pytest.raises(ShapeError, match=r"non-empty slice of step 1, but slice\(.* selects \d+ of 200"):
                data[rows]
        for rows in (0, np.arange(3), "gyr", (slice(0, 3), 0), None):
            with pytest.raises(ShapeError, match=r"cut by a slice, as in data\[10:20\]"):
                data[rows]
        for size in (0, -3):
            with pytest.raises(ShapeError, match="size must be a whole number of at least 1"):
                list(data.chunks(size))


class TestCorrected:
    def test_flags_stay_nothing_is_judged_anew_and_values_that_are_lost_become_absent(self):
        data = made(**changed("acc", 4, units.g(2.0)), meta=ImuMeta(acc_range=units.g(2.0)))
        corrected = data.corrected(meta=replace(data.meta, calibration="card"), acc=10.0 * data.acc)
        assert flagged(corrected, flags.ACC_CLIPPED) == [4]
        assert not flagged(corrected, flags.ACC_INVALID) and np.array_equal(corrected.acc, 10.0 * data.acc)
        assert np.shares_memory(corrected.gyr, data.gyr)
        assert corrected.meta.calibration == "card"
        assert data.meta.calibration is None
        lost = made().corrected(meta=ImuMeta(), **changed("acc", (4, 1), np.nan))
        assert flagged(lost, flags.ACC_ABSENT) == [4]
        with pytest.raises(ShapeError, match="no mag to correct, only gyr, acc"):
            made(mag=None).corrected(meta=ImuMeta(), mag=parts()["mag"])
        with pytest.raises(ShapeError, match="acc must have one row per time stamp"):
            made().corrected(meta=ImuMeta(), acc=np.zeros((3, 3)))


HOSTILE = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=3),
    st.lists(st.floats(), max_size=4), st.lists(st.lists(st.floats(), min_size=3, max_size=3), max_size=4),
    st.lists(st.lists(st.one_of(st.none(), st.integers(), st.text(max_size=2)), max_size=4), max_size=4),
)  # fmt: skip


@given(HOSTILE, HOSTILE, HOSTILE, HOSTILE)
@examples(0.5)
def test_whatever_comes_is_taken_or_refused_by_name(t, gyr, acc, known):
    try:
        data = ImuData(t=t, gyr=gyr, acc=acc, flags=known)
    except PlumbobError as error:
        assert str(error).endswith((".", "]", ")")) or "NumPy" in str(error)
    else:
        assert len(data) == data.t.size > 0


T = 0.01 * np.arange(10)
GYR = np.zeros((10, 3))


def joined(t_mag, values=None, t=T):
    t_mag = np.asarray(t_mag, dtype=float)
    mag = np.arange(1.0, t_mag.size + 1)[:, np.newaxis] * [10.0, 0.0, 0.0] if values is None else values
    data = ImuData.from_streams(t, gyr=GYR[: len(t)], t_mag=t_mag, mag=mag)
    return {i: data.mag[i, 0] for i in np.flatnonzero(np.isfinite(data.mag[:, 0]))}


@pytest.mark.parametrize(("t_mag", "expected"), [
    ([0.0, 0.011, 0.029, 0.05], {0: 10.0, 2: 20.0, 3: 30.0, 5: 40.0}),  # each goes to the next inertial sample
    ([0.001, 0.002, 0.009, 0.02], {1: 30.0, 2: 40.0}),  # the last of several wins
    ([0.05, 0.0901, 5.0], {5: 10.0}),  # those after the end are left out
])  # fmt: skip
def test_each_goes_to_the_next_inertial_sample(t_mag, expected):
    assert joined(t_mag) == expected


def test_equal_stamps_meet_to_the_nanosecond_and_absent_values_do_not_win():
    """0.1 + 0.2 is not 0.3 in float64: the sample at 0.3 s must not wait for the next."""
    t = np.array([0.1, 0.2, 0.3, 0.4])
    assert joined([0.1 + 0.2], t=t) == {2: 10.0}
    assert joined([0.3 + 1e-9], t=t) == {3: 10.0}
    values = np.array([[10.0, 0, 0], [np.nan, 0, 0], [30.0, 0, 0]])
    assert joined([0.001, 0.002, 0.015], values) == {1: 10.0, 2: 30.0}
    data = ImuData.from_streams(T, gyr=GYR, acc=GYR + 9.81, t_mag=[0.0], mag=[[20, 0, 0]], meta=ImuMeta(device="x"))
    assert (data.meta.device, data.triads) == ("x", ("gyr", "acc", "mag"))
    assert np.array_equal(data.acc, GYR + 9.81)


CLOCKS = r"no sample of mag, at .* Put both on one clock"


@pytest.mark.parametrize(("t", "t_mag", "values", "error", "says"), [
    (T, [0.1, 0.2], None, ClockError, CLOCKS),
    (T, [0.01], np.full((1, 3), np.nan), ClockError, CLOCKS),
    (T[::-1], [0.01], None, ClockError, "t must strictly increase"),
    (T, [0.02, 0.01], None, ClockError, "t_mag must strictly increase"),
    (T, [np.nan], None, ClockError, r"t_mag\[0\] = nan"),
    (T, [], None, ShapeError, "t_mag is empty"),
    (T, [0.01, 0.02], np.zeros((3, 3)), ShapeError, r"mag must have one row per time stamp \(2\), but it has 3"),
])  # fmt: skip
def test_bad_clocks_and_lengths_are_named(t, t_mag, values, error, says):
    with pytest.raises(error, match=says):
        joined(t_mag, values, t=t)
