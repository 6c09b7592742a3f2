"""From a scenario and sensors to a recording with its truth, on one timeline."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core import check, flags
from plumbob.core.check import Floats
from plumbob.core.constants import ABSOLUTE_ZERO_C
from plumbob.core.errors import ParameterError
from plumbob.core.series import Series
from plumbob.core.time import to_ns, to_s
from plumbob.core.units import Quantity, deg, given, split, unit
from plumbob.data import TRIADS, AttitudeTrack, ImuData, ImuMeta, Range
from plumbob.data.cards import UNITS, CalibrationCard, NoiseCard
from plumbob.rotations import Frame, North
from plumbob.simulation.errors import Measured, TriadErrors, measure, stream
from plumbob.simulation.motion import Scenario, Truth
from plumbob.simulation.presets import Module, draw_module
from plumbob.simulation.scenarios import SCENARIOS
from plumbob.simulation.scenarios import scenario as named_scenario
from plumbob.simulation.signals import Signal, WarmUp, constant, earth_field

_MOST_SAMPLES = 50_000_000


@dataclass(frozen=True, eq=False)
class TimeLine:
    """Instants of a recording.

    `sampled`, `stamps` (N,): when each sample was taken, evenly spaced, and what its time stamp says, s; `kept` (N,):
    false for the samples that got lost on the way; `rate`: samples per second, Hz.
    """

    sampled: Floats
    stamps: Floats
    received: NDArray[np.bool_]
    rate: float


def time_line(*, rate: float, duration: float, jitter: float = 0.0, lost: float = 0.0, seed: int) -> TimeLine:
    """Lay out a recording of `duration`, s, at `rate`, Hz.

    `jitter`: standard deviation of the time stamps about the instants of sampling, s; at most a tenth of a step. Stamps
    keep their order: none strays by more than 0.45 steps. `lost`: share of the samples that are missing from the
    recording, each by its own chance; the first is always there.
    """
    samples = rate * duration
    if not (rate > 0.0 and duration > 0.0 and 2.0 <= samples <= _MOST_SAMPLES):
        raise ParameterError(
            f"rate × duration must give 2 to {_MOST_SAMPLES} samples, but {rate:g} Hz × {duration:g} s is {samples:g}."
        )
    count = round(samples)
    if not (0.0 <= jitter <= 0.1 / rate and 0.0 <= lost < 1.0):
        raise ParameterError(
            f"jitter must be 0 to {0.1 / rate:g} s (a tenth of a step) and lost 0 to below 1, "
            f"but they are {jitter:g} s and {lost:g}."
        )
    sampled = to_s(to_ns(np.arange(count) / rate))
    stray = np.clip(jitter * rate * stream(seed, "time", "jitter").standard_normal(count), -0.45, 0.45) / rate
    stray[0] = max(stray[0], 0.0)  # a recording starts at 0, not before
    received = stream(seed, "time", "lost").random(count) >= lost
    received[0] = True
    return TimeLine(sampled, to_s(to_ns(sampled + stray)), received, rate)


def arrivals(count: int, rate: float, own_rate: float | None) -> NDArray[np.int64]:
    """Rows of a time line of `count` samples at `rate`, Hz, that hold a new value of a slower sensor.

    A value goes to the first row at or after its own instant; a sensor without own_rate, or a faster one, has a value
    in every row.
    """
    if own_rate is None or own_rate >= rate:
        return np.arange(count)
    place = np.ceil(np.arange(int(count * own_rate / rate) + 1) * (rate / own_rate) - 1e-9)
    rows: NDArray[np.int64] = place[place < count].astype(np.int64)
    return rows


WarmingUp = str | tuple[float | str, float | str]
"""Rise and time constant of a device that warms up, as `warming_up` takes them."""

KINDS = ("random", "calibrated")  # what a unit may be: as it left the line, or after an ideal calibration

WORLD = {
    "strength": Quantity.FIELD,
    "dip": Quantity.ANGLE,
    "declination": Quantity.ANGLE,
    "temp_c": Quantity.TEMPERATURE,
    "mag_rate": Quantity.FREQUENCY,
    "jitter": Quantity.TIME,
    "lost": Quantity.RATIO,
}
"""Numbers of the world and of the recording that are no parameters of a scenario, with what they measure."""

_CLIPPED = {"gyr": flags.GYR_CLIPPED, "acc": flags.ACC_CLIPPED, "mag": flags.MAG_CLIPPED}


@dataclass(frozen=True, eq=False, repr=False)
class Simulation(Series):
    """A simulated recording and everything that is true about it.

    Attributes
    ----------
    imu : ImuData
        What the sensors say. ``imu.meta.device`` names the parts and the seed, so that cards fit this unit only.
    truth : AttitudeTrack
        Attitude at the same time stamps, headings from true North; ``bias_b`` is the gyroscope's true bias.
    calibration : CalibrationCard
        What a perfect laboratory would find for this unit; changes nothing for a calibrated one.
    noise : NoiseCard
        Noise that was simulated, and which of its figures are not verified.
    kinematics : Truth
        Rates, positions and accelerations at the same time stamps.
    module : Module
        Errors of the unit.
    scenario : Scenario
        The motion, with its parameters.
    angles : ndarray (N, 3) or None
        Heading from true North, pitch and roll that a reference says itself, rad, NED; None of a unit that says none.
    """

    imu: ImuData
    truth: AttitudeTrack
    calibration: CalibrationCard
    noise: NoiseCard
    kinematics: Truth
    module: Module
    scenario: Scenario
    angles: Floats | None = None

    def facts(self) -> Mapping[str, str]:
        """Scenario and samples."""
        return {"scenario": self.truth.source.partition("(")[0], **self.imu.facts()}

    def columns(self) -> Mapping[str, NDArray[Any]]:
        """Of the samples, and the true angles beside them."""
        angles = {f"true {name}": values for name, values in self.truth.columns().items() if name.endswith("[deg]")}
        return {**self.imu.columns(), **angles}


class _World(NamedTuple):
    """What surrounds the sensors: the time line, the body's state at any delay, temperature and the field there."""

    line: TimeLine
    body: Callable[[float], Truth]
    temp_c: Floats
    field_n: Callable[[Truth], Floats]
    declination: float

    def true_input(self, triad: str, delay: float) -> Floats:
        """True values (N, 3) of a triad, `delay` s before each instant of sampling."""
        body = self.body(delay)
        if triad == "gyr":
            return body.rate_b
        return body.specific_force_b if triad == "acc" else body.in_body(self.field_n(body))


