"""FilterBattery: what every filter must do. A new filter joins by being listed in `plumbob.filters`."""

import hashlib
import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given
from hypothesis import strategies as st

from plumbob import Filter, Frame, ImuData, ImuSample, flags
from plumbob import rotations as rot
from plumbob.core.constants import G0
from plumbob.filters import filter_names, load
from plumbob.filters.layout import CLOCK, OWN
from plumbob.filters.settling import UPRIGHT_FOR
from tests.helpers import examples, slow_as_python
from tests.helpers.filter_state import state_of, through_json
from tests.helpers.motion import FIELD_ENU, consistent, noisy, seen_by, swinging, tilt_between, up_in_body

EPS = np.finfo(float).eps

# A normalised gradient never rests: where the error is zero up to rounding, each step of 10 ms still turns by 2βΔt in a
# direction that rounding chooses. Two such steps lie between two runs that are otherwise equal.
CHATTER = {"madgwick": 2 * (2 * 0.041 * 0.01)}

# How the error falls with the step on a smooth motion. The rate at the end of a step taken for the whole of it leaves
# ω̇Δt²/2 per step: order 1, which is what is not named here. A straight line between two rates leaves ω̈Δt³/12: order 2.
# A parabola through three leaves ω⃛Δt⁴/24: order 3, and so does its start, one straight step. Without a gyroscope
# nothing depends on the step.
ORDER = {"complementary": 2, "fuzzy_pi": 2, "integrate": 3, "tilt_compass": None}

NEVER_CORRECT = {"integrate", "integrate_first_order"}
"""They integrate the gyroscope alone from the start that they are given."""

FIELD_HAS_A_SAY = {
    "ekf_quaternion": "its innovation is the whole field, dip included",
    "fuzzy_pi": "the bias that it learns takes the heading's error about all axes of the body",
    "madgwick": "the gradient of the field's error is not about the vertical",
    "mahony": "the vector product with the field is not about the vertical",
    "mekf": "the heading corrects the bias about all axes of the body",
}
"""Filters in which the field may move the tilt, and how; in all others the tilt is that of gravity alone."""

AXES_MATTER = {
    "madgwick": "its gradient, of a formula for unit quaternions, has a part along q that depends on the axes"
}
"""Filters whose answer depends on how the axes sit in the body."""

STAMPS = st.one_of(
    st.sampled_from([10_000_000, 10_000_000, 0, 1, -1, -10_000_000, 500_000_000, 2_000_000_000, 10**15, -(10**15)]),
    st.integers(-(2**60), 2**60),
)
"""Steps from one stamp to the next, ns: as they should be, repeated, late, with gaps, and from another clock."""
NUMBERS = st.one_of(
    st.sampled_from([math.nan, math.inf, -math.inf, 0.0, -0.0, 5e-324, 1e-160, 1e30, 1e160, -1e300, 35.0, 100.0, 2e4]),
    st.floats(),
)
TRIPLES = st.one_of(
    st.none(),  # the good value of the moment
    NUMBERS.map(lambda v: (v, v, v)),
    st.tuples(NUMBERS, NUMBERS, NUMBERS),
)
BAD_SAMPLES = st.lists(st.tuples(STAMPS, TRIPLES, TRIPLES, TRIPLES, st.integers(0, 2**32 - 1)), max_size=40)


def bits(*tracks, rows=slice(None)):
    """Every number of some tracks, one after the other, as bytes."""
    return b"".join(getattr(track, of)[rows].tobytes() for of in ("q_nb", "bias_b", "flags") for track in tracks)


def digest(name):
    """Of the bits that a filter makes of samples without physical sense."""
    return hashlib.sha256(bits(Filter(name, frame=Frame.ENU).process(noisy()))).hexdigest()


def disturbed():
    """The consistent motion with a gyroscope bias and with accelerations, so that there is something to correct."""
    data, q = consistent()
    push = 0.3 * np.sin(2.0 * np.pi * np.array([0.3, 0.41, 0.23]) * data.t[:, np.newaxis])
    return ImuData(t=data.t, gyr=data.gyr + np.radians([1.0, -1.5, 0.5]), acc=data.acc + push, mag=data.mag), q


