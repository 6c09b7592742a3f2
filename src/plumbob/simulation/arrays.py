"""Arrays of units on one body, drawn at once from its motion: white noise, even biases, gains and axes that are off."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.units import deg
from plumbob.data import TRIADS, ImuData, ImuMeta
from plumbob.data.array import PRESETS, ImuArray, UnitMount
from plumbob.data.cards import NoiseCard
from plumbob.data.cards.noise import TriadNoise
from plumbob.rotations import Frame, dcm_from_quat
from plumbob.simulation.signals import earth_field


class UnitErrors(NamedTuple):
    """Errors of a unit: scatter of one sample, rad/s, m/s², µT, and half widths of biases that are spread evenly."""

    gyr: float
    acc: float
    mag: float
    bias: float = 0.0  # of the gyroscope, rad/s
    iron: float = 0.0  # of the magnetometer, µT
    scale: float = 0.0  # standard deviation of gains and of angles between axes; with it, no unit has hard iron

    def card(self, rate: float) -> NoiseCard:
        """Card of the white noise of such a unit at a rate, Hz."""
        none = np.zeros(3)
        of = {name: TriadNoise(np.full(3, getattr(self, name) / np.sqrt(rate)), none, none) for name in TRIADS}
        return NoiseCard("drawn", "drawn white noise", **of)


def draw_array(
    q_nb: Floats, rate_b: Floats, errors: UnitErrors, *, rate: float, frame: Frame | str,
    seed: int | Sequence[int] | np.random.Generator, mounts: Mapping[str, UnitMount] | None = None,
    strength: float = 50.0, dip: float = deg(50.0),
) -> ImuArray:  # fmt: skip
    """Draw what an array of units measures on a body that turns about one place.

    Many arrays come this way in the time in which `plumbob.simulate` makes one unit; it has the errors of data sheets.

    Parameters
    ----------
    q_nb, rate_b : ndarray (N, 4), (N, 3)
        Attitude of the body, and its rates, rad/s, at each sample.
    errors : UnitErrors
        Of every unit.
    rate : float
        Samples per second, Hz.
    frame : Frame or str
        Navigation frame of the attitude.
    seed : int, sequence of int or Generator
        Of everything that is left to chance.
    mounts : mapping of str to UnitMount, optional
        How the units sit, by name; by default the six of the rig ``arm``. Levers are left out: no place accelerates.
    strength, dip : float
        The Earth's magnetic field: µT, rad below the horizontal.

    Returns
    -------
    ImuArray
        Whose mounts have the noise of the units.
    """
    frame, rng, c_nb = Frame.parse(frame), np.random.default_rng(seed), dcm_from_quat(q_nb)
    field = earth_field(frame, strength=strength, dip=dip, declination=0.0)
    felt = {"gyr": rate_b} | {
        name: np.einsum("nji,j->ni", c_nb, of) for name, of in (("acc", G0 * frame.up), ("mag", field))
    }
    units, card, t = {}, errors.card(rate), np.arange(len(q_nb)) / rate
    placed = dict(PRESETS["arm"] if mounts is None else mounts)
    for name, mount in placed.items():
        of = {}
        for triad, values in felt.items():
            axes = np.eye(3) + errors.scale * rng.normal(size=(3, 3)) if errors.scale else np.eye(3)
            of[triad] = (values @ mount.dcm) @ axes.T + getattr(errors, triad) * rng.normal(size=values.shape)
        of["gyr"] += rng.uniform(-errors.bias, errors.bias, 3)
        if not errors.scale:
            of["mag"] += rng.uniform(-errors.iron, errors.iron, 3)
        units[name] = ImuData(t, **of, meta=ImuMeta(rate_nominal=rate, frame=frame))
        placed[name] = UnitMount(mount.q_bs, mount.lever_b, mount.clock_offset, card)
    return ImuArray(units, placed)
