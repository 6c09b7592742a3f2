"""Chains of bodies: exact motion of every segment and unit, and what the units say of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from operator import itemgetter
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError, unknown_name
from plumbob.core.series import Series
from plumbob.core.units import Quantity, given
from plumbob.data import AttitudeTrack
from plumbob.data.array import ImuArray, Quat, UnitMount
from plumbob.data.chain import Chain, Posture, Segment
from plumbob.rotations import Frame, North, quat_conjugate, quat_rotate
from plumbob.simulation.chains import SoftTissue, chain_mounts, drawn_mounts, named_chain
from plumbob.simulation.errors import stream, unit_seed
from plumbob.simulation.fields import Disturbance, bent_at
from plumbob.simulation.motion import Motion, Scenario, Truth, at_rest
from plumbob.simulation.presets import Module, draw_module
from plumbob.simulation.programs import ChainProgram, named_program
from plumbob.simulation.signals import Jet, Linear, Signal
from plumbob.simulation.simulation import WORLD, Simulation, simulate

_IDENTITY: Quat = (1.0, 0.0, 0.0, 0.0)
_UPSIDE_DOWN: Quat = (0.0, 1.0, 0.0, 0.0)
_KEPT = 4
_SHORT = 100_000
_DRIVE_STEP = 0.0025  # s between the knots of the force that drives soft tissue; in between it goes in straight lines

SETTINGS: Final = (
    "mount_angle", "mount_shift", "mount_clock", "soft", "bend", "bend_at", "gyr_range", "acc_range",
    *(name for name in WORLD if name not in {"jitter", "lost"}),
)  # fmt: skip
"""Arguments of `simulate_chain` that a command line gives as text."""


@dataclass(frozen=True, eq=False)
class ChainMotion:
    """Motion of every segment of a chain, exact to rounding.

    Parameters
    ----------
    chain : Chain
        What moves.
    angles : Signal with one component for each angle
        rad, in the order of `Chain.angles`.
    frame : Frame
        Navigation frame. The segments' axes stay what they are, whatever the frame.
    root : Motion or tuple of 4 floats
        Of the first segment, in any frame; or its attitude q_nb where it stands still at the origin.
    """

    chain: Chain
    angles: Signal
    frame: Frame
    root: Motion | Quat = _IDENTITY
    _memory: dict[bytes, dict[str, Truth]] = field(default_factory=dict, init=False, repr=False)

    def truth(self, t: Floats) -> dict[str, Truth]:
        """State of each segment's origin, in segment axes, at the instants t (N,), s."""
        key = t.tobytes()
        if key not in self._memory:  # several units ask for the same instants
            while len(self._memory) >= (_KEPT if t.size <= _SHORT else 1):
                del self._memory[next(iter(self._memory))]
            self._memory[key] = self._truth(t)
        return self._memory[key]

    def _truth(self, t: Floats) -> dict[str, Truth]:
        truths = {self.chain.segments[0].name: self._rooted(t)}
        angles = self.angles.jet(t)
        first = 0
        for joint in self.chain.joints:
            at = truths[joint.parent].at_lever(joint.place).rotated(joint.q_pc)
            for axis in joint.axes:
                at = at.hinged(axis, Jet(*(part[:, first] for part in angles)))
                first += 1
            truths[joint.child] = at
        return truths

    def _rooted(self, t: Floats) -> Truth:
        if isinstance(self.root, tuple):
            return at_rest(t, self.frame, self.root)
        return self.root.truth(t).seen_from(self.frame)


@dataclass(frozen=True, eq=False)
class _UnitMotion:
    """Motion of a unit on a segment of a chain, in the unit's axes; `sway` moves it on its segment."""

    body: ChainMotion
    segment: str
    mount: UnitMount
    sway: Signal | None = None

    def segments(self, t: Floats) -> dict[str, Truth]:
        """State of each segment when the unit takes the values of its times t (N,), s."""
        return self.body.truth(t + self.mount.clock_offset if self.mount.clock_offset else t)

    def truth(self, t: Floats) -> Truth:
        """State of the unit, in its axes, when it takes the values of its times t (N,), s."""
        segment = replace(self.segments(t)[self.segment], t=t)
        if self.sway is None:
            return segment.at_lever(self.mount.lever_b).rotated(self.mount.q_bs)
        jet = self.sway.jet(t + self.mount.clock_offset)
        place = Jet(jet.value[:, :3] + self.mount.lever_b, jet.rate[:, :3], jet.acc[:, :3])
        at = segment.at_moving(place)
        for k, axis in enumerate(np.eye(3), 3):
            at = at.hinged(axis, Jet(*(part[:, k] for part in jet)))
        return at.rotated(self.mount.q_bs)


