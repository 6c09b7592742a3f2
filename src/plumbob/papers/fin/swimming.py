"""Attitude of the fin while it swims: quaternion, per-axis integrals, clipping, a high-pass, and warm-up."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, Final, NamedTuple

import numpy as np

from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.units import deg, dps, to_deg, to_dps
from plumbob.data import AttitudeTrack, ImuData
from plumbob.data.calibrated import apply_card
from plumbob.data.cards import CalibrationCard
from plumbob.door.calibrate import calibrate, read_track
from plumbob.door.estimate import estimate
from plumbob.evaluation.metrics import euler_errors
from plumbob.files import write
from plumbob.filters import Filter
from plumbob.live.replay import replay
from plumbob.live.rigs.rig import fitted
from plumbob.noise import deviation
from plumbob.papers.fin.forms import slope
from plumbob.papers.fin.records import LENGTH, RATE, gyr_rates
from plumbob.papers.workspace import Work, recorded_samples
from plumbob.protocols.find import find_format
from plumbob.rotations import Frame, euler_zyx_from_quat, quat_conjugate, quat_multiply, quat_normalize
from plumbob.simulation import EulerMotion, Module, Motion, Scenario, Simulation, draw_module, simulate
from plumbob.simulation.signals import Moves, Stack, constant

PARTS: Final = "adxrs290+adxrs453"
ANGLES: Final = ("yaw", "pitch", "roll")
LIVE: Final = '\n[imu]\nframe = "NED"\n[estimate]\nfilter = "integrate"\ninit = "level"\n'
"""Of a session that estimates while it records: quaternion integration from a level start."""
CORNERS: Final = (0.011, 0.5)
"""Of a high-pass, Hz: the ADXRS290's lowest, and one within the swimming."""
TEMPCO: Final = dps(np.array([0.004, -0.006, 0.004]))
"""Bias per kelvin that is assumed for x, y and z, rad/s/K: no sheet at hand states one."""
WARM_UP: Final = "15 K, 120 s"
AT_REST: Final[Mapping[str, Any]] = {"scenario": "static", "duration": LENGTH, "unit": "calibrated"}
"""Of an emulated record, so that no bias is in it."""


@dataclass(frozen=True, kw_only=True)
class Turn(Scenario):
    """A turn of 90° about the vertical within 4 s, and then a hold."""

    rate: ClassVar[float] = RATE

    @property
    def duration(self) -> float:
        """Time that it takes, s."""
        return LENGTH

    def motion(self, rng: np.random.Generator, duration: float) -> Motion:
        """One move."""
        rest = constant(0.0)
        return EulerMotion(Frame.NED, Stack((Moves((2.0,), (4.0,), (deg(90.0),)), rest, rest)))


def fin_unit(seed: int) -> Module:
    """The rig's unit after an ideal calibration, with the counts and ranges of its frame."""
    message = find_format("fin").bind().messages[0]
    return fitted(draw_module(PARTS, seed), message, "").calibrated()


def integrated(imu: ImuData, start: Floats | None = None) -> AttitudeTrack:
    """Attitude by quaternion integration, from level or from a known attitude (4,)."""
    return Filter("integrate", frame=Frame.NED, init="level" if start is None else start).process(imu)


def errors_deg(track: AttitudeTrack, truth: AttitudeTrack) -> Floats:
    """Errors (N, 3) of yaw, pitch and roll, degrees."""
    return to_deg(euler_errors(track.q_nb, truth.q_nb))


def per_axis_deg(imu: ImuData) -> Floats:
    """Integral (N, 3) of each body rate on its own, z, y and x as if they were yaw, pitch and roll, degrees."""
    rates = gyr_rates(imu)[:, ::-1]
    steps = 0.5 * np.diff(imu.t)[:, np.newaxis] * (rates[1:] + rates[:-1])
    return to_deg(np.concatenate((np.zeros((1, 3)), np.cumsum(steps, axis=0))))


