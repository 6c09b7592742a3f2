"""Rigs: what each is made of, every frame with its time, the truth behind it, and the faults on the way."""

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Final, Self

import numpy as np
from numpy.typing import NDArray

from plumbob import simulation as simulated
from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError
from plumbob.core.resources import packaged
from plumbob.core.time import to_ns
from plumbob.core.units import to_deg
from plumbob.data.cards import CalibrationCard, NoiseCard
from plumbob.data.chain import Chain
from plumbob.live.rigs import faults as line_faults
from plumbob.live.rigs.faults import Fault, LineDamage
from plumbob.protocols.decode import values_by_field
from plumbob.protocols.encode import encode, hold_last
from plumbob.protocols.field import Field
from plumbob.protocols.format import Format, Message
from plumbob.protocols.format_toml import find_format
from plumbob.protocols.unpack import unit_prefixes
from plumbob.rotations import Frame, euler_zyx_from_quat, quat_from_rotvec, quat_multiply
from plumbob.simulation.chains import CHAINS
from plumbob.simulation.errors import stream, unit_seed
from plumbob.simulation.signals import Signal
from plumbob.simulation.simulation import WarmingUp

if TYPE_CHECKING:
    from plumbob.live.rigs.firmware import Firmware

Quat = tuple[float, float, float, float]
ALIGNED: Final[Quat] = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class MountedMotion:
    """Motion of a unit on a moving body, whose axes go with `frame`; `q_bs` leads from the unit's to them."""

    motion: simulated.Motion
    frame: Frame
    q_bs: Quat

    def truth(self, t: Floats) -> simulated.Truth:
        """State at the instants t (N,), s, in the unit's axes."""
        return self.motion.truth(t).in_frame(self.frame).rotated(self.q_bs)


@dataclass(frozen=True, kw_only=True)
class MountedScenario(simulated.Scenario):
    """A body's scenario as one of its units feels it; units of the same seed ride on the same motion."""

    plan: simulated.Scenario
    frame: Frame
    q_bs: Quat
    seed: int
    off: tuple[float, float, float] = (0.0, 0.0, 0.0)

    rate: ClassVar[float] = 100.0

    @property
    def description(self) -> str:
        """The body's scenario, how the unit is said to sit on it, and how far that is from the truth."""
        turned = "" if self.q_bs == ALIGNED else f", of a unit at q_bs = {self.q_bs}"
        off = f", mounted {to_deg(float(np.linalg.norm(self.off))):.3g}° off" if any(self.off) else ""
        return self.plan.description + turned + off

    @property
    def duration(self) -> float:
        """Time that it takes, s."""
        return self.plan.duration

    def motion(self, rng: np.random.Generator, duration: float) -> simulated.Motion:
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
    settings: Mapping[str, Any]  # further arguments of `plumbob.simulation.simulate_chain`


CHIP_RATE: Final = 1000.0  # Hz; how often the MPU-6000 renews its registers at most


@dataclass(frozen=True, slots=True)
class RigPlan:
    """A rig before it is built."""

    # name, title: short and full name
    name: str
    title: str
    scenario: simulated.Scenario | Chained  # what the body does, or the chain that the units are on
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


def plan_for(form: Format, motion: simulated.Scenario, *, sensors: str, frame: Frame, rate: float | None) -> RigPlan:
    """Plan for a format of your own: every unit in it has the same sensors, aligned with the body."""
    pace = form.framing.rate if rate is None else rate
    if pace is None:
        raise ParameterError(f"{form.name} does not say how many frames it sends per second; give a rate, as 100Hz.")
    units = tuple(RigUnit(sensors, prefix) for prefix in unit_prefixes(form.messages[0]))
    return RigPlan(form.name, form.title, motion, frame, pace, motion.duration, units)


