"""Chains of bodies: exact motion against closed forms and differences, mounts, soft tissue and fields."""

import numpy as np
import pytest

from plumbob import Frame
from plumbob.core.constants import G0
from plumbob.core.units import deg
from plumbob.data.array import UnitMount
from plumbob.data.chain import Chain, Joint, Segment
from plumbob.rotations import quat_angle, quat_conjugate, quat_from_rotvec, quat_multiply, quat_rotate, rotvec_from_quat
from plumbob.simulation import CHAINS, PROGRAMS, BentRegion, ChainProgram, Dipole, EulerMotion, simulate_chain
from plumbob.simulation.bodies import ChainMotion
from plumbob.simulation.signals import Sinusoids, Stack, constant, sinusoid

T = np.linspace(0.1, 6.3, 120)
Z = (0.0, 0.0, 1.0)


def lively(chain, seed=3):
    rng, k = np.random.default_rng(seed), len(chain.angles)
    return Sinusoids(rng.uniform(0.5, 5.0, 4), rng.normal(size=(4, k)) * 0.3, rng.normal(size=(4, k)) * 0.3)


@pytest.mark.parametrize("name", CHAINS)
def test_last_segment_moves_as_its_derivatives_say(name, moves_as_derived):
    chain = CHAINS[name]
    root = EulerMotion(Frame.NED, lively(chain, 7) if len(chain.angles) == 3 else Sinusoids(
        np.array([1.0, 2.3]), np.full((2, 3), 0.3), np.full((2, 3), -0.2)), sinusoid3(0.4, 0.3))  # fmt: skip
    motion = ChainMotion(chain, lively(chain), Frame.ENU, root)
    moves_as_derived(lambda t: motion.truth(t)[chain.segments[-1].name], T)


def sinusoid3(amplitude, frequency):
    return Stack(tuple(sinusoid(amplitude, frequency * k, 0.3 * k) for k in (1.0, 1.7, 2.1)))


@pytest.mark.parametrize("frame", list(Frame))
@pytest.mark.parametrize("name", CHAINS)
def test_truth_is_where_the_chain_puts_it(name, frame):
    made = simulate_chain(name, "calibration", frame=frame, unit="calibrated", seed=2, duration=8.0)
    root = made.bodies[made.chain.segments[0].name]
    postures = made.chain.postures(made.angles, root.q_nb, root.pos_n)
    for segment, one in postures.items():
        np.testing.assert_allclose(one.pos_n, made.postures[segment].pos_n, atol=1e-13)
        assert quat_angle(one.q_nb, made.tracks[segment].q_nb).max() < 1e-13
    np.testing.assert_allclose(made.chain.hand_at(postures), made.hand_n, atol=1e-13)
    assert made.chain.base_fixed is not root.vel_n.any()
    rising = quat_rotate(root.q_nb[0], Z) @ frame.up  # at the start the root's z axis points up, or nearly
    assert rising > 0.8


def test_frames_give_the_same_motion_and_the_same_readings():
    one, other = (
        simulate_chain("arm", "fast", frame=frame, unit="calibrated", seed=4, duration=5.0) for frame in ("NWU", "NED")
    )
    for name in one.array.names:
        for triad in ("gyr", "acc", "mag"):
            np.testing.assert_allclose(
                getattr(one.array.units[name], triad), getattr(other.array.units[name], triad), atol=1e-11
            )