def true_deg(truth: AttitudeTrack) -> Floats:
    """Angles (N, 3) yaw, pitch and roll without jumps, from their start, degrees."""
    angles = np.unwrap(euler_zyx_from_quat(truth.q_nb), axis=0)
    return to_deg(angles - angles[0])


def largest(errors: Floats) -> dict[str, float]:
    """Largest absolute error of each angle, in the unit of the errors."""
    return dict(zip(ANGLES, np.max(np.abs(errors), axis=0).tolist(), strict=True))


class Swum(NamedTuple):
    """What one swim through bytes gave.

    Attributes
    ----------
    t : ndarray (N,)
        Times, s.
    truth, live : ndarray (N, 3)
        Yaw, pitch and roll, degrees; what the session estimated while it recorded.
    errors : ndarray (N, 3)
        Of the live attitude, degrees.
    same_live, same_text : bool
        Whether the replay, and the rates that were stored as TXT and read back, give the same attitude to the bit.
    samples : int
        Decoded ones.
    """

    t: Floats
    truth: Floats
    live: Floats
    errors: Floats
    same_live: bool
    same_text: bool
    samples: int


def swim(work: Work) -> Swum:
    """Swim for 220 s, estimated while it is recorded."""
    taken = work.recorded("fin", "swim", session=LIVE, unit="calibrated")
    replayed = replay(taken.recording, check=True)
    track, imu, same = replayed.track, replayed.imu, replayed.comparison
    assert track is not None
    assert imu is not None
    assert same is not None
    text = taken.recording.with_suffix(".txt")
    write(text, imu, overwrite=True)
    back = estimate(text, "integrate", init="level", frame="NED").track
    truth = read_track(taken.truth)
    return Swum(
        imu.t,
        true_deg(truth),
        to_deg(np.unwrap(euler_zyx_from_quat(track.q_nb), axis=0)),
        errors_deg(track, truth),
        same.equal,
        bool(np.array_equal(back.q_nb, track.q_nb)),
        len(imu),
    )


class PerAxis(NamedTuple):
    """Errors of both ways to integrate, noise-free.

    Attributes
    ----------
    t : ndarray (N,)
        Times, s.
    axis, quaternion : ndarray (N, 3)
        Errors of yaw, pitch and roll, degrees.
    peaks : ndarray (3,)
        Largest rates about x, y and z, °/s.
    """

    t: Floats
    axis: Floats
    quaternion: Floats
    peaks: Floats


def without_noise(**parameters: str) -> PerAxis:
    """Swim with ideal sensors, and integrate each axis on its own and the quaternion."""
    made = simulate("fin", frame="NED", sensors="ideal", unit="calibrated", seed=0, **parameters)
    quaternion = errors_deg(integrated(made.imu), made.truth)
    axis = per_axis_deg(made.imu) - true_deg(made.truth)
    return PerAxis(made.imu.t, axis, quaternion, np.max(np.abs(to_dps(gyr_rates(made.imu))), axis=0))


def over_seeds(work: Work, runs: int, **parameters: str) -> tuple[Floats, Floats]:
    """Median of the largest errors (3,), degrees, by quaternion and per axis, with the parts' noise and rounding."""
    peaks: tuple[list[Floats], list[Floats]] = ([], [])
    for seed in work.seeds(runs):
        made = simulate("fin", frame="NED", sensors=fin_unit(work.seed), unit="calibrated", seed=seed, **parameters)
        peaks[0].append(np.max(np.abs(errors_deg(integrated(made.imu), made.truth)), axis=0))
        peaks[1].append(np.max(np.abs(per_axis_deg(made.imu) - true_deg(made.truth)), axis=0))
    return np.asarray(np.median(peaks[0], axis=0)), np.asarray(np.median(peaks[1], axis=0))


