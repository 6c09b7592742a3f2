"""Arrays whose units measure what is said, for the tests of this room."""

import numpy as np

from plumbob import ImuData, NoiseCard
from plumbob.data.array import ImuArray, UnitMount
from plumbob.data.cards.noise import TriadNoise
from plumbob.papers.arm.faults import as_array, moved
from plumbob.rotations import quat_from_rotvec


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


def turned(*degrees):
    """Rotation about x, y and z, degrees, as a mount has it."""
    return tuple(quat_from_rotvec(np.radians(degrees)).tolist())


__all__ = ["ImuArray", "ImuData", "UnitMount", "as_array", "card", "moved", "sampled", "turned"]