def simulate(
    scenario: str | Scenario,
    *,
    frame: Frame | str,
    sensors: str | Module = "ideal",
    unit: str,
    seed: int = 0,
    rate: float | str | None = None,
    duration: float | str | None = None,
    strength: float | str = 50.0,
    dip: float | str = deg(50.0),
    declination: float | str = 0.0,
    temp_c: float | str | Signal = 25.0,
    mag_rate: float | str | None = None,
    jitter: float | str = 0.0,
    lost: float | str = 0.0,
    noise: NoiseCard | str | Path | None = None,
    warm_up: WarmingUp | None = None,
    **parameters: float | str,
) -> Simulation:
    """Simulate what sensors record in a scenario, and the truth; every number may be text with its unit.

    Parameters
    ----------
    scenario : str or Scenario
        Name of a scenario ('plumbob list scenarios'), or one already made.
    frame : Frame or str
        Navigation frame of the truth. The body's axes go with it: z up in ENU and NWU, z down in NED.
    sensors : str or Module
        Parts joined by ``+``, such as ``"mpu6000+hmc5983"`` or ``"ideal"``, or a unit already made.
    unit : {"random", "calibrated"}
        "random" draws the unit's bias, scale, misalignment and so on within the sheets' limits (a `Module` is taken as
        it stands); "calibrated" removes every deterministic error and leaves noise, quantisation and range.
    seed : int
        Of everything that is left to chance. Each error has its own random stream: switching one off, or sampling
        longer, leaves the others as they are.
    rate, duration : float, optional
        Samples per second, Hz, and how long, s; by default the scenario's.
    strength, dip, declination : float
        The Earth's magnetic field: µT, rad below the horizontal, rad of magnetic North east of true North.
    temp_c : float or Signal
        Temperature, °C, constant or over time.
    warm_up : str or tuple, optional
        What is added to the temperature, ``rise (1 - exp(-t / time))``, as ``"15 K, 120 s"`` or a pair of numbers.
    mag_rate : float, optional
        Sampling rate of the magnetometer, Hz, default: that of its data sheet; rows between are NaN.
    jitter : float
        Standard deviation of the time stamps about the instants of sampling, s.
    lost : float
        Share of the samples that are missing from the recording.
    noise : NoiseCard, optional
        Noise card whose N, B and K the sensors take instead of their own.
    **parameters : float or str
        Of the scenario: a number in its unit, or text with a unit.

    Raises
    ------
    FrameError
        If `frame` is no `Frame`.
    ParameterError
        If a name is unknown, a value outside its domain, a text without the unit that it needs, or `noise` has a triad
        that the sensors have not.
    """
    frame = Frame.parse(frame)
    strength, dip, jitter = _number("strength", strength), _number("dip", dip), _number("jitter", jitter)
    declination = _number("declination", declination)
    warmth = temp_c if isinstance(temp_c, Signal) else _temperature(temp_c)
    warmth = warmth if warm_up is None else warmth + warming_up(warm_up)
    card = None if noise is None else check.kind("noise", NoiseCard.of(noise), NoiseCard)
    magnetic = None if mag_rate is None else _number("mag_rate", mag_rate)
    plan, module = _plan(scenario, parameters), _unit(sensors, unit, seed, magnetic, card)
    rate = plan.rate if rate is None else _number("rate", rate)
    duration = plan.duration if duration is None else _number("duration", duration)
    line = time_line(rate=rate, duration=duration, jitter=jitter, lost=_number("lost", lost), seed=seed)
    motion = plan.motion(stream(seed, "scenario"), duration)
    world = _World(
        line=line,
        body=cache(lambda delay: motion.truth(line.sampled - delay).in_frame(frame)),
        temp_c=warmth.jet(line.sampled).value,
        field_n=partial(plan.field_n, earth_n=earth_field(frame, strength=strength, dip=dip, declination=declination)),
        declination=declination,
    )
    stamped = motion.truth(line.stamps).in_frame(frame) if jitter else world.body(0.0)
    made = _simulation(world, stamped.rows(line.received), plan, module, seed, calibrated=unit == "calibrated")
    if module.attitude is None:
        return made
    angles = module.attitude.said(stamped.in_frame(Frame.NED).q_nb, seed=seed, rate=rate)
    return replace(made, angles=angles[line.received])