def coning() -> float:
    """Largest error of the quaternion in classical coning of 10° at 1 Hz over 220 s at 500 Hz, noise-free, degrees."""
    made = simulate(
        "coning",
        frame="NED",
        sensors="ideal",
        unit="calibrated",
        seed=0,
        rate=RATE,
        duration=LENGTH,
    )
    track = integrated(made.imu, made.truth.q_nb[0])
    off = quat_normalize(quat_multiply(quat_conjugate(made.truth.q_nb), track.q_nb))
    return float(to_deg(2.0 * np.max(np.arcsin(np.linalg.norm(off[:, 1:], axis=1)))))


class Clipped(NamedTuple):
    """A swim at 1 Hz that the ADXRS290's range cuts off.

    Attributes
    ----------
    t : ndarray (N,)
        Times, s.
    true, said : ndarray (N, 3)
        Rates, °/s.
    share : float
        Of the samples that are flagged.
    missed : int
        Samples at the end of a range that carry no flag.
    errors : ndarray (N, 3)
        Of yaw, pitch and roll, degrees.
    """

    t: Floats
    true: Floats
    said: Floats
    share: float
    missed: int
    errors: Floats

    @property
    def peaks(self) -> Floats:
        """Largest true rates (3,), °/s."""
        return np.asarray(np.max(np.abs(self.true), axis=0))


def clipped(work: Work) -> Clipped:
    """Swim at twice the frequency for 20 s, through bytes."""
    taken = work.recorded(
        "fin", "fast", session=LIVE, unit="calibrated", duration=20.0, scenario="fin", set={"frequency": "1 Hz"}
    )
    imu = recorded_samples(taken.recording)
    made = simulate("fin", frame="NED", sensors="ideal", unit="calibrated", seed=0, duration=20.0, frequency=1.0)
    said = to_dps(gyr_rates(imu))
    at_end = (np.abs(said[:, :2]) >= 100.0).any(axis=1) | (np.abs(said[:, 2]) >= 300.0)
    flagged = (imu.flags & np.uint32(flags.GYR_CLIPPED)) != 0
    return Clipped(
        imu.t,
        to_dps(gyr_rates(made.imu)),
        said,
        float(np.mean(flagged)),
        int(np.sum(at_end & ~flagged)),
        errors_deg(integrated(imu), read_track(taken.truth)),
    )


class HighPassed(NamedTuple):
    """What a high-pass in the chain costs.

    Attributes
    ----------
    t : ndarray (N,)
        Times, s.
    yaw : mapping of float to ndarray (N,)
        Yaw of a turn by 90° and a hold, degrees, by corner, Hz; 0 is without a high-pass.
    tau : ndarray (m,)
        Averaging times, s.
    dev : mapping of float to ndarray (m,)
        Allan deviation of the ADXRS453 at rest, °/s, by corner.
    """

    t: Floats
    yaw: Mapping[float, Floats]
    tau: Floats
    dev: Mapping[float, Floats]

    def at_end(self, corner: float) -> float:
        """Yaw at the end, degrees."""
        return float(self.yaw[corner][-1])

    def at_fifty(self, corner: float) -> float:
        """Deviation at 50 s, °/s."""
        return float(np.interp(50.0, self.tau, self.dev[corner]))

    def slope(self, corner: float) -> float:
        """Slope of the deviation from 2 s to 20 s."""
        use = (self.tau >= 2.0) & (self.tau <= 20.0)
        return slope(self.tau[use], self.dev[corner][use])