@dataclass(frozen=True, kw_only=True)
class _Ridden(Scenario):
    """Program of a chain as one of its units feels it."""

    unit: _UnitMotion
    title: str
    time: float
    disturbances: tuple[Disturbance, ...]

    @property
    def description(self) -> str:
        """Program, and which segment the unit is on."""
        return f"{self.title}, unit on {self.unit.segment}"

    def motion(self, rng: np.random.Generator, duration: float) -> Motion:
        """Motion of the unit; nothing is left to chance."""
        return self.unit

    def field_n(self, body: Truth, earth_n: Floats) -> Floats:
        """Field at the unit, (3,) or (N, 3), µT: the Earth's, and what bends it there."""
        segments = self.unit.segments(body.t) if any(disturbance.on for disturbance in self.disturbances) else {}
        total = earth_n
        for disturbance in self.disturbances:
            total = total + disturbance.added_field(body.pos_n, segments[disturbance.on] if disturbance.on else None)
        return total


@dataclass(frozen=True, eq=False, repr=False)
class ChainSimulation(Series):
    """What the units of a chain say, and everything that is true about it.

    Attributes
    ----------
    chain : Chain
        What moves, with the mounts that the units should have.
    array : ImuArray
        What the units say, with these mounts and each unit's noise; a unit for each segment that has one.
    t : ndarray (N,)
        Times of all that follows, s.
    angles : ndarray (N, angles)
        True joint angles, rad, in the order of `Chain.angles`.
    bodies : mapping of str to Truth
        State of each segment's origin in segment axes, by name.
    mounts : mapping of str to UnitMount
        How the units really sit, by unit; with soft tissue about where they sway.
    units : mapping of str to Simulation
        Each unit's simulation: truth in its own axes when it took its values, calibration, noise.
    program : ChainProgram
        What the joints do.
    """

    chain: Chain
    array: ImuArray
    t: Floats
    angles: Floats
    bodies: Mapping[str, Truth]
    mounts: Mapping[str, UnitMount]
    units: Mapping[str, Simulation]
    program: ChainProgram

    @property
    def frame(self) -> Frame:
        """Navigation frame of all that is true."""
        return next(iter(self.bodies.values())).frame

    @property
    def postures(self) -> dict[str, Posture]:
        """Where every segment is, by name."""
        return {name: Posture(body.q_nb, body.pos_n) for name, body in self.bodies.items()}

    @property
    def hand_n(self) -> Floats:
        """Position of the hand (N, 3), m, navigation frame."""
        return self.chain.hand_at(self.postures)

    @property
    def tracks(self) -> dict[str, AttitudeTrack]:
        """True attitude of every segment, by name; headings from true North."""
        source = f"simulated {self.program.name}"
        return {
            name: AttitudeTrack(self.t, body.q_nb, self.frame, North.TRUE, source=f"{source}, {name}")
            for name, body in self.bodies.items()
        }

    @property
    def true_chain(self) -> Chain:
        """The chain with the mounts that the units really have."""
        segments = (replace(link, mount=self.mounts.get(link.unit, link.mount)) for link in self.chain.segments)
        return replace(self.chain, segments=tuple(segments))

    def facts(self) -> Mapping[str, str]:
        """Chain, program and samples."""
        return {"chain": self.chain.name, "program": self.program.name, **self.array.facts()}

    def columns(self) -> Mapping[str, NDArray[Any]]:
        """Time, true angles, and the hand's place: in the axes of a root that stands still, else in the frame."""
        root = next(iter(self.bodies.values()))
        hand = self.hand_n
        if self.chain.base_fixed:
            hand = quat_rotate(quat_conjugate(root.q_nb), hand - root.pos_n)
        turned = {f"{name} [rad]": self.angles[:, k] for k, name in enumerate(self.chain.angles)}
        return {"t [s]": self.t, **turned, **{f"hand_{a} [m]": hand[:, k] for k, a in enumerate("xyz")}}