def _simulation(
    world: _World, kinematics: Truth, plan: Scenario, unit: Module, seed: int, *, calibrated: bool
) -> Simulation:
    rate = world.line.rate
    measured = {name: _sense(world, name, getattr(unit, name), seed) for name in TRIADS if getattr(unit, name)}
    noises = {n: getattr(unit, n) and getattr(unit, n).noise_card(rate) for n in TRIADS}
    meta = ImuMeta(
        device=f"{unit.name} #{seed}",
        gyr_range=_range(unit.gyr),
        acc_range=_range(unit.acc),
        mag_range=_range(unit.mag),
        rate_nominal=rate,
        frame=kinematics.frame,
        north=North.TRUE,
        declination=world.declination,
        calibration="ideal (simulated)" if calibrated else None,
    )
    return Simulation(
        imu=_recording(world, measured, meta),
        truth=AttitudeTrack(
            t=kinematics.t,
            q_nb=kinematics.q_nb,
            frame=kinematics.frame,
            north=North.TRUE,
            bias_b=measured["gyr"].bias[world.line.received] if "gyr" in measured else None,
            source=f"simulated {plan.description}, seed {seed}",
        ),
        calibration=_calibration(unit, meta.device),
        noise=NoiseCard(meta.device, f"simulated from {unit.source}", **noises),
        kinematics=kinematics,
        module=unit,
        scenario=plan,
    )


def _temperature(temp_c: float | str) -> Signal:
    """Temperature, °C, that there can be."""
    value = _number("temp_c", temp_c)
    if value < ABSOLUTE_ZERO_C:
        raise ParameterError(f"temp_c must be at least {ABSOLUTE_ZERO_C} °C, absolute zero, but it is {value:g} °C.")
    return constant(value)


def _number(name: str, value: float | str) -> float:
    quantity = {"rate": Quantity.FREQUENCY, "duration": Quantity.TIME, **WORLD}[name]
    return check.number(name, given(name, value, quantity), quantity.value)