OTHER_WAYS = {"ekf7": [{"hard_switch": True, "reset": True}], "mahony": [{"quick_start": True, "gate": None}]}
"""Parameters that switch on what a filter does not do by default."""


def moved_then_at_rest():
    """`disturbed` for 6 s with a gap in it, then rest with noise for 4 s: every correction has work to do."""
    data, q = disturbed()
    rng = np.random.default_rng(6)
    still = {"gyr": np.radians([1.0, -1.5, 0.5]), **seen_by(q[600], Frame.ENU)}
    sd = {"gyr": 1e-3, "acc": 0.02, "mag": 0.2}
    triads = {k: np.concatenate((getattr(data, k)[:600], still[k] + sd[k] * rng.normal(size=(400, 3)))) for k in sd}
    return np.where(np.arange(1000) < 300, 0.0, 60.0) + np.arange(1000) / 100.0, triads


def pushed():
    """A swinging body with accelerations of 0.3 m/s², pushed by tan 39° g, 0.3 s there and 0.3 s back, at the start.

    That is 1.29 g in all: just what every filter takes for gravity.
    """
    data, q = swinging(100.0, 40.0)
    force = 0.3 * np.sin(2.0 * np.pi * np.array([0.9, 1.1, 1.7]) * data.t[:, np.newaxis] + [0.0, 1.0, np.pi])
    push = np.where(data.t < 0.3, 1.0, np.where(data.t < 0.6, -1.0, 0.0))
    force[:, 0] += math.tan(math.radians(39.0)) * G0 * push
    acc = data.acc + rot.quat_rotate(rot.quat_conjugate(q), force)
    return ImuData(t=data.t, gyr=data.gyr, acc=acc, mag=data.mag), q