def test_ideal_units_say_what_their_true_mounts_make_of_the_segment_drawn_in_a_ball_or_given():
    made = simulate_chain(
        "teach", "fast", frame="NED", unit="calibrated", seed=5, duration=4.0, mount_angle="5 deg", mount_shift="2 cm"
    )
    for segment in made.chain.segments[1:]:
        mount, body = made.mounts[segment.unit], made.bodies[segment.name]
        q_sb = quat_conjugate(mount.q_bs)
        r, w, alpha = np.array(mount.lever_b), body.rate_b, body.rate_dot_b
        force = body.specific_force_b + np.cross(alpha, r) + np.cross(w, np.cross(w, r))
        np.testing.assert_allclose(made.array.units[segment.unit].gyr, quat_rotate(q_sb, w), atol=1e-12)
        np.testing.assert_allclose(made.array.units[segment.unit].acc, quat_rotate(q_sb, force), atol=1e-11)
        nominal = made.array.mounts[segment.unit]
        assert nominal.q_bs == segment.mount.q_bs
        assert 0.0 < quat_angle(nominal.q_bs, mount.q_bs) <= deg(5.0)
        assert 0.0 < np.linalg.norm(r - nominal.lever_b) <= 0.02
    made = [
        simulate_chain("five", "still", frame="NED", unit="calibrated", seed=k, duration=0.1, mount_angle=deg(5.0))
        for k in range(24)
    ]
    size = [
        float(quat_angle(mount.q_bs, one.array.mounts[name].q_bs)) for one in made for name, mount in one.mounts.items()
    ]
    assert max(size) <= deg(5.0)
    # evenly in a ball: rms √(3/5) of its radius; 120 draws of r² with relative sd √(3/7 − 9/25) / (3/5) / √120 = 4.0 %
    assert np.mean(np.square(size)) == pytest.approx(0.6 * deg(5.0) ** 2, rel=4 * 0.040)
    mount = UnitMount(tuple(quat_from_rotvec([0.1, 0.0, 0.0]).tolist()), (0.2, 0.0, 0.0))
    made = simulate_chain("arm", "still", frame="NED", unit="calibrated", seed=1, duration=1.0, mounts={"hand": mount})
    assert made.mounts["hand"] == mount
    assert made.mounts["forearm"] == made.chain.segments[2].mount


def test_fixed_joints_make_an_array_on_one_body_which_a_named_program_carries_about():
    levers = {"a": (0.1, 0.0, 0.0), "b": (0.0, -0.2, 0.05)}
    board = Chain(
        "board",
        (Segment("body"), *(Segment(name, name) for name in levers)),
        tuple(Joint(name, "body", name, "fixed", origin=lever) for name, lever in levers.items()),
    )
    root = EulerMotion(Frame.ENU, sinusoid3(0.5, 0.4), sinusoid3(0.2, 0.3))
    made = simulate_chain(
        board, ChainProgram("swung", constant(np.zeros(0)), 3.0, root=root), frame="ENU", unit="calibrated", seed=0
    )
    body = root.truth(made.t)
    for name, lever in levers.items():
        np.testing.assert_allclose(made.array.units[name].acc, body.at_lever(lever).specific_force_b, atol=1e-11)
        np.testing.assert_allclose(made.array.units[name].gyr, body.rate_b, atol=1e-13)
    board = Chain(
        "board", (Segment("body"), Segment("a", "a")), (Joint("a", "body", "a", "fixed", origin=(0.1, 0.0, 0.0)),)
    )
    made = simulate_chain(board, "fast", frame="NED", unit="calibrated", seed=1, duration=5.0)
    assert made.angles.shape == (500, 0)
    assert np.abs(made.array.units["a"].gyr).max() > 0.3
    assert made.program.stops == ()


def test_a_clock_that_is_late_takes_its_values_later():
    late = {"hand": UnitMount(lever_b=(0.05, 0.0, 0.02), clock_offset=0.03)}
    common = {"frame": "NED", "unit": "calibrated", "seed": 1, "duration": 5.0, "bend": 20.0, "bend_at": "hand"}
    plain = simulate_chain("arm", "fast", **common)
    found = simulate_chain("arm", "fast", **common, mounts=late)
    for triad in ("gyr", "acc", "mag"):  # three steps of 10 ms
        one, other = (getattr(made.array.units["hand"], triad) for made in (found, plain))
        np.testing.assert_allclose(one[:-3], other[3:], atol=1e-10)
    np.testing.assert_array_equal(found.bodies["hand"].q_nb, plain.bodies["hand"].q_nb)
    drawn = simulate_chain("arm", "still", frame="NED", unit="calibrated", seed=1, duration=1.0, mount_clock="5 ms")
    assert all(0.0 < abs(one.clock_offset) <= 0.005 for one in drawn.mounts.values())
    assert not any(one.clock_offset for one in drawn.array.mounts.values())