def _plan(name: str, table: dict[str, Any]) -> RigPlan:
    units = tuple(RigUnit(**{**unit, "q_bs": tuple(unit.get("q_bs", ALIGNED))}) for unit in table.pop("units"))
    if "chain" in table:
        motion: Any = Chained(CHAINS[table.pop("chain")], table.pop("program"), table.pop("settings"))
    else:
        motion = simulated.scenario(table.pop("scenario"))
    table.setdefault("duration", getattr(motion, "duration", None))
    return RigPlan(name, scenario=motion, frame=Frame.NED, units=units, **table)


PLANS: Final[Mapping[str, RigPlan]] = {
    name: _plan(name, table) for name, table in tomllib.loads(packaged("live/rigs/plans.toml")).items()
}
"""The papers' rigs by name, and a machine that is taught."""

Column = Floats | NDArray[np.int64]
Card = NoiseCard | str | Path
Cards = Card | Mapping[str, Card]  # for every measuring unit, or for some of them, by the prefix of their fields
_JUST_BELOW = 1.0 - 1e-9  # a value at the end of its range stays there whatever it is rounded by


def columns_for(
    message: Message, units: Mapping[str, simulated.Simulation], device_ns: NDArray[np.int64],
    counter: NDArray[np.int64],
) -> dict[str, Column]:  # fmt: skip
    """Columns for `plumbob.protocols.encode.encode`, of simulations by prefix.

    `device_ns` (N,): the device's own clock at each frame, ns; `counter` (N,): its number.
    """
    fields = {field.name: field for field in message.fields}
    measured: dict[str, Floats] = {}
    for prefix, simulation in units.items():
        measured |= values_by_field(simulation.imu, message, prefix) | _angles(simulation, fields, prefix)
    if not measured:
        return {}
    columns: dict[str, Column] = {name: _in_register(fields[name], values) for name, values in measured.items()}
    for field in message.fields:
        if field.role == "counter":
            columns[field.name] = counter
        elif field.role == "clock":
            columns[field.name] = np.rint(device_ns / (1e9 * field.scale)).astype(np.int64)
        elif field.role == "status" and not field.derived and "absent" in field.says.values():
            columns[field.name] = _presence(field, measured, device_ns.size)
    return columns


def _in_register(field: Field, values: Floats) -> Floats:
    """Hold the last value where there is none, and run into the rail where the sensor is at the end of its range."""
    said = hold_last(values)
    if not field.triad or field.type[0] == "f":
        return said
    beyond = np.abs(said) >= field.full_scale * _JUST_BELOW
    return np.where(beyond, np.nan if field.overflow else np.copysign(np.inf, said), said)


def _angles(simulation: simulated.Simulation, fields: Mapping[str, Field], prefix: str) -> dict[str, Floats]:
    """Roll, pitch and heading, for devices that say them: of a reference, else true; heading from true North."""
    names = {name: f"{prefix}.{name}" if prefix else name for name in ("heading", "pitch", "roll")}
    if not any(name in fields for name in names.values()):
        return {}
    angles = simulation.angles
    if angles is None:
        angles = euler_zyx_from_quat(simulation.kinematics.in_frame(Frame.NED).q_nb)
    columns = {names[key]: angles[:, i] for i, key in enumerate(names) if names[key] in fields}
    if (heading := fields.get(names["heading"])) and _counts_from_zero(heading):
        columns[heading.name] = np.remainder(columns[heading.name], 2.0 * math.pi)
    return columns


def _counts_from_zero(field: Field) -> bool:
    """Whether a heading goes from 0° to 360°; decimal digits do, of compasses that speak so [RI-705]."""
    return field.type == "bcd" or (field.range or field.limits)[0] >= 0


def _presence(field: Field, measured: Mapping[str, Floats], count: int) -> NDArray[np.int64]:
    """Counts of a status that says whether its triads or fields have a new value; what is not simulated has none."""
    there = np.zeros(count, dtype=bool)
    for name, values in measured.items():
        if name in field.of or name.rpartition(".")[0] in field.of:
            there |= ~np.isnan(values)
    absent = next(code for code, word in field.says.items() if word == "absent")
    present = field.value if field.value not in field.says else min(set(range(len(field.says) + 1)) - set(field.says))
    return np.where(there, present, absent)