def simulate_chain(
    chain: str | Chain,
    program: str | ChainProgram = "calibration",
    *,
    frame: Frame | str,
    sensors: str | Mapping[str, Module] = "ideal",
    unit: str,
    seed: int,
    rate: float | str = 100.0,
    duration: float | str | None = None,
    mount_angle: float | str = 0.0,
    mount_shift: float | str = 0.0,
    mount_clock: float | str = 0.0,
    mounts: Mapping[str, UnitMount] | None = None,
    soft: bool | str | SoftTissue = False,
    bend: float | str = 0.0,
    bend_at: str | None = None,
    disturbances: Sequence[Disturbance] = (),
    base: ArrayLike | None = None,
    gyr_range: float | str | None = None,
    acc_range: float | str | None = None,
    **world: Any,
) -> ChainSimulation:
    """Simulate the units on a chain that moves; every number may be text with its unit, as ``"5 deg"``.

    Parameters
    ----------
    chain : str or Chain
        Name of a chain (`CHAINS`), or one of your own.
    program : str or ChainProgram
        Name of a program (`PROGRAMS`), or one already made. A named one carries a chain without a fixed base about.
    frame : Frame or str
        Navigation frame of the truth. Segments keep their own axes, whatever the frame.
    sensors : str, or mapping of str to Module
        Parts of every unit, joined by ``+``; or a module for each unit by its name.
    unit : {"random", "calibrated"}
        As of `simulate`; each unit has its own errors and its own noise.
    seed : int
        Of everything that is left to chance.
    rate : float
        Samples per second, Hz.
    duration : float, optional
        s; by default the program's, and 60 s of a named one.
    mount_angle, mount_shift : float
        Largest errors of the units' mounting, rad and m, drawn: each unit's turn and displacement lie in a ball of
        that radius.
    mount_clock : float
        Largest offset of the units' clocks, s, drawn evenly to both sides; `UnitMount.clock_offset` says its sign.
    mounts : mapping of str to UnitMount, optional
        How units really sit, by unit, instead of drawn errors.
    soft : bool, "yes", "no" or SoftTissue
        Whether the units sway on their segments.
    bend : float
        By how much the field is bent to the east around one unit, µT, as by iron; it fades within 0.3 m.
    bend_at : str, optional
        Segment of that unit; by default the middle one of those that have a unit.
    disturbances : sequence of Disturbance
        What else bends the field: `Dipole`, `BentRegion`.
    base : (4,), optional
        Attitude q_nb of a fixed first segment; by default its z axis points up and its x axis is the frame's own:
        identity in ENU and NWU, half a turn about x in NED.
    gyr_range, acc_range : float, optional
        Full scales, rad/s and m/s², instead of the sensors' own.
    **world : float or str
        As of `simulate`: strength, dip, declination, temp_c, warm_up, mag_rate, noise.

    Returns
    -------
    ChainSimulation

    Raises
    ------
    FrameError
        If `frame` is not a `Frame`.
    ParameterError
        If a name is unknown, a value outside its domain, or the chain has no unit.
    """
    frame = Frame.parse(frame)
    geometry = named_chain(chain) if isinstance(chain, str) else check.kind("chain", chain, Chain)
    riders = [segment for segment in geometry.segments if segment.unit]
    if not riders:
        raise ParameterError(f"no segment of {geometry.name} has a unit; give one to those that carry a sensor.")
    _require_known(world)
    moves = _programmed(geometry, program, seed, given("duration", duration, Quantity.TIME))
    length = moves.duration if duration is None else float(given("duration", duration, Quantity.TIME) or 0.0)
    body = ChainMotion(geometry, moves.angles, frame, _root(moves, frame, base))
    true_mounts = _mounted(geometry, mounts, (mount_angle, mount_shift, mount_clock), seed)
    ends = (given("gyr_range", gyr_range, Quantity.RATE), given("acc_range", acc_range, Quantity.ACCELERATION))
    bends = _bends(geometry, riders, bend, bend_at, frame) + _checked(disturbances, geometry)
    tissue = _tissue(soft)
    units: dict[str, Simulation] = {}
    for number, rider in enumerate(riders):
        own_seed = unit_seed(seed, number)
        motion = _UnitMotion(body, rider.name, true_mounts[rider.unit])
        if tissue is not None:
            motion = replace(motion, sway=_sway(motion, tissue, length, stream(seed, rider.unit, "soft")))
        units[rider.unit] = simulate(
            _Ridden(unit=motion, title=moves.name, time=length, disturbances=bends),
            frame=frame, sensors=_module(sensors, rider.unit, own_seed).with_range(*ends), unit=unit, seed=own_seed,
            rate=rate, duration=length, **world,
        )  # fmt: skip
    imus = {name: run.imu for name, run in units.items()}
    t = next(iter(imus.values())).t
    nominal = {rider.unit: replace(rider.mount, noise=units[rider.unit].noise) for rider in riders}
    array, angles = ImuArray(imus, nominal), moves.angles.jet(t).value
    return ChainSimulation(geometry, array, t, angles, body.truth(t), true_mounts, units, moves)


