"""Joint angles of a leg that walks, on one clock or on several, and its strides; truth is that of the simulator."""

from dataclasses import replace

import numpy as np
import pytest

import plumbob
from plumbob.arm.alignment import ArmCard
from plumbob.arm.joints import CHAINS, JOINTS
from plumbob.data.array import ImuArray, UnitMount
from plumbob.data.chain import Chain, Joint, Segment, chain_text, parse_chain
from plumbob.rotations import Frame, quat_rotate
from plumbob.simulation import simulate_chain
from plumbob.simulation.motion import EulerMotion
from plumbob.simulation.programs import waypoints
from plumbob.simulation.signals import Moves, Sinusoids, Windowed, constant

UPRIGHT = (0.0, 1.8)
OFFSET, DRIFT = 0.03, 40e-6


@pytest.fixture(scope="module")
def walk():
    return simulate_chain(
        "leg", "walk", frame="ENU", sensors="icm20948", unit="random", seed=2, rate=100.0, duration="24 s",
        gyr_range="2000 deg/s", acc_range="16 g", mount_angle="15 deg", mount_shift="2 cm",
    )  # fmt: skip


def units(walk, *names):
    return ImuArray({name: walk.array.units[name] for name in names})


def error_of(walk, found, name, column):
    """Error behind the upright pose, rad, and the whole error."""
    true = np.interp(found.joints.t, walk.t, walk.angles[:, column])
    error = found.joints.angles[:, found.joints.names.index(name)] - true
    return error - error[found.joints.t < UPRIGHT[1]].mean(), error


def rms(error):
    return np.degrees(np.sqrt(np.mean(error**2)))


def test_files_on_clocks_of_their_own_give_the_knee_and_its_strides(walk, tmp_path):
    shank = walk.array.units["shank"]
    late = replace(shank, t=np.array(shank.t) * (1.0 + DRIFT) + OFFSET)
    plumbob.write(tmp_path / "my_shank.csv", late)
    plumbob.write(tmp_path / "thigh.csv", walk.array.units["thigh"])
    files = [tmp_path / "my_shank.csv", tmp_path / "thigh.csv"]  # in the wrong order: their names say what they are
    found = plumbob.joints(files, hinge="knee", upright=UPRIGHT)
    behind, whole = error_of(walk, found, "knee_angle_r", 3)
    assert rms(behind) < 1.0  # issue's bar; half a step of unknown stamps is 2° at 400°/s
    assert np.mean(np.abs(whole) < 2.0 * found.joints.sd[:, 0]) > 0.9
    (clock,) = [note.values for note in found.notes if getattr(note, "code", "") == "joints.clock"]
    middle = OFFSET + DRIFT * 12.0
    assert abs(clock["offset_ms"] + 1e3 * middle) < 3.0 * clock["sd_ms"]
    axis = quat_rotate(np.array(found.chain.joints[0].q_pc), np.array(found.chain.joints[0].axes[0]))
    by_cov = np.sqrt(axis @ found.joint_cov["knee_r"] @ axis)  # clocks and stamps count in both
    assert by_cov == pytest.approx(found.joints.sd[found.rows, 0], rel=0.05)
    stride = found.strides["_r"]
    spectrum = np.abs(np.fft.rfft(walk.angles[500:2000, 3] - walk.angles[500:2000, 3].mean(), 1 << 16))
    assert stride.cadence == pytest.approx(120.0 * np.fft.rfftfreq(1 << 16, 0.01)[np.argmax(spectrum)], rel=0.02)
    assert len(stride) >= 12
    grids = stride.start[:, np.newaxis] + np.outer(stride.end - stride.start, np.linspace(0.0, 1.0, 101))
    true = np.interp(grids, walk.t, walk.angles[:, 3])
    assert rms(np.ptp(stride.curves[:, :, 0], axis=1) - np.ptp(true, axis=1)) < 1.0
    found.save(tmp_path / "knee.mot")
    again = ImuArray({"my_shank": shank, "thigh": walk.array.units["thigh"]})
    by_card = plumbob.joints(again, chain=found.card, upright=UPRIGHT)
    assert by_card.joints.names == ("knee_angle_r",)
    assert len(by_card.strides["_r"]) == len(stride)
    by_card = plumbob.joints({"my_shank": late, "thigh": walk.array.units["thigh"]}, chain=found.card, upright=UPRIGHT)
    assert rms(error_of(walk, by_card, "knee_angle_r", 3)[0]) < 1.0


