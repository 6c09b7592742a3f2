"""Chains and motions of an arm, for the tests of this room and of its verb."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from plumbob import ImuData, NoiseCard
from plumbob.arm import JointTrack
from plumbob.data import TRIADS
from plumbob.data.array import PRESETS, ImuArray, UnitMount
from plumbob.data.cards.noise import TriadNoise
from plumbob.data.chain import Chain, Joint, Limits, Segment
from plumbob.papers.arm import RATE, REST
from plumbob.papers.arm import moved as moved_array
from plumbob.rotations import quat_from_rotvec


def eased(x):
    """Polynomial of least jerk from 0 to 1 with rest at both ends (Flash and Hogan 1985, eq. 3)."""
    x = np.clip(x, 0.0, 1.0)
    return x**3 * (10.0 - 15.0 * x + 6.0 * x**2)


def pick_and_place(poses, *, rest=1.0, move=2.0, rate=100.0, noise=0.0, seed=0):
    """Joint angles that rest at each pose, and the times at which the rests begin."""
    poses = np.asarray(poses, dtype=float)
    t = np.arange(0.0, len(poses) * (rest + move) - move, 1.0 / rate)
    k = np.minimum((t / (rest + move)).astype(int), len(poses) - 1)
    after = np.minimum(k + 1, len(poses) - 1)
    x = eased((t - k * (rest + move) - rest) / move)[:, np.newaxis]
    angles = poses[k] * (1.0 - x) + poses[after] * x
    angles += np.random.default_rng(seed).normal(0.0, noise, angles.shape) if noise else 0.0
    return JointTrack(t, tuple(f"j{i}" for i in range(poses.shape[1])), angles)


def arm() -> Chain:
    """Ball, universal, hinge and fixed joints, tilted against each other."""
    bounds = Limits(-2.5, 2.5, 1.0, 8.0, 100.0)
    third = Rotation.from_euler("xyz", [0.3, -0.4, 0.5]).as_quat(scalar_first=True)
    return Chain(
        "arm",
        tuple(Segment(name, unit) for name, unit in (("base", ""), ("upper", "a"), ("lower", "b"), ("hand", "c"))),
        (
            Joint("shoulder", "base", "upper", "ball", (0.0, 0.1, 1.2), tuple(third.tolist()), limits=(bounds,) * 3),
            Joint("elbow", "upper", "lower", "hinge", (0.3, 0, 0), axes=((0, 0.6, 0.8),), limits=(bounds,)),
            Joint("wrist", "lower", "hand", "universal", (0.25, 0, 0), axes=((0, 1.0, 0), (0, 0, 1.0))),
        ),
        hand_b=(0.1, 0.0, 0.02),
        base_fixed=True,
    )


def scipy_hand(angles: np.ndarray) -> np.ndarray:
    """Hand of `arm`, by hand."""
    turn = Rotation.from_euler("xyz", [0.3, -0.4, 0.5]) * Rotation.from_euler("ZYX", angles[:3])
    at = np.array([0.0, 0.1, 1.2]) + turn.apply([0.3, 0.0, 0.0])
    turn = turn * Rotation.from_rotvec(np.array([0.0, 0.6, 0.8]) * angles[3])
    at = at + turn.apply([0.25, 0.0, 0.0])
    return at + (turn * Rotation.from_euler("YZ", angles[4:])).apply([0.1, 0.0, 0.02])


def card(gyr=1e-3, acc=1e-2, mag=0.1):
    parts = {"gyr": gyr, "acc": acc, "mag": mag}
    return NoiseCard("u", "test", **{k: TriadNoise(np.full(3, n), np.zeros(3), np.zeros(3)) for k, n in parts.items()})


def sampled(t, mounts, *, gyr, acc, mag=None, noise=0.0, seed=0):
    """Array of units that feel the rates, forces (at the reference point) and field of a body, in their own axes."""
    rng, units = np.random.default_rng(seed), {}
    turn = np.gradient(gyr, t, axis=0, edge_order=2)
    for name, mount in mounts.items():
        lever = np.array(mount.lever_b)
        force = acc + np.cross(turn, lever) + np.cross(gyr, np.cross(gyr, lever))
        values = {"gyr": gyr, "acc": force} | ({} if mag is None else {"mag": mag})
        units[name] = ImuData(t, **{k: v @ mount.dcm + noise * rng.normal(size=v.shape) for k, v in values.items()})
    return ImuArray(units, mounts)


def moved(*args, **how):
    """Values by unit and triad of `plumbob.papers.arm.moved`, to be changed; `truth` has times and attitudes."""
    array, q_nb = moved_array(*args, **how)
    values = {name: {triad: getattr(imu, triad).copy() for triad in TRIADS} for name, imu in array.units.items()}
    return {"truth": {"t": array.t, "q_nb": q_nb}, **values}


def as_array(values):
    """Array of what `moved` gave."""
    units = {name: ImuData(values["truth"]["t"], **of) for name, of in values.items() if name != "truth"}
    places = [replace(mount, noise=REST.card(RATE)) for mount in PRESETS["arm"].values()]
    return ImuArray(units, {name: places[k % 6] for k, name in enumerate(units)})


def turned(*degrees):
    """Rotation about x, y and z, degrees, as a mount has it."""
    return tuple(quat_from_rotvec(np.radians(degrees)).tolist())


__all__ = ["ImuArray", "ImuData", "UnitMount", "as_array", "card", "moved", "sampled", "turned"]
