"""The buoy paper's slide [Yu2018] and a sea, on simulated units with cards of their own, by several filters.

A unit is drawn within the limits of the data sheets of MPU-6000 and HMC5983, all errors included: zero-rate output,
scale, misalignment, iron. It is calibrated twice from one capture on six faces and twelve edges: as the paper does,
with one reading in each of 18 regions, six parameters, and the zero-rate output at rest removed; and as Plumbob
recommends, with accelerometer, gyroscope and magnetometer by all samples and the mounting by two poses. Simulated
directly: no bytes.
"""

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, Final, NamedTuple

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.errors import CalibrationError
from plumbob.core.units import to_deg
from plumbob.data import ImuData
from plumbob.data.calibrated import apply_card
from plumbob.data.cards import CalibrationCard, TriadCalibration
from plumbob.door.calibrate import calibrate
from plumbob.evaluation.metrics import euler_errors
from plumbob.filters.offline import Stage, run_stage
from plumbob.papers.buoy.modules import by_paper
from plumbob.quality.static_periods import stills
from plumbob.rotations import Frame
from plumbob.simulation import Simulation, simulate

SENSORS: Final = "mpu6000+hmc5983"
STROKES: Final = ((2.0, 0.4), (3.0, 0.8), (2.0, 0.8), (1.0, 0.6))
"""Highest speed of a stroke, m/s, and its duration, s."""
SETTLE: Final = 60.0
"""Time at sea that is left out, s."""


class Contender(NamedTuple):
    """A filter on samples that one of the two cards has corrected."""

    filter: str
    params: Mapping[str, Any]
    paper: bool = False


NO_GATE: Final = Contender("mahony", {"gate": "off"}, paper=True)
GATED: Final = Contender("mahony", {}, paper=True)
NARROW: Final = Contender("mahony", {"gate": 0.08}, paper=True)
NEW: Final = Contender("mekf", {})
SLIDE: Final[Mapping[str, Contender]] = {
    "no gate": NO_GATE,
    "gate 0.08 g": GATED,
    "gate 0.08 m/s²": NARROW,
    "gate 0.08 g, best card": Contender("mahony", {}),
    "vqf": Contender("vqf", {}),
    "mekf": NEW,
}
SEA: Final[Mapping[str, Contender]] = {
    "tilt_compass": Contender("tilt_compass", {}),
    "no gate": NO_GATE,
    "gate 0.08 g": GATED,
    "no gate, best card": Contender("mahony", {"gate": "off"}),
    "gate 0.08 g, best card": Contender("mahony", {}),
    "gate 0.08 m/s², best card": Contender("mahony", {"gate": 0.08}),
    "Kp 0.05, Ki 0.001": Contender("mahony", {"kp": 0.05, "ki": 0.001, "gate": "off", "quick_start": True}),
    "vqf": Contender("vqf", {}),
    "vqf, tau_acc 10 s": Contender("vqf", {"tau_acc": 10.0}),
    "mekf": NEW,
}