def test_all_angles_of_a_leg_and_what_is_said_of_them(walk, tmp_path):
    found = plumbob.joints(walk.array, chain="leg", upright=UPRIGHT, stamps="instant")
    names = [angle + "_r" for joint in CHAINS["leg"] for angle in JOINTS[joint].angles]
    assert list(found.joints.names) == names
    for k, name in enumerate(names):
        behind, whole = error_of(walk, found, name, k)
        assert rms(behind) < 1.5, name
        assert np.mean(np.abs(whole) < 2.0 * found.joints.sd[:, k]) > 0.85, name
    assert found.joints.hand is None
    assert "hand_m" not in found.summary()
    assert parse_chain(chain_text(found.chain)).angles == found.chain.angles
    text = found.save(tmp_path / "leg.mot").read_text().splitlines()
    assert text[6].split("\t") == ["time", *names]
    assert float(text[7 + 500].split("\t")[4]) == np.degrees(found.joints.angles[500, 3])


def test_the_left_side_is_the_right_one_in_a_mirror(walk):
    right = plumbob.joints(units(walk, "pelvis", "thigh"), chain="hip", upright=UPRIGHT).joints
    left = plumbob.joints(units(walk, "pelvis", "thigh"), chain="hip", upright=UPRIGHT, side="left").joints
    assert left.names == ("hip_flexion_l", "hip_adduction_l", "hip_rotation_l")
    # the ranges of abduction and adduction change sides, so that ahead is weighed anew, half a degree away
    assert np.allclose(left.angles, right.angles * [1.0, -1.0, -1.0], atol=0.02)
    named = ImuArray({f"Left {name}": walk.array.units[name] for name in ("thigh", "shank")})
    with pytest.raises(plumbob.PlumbobError, match="say left"):
        plumbob.joints(named, hinge="knee", upright=UPRIGHT)


def test_a_hinge_without_a_pose_counts_from_the_first_sample(walk):
    found = plumbob.joints(units(walk, "thigh", "shank"), hinge="knee", stamps="instant")
    assert "joints.first_sample" in [getattr(note, "code", "") for note in found.notes]
    true = walk.angles[:, 3] - walk.angles[0, 3]
    assert np.mean(np.abs(found.joints.angles[:, 0] - true) < 2.0 * found.joints.sd[:, 0]) > 0.85
    machine = plumbob.joints(units(walk, "thigh", "shank"), hinge="boom", stamps="instant")
    assert machine.joints.names == ("boom",)
    assert not machine.strides


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({}, "either a hinge"),
        ({"hinge": "knee", "chain": "leg"}, "either a hinge"),
        ({"hinge": "hip"}, "--chain hip"),
        ({"chain": "hip"}, "--upright"),
        ({"chain": "lge"}, "leg"),
        ({"chain": "leg", "upright": UPRIGHT}, "4 segments"),
        ({"hinge": "knee", "upright": (100.0, 101.0)}, "no sample"),
        ({"hinge": "knee", "upright": (3.0, 6.0)}, r"'thigh' turns by .* of the recording.* at 0, 1 s"),  # it walks
        ({"hinge": "knee", "stamps": "late"}, "unknown"),
        ({"hinge": "knee", "ahead": "up"}, "ahead"),
    ],
)
def test_what_does_not_fit_is_refused(walk, given, said):
    with pytest.raises(plumbob.PlumbobError, match=said):
        plumbob.joints(units(walk, "thigh", "shank"), **given)


def test_an_upright_pose_that_sways_claims_less_and_counts_on_the_first_clock(walk):
    """The first step begins at 2 s: in 0.2 s of it the mean force turns by 2°, which the pose and the bias then may."""
    still, swayed = (
        plumbob.joints(units(walk, "thigh", "shank"), hinge="knee", stamps="instant", upright=(0.0, end))
        for end in (UPRIGHT[1], 2.2)
    )
    assert "joints.sways" in [getattr(note, "code", "") for note in swayed.notes]
    assert np.median(swayed.joints.sd) > 2.0 * np.median(still.joints.sd)
    shank = walk.array.units["shank"]
    ahead = {"thigh": walk.array.units["thigh"], "shank": replace(shank, t=np.array(shank.t) + 10.0)}
    with pytest.raises(plumbob.PlumbobError, match=r"of the clock of 'thigh'.* at 0, 1 s"):
        plumbob.joints(ahead, hinge="knee", upright=(10.0, 11.8))  # it stood then on the clock of the shank


BACK = Chain(
    "back", (Segment("pelvis", "pelvis"), Segment("thorax", "thorax", UnitMount(lever_b=(0.1, 0.25, 0.0)))),
    (Joint("lumbar", "pelvis", "thorax", "ball", origin=(0.0, 0.1, 0.0),
           axes=((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))),),
)  # fmt: skip


