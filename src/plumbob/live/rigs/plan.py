"""What each rig is made of: its units, their mounting, and what is done with them."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import sqrt
from typing import Any, ClassVar, Final, Self

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError
from plumbob.core.units import to_deg
from plumbob.data.array import PRESETS
from plumbob.data.chain import Chain
from plumbob.protocols.format import Format
from plumbob.protocols.unpack import unit_prefixes
from plumbob.rotations import Frame, quat_from_rotvec, quat_multiply
from plumbob.simulation import Motion, Scenario, Truth, scenario
from plumbob.simulation.chains import CHAINS
from plumbob.simulation.errors import stream

Quat = tuple[float, float, float, float]
ALIGNED: Final[Quat] = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class MountedMotion:
    """Motion of a unit on a moving body, whose axes go with `frame`; `q_bs` leads from the unit's to them."""

    motion: Motion
    frame: Frame
    q_bs: Quat

    def truth(self, t: Floats) -> Truth:
        """State at the instants t (N,), s, in the unit's axes."""
        return self.motion.truth(t).in_frame(self.frame).turned(self.q_bs)


@dataclass(frozen=True, kw_only=True)
class MountedScenario(Scenario):
    """A body's scenario as one of its units feels it; units of the same seed ride on the same motion."""

    plan: Scenario
    frame: Frame
    q_bs: Quat
    seed: int
    off: tuple[float, float, float] = (0.0, 0.0, 0.0)

    rate: ClassVar[float] = 100.0

    @property
    def told(self) -> str:
        """The body's scenario, how the unit is said to sit on it, and how far that is from the truth."""
        turned = "" if self.q_bs == ALIGNED else f", of a unit at q_bs = {self.q_bs}"
        off = f", mounted {to_deg(float(np.linalg.norm(self.off))):.3g}° off" if any(self.off) else ""
        return self.plan.told + turned + off

    @property
    def duration(self) -> float:
        """Time that it takes, s."""
        return self.plan.duration

    def motion(self, rng: np.random.Generator, duration: float) -> Motion:
        """Body's motion, drawn with the rig's seed instead of the unit's."""
        body = self.plan.motion(stream(self.seed, "scenario"), duration)
        return MountedMotion(body, self.frame, self.true_q_bs)

    @property
    def true_q_bs(self) -> Quat:
        """How the unit really sits: `off`, rad about its own axes, from what is said."""
        w, x, y, z = quat_multiply(np.array(self.q_bs), quat_from_rotvec(np.array(self.off))).tolist()
        return (w, x, y, z) if any(self.off) else self.q_bs


@dataclass(frozen=True, slots=True)
class RigUnit:
    """One unit of a rig."""

    sensors: str  # its parts, as `plumbob.simulation.simulate` knows them
    prefix: str = ""  # of its fields in the frame; empty where there is one unit only
    q_bs: Quat = ALIGNED  # how it is mounted: from its axes to the body's
    reference: bool = False  # whether it is what the others are compared with


@dataclass(frozen=True, slots=True)
class Chained:
    """Program of a chain that carries the units, each on a segment of its own."""

    chain: Chain  # its units have the names of the frame's
    program: str  # name of what it does, one of `plumbob.simulation.PROGRAMS`
    # further arguments of `plumbob.simulation.simulate_chain`
    settings: Mapping[str, Any] = field(default_factory=dict)


CHIP_RATE: Final = 1000.0  # Hz; how often the MPU-6000 renews its registers at most


