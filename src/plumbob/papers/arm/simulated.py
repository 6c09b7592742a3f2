"""The paper's six units with the noise that its tables need, drawn directly: for statistics over many seeds.

The noise is that of the parts ``arm:rest`` and ``arm:turn`` of the simulator, assumed by trial; and that which the
paper states, 0.1 °/h, 0.1 mg and 50 nT, which gives nothing like its tables.
"""

from dataclasses import replace
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.units import deg, dps, to_deg
from plumbob.data import ImuData, ImuMeta
from plumbob.data.array import PRESETS, ImuArray
from plumbob.data.cards import NoiseCard
from plumbob.data.cards.noise import TriadNoise
from plumbob.rotations import (
    Frame,
    dcm_from_quat,
    euler_zyx_from_quat,
    quat_conjugate,
    quat_from_euler_zyx,
    quat_multiply,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

AXES: Final = ("roll", "pitch", "yaw")
MOUNTS: Final = PRESETS["arm"]
ALL: Final = 'units = "all"\n'
"""What a session of the rig says of its units."""
PAIR: Final = ("u1", "u4")
"""One unit of each set, on +x and −x."""
RATE: Final = 10.0
"""Samples per second in the paper, Hz."""
DURATION: Final = 30.0
FIELD: Final = 50.0 * np.array([np.cos(deg(50.0)), 0.0, np.sin(deg(50.0))])
"""µT in NED: 50 µT, 50° down."""


class UnitErrors(NamedTuple):
    """Errors of a unit.

    `gyr`, `acc`, `mag`: scatter of one sample: rad/s, m/s², µT; `bias`: half width of the gyroscope's bias, which
    is spread evenly, rad/s; `iron`: the same of the magnetometer, µT.
    """

    gyr: float
    acc: float
    mag: float
    bias: float
    iron: float = 0.0


REST: Final = UnitErrors(dps(0.1), 0.01 * G0, 0.5, dps(0.13))
TURN: Final = UnitErrors(dps(0.2), 0.02 * G0, 1.0, dps(0.25))
STATED: Final = UnitErrors(dps(0.1 / 3600.0), 1e-4 * G0, 0.05, 0.0)
"""What the paper says: 0.1 °/h, 0.1 mg and 50 nT."""


def assumed_noise(turns: bool) -> UnitErrors:
    """Noise that is assumed in the turn, or at rest."""
    return TURN if turns else REST


def card(noise: UnitErrors, rate: float = RATE) -> NoiseCard:
    """Noise card of a unit that is read at a rate, Hz."""
    zero = np.zeros(3)
    parts = {name: TriadNoise(np.full(3, getattr(noise, name) / np.sqrt(rate)), zero, zero) for name in _TRIADS}
    return NoiseCard("a unit", "assumed for the paper's tables", **parts)


_TRIADS: Final = ("gyr", "acc", "mag")


def with_noise(array: ImuArray, noise: UnitErrors) -> ImuArray:
    """Array whose mounts know the noise of their units."""
    noise_card = card(noise)
    return ImuArray(array.units, {name: replace(mount, noise=noise_card) for name, mount in array.mounts.items()})


def pair(array: ImuArray) -> ImuArray:
    """The first unit of each set."""
    return ImuArray({name: array.units[name] for name in PAIR}, {name: array.mounts[name] for name in PAIR})


def attitude(t: Floats, *, turns: bool) -> Floats:
    """True attitude (N, 4): level, its heading from 0° to −90° in 30 s, or 0°."""
    heading = np.zeros((t.size, 3))
    heading[:, 0] = deg(-90.0) / DURATION * t if turns else 0.0
    return quat_from_euler_zyx(heading)


def felt(q_nb: Floats, rate_b: Floats) -> dict[str, Floats]:
    """What a body of this attitude (N, 4) and rate (N, 3) feels, in its axes, by triad."""
    c_nb = dcm_from_quat(q_nb)
    return {"gyr": rate_b, "acc": -G0 * c_nb[:, 2], "mag": np.einsum("nji,j->ni", c_nb, FIELD)}


def arm(seed: int, *, turns: bool, rate: float = RATE, noise: UnitErrors | None = None) -> tuple[ImuArray, Floats]:
    """The paper's array for 30 s, in the turn of −90° or at rest, and the true attitude (N, 4) of its body in NED.

    At every rate, Hz, the scatter of a sample is that of 10 Hz; `noise` is by default that assumed in the turn, or at
    rest.
    """
    rng, noise = np.random.default_rng([seed, turns]), noise or assumed_noise(turns)
    t = np.arange(round(DURATION * rate)) / rate
    q_nb = attitude(t, turns=turns)
    body = felt(q_nb, np.tile([0.0, 0.0, deg(-90.0) / DURATION if turns else 0.0], (t.size, 1)))
    noise_card, meta, units = card(noise, rate), ImuMeta(rate_nominal=rate, frame=Frame.NED), {}
    for name, mount in MOUNTS.items():
        of = {triad: values @ mount.dcm for triad, values in body.items()}
        for triad, values in of.items():
            of[triad] = values + getattr(noise, triad) * rng.normal(size=values.shape)
        of["gyr"] += rng.uniform(-noise.bias, noise.bias, 3)
        of["mag"] += rng.uniform(-noise.iron, noise.iron, 3)
        units[name] = ImuData(t, of["gyr"], of["acc"], of["mag"], meta=meta)
    return ImuArray(units, {name: replace(mount, noise=noise_card) for name, mount in MOUNTS.items()}), q_nb


def quiet(duration: float = 120.0) -> tuple[ImuArray, Floats]:
    """The paper's array at rest without noise, and its attitude."""
    t = np.arange(round(duration * RATE)) / RATE
    q_nb = attitude(t, turns=False)
    body = felt(q_nb, np.zeros((t.size, 3)))
    units = {
        name: ImuData(t, body["gyr"] @ mount.dcm, body["acc"] @ mount.dcm, body["mag"] @ mount.dcm)
        for name, mount in MOUNTS.items()
    }
    return ImuArray(units, MOUNTS), q_nb


def errors_deg(q_nb: Floats, truth: Floats) -> Floats:
    """Errors (N, 3) of roll, pitch and yaw, deg: angles of the turn from the true to the estimated attitude."""
    e = euler_zyx_from_quat(quat_multiply(quat_conjugate(truth), q_nb))
    return np.asarray(to_deg(np.unwrap(e, axis=0)))[:, ::-1]


def statistics(e: Floats) -> Floats:
    """Standard deviation, range and rms (rows) of each column of errors (N, 3)."""
    return np.array([e.std(axis=0), np.ptp(e, axis=0), np.sqrt(np.mean(e**2, axis=0))])


class Over(NamedTuple):
    """Statistics over seeds.

    `std`, `range`, `rms` (3,): of roll, pitch and yaw, deg: means over the seeds, of the rms the root mean square;
    `standard_error` (3,): of the mean of the standard deviations.
    """

    std: Floats
    range: Floats
    rms: Floats
    standard_error: Floats


def over_seeds(runs: list[Floats]) -> Over:
    """Of the `statistics` of each seed."""
    rows = np.array(runs)
    std, span, rms = rows[:, 0], rows[:, 1], rows[:, 2]
    error = std.std(axis=0) / np.sqrt(len(runs))
    return Over(std.mean(axis=0), span.mean(axis=0), np.sqrt(np.mean(rms**2, axis=0)), error)


def time_axis(ax: "Axes", t: Floats) -> None:
    """Time below a figure."""
    ax.set_xlim(float(t[0]), float(np.ceil(t[-1])))
    ax.set_xlabel("time [s]")