def bent(seed, poses):
    """A back that goes upright and to poses, degrees, in turn, while the pelvis moves by 8° and 10 cm."""
    rng = np.random.default_rng(seed)
    omega, grown = 2.0 * np.pi * rng.uniform(0.1, 0.6, 3), Moves((2.0,), (1.0,), (1.0,))
    turn, way = (Windowed(Sinusoids.from_phasors(omega, size * np.exp(2j * np.pi * rng.uniform(size=(3, 3)))), grown)
                 for size in (np.radians(8.0), 0.1))  # fmt: skip
    upright = constant([0.0, 0.0, np.pi / 2.0])  # y up, x ahead
    rows = [pose * rng.uniform(0.7, 1.0) + 3.0 * rng.standard_normal(3) * (abs(pose).sum() > 0.0)
            for _ in range(6) for pose in np.array(poses, dtype=float)]  # fmt: skip
    table = np.radians(np.vstack((np.zeros((2, 3)), *rows)))
    program = waypoints(BACK, table, dwell=[1.0, 1.0, *rng.uniform(0.1, 0.4, len(rows))], speed=np.radians(90.0))
    program = replace(program, root=EulerMotion(Frame.ENU, turn + upright, way))
    return simulate_chain(
        BACK, program, frame="ENU", sensors="icm20948", unit="random", seed=seed, rate=100.0,
        duration=program.duration, mount_angle="10 deg", mount_shift="2 cm",
    )  # fmt: skip


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize(
    ("poses", "ahead", "most"),
    [
        ([(-60, 0, 0), (0, 0, 0)], None, 5.0),  # no back bends 60° to the rear
        ([(-50, 10, 0), (15, -20, 25), (0, 20, -35)], None, 10.0),
        ([(0, 24, 0), (0, -24, 0)], "x", 8.0),  # to the sides alone: as far ahead and back it could be, too
        ([(0, 24, 0), (0, -24, 0)], None, np.inf),
    ],
)
def test_motion_that_is_no_walk_shows_ahead_or_claims_that_it_does_not(seed, poses, ahead, most):
    made = bent(seed, poses)
    estimate = plumbob.joints(made.array, chain="back", upright=(0.0, 1.8), stamps="instant", ahead=ahead)
    error, sd = estimate.joints.angles - made.angles, estimate.joints.sd
    assert np.degrees(np.sqrt(np.mean(error**2, axis=0)).max()) < most
    assert np.mean(np.abs(error) < 2.0 * sd) > 0.8  # 95 % of a claim that is no wider than it must be
    assert np.abs(error / sd).max() < 6.0
    (note,) = [note.values for note in estimate.notes if getattr(note, "code", "") == "joints.facing"]
    assert note["percent"] < 5.0 or most == np.inf
    if most == np.inf:
        assert note["sd_deg"] > 45.0
    again = plumbob.joints(
        made.array, chain=ArmCard.from_text(estimate.card.text(), "card"), upright=UPRIGHT, stamps="instant"
    )
    assert np.median(again.joints.sd) > 0.5 * np.median(sd)  # a card carries it


def test_a_knee_that_bends_both_ways_claims_either_sign():
    joint = Joint("knee", "thigh", "shank", "hinge", origin=(0.0, 0.0, -0.4), axes=((0.0, 1.0, 0.0),))
    chain = Chain("machine", (Segment("thigh", "thigh"), Segment("shank", "shank")), (joint,))
    made = simulate_chain(chain, "calibration", frame="ENU", unit="random", seed=1, rate=50.0, duration="20 s")
    reach = min(-made.angles.min(), made.angles.max())
    assert reach > np.radians(15.0)
    knee = plumbob.joints(made.array, hinge="knee", stamps="instant", upright=UPRIGHT)
    assert "joints.facing" in [getattr(note, "code", "") for note in knee.notes]
    assert np.mean(np.abs(knee.joints.angles - made.angles) < 2.0 * knee.joints.sd) > 0.8


def test_a_walk_without_a_beginning_and_without_dates_has_no_one_offset(walk):
    """Of parts that begin in the middle of strides that repeat themselves, an offset is refused or right."""
    parts = {name: walk.array.units[name][600:2000] for name in ("thigh", "shank")}
    parts = {name: replace(imu, t=np.array(imu.t) - imu.t[0]) for name, imu in parts.items()}
    parts["shank"] = parts["shank"][700:]
    parts["shank"] = replace(parts["shank"], t=np.array(parts["shank"].t) - parts["shank"].t[0])
    try:
        found = plumbob.joints(parts, hinge="knee")
    except plumbob.PlumbobError as error:
        assert "repeats itself" in str(error)
    else:
        (clock,) = [note.values for note in found.notes if getattr(note, "code", "") == "joints.clock"]
        assert abs(clock["offset_ms"] - 7000.0) < 3.0 * clock["sd_ms"] + 5.0