@dataclass(frozen=True, slots=True)
class RigPlan:
    """A rig before it is built."""

    # name, title: short and full name
    name: str
    title: str
    scenario: Scenario | Chained  # what the body does, or the chain that the units are on
    frame: Frame  # navigation frame of the truth, and the body's axes with it
    rate: float  # frames per second, Hz
    duration: float  # time that it talks, s
    units: tuple[RigUnit, ...]  # what sits on the body
    firmware: bool = False  # whether it sends the attitude that its own processor computes, and not samples

    @property
    def sampled(self) -> float:
        """Samples of the units per second, Hz: one for each frame, or what a processor's chips have for it to read."""
        return CHIP_RATE if self.firmware else self.rate

    @property
    def measuring(self) -> tuple[RigUnit, ...]:
        """Units that are not references."""
        return tuple(unit for unit in self.units if not unit.reference)

    def with_sensors(self, sensors: str) -> Self:
        """Return the plan with other parts, joined by ``+``, in every unit that is not a reference."""
        return self._with(sensors, reference=False)

    def with_reference(self, sensors: str) -> Self:
        """Return the plan with other parts in its reference: ``"ideal"`` says exactly what is true."""
        if len(self.measuring) == len(self.units):
            raise ParameterError(f"{self.name} has no reference beside its units; leave the reference out.")
        return self._with(sensors, reference=True)

    def _with(self, sensors: str, *, reference: bool) -> Self:
        units = (replace(unit, sensors=sensors) if unit.reference is reference else unit for unit in self.units)
        return replace(self, units=tuple(units))


def plan_for(form: Format, motion: Scenario, *, sensors: str, frame: Frame, rate: float | None) -> RigPlan:
    """Plan for a format of your own: every unit in it has the same sensors, aligned with the body."""
    pace = form.framing.rate if rate is None else rate
    if pace is None:
        raise ParameterError(f"{form.name} does not say how many frames it sends per second; give a rate, as 100Hz.")
    units = tuple(RigUnit(sensors, prefix) for prefix in unit_prefixes(form.messages[0]))
    return RigPlan(form.name, form.title, motion, frame, pace, motion.duration, units)


_REFERENCE: Final[Quat] = (sqrt(0.5), 0.0, 0.0, -sqrt(0.5))
"""The reference's y axis is the body's x axis [Li2012], both z axes point down."""

PLANS: Final[Mapping[str, RigPlan]] = {
    plan.name: plan
    for plan in (
        RigPlan(
            "buoy", "drifting buoy: MPU-6000 and HMC5983", scenario("buoy"), Frame.NED, 100.0, 600.0,
            (RigUnit("mpu6000+hmc5983"),),
        ),
        RigPlan(
            "buoy_attitude", "drifting buoy: attitude from its own processor", scenario("buoy"), Frame.NED, 20.0, 600.0,
            (RigUnit("mpu6000+hmc5983"),), firmware=True,
        ),
        RigPlan(
            "fin", "bionic fin: ADXRS453 and ADXRS290", scenario("fin"), Frame.NED, 500.0, 220.0,
            (RigUnit("adxrs290+adxrs453"),),
        ),
        RigPlan(
            "trackball", "gyroscope at rest: MPU-3050, 1000 samples", scenario("static"), Frame.NED, 10.0, 100.0,
            (RigUnit("mpu3050"),),
        ),
        RigPlan(
            "arm", "teaching arm: six nine-axis units", scenario("arm"), Frame.NED, 10.0, 30.0,
            tuple(RigUnit("arm", name, mount.q_bs) for name, mount in PRESETS["arm"].items()),
        ),
        RigPlan(
            "rod", "rod moved by hand: ADIS16355 beside an AHRS500GA", scenario("rod"), Frame.NED, 100.0, 600.0,
            (RigUnit("adis16355"), RigUnit("ahrs500ga", "ref", _REFERENCE, reference=True)),
        ),
        RigPlan(
            "ring", "static ring test: the buoy's unit beside a DCM260B", scenario("table36"), Frame.NED, 100.0,
            scenario("table36").duration,
            (RigUnit("mpu6000+hmc5983"), RigUnit("dcm260b", "ref", reference=True)),
        ),
        RigPlan(
            "teach", "six-axis machine taught by hand: a nine-axis unit on each link",
            Chained(CHAINS["teach"], "teach", {"mag_rate": 220.0}), Frame.NED, 100.0, 60.0,
            tuple(RigUnit("mpu6000+hmc5983", segment.unit) for segment in CHAINS["teach"].segments if segment.unit),
        ),
    )
}  # fmt: skip
"""The papers' rigs by name, and a machine that is taught."""