def warming_up(spec: WarmingUp) -> WarmUp:
    """How a device warms up: rise, K, and time constant, s, as numbers or as one text, ``"15 K, 120 s"``."""
    parts = spec.split(",") if isinstance(spec, str) else tuple(spec)
    if len(parts) != 2:
        raise ParameterError(f"warm_up must be RISE, TIME, as '15 K, 120 s', but it is {check.said(spec)}.")
    time = given("the time of warm_up", parts[1], Quantity.TIME, positive=True)
    if isinstance(parts[0], str):
        number, name = split(parts[0])
        rise = float(number) * unit(name or "K", Quantity.TEMPERATURE).factor  # a difference: no zero point
    else:
        rise = check.number("the rise of warm_up", parts[0], "K")
    if not np.isfinite(rise):
        raise ParameterError(f"the rise of warm_up must be finite, but it is {rise:g} K.")
    return WarmUp(rise, float(time or 0.0))


def _plan(scenario: str | Scenario, parameters: dict[str, float | str]) -> Scenario:
    if isinstance(scenario, str):
        return named_scenario(scenario, **parameters)
    if not isinstance(scenario, Scenario):
        raise ParameterError(f"scenario must be one of {', '.join(SCENARIOS)}, but it is {check.said(scenario)}.")
    if parameters:
        raise ParameterError(f"the scenario was given as an object; set {', '.join(parameters)} where it is made.")
    return scenario


def _unit(sensors: str | Module, kind: str, seed: int, mag_rate: float | None, noise: NoiseCard | None) -> Module:
    if not isinstance(kind, str) or kind not in KINDS:
        raise ParameterError(f"unit must be one of {', '.join(KINDS)}, but it is {check.said(kind)}.")
    unit = draw_module(sensors, seed) if isinstance(sensors, str) else check.kind("sensors", sensors, Module)
    unit = unit if mag_rate is None else unit.with_mag_rate(mag_rate)
    unit = unit if noise is None else unit.with_noise(noise)
    return unit.calibrated() if kind == "calibrated" else unit


def _sense(world: _World, triad: str, errors: TriadErrors, seed: int) -> Measured:
    """What a triad says on the whole time line; NaN in rows where it has no new value."""
    rows = arrivals(world.line.sampled.size, world.line.rate, errors.rate)
    by_axis = [world.true_input(triad, delay)[rows, axis] for axis, delay in enumerate(errors.latency.tolist())]
    force = world.true_input("acc", 0.0) if errors.g_sensitivity.any() else np.zeros((world.line.sampled.size, 3))
    measured = measure(
        errors, np.stack(by_axis, axis=-1), triad=triad, seed=seed, rate=errors.own_rate(world.line.rate),
        temp_c=world.temp_c[rows], force_b=force[rows],
    )  # fmt: skip
    count = world.line.sampled.size
    if rows.size == count:
        return measured
    spread = Measured(np.full((count, 3), np.nan), np.full((count, 3), np.nan), np.zeros((count, 3), dtype=bool))
    for column, part in zip(spread, measured, strict=True):
        column[rows] = part
    return spread


def _recording(world: _World, measured: dict[str, Measured], meta: ImuMeta) -> ImuData:
    received = world.line.received
    marks = np.zeros(received.size, dtype=np.uint32)
    for name, triad in measured.items():  # before the sensor's errors, a value at the end may look smaller
        marks[triad.clipped.any(axis=1)] |= np.uint32(_CLIPPED[name])
    return ImuData(
        t=world.line.stamps[received],
        **{name: triad.values[received] for name, triad in measured.items()},
        temp_c=world.temp_c[received],
        flags=marks[received],
        meta=meta,
    )


def _range(errors: TriadErrors | None) -> Range:
    if errors is None or not np.isfinite(errors.full_scale).all():
        return None
    x, y, z = errors.full_scale.tolist()
    return (x, y, z)


def _calibration(unit: Module, device: str) -> CalibrationCard:
    triads = {n: getattr(unit, n) and getattr(unit, n).card(UNITS[n]) for n in TRIADS}
    if unit.acc is None and triads["gyr"] is not None:  # without a specific force, nothing tells what it does
        triads["gyr"] = replace(triads["gyr"], g_sensitivity=np.zeros((3, 3)))
    # simulated recordings begin at unix time 0, and so do their cards
    return CalibrationCard(device, "1970-01-01", "simulated: inverse of the planted errors", **triads)