@pytest.mark.parametrize("name", filter_names())
class FilterBattery:
    """Inherited by the test class; each test runs for each filter."""

    def uses_acc(self, name):
        return "acc" in load(name).NEEDS

    # --- one step, however it is called ---------------------------------------------------------------------

    @pytest.mark.parametrize("recording", [noisy, lambda: consistent(600)[0]], ids=["noisy", "consistent"])
    def test_however_it_is_called_the_bits_are_the_same(self, name, recording):
        """With its covariance and without, in chunks, sample by sample, restored on the way, and a second time."""
        data, f, stream = recording(), *(Filter(name, frame=Frame.NED) for _ in range(2))
        before = data.gyr.tobytes() + data.acc.tobytes() + data.mag.tobytes()
        whole = f.process(data, covariance=True)
        f.reset()
        assert bits(f.process(data)) == bits(whole)
        for size in (1, 7, 64, 599, 600, 10_000):
            f.reset()
            parts = [f.process(chunk, covariance=True) for chunk in data.chunks(size)]
            assert bits(*parts) == bits(whole), size
            assert whole.cov_b is None or np.concatenate([p.cov_b for p in parts]).tobytes() == whole.cov_b.tobytes()
        for i, sample in enumerate(data.samples()):
            if i in {1, 2, 3, 100, 299, 599}:
                stream = through_json(stream)
                assert bits(through_json(stream).process(data[i:])) == bits(whole, rows=slice(i, None)), i
            assert stream.update(sample) == whole.flags[i], i
            assert stream.q_nb.tobytes() == whole.q_nb[i].tobytes(), i
            assert stream.bias_b.tobytes() == whole.bias_b[i].tobytes(), i
            assert whole.cov_b is None or stream.cov_b.tobytes() == whole.cov_b[i].tobytes(), i
        assert data.gyr.tobytes() + data.acc.tobytes() + data.mag.tobytes() == before
        if hasattr(load(name), "COVARIANCE"):
            # turned to body axes by two products with a rotation, each a sum of three
            assert np.abs(whole.cov_b - whole.cov_b.transpose(0, 2, 1)).max() <= 12 * EPS * np.abs(whole.cov_b).max()
            assert (np.linalg.eigvalsh(whole.cov_b) > 0.0).all()
        else:
            assert (whole.cov_b, stream.cov_b) == (None, None)

    # --- physics --------------------------------------------------------------------------------------------

    @pytest.mark.parametrize("frame", list(Frame))
    @pytest.mark.parametrize(
        "start", [(0, 0, 0), (0, 0, math.pi), (0, math.pi / 2, 0), (math.pi, 0, 0), (2.0, -1.2, 3.0), (-3.0, 1.5, -2.0)]
    )
    def test_the_first_sample_gives_the_attitude(self, name, frame, start):
        """Level, upside down, nose up, heading 180°, and two that are none of these: each sensor sees its truth."""
        q = rot.quat_from_euler_zyx(np.array([start], dtype=float))
        track = Filter(name, frame=frame).process(ImuData(t=[0.0], gyr=np.zeros((1, 3)), **seen_by(q, frame)))
        assert rot.quat_angle(track.q_nb[0], q[0]) < 1e-7  # atan2 near its branch loses half the digits at most
        assert not track.flags[0] & (flags.NOT_CONVERGED | flags.HEADING_FREE)

    def test_rest_keeps_the_attitude(self, name):
        q = np.tile(rot.quat_from_euler_zyx([0.4, -0.3, 0.2]), (6000, 1))
        data = ImuData(t=np.arange(6000) / 100.0, gyr=np.zeros((6000, 3)), **seen_by(q, Frame.NED))
        track = Filter(name, frame=Frame.NED).process(data)
        assert rot.quat_angle(track.q_nb, q).max() < 1e-9 + CHATTER.get(name, 0.0)  # 6000 roundings of a few eps
        assert not (track.flags[:25] & flags.NOT_CONVERGED).any()  # then the same bits are those of stuck sensors

    def test_constant_rate_follows_the_closed_form(self, name):
        """q(t) = q0 exp(ωt); the first-order step is slow by ω³Δt²/12 (series of Δφ − 2 atan(Δφ/2))."""
        omega = np.array([0.3, -0.5, 0.9])
        t = np.arange(1000) / 100.0
        q = rot.quat_multiply(rot.quat_from_euler_zyx([0.1, 0.2, 0.3]), rot.quat_from_rotvec(t[:, None] * omega))
        alive = np.where(np.arange(1000) % 2, EPS, 0.0)[:, None]  # the same bits for long would be a stuck sensor
        data = ImuData(t=t, gyr=omega * (1.0 + alive), **seen_by(q, Frame.ENU))
        error = rot.quat_angle(Filter(name, frame=Frame.ENU).process(data).q_nb, q).max()
        speed = np.linalg.norm(omega)
        lag = speed * 0.01  # the PI filter compares with the attitude of the sample before
        bound = {
            "integrate": 1e-12,
            "tilt_compass": 1e-7,
            # exact turns, compared with the attitude predicted to the sample: what is left is rounding of the start
            "complementary": 1e-12,
            "fuzzy_pi": 1e-12,
            "integrate_first_order": 10 * speed**3 * 1e-4 / 12 * 1.01,
        }
        assert error < bound.get(name, lag) + CHATTER.get(name, 0.0)

    @pytest.mark.parametrize("other", [Frame.NED, Frame.NWU])
    def test_equal_answers_in_every_frame(self, name, other):
        data, _ = consistent()
        enu = Filter(name, frame=Frame.ENU).process(data)
        same = Filter(name, frame=other).process(data)
        apart = rot.quat_angle(rot.change_frame(same.q_nb, to=Frame.ENU, from_=other), enu.q_nb)
        assert apart.max() < 1e-9 + CHATTER.get(name, 0.0)

    def test_the_error_falls_with_the_step_as_it_should(self, name):
        """The next term of the error is smaller by about ωΔt, here 4 % at most: log2 of it moves the order by 0.06."""
        errors = []
        for rate in (100.0, 200.0):
            data, q = swinging(rate)
            errors.append(rot.quat_angle(Filter(name, frame=Frame.ENU).process(data).q_nb, q).max())
        if ORDER.get(name, 1) is None:
            assert max(errors) < 1e-7
        else:
            assert math.log2(errors[0] / errors[1]) == pytest.approx(ORDER.get(name, 1), abs=0.06)

    def test_a_start_under_acceleration_is_flagged_until_it_is_right(self, name):
        """39° of tilt at the start; scored are 3° of the mean at most, and 0.3 m/s², 1.75°, of which it is the mean."""
        data, q = pushed()
        track = Filter(name, frame=Frame.ENU).process(data)
        error = tilt_between(track.q_nb, q)
        flagged = (track.flags & flags.NOT_CONVERGED) != 0
        assert math.radians(35.0) < error[:20].max()
        if name == "tilt_compass":  # without a memory each sample is a start of its own
            assert not flagged.any()
            return
        assert flagged[: round(100 * UPRIGHT_FOR)].all()
        assert flagged.all() == (name in NEVER_CORRECT)
        assert error[~flagged].max(initial=0.0) < math.radians(3.0 + 1.75)

    def test_a_start_that_is_given_is_not_on_trial(self, name):
        data, q = pushed()
        track = Filter(name, frame=Frame.ENU, init=q[0]).process(data)
        assert not (track.flags & flags.NOT_CONVERGED).any()

    def test_a_wrong_tilt_is_corrected_though_the_gyroscope_says_zero(self, name):
        """From 10° to less than 1° in a minute, twelve time constants of the slowest (5 s, complementary)."""
        n, true = 3000, rot.quat_from_euler_zyx([0.4, -0.3, 0.2])
        rng = np.random.default_rng(0)
        seen = seen_by(np.tile(true, (n, 1)), Frame.ENU)
        alive = {k: v + 1e-6 * rng.normal(size=(n, 3)) for k, v in seen.items()}  # the same bits for long were stuck
        gyr = np.where(np.arange(n) % 2, 1e-9, 0.0)[:, np.newaxis] * np.ones(3)
        start = rot.quat_multiply(rot.quat_from_rotvec(math.radians(10.0) * np.array([0.6, -0.8, 0.0])), true)
        data = ImuData(t=np.arange(n) / 50.0, gyr=gyr, **alive)
        end = Filter(name, frame=Frame.ENU, init=start).process(data).q_nb[-1]
        error = np.linalg.norm(up_in_body(end) - up_in_body(true))
        assert bool(error < math.radians(1.0)) is (name not in NEVER_CORRECT)

    def test_turning_the_field_about_the_vertical_leaves_the_tilt(self, name):
        """Where the body heads is nothing to the horizon, whatever there is to correct."""
        data, q = disturbed()
        turned = rot.quat_rotate(rot.quat_from_euler_zyx([-1.234, 0.0, 0.0]), FIELD_ENU)
        mag = rot.quat_rotate(rot.quat_conjugate(q), turned)
        a = Filter(name, frame=Frame.ENU).process(data)
        b = Filter(name, frame=Frame.ENU).process(ImuData(t=data.t, gyr=data.gyr, acc=data.acc, mag=mag))
        apart = np.linalg.norm(up_in_body(a.q_nb) - up_in_body(b.q_nb), axis=1).max()
        assert bool(apart < 1e-9) is (name not in FIELD_HAS_A_SAY)

    def test_turning_the_world_about_the_vertical_turns_only_the_heading(self, name):
        data, q = disturbed()
        yaw = rot.quat_from_euler_zyx([1.234, 0.0, 0.0])
        a = Filter(name, frame=Frame.ENU, init=q[0], params={"mag": False}).process(data)
        b = Filter(name, frame=Frame.ENU, init=rot.quat_multiply(yaw, q[0]), params={"mag": False}).process(data)
        assert rot.quat_angle(rot.quat_multiply(yaw, a.q_nb), b.q_nb).max() < 1e-9 + CHATTER.get(name, 0.0)

    @pytest.mark.parametrize(
        "turn",
        [[[0, 1, 0], [0, 0, 1], [1, 0, 0]], [[0, -1, 0], [1, 0, 0], [0, 0, 1]], [[1, 0, 0], [0, 0, -1], [0, 1, 0]]],
    )
    def test_other_axes_of_the_body_give_the_same_answer_in_those_axes(self, name, turn):
        """A sensor turned in its case: attitude, bias and covariance turn with it, and no flag changes.

        1000 steps of some hundred roundings each, which the corrections forget again: 1e-12 is a hundred times more
        than what is left of them.
        """
        (t, triads), turn = moved_then_at_rest(), np.array(turn, dtype=float)
        for params in ({}, *OTHER_WAYS.get(name, ())):
            f, g = (Filter(name, frame=Frame.ENU, params=params) for _ in range(2))
            a = f.process(ImuData(t=t, **triads), covariance=True)
            b = g.process(ImuData(t=t, **{k: v @ turn.T for k, v in triads.items()}), covariance=True)
            apart = rot.quat_angle(b.q_nb, rot.quat_multiply(a.q_nb, rot.quat_from_dcm(turn.T))).max()
            assert bool(apart < 1e-12) is (name not in AXES_MATTER)
            if name in AXES_MATTER:
                continue
            assert np.abs(b.bias_b - a.bias_b @ turn.T).max() < 1e-12
            assert (a.flags == b.flags).all()
            if a.cov_b is not None:
                assert np.abs(b.cov_b - turn @ a.cov_b @ turn.T).max() < 1e-12 * np.abs(a.cov_b).max()

    def test_opposite_start_quaternions_are_the_same_start(self, name):
        data, q = consistent(300)
        a = Filter(name, frame=Frame.ENU, init=q[0]).process(data, covariance=True)
        b = Filter(name, frame=Frame.ENU, init=-q[0]).process(data, covariance=True)
        assert rot.quat_angle(a.q_nb, b.q_nb).max() < 1e-12
        assert a.cov_b is None or np.abs(a.cov_b - b.cov_b).max() < 1e-15

    def test_declination_turns_the_heading_to_true_north(self, name):
        data, _ = consistent(300)
        d = 0.1
        magnetic = Filter(name, frame=Frame.NED).process(data)
        true = Filter(name, frame=Frame.NED, params={"declination": d}).process(data)
        east = rot.quat_from_euler_zyx([d, 0.0, 0.0])  # in NED a yaw grows from north to east
        assert rot.quat_angle(rot.quat_multiply(east, magnetic.q_nb), true.q_nb).max() < 1e-9 + CHATTER.get(name, 0.0)
        assert (magnetic.north, true.north) == ("magnetic", "true")

    def test_irregular_steps_follow_the_same_motion(self, name):
        data, q = consistent(4000, rate=400.0)
        rng = np.random.default_rng(3)
        keep = np.sort(rng.choice(4000, 2000, replace=False))
        keep[0] = 0
        thin = ImuData(t=data.t[keep], gyr=data.gyr[keep], acc=data.acc[keep], mag=data.mag[keep])
        error = rot.quat_angle(Filter(name, frame=Frame.ENU).process(thin).q_nb, q[keep])
        assert error.max() < 0.02  # rad; a step of about 5 ms lags by ω̇Δt²/2 and ωΔt at up to 1.7 rad/s

    # --- what goes wrong ------------------------------------------------------------------------------------

    @pytest.mark.parametrize("channel", ["gyr", "acc", "mag"])
    def test_one_bad_sample_never_ends_in_nan_and_is_soon_forgotten(self, name, channel):
        data, _ = consistent(1500)
        clean = Filter(name, frame=Frame.ENU).process(data)
        for value in (np.nan, np.inf, -np.inf, 1e30, 1e300, 5e-324, 0.0):
            arrays = {k: getattr(data, k).copy() for k in ("gyr", "acc", "mag")}
            arrays[channel][500] = value
            track = Filter(name, frame=Frame.ENU).process(ImuData(t=data.t, **arrays))
            assert np.isfinite(track.q_nb).all()
            assert np.abs(np.linalg.norm(track.q_nb, axis=1) - 1.0).max() < 4 * EPS
            excess = rot.quat_angle(track.q_nb, clean.q_nb)
            assert excess.max() < math.radians(2.0), value  # reliability figure F1

    @given(stream=BAD_SAMPLES, begun=st.booleans())
    @examples(0.6, suppress_health_check=[HealthCheck.differing_executors])
    def test_whatever_comes_it_never_raises_and_stays_an_attitude(self, name, stream, begun):
        """Values, flags and stamps at will; the state can be saved and restored, which refuses what is not finite."""
        good, _ = consistent(60)
        f, t_ns = Filter(name, frame=Frame.ENU), 0
        if begun:
            for sample in good[:10].samples():
                f.update(sample)
        for i, (step_ns, *triads, word) in enumerate(stream):
            t_ns = max(-(2**62), min(2**62, t_ns + step_ns))
            now = [
                getattr(good, k)[i + 10] if v is None else v for k, v in zip(("gyr", "acc", "mag"), triads, strict=True)
            ]
            f.update(ImuSample(t_ns, *now, flags=word))
            assert abs(np.linalg.norm(f.q_nb) - 1.0) < 8 * EPS and np.isfinite(f.bias_b).all()
        Filter.restore(f.save())

    @pytest.mark.parametrize("channel", ["gyr", "acc", "mag"])
    def test_a_bad_first_sample_does_not_matter_after_the_next_good_one(self, name, channel):
        data, q = consistent(50, amplitude=0.1)
        arrays = {k: getattr(data, k).copy() for k in ("gyr", "acc", "mag")}
        arrays[channel][0] = np.nan
        track = Filter(name, frame=Frame.ENU).process(ImuData(t=data.t, **arrays))
        assert np.isfinite(track.q_nb).all() and rot.quat_angle(track.q_nb[1:], q[1:]).max() < 0.01

    def test_a_long_gap_is_flagged_and_not_integrated(self, name):
        data, q = consistent(400)
        t = data.t.copy()
        t[200:] += 60.0
        track = Filter(name, frame=Frame.ENU).process(ImuData(t=t, gyr=data.gyr, acc=data.acc, mag=data.mag))
        assert track.flags[200] & flags.GAP
        assert rot.quat_angle(track.q_nb[200], q[200]) < 1e-7 or not self.uses_acc(name)
        assert rot.quat_angle(track.q_nb, q).max() < 0.05

    def test_a_repeated_or_late_sample_is_flagged_and_changes_nothing(self, name):
        data, _ = consistent(100)
        all_samples = list(data.samples())
        f = Filter(name, frame=Frame.ENU)
        for sample in all_samples[:50]:
            f.update(sample)
        before = state_of(f)
        for late in (all_samples[49], all_samples[20]):
            assert f.update(late) & flags.TIME_FAULT
        after = state_of(f)
        assert (after[:CLOCK] == before[:CLOCK]).all() and (after[OWN:] == before[OWN:]).all()
        assert not f.update(all_samples[50]) & flags.TIME_FAULT

    @slow_as_python
    @pytest.mark.parametrize("n", [50_000, pytest.param(1_000_000, marks=pytest.mark.long(reason="8 s for all"))])
    def test_a_million_steps_keep_the_norm(self, name, n):
        rng = np.random.default_rng(5)
        data = ImuData(
            t=np.arange(n) / 1000.0, gyr=rng.normal(size=(n, 3)) * 5.0, acc=rng.normal(size=(n, 3)) + [0, 0, 9.8],
            mag=rng.normal(size=(n, 3)) + [0, 20, -40],
        )  # fmt: skip
        q = Filter(name, frame=Frame.ENU).process(data).q_nb
        assert np.abs(np.linalg.norm(q, axis=1) - 1.0).max() < 1e-12  # reliability figure F10

    def test_without_a_magnetometer_the_heading_is_free_and_says_so(self, name):
        data, _ = consistent(50)
        without = ImuData(t=data.t, gyr=data.gyr, acc=data.acc)
        track = Filter(name, frame=Frame.ENU).process(without)
        assert track.north == "free"
        assert (track.flags & flags.HEADING_FREE).all()
        off = Filter(name, frame=Frame.ENU, params={"mag": "off"}).process(data)
        assert off.q_nb.tobytes() == track.q_nb.tobytes()