def _programmed(chain: Chain, program: str | ChainProgram, seed: int, duration: float | None) -> ChainProgram:
    if isinstance(program, str):
        rng = stream(seed, "program")
        return named_program(program, chain, rng=rng, duration=60.0 if duration is None else duration)
    made = check.kind("program", program, ChainProgram)
    count = made.angles.jet(np.zeros(1)).value.shape
    if count != (1, len(chain.angles)):
        raise ParameterError(
            f"{chain.name} has the {len(chain.angles)} angles {', '.join(chain.angles)}, but the program gives "
            f"{count[-1] if len(count) > 1 else 'one without components'}."
        )
    return made


def _root(program: ChainProgram, frame: Frame, base: ArrayLike | None) -> Motion | Quat:
    if program.root is not None:
        if base is not None:
            raise ParameterError("the program moves the first segment; leave base out.")
        return program.root
    if base is None:
        return _IDENTITY if frame.up[2] > 0.0 else _UPSIDE_DOWN
    q = check.last_axis("base", base, 4)
    check.unit_norm("base", q, 1e-3)
    return UnitMount(tuple(q.tolist())).q_bs  # normalised there


def _mounted(
    chain: Chain, mounts: Mapping[str, UnitMount] | None, largest: tuple[float | str, ...], seed: int
) -> dict[str, UnitMount]:
    named = zip(("angle", "shift", "clock"), largest, (Quantity.ANGLE, Quantity.LENGTH, Quantity.TIME), strict=True)
    errors = {name: given(f"mount_{name}", value, quantity) or 0.0 for name, value, quantity in named}
    if mounts is None:
        return drawn_mounts(chain, **errors, seed=seed)
    if any(errors.values()):
        raise ParameterError("give either mounts or errors to draw: mount_angle, mount_shift, mount_clock.")
    return chain_mounts(chain, mounts)


def _module(sensors: str | Mapping[str, Module], unit: str, seed: int) -> Module:
    if isinstance(sensors, str):
        return draw_module(sensors, seed)
    if not isinstance(sensors, Mapping) or unit not in sensors:
        raise ParameterError(f"sensors must name parts, or hold a module for each unit; '{unit}' has none.")
    return check.kind(f"sensors of '{unit}'", sensors[unit], Module)


def _checked(disturbances: Sequence[Disturbance], chain: Chain) -> tuple[Disturbance, ...]:
    for bend in disturbances:
        if bend.on and bend.on not in chain.places:
            raise ParameterError(f"'{bend.on}' is not a segment of {chain.name}; they are {', '.join(chain.places)}.")
    return tuple(disturbances)


def _require_known(world: Mapping[str, Any]) -> None:
    for name in world:
        if name in {"jitter", "lost"}:
            raise ParameterError(f"the units of a chain share one time line; leave {name} out.")
        if name not in SETTINGS and name not in {"noise", "warm_up"}:
            raise unknown_name("setting", name, SETTINGS, of="a chain")


def _bends(
    chain: Chain, riders: Sequence[Segment], bend: float | str, at: str | None, frame: Frame
) -> tuple[Disturbance, ...]:
    strength = given("bend", bend, Quantity.FIELD) or 0.0
    segment = riders[len(riders) // 2].name if at is None else at
    return (bent_at(chain, segment, strength, frame),) if strength or at is not None else ()


def _tissue(soft: bool | str | SoftTissue) -> SoftTissue | None:
    if isinstance(soft, SoftTissue):
        return soft
    if soft not in (True, False, "yes", "no"):
        raise ParameterError(f"soft must be yes or no, or a SoftTissue, but it is {check.said(soft)}.")
    return SoftTissue() if soft in (True, "yes") else None


def _sway(motion: _UnitMotion, tissue: SoftTissue, length: float, rng: np.random.Generator) -> Signal:
    start = -0.1  # before the first value that a sensor with a latency gives
    t = start + _DRIVE_STEP * np.arange(int((length - 2.0 * start) / _DRIVE_STEP) + 2, dtype=np.float64)
    force = motion.body.truth(t)[motion.segment].at_lever(motion.mount.lever_b).specific_force_b
    angles, count, first = None, 0, 0
    for joint in motion.body.chain.joints:
        if joint.child == motion.segment:
            count = len(joint.axes)
            angles = Linear(motion.body.angles, itemgetter((slice(None), slice(first, first + count))))
        first += len(joint.axes)
    return tissue.sway(rng, start=start, step=_DRIVE_STEP, force=force, angles=angles, count=count)