@dataclass(frozen=True, eq=False)
class Rig:
    """A rig that is ready to talk."""

    plan: RigPlan  # what it is made of
    form: Format  # what it says, bound
    # truth, samples, calibration and noise of each unit in its own axes, by the prefix of its fields
    units: Mapping[str, simulated.Simulation]
    due_ns: NDArray[np.int64]  # (N,), when each frame is ready, ns from the start
    frames: NDArray[np.uint8]  # (N, L), frames as the device makes them, before anything happens to them on the line
    damage: LineDamage  # what happens to them on the line
    chain: simulated.ChainSimulation | None = None  # the chain that the units are on, where they are on one
    firmware: "Firmware | None" = None  # what its own processor did, where that computes what it says

    def __len__(self) -> int:
        return int(self.due_ns.size)

    @property
    def faults(self) -> tuple[Fault, ...]:
        """Faults on the line, in order."""
        return self.damage.faults

    def payloads(self, first: int, end: int) -> list[bytes]:
        """Bytes that go out for frames `first` to `end`, exclusive; empty where a frame is lost."""
        changed, lost = self.damage.changed, self.damage.lost
        return [b"" if lost[i] else changed.get(i) or self.frames[i].tobytes() for i in range(first, end)]

    def stream(self) -> bytes:
        """All bytes that go out."""
        return b"".join(self.payloads(0, len(self)))


def make_rig(
    plan: RigPlan, form: Format, *, seed: int, duration: float | None = None, unit: str = "random",
    clock_error: float = 0.0, faults: Mapping[str, float] | None = None, calibration: CalibrationCard | None = None,
    noise: Cards | None = None, temp_c: float | str | Signal | None = None, warm_up: WarmingUp | None = None,
    high_pass: float | None = None, mount_error: float = 0.0,
) -> Rig:  # fmt: skip
    """Build a rig of a plan, which sends the first message of a format; arguments as of `plumbob.emulate`.

    `clock_error` 4e-5 is 40 µs a second fast; `faults` are shares by kind of `plumbob.live.rigs.faults.KINDS`.
    """
    bound = form.bind()
    message = bound.messages[0]
    if calibration is not None and not plan.firmware:
        raise ParameterError(f"rig {plan.name} sends samples as they are; leave the calibration to who reads them.")
    # chips count as in the rig of samples
    measured = find_format("buoy").bind().messages[0] if plan.firmware else message
    modules = _modules(plan, measured, seed, noise, high_pass)
    common = {"frame": plan.frame, "unit": unit, "rate": plan.sampled}
    common |= {"duration": plan.duration if duration is None else duration}
    world = {name: value for name, value in (("temp_c", temp_c), ("warm_up", warm_up)) if value is not None}
    units, chain = _units(plan, modules, seed, common | world, mount_error)
    done = _computed(units[""], calibration) if plan.firmware else None
    due_ns = to_ns(next(iter(units.values())).imu.t) if done is None else done.sent_ns
    drawn = line_faults.draw(bound, faults or {}, due_ns, seed)
    device_ns = drawn.device_ns + np.rint(drawn.device_ns * clock_error).astype(np.int64)
    if done is None:
        columns = columns_for(message, units, device_ns, drawn.counter)
    else:
        clock = done.columns["clock"] + (device_ns - due_ns) // 1000
        columns = {**done.columns, "clock": clock, "counter": drawn.counter}
    if not columns:
        raise ParameterError(f"{form.name} has no field that a simulation can fill: no triad, temperature or angle.")
    frames = encode(bound, columns)
    damaged = line_faults.damage(bound, drawn, frames, due_ns, seed)
    return Rig(plan, bound, units, due_ns, frames, damaged, chain, done)