def test_soft_tissue_sways_by_millimetres_and_degrees_as_its_derivatives_say():
    # central differences of 2 ms; waves of 20 rad/s and their products leave (40 · 1e-3)² / 6 of a derivative (Taylor)
    mounts = {"hand": UnitMount((0.6, 0.0, 0.8, 0.0), (0.1, 0.02, 0.0))}
    common = {"frame": "NED", "unit": "calibrated", "seed": 6, "duration": 3.0, "rate": 1000.0}
    made = simulate_chain("arm", "fast", **common, soft=True, mounts=mounts)
    unit = made.units["hand"].kinematics
    turned = rotvec_from_quat(quat_multiply(quat_conjugate(unit.q_nb[:-2]), unit.q_nb[2:]))
    differences = [turned, *(x[2:] - x[:-2] for x in (unit.rate_b, unit.pos_n, unit.vel_n))]
    for difference, exact in zip(differences, (unit.rate_b, unit.rate_dot_b, unit.vel_n, unit.acc_n), strict=True):
        np.testing.assert_allclose(difference / 2e-3, exact[1:-1], atol=1e-3 * np.abs(exact).max())
    still, fast = (
        simulate_chain("arm", program, frame="NED", unit="calibrated", seed=6, duration=20.0, soft=True)
        for program in ("still", "fast")
    )
    for name in ("upperarm", "forearm", "hand"):
        own, body = fast.units[name].kinematics, fast.bodies[name]
        r = quat_rotate(quat_conjugate(body.q_nb), own.pos_n - body.pos_n) - fast.mounts[name].lever_b
        turn = quat_angle(quat_multiply(body.q_nb, fast.mounts[name].q_bs), own.q_nb)
        assert 0.002 < np.sqrt(np.mean(np.sum(r**2, axis=1))) < 0.012
        assert deg(1.0) < np.sqrt(np.mean(turn**2)) < deg(5.0)
        assert np.ptp(still.units[name].kinematics.q_nb, axis=0).max() < 1e-12


def test_a_dipole_and_a_bent_region_in_closed_form_and_a_magnet_on_a_segment():
    magnet = Dipole((1.0, 0.0, 0.0), (0.0, 0.0, 0.1))
    places = np.array([(1.0, 0.0, 0.2), (1.2, 0.0, 0.0)])
    # B = μ0 m / (2π r³) on the axis and −μ0 m / (4π r³) at the side: 2.5 and −1.25 µT for 0.1 A m² at 0.2 m
    np.testing.assert_allclose(magnet.added_field(places, None), [(0.0, 0.0, 2.5), (0.0, 0.0, -1.25)], atol=1e-12)
    assert np.isfinite(magnet.added_field(np.array([(1.0, 0.0, 0.0)]), None)).all()
    magnet = Dipole((0.19, 0.07, 0.0), (0.0, 0.05, 0.0), on="forearm")
    common = {"frame": "NED", "unit": "calibrated", "seed": 3, "duration": 6.0}
    plain = simulate_chain("arm", "fast", **common)
    bent = simulate_chain("arm", "fast", **common, disturbances=[magnet])
    added = {name: bent.array.units[name].mag - plain.array.units[name].mag for name in plain.array.names}
    assert np.ptp(added["forearm"], axis=0).max() < 1e-9
    # on the axis, 0.1 m away: 0.2 · 0.05 / 0.1³ = 10 µT
    np.testing.assert_allclose(np.linalg.norm(added["forearm"], axis=1), 10.0, rtol=1e-9)
    assert np.ptp(added["hand"], axis=0).max() > 0.01
    np.testing.assert_array_equal(bent.array.units["hand"].acc, plain.array.units["hand"].acc)
    region = BentRegion((0.0, 0.0, 0.0), (20.0, 0.0, 0.0), radius=0.1)
    found = region.added_field(np.array([(0.0, 0.0, 0.0), (0.0, 0.2, 0.0)]), None)
    np.testing.assert_allclose(found[:, 0], [20.0, 20.0 * np.exp(-2.0)])


