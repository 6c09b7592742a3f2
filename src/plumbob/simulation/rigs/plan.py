"""What each rig is made of: its units, their mounting, and what is done with them."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import sqrt
from typing import Any, ClassVar, Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError
from plumbob.data.array import PRESETS
from plumbob.data.chain import Chain
from plumbob.protocols.format import Format
from plumbob.protocols.unpack import units_of
from plumbob.rotations import Frame
from plumbob.simulation import Motion, Scenario, Truth, scenario
from plumbob.simulation.chains import CHAINS
from plumbob.simulation.errors import stream

Quat = tuple[float, float, float, float]


@dataclass(frozen=True, eq=False)
class MountedMotion:
    """Motion of a unit that is fixed to a body.

    Parameters
    ----------
    motion : Motion
        Of the body.
    frame : Frame
        Navigation frame; the body's axes are those that go with it.
    q_bs : tuple of 4 float
        From the unit's axes to the body's.
    """

    motion: Motion
    frame: Frame
    q_bs: Quat

    def truth(self, t: Floats) -> Truth:
        """State at the instants t (N,), s, in the unit's axes."""
        return self.motion.truth(t).in_frame(self.frame).turned(self.q_bs)


@dataclass(frozen=True, kw_only=True)
class Mounted(Scenario):
    """A body's scenario as one of its units feels it; units of the same seed ride on the same motion."""

    plan: Scenario
    frame: Frame
    q_bs: Quat
    seed: int

    rate: ClassVar[float] = 100.0

    @property
    def told(self) -> str:
        """The body's scenario, and how the unit sits on it."""
        turned = "" if self.q_bs == (1.0, 0.0, 0.0, 0.0) else f", of a unit at q_bs = {self.q_bs}"
        return self.plan.told + turned

    @property
    def duration(self) -> float:
        """Time that it takes, s."""
        return self.plan.duration

    def motion(self, rng: np.random.Generator, duration: float) -> Motion:
        """Body's motion, drawn with the rig's seed instead of the unit's."""
        body = self.plan.motion(stream(self.seed, "scenario"), duration)
        return MountedMotion(body, self.frame, self.q_bs)


ALIGNED: Final[Quat] = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Unit:
    """One unit of a rig.

    Attributes
    ----------
    sensors : str
        Its parts, as `plumbob.simulation.simulate` knows them.
    prefix : str
        Of its fields in the frame; empty where there is one unit only.
    q_bs : tuple of 4 float
        How it is mounted: from its axes to the body's.
    """

    sensors: str
    prefix: str = ""
    q_bs: Quat = ALIGNED


@dataclass(frozen=True, slots=True)
class Chained:
    """Program of a chain that carries the units, each on a segment of its own.

    Attributes
    ----------
    chain : Chain
        Its units have the names of the frame's.
    program : str
        Name of what it does, one of `plumbob.simulation.PROGRAMS`.
    settings : mapping
        Further arguments of `plumbob.simulation.simulate_chain`.
    """

    chain: Chain
    program: str
    settings: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Plan:
    """A rig before it is built.

    Attributes
    ----------
    name, title : str
        Short and full name.
    scenario : Scenario or Chained
        What the body does, or the chain that the units are on.
    frame : Frame
        Navigation frame of the truth, and the body's axes with it.
    rate : float
        Frames per second, Hz.
    duration : float
        Time that it talks, s.
    units : tuple of Unit
        What sits on the body.
    firmware : bool
        Whether it sends the attitude that its own processor computes, and not samples.
    """

    name: str
    title: str
    scenario: Scenario | Chained
    frame: Frame
    rate: float
    duration: float
    units: tuple[Unit, ...]
    firmware: bool = False


def plan_for(form: Format, motion: Scenario, *, sensors: str, frame: Frame, rate: float | None) -> Plan:
    """Plan for a format of your own: every unit in it has the same sensors, aligned with the body.

    Parameters
    ----------
    form : Format
        What it says on the wire.
    motion : Scenario
        What the body does.
    sensors : str
        Parts of each unit, joined by ``+``.
    frame : Frame
        Navigation frame.
    rate : float or None
        Frames per second, Hz; the format's where it is None.

    Raises
    ------
    ParameterError
        If neither says a rate.
    """
    pace = form.framing.rate if rate is None else rate
    if pace is None:
        raise ParameterError(f"{form.name} does not say how many frames it sends per second; give a rate, as 100Hz.")
    units = tuple(Unit(sensors, prefix) for prefix in units_of(form.messages[0]))
    return Plan(form.name, form.title, motion, frame, pace, motion.duration, units)


_REFERENCE: Final[Quat] = (sqrt(0.5), 0.0, 0.0, -sqrt(0.5))
"""The reference's y axis is the body's x axis [Li2012], both z axes point down."""

PLANS: Final[Mapping[str, Plan]] = {
    plan.name: plan
    for plan in (
        Plan(
            "buoy", "drifting buoy: MPU-6000 and HMC5983", scenario("buoy"), Frame.NED, 100.0, 600.0,
            (Unit("mpu6000+hmc5983"),),
        ),
        Plan(
            "buoy_attitude", "drifting buoy: attitude from its own processor", scenario("buoy"), Frame.NED, 20.0, 600.0,
            (Unit("mpu6000+hmc5983"),), firmware=True,
        ),
        Plan(
            "fin", "bionic fin: ADXRS453 and ADXRS290", scenario("fin"), Frame.NED, 500.0, 220.0,
            (Unit("adxrs290+adxrs453"),),
        ),
        Plan(
            "trackball", "gyroscope at rest: MPU-3050, 1000 samples", scenario("static"), Frame.NED, 10.0, 100.0,
            (Unit("mpu3050"),),
        ),
        Plan(
            "arm", "teaching arm: six nine-axis units", scenario("arm"), Frame.NED, 10.0, 30.0,
            tuple(Unit("arm", name, mount.q_bs) for name, mount in PRESETS["arm"].items()),
        ),
        Plan(
            "rod", "rod moved by hand: ADIS16355 beside an AHRS500GA", scenario("rod"), Frame.NED, 100.0, 600.0,
            (Unit("adis16355"), Unit("ideal", "ref", _REFERENCE)),
        ),
        Plan(
            "teach", "six-axis machine taught by hand: a nine-axis unit on each link",
            Chained(CHAINS["teach"], "teach", {"mag_rate": 220.0}), Frame.NED, 100.0, 60.0,
            tuple(Unit("mpu6000+hmc5983", one.unit) for one in CHAINS["teach"].segments if one.unit),
        ),
    )
}  # fmt: skip
"""The papers' rigs by name, and a machine that is taught."""
