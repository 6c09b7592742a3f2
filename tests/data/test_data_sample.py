"""Samples and recordings as their texts show them, and delays between sensors."""

from dataclasses import replace

import numpy as np
import pytest

from plumbob import AttitudeTrack, Filter, Frame, ImuData, ImuMeta, ImuSample, evaluate, flags, simulate
from plumbob.core.errors import ClockError, ParameterError, ShapeError
from plumbob.data.delay import gyr_delay
from plumbob.filters.smoother import Smoother
from plumbob.rotations import quat_from_euler_zyx
from tests.helpers.motion import consistent, noisy

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


N = 6000
DATA, _ = consistent(N, amplitude=2.0)


def late(by, *, push=0.0, bias=0.0):
    """Samples whose rates are that much later, s, of a body that is pushed about."""
    rng = np.random.default_rng(0)
    gyr = np.stack([np.interp(DATA.t - by, DATA.t, column) for column in DATA.gyr.T], axis=1)
    noise = np.cumsum(rng.normal(0.0, 0.1, (N, 3)), axis=0)
    acc = DATA.acc + push * (noise - noise.mean(axis=0)) / noise.std(axis=0) + rng.normal(0.0, 0.03, (N, 3))
    return ImuData(t=DATA.t, gyr=gyr + bias + rng.normal(0.0, 0.002, (N, 3)), acc=acc)


@pytest.mark.parametrize(("by", "push"), [(0.02, 0.5), (0.05, 0.0), (-0.03, 0.5), (0.1, 0.5)])
def test_a_delay_is_found(by, push):
    delay = gyr_delay(late(by, push=push, bias=0.03))
    assert delay.found
    assert delay.delay == pytest.approx(by, abs=max(3.0 * delay.sd, 1e-3))


@pytest.mark.parametrize(("tilt", "damping", "way", "period"), [
    (3.0, 0.4, 2.2, "8 s"), (0.0, 0.4, 2.2, "4 s"), (1.5, 0.1, 2.2, "8 s"), (1.5, 0.4, 0.0, "4 s"),
    (6.0, 0.1, 0.0, "8 s"),
])  # fmt: skip
def test_no_delay_is_claimed_of_a_buoy_whose_way_goes_with_its_tilt(tilt, damping, way, period):
    hull = {"tilt_period": tilt, "tilt_damping": damping, "way_period": way, "period": period}
    made = simulate("buoy", frame="NED", unit="calibrated", seed=3, rate=10.0, duration=600.0, **hull)
    assert not gyr_delay(made.imu).found


def test_no_delay_is_none_nor_is_there_one_of_forces_that_have_nothing_to_do_with_the_rates():
    delay = gyr_delay(late(0.0, push=0.5))
    assert not delay.found and abs(delay.delay) < 3.0 * delay.sd
    # forces of 5 m/s² that have nothing to do with the rates
    found = gyr_delay(late(0.0, push=5.0))
    assert found is None or not found.found
    still = ImuData(t=DATA.t, gyr=np.zeros((N, 3)), acc=np.tile([0.0, 0.0, 9.81], (N, 1)))
    assert not gyr_delay(still).found
    assert gyr_delay(ImuData(t=DATA.t, gyr=DATA.gyr)) is None
    assert gyr_delay(DATA[:500]) is None
    smoother = Smoother(frame=Frame.ENU)
    smoother.process(late(0.05))
    assert str(smoother.remarks[0]).startswith("the gyroscope seems to lag the accelerometer by 50 ± ")
    assert len(smoother.remarks) == 1
    smoother.process(late(-0.03))
    assert str(smoother.remarks[0]).startswith("the accelerometer seems to lag the gyroscope by 30 ± ")
    smoother.process(late(0.0))
    assert smoother.remarks == ()


MADE = simulate("static", frame="NED", sensors="mpu6000+hmc5983", unit="random", seed=0, rate=50.0, duration=2.0)
SHOWN = {
    "imu": (MADE.imu, ("<ImuData: samples 100 in 1.98 s at 50 Hz; sensors gyr, acc, mag, temp_c;", "calibration none")),
    "track": (MADE.truth, ("<AttitudeTrack: samples 100 in 1.98 s at 50 Hz; known 100; frame NED; north true;",)),
    "evaluation": (evaluate(MADE.truth, MADE.truth), ("<Evaluation: scored 100 of 100 samples; total rmse 0°;",)),
    "card": (MADE.calibration, ("<CalibrationCard: device mpu6000+hmc5983 #0; date 1970-01-01;", "; of gyr, acc, mag")),
    "noise": (MADE.noise, ("<NoiseCard: device mpu6000+hmc5983 #0; source", "; of gyr, acc, mag")),
    "filter": (
        Filter("mahony", frame="ENU", params={"kp": 0.25}),
        ("<Filter: name mahony; frame ENU; params kp=0.25 1/s; samples 0>",),
    ),
}


@pytest.mark.parametrize("name", SHOWN)
def test_one_line_and_a_small_table(name):
    shown, words = SHOWN[name]
    line, table = repr(shown), shown._repr_html_()
    assert "\n" not in line
    assert all(word in line for word in words)
    assert table.startswith(f"<table><caption>{type(shown).__name__}</caption><tr><th>")
    assert table.count("<tr>") == table.count("</tr>") == len(shown.facts())


def test_what_a_file_says_is_shown_as_text():
    """A device's name can hold anything: markup, and what steers a terminal."""
    name = "<script>alert(1)</script>\x1b[2J\nx"
    imu = ImuData(t=[0.0], gyr=[[0.0, 0.0, 0.0]], meta=ImuMeta(device=name))
    assert "samples 1; sensors gyr" in repr(imu) and not {"\x1b", "\n"} & {*repr(imu), *imu._repr_html_()}
    assert "<script>" not in imu._repr_html_() and "&lt;script&gt;" in imu._repr_html_()


def test_angles_of_a_track_are_yaw_pitch_roll_in_rad():
    angles = np.array([[0.1, -0.2, 0.3], [3.0, 1.5, -3.0]])
    track = AttitudeTrack(t=[0.0, 1.0], q_nb=quat_from_euler_zyx(angles), frame="NED", north="true")
    np.testing.assert_allclose(track.euler_zyx, angles, rtol=0, atol=1e-14)
    np.testing.assert_array_equal(np.column_stack((track.yaw, track.pitch, track.roll)), track.euler_zyx)
    unknown = replace(track, q_nb=np.full((2, 4), np.nan))
    assert np.isnan(unknown.euler_zyx).all()