@pytest.mark.parametrize("frame", list(Frame))
def test_a_bent_field_is_bent_to_the_east_at_its_unit_and_less_at_the_next(frame):
    common = {"frame": frame, "unit": "calibrated", "seed": 3, "duration": 6.0}
    plain, bent = (simulate_chain("arm", "fast", **common, bend=bend) for bend in (0.0, "20 uT"))
    change = {
        name: quat_rotate(unit.kinematics.q_nb, bent.array.units[name].mag - plain.array.units[name].mag)
        for name, unit in plain.units.items()
    }
    # at the nominal place of the unit; it sits there, as no mounting error was asked for
    np.testing.assert_allclose(change["forearm"], np.tile(20.0 * frame.east, (600, 1)), atol=1e-9)
    assert 1.0 < np.linalg.norm(change["hand"], axis=1).max() < 20.0


def test_each_unit_has_errors_and_noise_of_its_own_and_other_ranges_cut_into_as_many_counts():
    made, again = (
        simulate_chain("arm", "slow", frame="NED", sensors="mpu6000+hmc5983", unit="random", seed=9, duration=3.0)
        for _ in range(2)
    )
    names = made.array.names
    assert names == ("upperarm", "forearm", "hand")
    for name in names:
        np.testing.assert_array_equal(made.array.units[name].gyr, again.array.units[name].gyr)
    biases = np.array([made.units[name].calibration.gyr.bias for name in names])
    assert np.linalg.matrix_rank(biases) == 3
    assert made.array.mounts["hand"].noise is made.units["hand"].noise
    made = simulate_chain(
        "arm", "still", frame="NED", sensors="mpu6000", unit="calibrated", seed=1, duration=1.0,
        gyr_range="1000 deg/s", acc_range="8 g",
    )  # fmt: skip
    module = made.units["hand"].module
    np.testing.assert_allclose(module.gyr.full_scale, deg(1000.0))
    np.testing.assert_allclose(module.gyr.lsb, deg(4.0 / 131.0))  # the sheet's 131 counts per °/s at ±250 °/s
    np.testing.assert_allclose(module.acc.lsb, 2.0 * G0 / 8192.0)  # the sheet's 8192 counts per g at ±4 g


@pytest.mark.parametrize(("name", "program"), [(n, p) for n in CHAINS for p in PROGRAMS if p != "walk" or n == "leg"])
def test_programs_keep_their_chain_within_its_limits(name, program):
    made = simulate_chain(name, program, frame="ENU", unit="calibrated", seed=11, duration=40.0, rate=50.0)
    jet = made.program.angles.jet(made.t)
    for k, limit in enumerate(made.chain.limits):
        assert limit.low - 1e-9 <= jet.value[:, k].min()
        assert jet.value[:, k].max() <= limit.high + 1e-9
        assert np.abs(jet.rate[:, k]).max() <= min(limit.velocity, 7.0)
        assert np.abs(jet.acc[:, k]).max() <= limit.acceleration
    for start, end in made.program.stops:
        rows = (made.t > start) & (made.t < end)
        assert not jet.rate[rows].any()
        assert all(not body.rate_b[rows].any() and not body.vel_n[rows].any() for body in made.bodies.values())
    assert made.program.stops[0][0] == 0.0