def region_readings(capture: ImuData) -> tuple[Floats, Floats]:
    """One reading (M, 3) of specific force, m/s², and field, µT, in the middle of each of M rests."""
    acc, mag = capture.usable("acc"), capture.usable("mag")
    fresh = np.flatnonzero(np.isfinite(mag).all(axis=1) & np.isfinite(acc).all(axis=1))
    rests = stills(capture.t, acc, capture.usable("gyr"))
    at = [fresh[np.searchsorted(fresh, (rest.start + rest.stop) // 2)] for rest in rests]
    return acc[at], mag[at]


def paper_card(capture: ImuData, still: ImuData) -> CalibrationCard:
    """Card as the paper finds it: eq. (13) on one reading for each of 18 poses, and the mean of the rates at rest."""
    fit = by_paper(*region_readings(capture))
    if fit is None:
        raise CalibrationError("the paper's fit gives no ellipsoid. Turn the unit to all faces and edges.")
    method = "[Yu2018] (13)"
    acc, mag = (
        TriadCalibration(linear.matrix, linear.bias, unit, unit, method=method)
        for linear, unit in zip(fit, ("m/s2", "uT"), strict=True)
    )
    rate = np.nanmean(still.usable("gyr"), axis=0)
    gyr = TriadCalibration(np.eye(3), rate, "rad/s", "rad/s", method="mean at rest")
    return CalibrationCard(capture.meta.device, "1970-01-01", method, gyr=gyr, acc=acc, mag=mag)


def best_card(capture: ImuData, raised: ImuData) -> CalibrationCard:
    """Card as Plumbob recommends: accelerometer, gyroscope and magnetometer of the capture, and the mounting."""
    card = None
    for kind in ("accel", "gyro", "mag"):
        card = calibrate(capture, kind, calibration=card).card
    return calibrate(raised, "mount", calibration=card, frame=Frame.NED).card


def simulated(scenario: str, seed: int, *, rate: float = 100.0, unit: str = "random", **how: Any) -> Simulation:
    """A unit of the rig ``buoy``, simulated directly."""
    return simulate(scenario, frame=Frame.NED, sensors=SENSORS, unit=unit, seed=seed, rate=rate, **how)


@cache
def cards(seed: int) -> tuple[CalibrationCard, CalibrationCard]:
    """Cards of a unit: the paper's, and Plumbob's."""
    capture = simulated("faces", seed, rate=50.0, edges="on", wobble="5 deg", move="2 s").imu
    still = simulated("static", seed, duration="10 s").imu
    return paper_card(capture, still), best_card(capture, simulated("raise", seed).imu)


def errors_deg(q_nb: Floats, truth: Floats) -> Floats:
    """Errors (N, 3) of yaw, pitch and roll of attitudes (N, 4), deg."""
    return to_deg(euler_errors(q_nb, truth))


def estimated(one: Contender, made: Simulation, seed: int) -> Floats:
    """Errors (N, 3) of yaw, pitch and roll, deg, of a contender on a unit's samples with its card."""
    imu = apply_card(cards(seed)[0 if one.paper else 1], made.imu)
    return errors_deg(run_stage(imu, Stage(one.filter, one.params), frame=Frame.NED).q_nb, made.truth.q_nb)


def slide(speed: float, stroke: float, seeds: Sequence[int]) -> dict[str, Floats]:
    """Largest errors of roll and pitch, deg, (seeds, 2), of each of `SLIDE`."""
    errors: dict[str, list[Floats]] = {name: [] for name in SLIDE}
    for seed in seeds:
        made = simulated("slide", seed, peak_speed=speed, stroke=stroke)
        for name, contender in SLIDE.items():
            errors[name].append(np.abs(estimated(contender, made, seed)).max(axis=0)[[2, 1]])
    return {name: np.array(each) for name, each in errors.items()}


def sea(seeds: Sequence[int], duration: float) -> dict[str, Floats]:
    """Root mean squares of the errors of roll, pitch and yaw, deg, (seeds, 3), of each of `SEA`, in `duration`, s."""
    rms: dict[str, list[Floats]] = {name: [] for name in SEA}
    for seed in seeds:
        made = simulated("buoy", seed, duration=duration)
        settled = made.imu.t >= SETTLE
        for name, contender in SEA.items():
            rms[name].append(np.sqrt(np.mean(estimated(contender, made, seed)[settled] ** 2, axis=0))[::-1])
    return {name: np.array(each) for name, each in rms.items()}


def gain_scan(
    kps: Sequence[float], speed: float, stroke: float, *, gate: str | float, seed: int = 1
) -> list[tuple[float, float]]:
    """Largest errors of roll and pitch, deg, of the PI law with each Kp on a slide; a unit without errors but noise."""
    made = simulated("slide", seed, unit="calibrated", peak_speed=speed, stroke=stroke)
    largest = []
    for kp in kps:
        track = run_stage(made.imu, Stage("mahony", {"kp": kp, "gate": gate}), frame=Frame.NED)
        _, pitch, roll = np.abs(errors_deg(track.q_nb, made.truth.q_nb)).max(axis=0).tolist()
        largest.append((roll, pitch))
    return largest


def bound(speed: float, kp: float = 0.5) -> float:
    """Inclination that a stroke to a speed, m/s, can feed into the PI law: Kp v/g, deg."""
    return float(to_deg(kp * speed / G0))