def high_passed(work: Work, still: Path) -> HighPassed:
    """A turn and a rest, without and with a high-pass, through bytes.

    Parameters
    ----------
    work : Work
        Of the run.
    still : Path
        Recording at rest without a high-pass.
    """
    yaw: dict[float, Floats] = {}
    t = np.empty(0)
    for corner in (0.0, *CORNERS):
        unit = fin_unit(work.seed)
        unit = unit.with_high_pass(corner) if corner else unit
        made = simulate(Turn(), frame="NED", sensors=unit, unit="calibrated", seed=work.seed)
        imu = made.imu if corner == CORNERS[1] else _through_bytes(work, f"turn-{corner:g}", made)
        t, yaw[corner] = imu.t, to_deg(euler_zyx_from_quat(integrated(imu).q_nb))[:, 0]
    passed = work.recorded("fin", "still-high-pass", high_pass=CORNERS[1], **AT_REST).recording
    n = np.unique(np.append(np.geomspace(1, 55_000, 80).astype(np.int64), 25_000))
    dev = {corner: deviation(_z_dps(path), n) for corner, path in ((0.0, still), (CORNERS[1], passed))}
    return HighPassed(t, yaw, n / RATE, dev)


def _z_dps(recording: Path) -> Floats:
    return np.ascontiguousarray(to_dps(gyr_rates(recorded_samples(recording)))[:, 2])


def _through_bytes(work: Work, name: str, made: Simulation) -> ImuData:
    return recorded_samples(work.sent("fin", name, made).recording)


class WarmedUp(NamedTuple):
    """A second warm-up, before and after the compensation that the first one gave.

    Attributes
    ----------
    t, temp_c : ndarray (N,)
        Times, s, and temperature, °C.
    rates : mapping of str to ndarray (m, 3)
        Means of the rates over 5 s, °/s, "before" and "after"; the unit is at rest.
    angles : mapping of str to ndarray (N, 3)
        Errors of yaw, pitch and roll, degrees.
    slopes : ndarray (3,)
        Bias per kelvin at the reference temperature that the card has, °/s/K.
    card : CalibrationCard
        What was found.
    """

    t: Floats
    temp_c: Floats
    rates: Mapping[str, Floats]
    angles: Mapping[str, Floats]
    slopes: Floats
    card: CalibrationCard


def warmed_up(work: Work) -> WarmedUp:
    """Warm up twice from cold; the first record makes the card, the second is scored.

    At 100 Hz: the temperature of a fin takes two minutes to settle.
    """
    unit = fin_unit(work.seed)
    assert unit.gyr is not None
    warm = replace(unit, gyr=replace(unit.gyr, bias_per_k=TEMPCO))
    imus: list[ImuData] = []
    for number in range(2):
        made = simulate(
            "static",
            frame="NED",
            sensors=warm,
            unit="random",
            seed=work.seed + number,
            rate=100.0,
            duration=(600.0, LENGTH)[number],
            warm_up=WARM_UP,
        )
        imus.append(_through_bytes(work, f"warm-{number + 1}", made))
    card = calibrate(imus[0], "temperature", device=imus[0].meta.device).card
    assert card.gyr is not None
    second, t = imus[1], imus[1].t
    after = apply_card(card, second)
    by = {"before": second, "after": after}
    assert second.temp_c is not None
    return WarmedUp(
        t,
        np.asarray(second.temp_c),
        {
            name: to_dps(gyr_rates(imu)[: 500 * (len(imu) // 500)].reshape(-1, 500, 3).mean(axis=1))
            for name, imu in by.items()
        },
        {name: to_deg(euler_zyx_from_quat(integrated(imu).q_nb)) for name, imu in by.items()},
        to_dps(np.atleast_2d(card.gyr.bias_per_k)[0]),
        card,
    )


def longest_swim() -> float:
    """Frequency at which the swing and twist of the page reach the ADXRS290's 100 °/s, Hz; rates grow with it."""
    peaks = without_noise(duration="4 s").peaks
    return 0.5 * 100.0 / float(peaks[:2].max())


def turned_without_noise(corner: float) -> float:
    """Yaw at the end of the turn and hold behind a high-pass, noise-free and not rounded, degrees."""
    unit = draw_module("ideal", 0).with_high_pass(corner)
    made = simulate(Turn(), frame="NED", sensors=unit, unit="calibrated", seed=0)
    return float(to_deg(euler_zyx_from_quat(integrated(made.imu).q_nb))[-1, 0])