def _computed(unit: simulated.Simulation, calibration: CalibrationCard | None) -> "Firmware":
    from plumbob.live.rigs.firmware import run_firmware  # with the filters, which no other rig needs

    return run_firmware(unit.imu, calibration=calibration)


def _modules(
    plan: RigPlan, message: Message, seed: int, noise: Cards | None, high_pass: float | None
) -> dict[str, simulated.Module]:
    """Modules by prefix, each with its own errors, or with those that are asked for instead."""
    cards: Mapping[str, Card] = {}
    if noise is not None:
        cards = noise if isinstance(noise, Mapping) else {unit.prefix: noise for unit in plan.measuring}
    if unknown := [name for name in cards if name not in [unit.prefix for unit in plan.measuring]]:
        names = ", ".join(unit.prefix or "the unit without a prefix" for unit in plan.measuring)
        raise ParameterError(f"{plan.name} has no measuring unit '{unknown[0]}' for a noise card; it has {names}.")
    modules = {}
    for number, unit in enumerate(plan.units):
        module = fitted(simulated.draw_module(unit.sensors, unit_seed(seed, number)), message, unit.prefix)
        if unit.prefix in cards:
            module = module.with_noise(check.kind("noise", NoiseCard.of(cards[unit.prefix]), NoiseCard))
        if high_pass is not None and not unit.reference:
            module = module.with_high_pass(high_pass)
        modules[unit.prefix] = module
    return modules


def _units(
    plan: RigPlan, modules: Mapping[str, simulated.Module], seed: int, common: Mapping[str, Any], mount_error: float
) -> tuple[Mapping[str, simulated.Simulation], simulated.ChainSimulation | None]:
    """Units by prefix, each with its own noise, and the chain that they are on."""
    if not 0.0 <= mount_error <= math.pi:
        raise ParameterError(f"mount_error must be 0 to 180°, but it is {to_deg(mount_error):g}°.")
    if isinstance(plan.scenario, Chained):
        if mount_error:
            raise ParameterError("the units of a chain have --set mount_angle; leave mount_error out.")
        chained, settings = plan.scenario, {**plan.scenario.settings, **common}
        made = simulated.simulate_chain(chained.chain, chained.program, sensors=modules, seed=seed, **settings)
        return made.units, made
    aslant = [unit for unit in plan.units if unit.reference] or plan.units
    units = {}
    for number, unit in enumerate(plan.units):
        motion = MountedScenario(plan=plan.scenario, frame=plan.frame, q_bs=unit.q_bs, seed=seed)
        if mount_error and unit in aslant:
            x, y, z = (mount_error * stream(seed, "mount", unit.prefix).standard_normal(3)).tolist()
            motion = replace(motion, off=(x, y, z))
        units[unit.prefix] = simulated.simulate(
            motion, sensors=modules[unit.prefix], seed=unit_seed(seed, number), **common
        )
    return units, None


def fitted(module: simulated.Module, message: Message, prefix: str) -> simulated.Module:
    """Unit whose counts and ranges are those of the wire, so that nothing is rounded or cut twice."""
    return replace(
        module,
        gyr=_fitted(module.gyr, message, prefix, "gyr"),
        acc=_fitted(module.acc, message, prefix, "acc"),
        mag=_fitted(module.mag, message, prefix, "mag"),
    )


def _fitted(
    errors: simulated.TriadErrors | None, message: Message, prefix: str, triad: str
) -> simulated.TriadErrors | None:
    if errors is None:
        return None
    lsb, full_scale = np.array(errors.lsb), np.array(errors.full_scale)
    for i, axis in enumerate("xyz"):
        name = ".".join(part for part in (prefix, triad, axis) if part)
        for field in (f for f in message.fields if f.name == name and f.type[0] != "f"):
            lsb[i], full_scale[i] = abs(field.scale), field.full_scale
    return replace(errors, lsb=lsb, full_scale=full_scale)
