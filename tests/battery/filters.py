"""FilterBattery: what every filter must do. A new filter joins by being listed in `plumbob.filters`."""

import json
import math

import numpy as np
import pytest

from plumbob import Filter, Frame, ImuData, flags
from plumbob._jit import jit_disabled
from plumbob.filters import filter_names, load
from plumbob.filters.layout import CLOCK, OWN
from plumbob.rotations import change_frame, quat_angle, quat_from_euler_zyx, quat_from_rotvec, quat_multiply
from tests.battery.motion import consistent, noisy, seen_by

EPS = np.finfo(float).eps

# A normalised gradient never rests: where the error is zero up to rounding, each step of 10 ms still turns by 2βΔt in a
# direction that rounding chooses. Two such steps lie between two runs that are otherwise equal.
CHATTER = {"madgwick": 2 * (2 * 0.041 * 0.01)}


def bits(track):
    """Every number of a track as bytes."""
    return track.q_nb.tobytes() + track.bias_b.tobytes() + track.flags.tobytes()


@pytest.mark.parametrize("name", filter_names())
class FilterBattery:
    """Inherited by the test class; each test runs for each filter."""

    def uses_acc(self, name):
        return "acc" in load(name).NEEDS

    # --- one step, however it is called ---------------------------------------------------------------------

    @pytest.mark.parametrize("size", [1, 7, 64, 599, 600, 10_000])
    def test_chunks_of_any_size_give_the_same_bits(self, name, size):
        data = noisy()
        whole = Filter(name, frame=Frame.ENU).process(data)
        chunked = Filter(name, frame=Frame.ENU)
        parts = [chunked.process(chunk) for chunk in data.chunks(size)]
        assert b"".join(p.q_nb.tobytes() for p in parts) == whole.q_nb.tobytes()
        assert b"".join(p.bias_b.tobytes() for p in parts) == whole.bias_b.tobytes()
        assert b"".join(p.flags.tobytes() for p in parts) == whole.flags.tobytes()

    def test_sample_by_sample_gives_the_same_bits(self, name):
        data = noisy()
        whole = Filter(name, frame=Frame.NED).process(data)
        stream = Filter(name, frame=Frame.NED)
        for i, sample in enumerate(data.samples()):
            found = stream.update(sample)
            assert stream.q_nb.tobytes() == whole.q_nb[i].tobytes(), i
            assert stream.bias_b.tobytes() == whole.bias_b[i].tobytes(), i
            assert found == whole.flags[i], i

    @pytest.mark.parametrize("cut", [1, 2, 3, 100, 299, 599])
    def test_restart_from_a_state_saved_as_json_gives_the_same_bits(self, name, cut):
        data = noisy()
        whole = Filter(name, frame=Frame.ENU).process(data)
        first = Filter(name, frame=Frame.ENU)
        first.process(data[:cut])
        second = Filter.restore(json.loads(json.dumps(first.save())))
        rest = second.process(data[cut:])
        assert rest.q_nb.tobytes() == whole.q_nb[cut:].tobytes()
        assert rest.flags.tobytes() == whole.flags[cut:].tobytes()

    def test_the_same_run_twice_gives_the_same_bits_and_leaves_its_input_alone(self, name):
        data = noisy()
        before = data.gyr.tobytes() + data.acc.tobytes() + data.mag.tobytes()
        f = Filter(name, frame=Frame.ENU)
        first = f.process(data)
        f.reset()
        assert bits(f.process(data)) == bits(first)
        assert data.gyr.tobytes() + data.acc.tobytes() + data.mag.tobytes() == before

    # --- physics --------------------------------------------------------------------------------------------

    @pytest.mark.parametrize("frame", list(Frame))
    @pytest.mark.parametrize(
        "start", [(0, 0, 0), (0, 0, math.pi), (0, math.pi / 2, 0), (math.pi, 0, 0), (2.0, -1.2, 3.0), (-3.0, 1.5, -2.0)]
    )
    def test_the_first_sample_gives_the_attitude(self, name, frame, start):
        """Level, upside down, nose up, heading 180°, and two that are none of these: each sensor sees its truth."""
        q = quat_from_euler_zyx(np.array([start], dtype=float))
        track = Filter(name, frame=frame).process(ImuData(t=[0.0], gyr=np.zeros((1, 3)), **seen_by(q, frame)))
        assert quat_angle(track.q_nb[0], q[0]) < 1e-7  # atan2 near its branch loses half the digits at most
        assert not track.flags[0] & (flags.NOT_CONVERGED | flags.HEADING_FREE)

    def test_rest_keeps_the_attitude(self, name):
        q = np.tile(quat_from_euler_zyx([0.4, -0.3, 0.2]), (6000, 1))
        data = ImuData(t=np.arange(6000) / 100.0, gyr=np.zeros((6000, 3)), **seen_by(q, Frame.NED))
        track = Filter(name, frame=Frame.NED).process(data)
        assert quat_angle(track.q_nb, q).max() < 1e-9 + CHATTER.get(name, 0.0)  # 6000 roundings of a few eps

    def test_constant_rate_follows_the_closed_form(self, name):
        """q(t) = q0 exp(ωt); the first-order step is slow by ω³Δt²/12 (series of Δφ − 2 atan(Δφ/2))."""
        omega = np.array([0.3, -0.5, 0.9])
        t = np.arange(1000) / 100.0
        q = quat_multiply(quat_from_euler_zyx([0.1, 0.2, 0.3]), quat_from_rotvec(t[:, None] * omega))
        alive = np.where(np.arange(1000) % 2, EPS, 0.0)[:, None]  # the same bits for long would be a stuck sensor
        data = ImuData(t=t, gyr=omega * (1.0 + alive), **seen_by(q, Frame.ENU))
        error = quat_angle(Filter(name, frame=Frame.ENU).process(data).q_nb, q).max()
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
        apart = quat_angle(change_frame(same.q_nb, to=Frame.ENU, from_=other), enu.q_nb)
        assert apart.max() < 1e-9 + CHATTER.get(name, 0.0)

    def test_turning_the_world_about_the_vertical_turns_only_the_heading(self, name):
        data, q = consistent()
        yaw = quat_from_euler_zyx([1.234, 0.0, 0.0])
        a = Filter(name, frame=Frame.ENU, init=q[0], params={"mag": False}).process(data)
        b = Filter(name, frame=Frame.ENU, init=quat_multiply(yaw, q[0]), params={"mag": False}).process(data)
        assert quat_angle(quat_multiply(yaw, a.q_nb), b.q_nb).max() < 1e-9 + CHATTER.get(name, 0.0)

    def test_opposite_start_quaternions_are_the_same_start(self, name):
        data, q = consistent(300)
        a = Filter(name, frame=Frame.ENU, init=q[0]).process(data)
        b = Filter(name, frame=Frame.ENU, init=-q[0]).process(data)
        assert quat_angle(a.q_nb, b.q_nb).max() < 1e-12

    def test_declination_turns_the_heading_to_true_north(self, name):
        data, _ = consistent(300)
        d = 0.1
        magnetic = Filter(name, frame=Frame.NED).process(data)
        true = Filter(name, frame=Frame.NED, params={"declination": d}).process(data)
        east = quat_from_euler_zyx([d, 0.0, 0.0])  # in NED a yaw grows from north to east
        assert quat_angle(quat_multiply(east, magnetic.q_nb), true.q_nb).max() < 1e-9 + CHATTER.get(name, 0.0)
        assert (magnetic.north, true.north) == ("magnetic", "true")

    def test_irregular_steps_follow_the_same_motion(self, name):
        data, q = consistent(4000, rate=400.0)
        rng = np.random.default_rng(3)
        keep = np.sort(rng.choice(4000, 2000, replace=False))
        keep[0] = 0
        thin = ImuData(t=data.t[keep], gyr=data.gyr[keep], acc=data.acc[keep], mag=data.mag[keep])
        error = quat_angle(Filter(name, frame=Frame.ENU).process(thin).q_nb, q[keep])
        assert error.max() < 0.02  # rad; a step of about 5 ms lags by ω̇Δt²/2 and ωΔt at up to 1.7 rad/s

    # --- what goes wrong ------------------------------------------------------------------------------------

    @pytest.mark.parametrize("channel", ["gyr", "acc", "mag"])
    @pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e30, 1e300, 5e-324, 0.0])
    def test_one_bad_sample_never_ends_in_nan_and_is_soon_forgotten(self, name, channel, value):
        data, _ = consistent(1500)
        arrays = {k: getattr(data, k).copy() for k in ("gyr", "acc", "mag")}
        arrays[channel][500] = value
        track = Filter(name, frame=Frame.ENU).process(ImuData(t=data.t, **arrays))
        clean = Filter(name, frame=Frame.ENU).process(data)
        assert np.isfinite(track.q_nb).all()
        assert np.abs(np.linalg.norm(track.q_nb, axis=1) - 1.0).max() < 4 * EPS
        excess = quat_angle(track.q_nb, clean.q_nb)
        assert excess.max() < math.radians(2.0)  # reliability figure F1

    @pytest.mark.parametrize("channel", ["gyr", "acc", "mag"])
    def test_a_bad_first_sample_does_not_matter_after_the_next_good_one(self, name, channel):
        data, q = consistent(50, amplitude=0.1)
        arrays = {k: getattr(data, k).copy() for k in ("gyr", "acc", "mag")}
        arrays[channel][0] = np.nan
        track = Filter(name, frame=Frame.ENU).process(ImuData(t=data.t, **arrays))
        assert np.isfinite(track.q_nb).all()
        assert quat_angle(track.q_nb[1:], q[1:]).max() < 0.01

    def test_a_long_gap_is_flagged_and_not_integrated(self, name):
        data, q = consistent(400)
        t = data.t.copy()
        t[200:] += 60.0
        track = Filter(name, frame=Frame.ENU).process(ImuData(t=t, gyr=data.gyr, acc=data.acc, mag=data.mag))
        assert track.flags[200] & flags.GAP
        assert quat_angle(track.q_nb[200], q[200]) < 1e-7 or not self.uses_acc(name)
        assert quat_angle(track.q_nb, q).max() < 0.05

    def test_a_repeated_or_late_sample_is_flagged_and_changes_nothing(self, name):
        data, _ = consistent(100)
        all_samples = list(data.samples())
        f = Filter(name, frame=Frame.ENU)
        for sample in all_samples[:50]:
            f.update(sample)
        before = f._x.copy()
        for late in (all_samples[49], all_samples[20]):
            assert f.update(late) & flags.TIME_FAULT
        assert (f._x[:CLOCK] == before[:CLOCK]).all()
        assert (f._x[OWN:] == before[OWN:]).all()
        assert not f.update(all_samples[50]) & flags.TIME_FAULT

    @pytest.mark.skipif(jit_disabled(), reason="minutes in plain Python, whose bits are the same")
    def test_a_million_steps_keep_the_norm(self, name):
        rng = np.random.default_rng(5)
        n = 1_000_000
        data = ImuData(
            t=np.arange(n) / 1000.0,
            gyr=rng.normal(size=(n, 3)) * 5.0,
            acc=rng.normal(size=(n, 3)) + [0, 0, 9.8],
            mag=rng.normal(size=(n, 3)) + [0, 20, -40],
        )
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
