"""Page of what the fin's chain does to an angle [Ou2017] §1: its range, a high-pass in it, and its temperature."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Final

import numpy as np

from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.units import deg, dps, to_deg, to_dps
from plumbob.data import ImuData
from plumbob.data.calibrated import apply_card
from plumbob.door.calibrate import calibrate, read_track
from plumbob.noise import deviation
from plumbob.noise.report import log_ticks
from plumbob.papers.description import FIN
from plumbob.papers.fin.algorithm import slope
from plumbob.papers.fin.attitude import ANGLES, LIVE, NAMES, Part, errors_deg, fin_unit, integrated, line, without_noise
from plumbob.papers.fin.records import LENGTH, RATE, gyr_rates
from plumbob.papers.outcome import at_most
from plumbob.papers.workspace import Work, recorded_samples
from plumbob.reporting.style import MUTED, SERIES
from plumbob.rotations import Frame, euler_zyx_from_quat
from plumbob.simulation import EulerMotion, Motion, Scenario, Simulation, draw_module, simulate
from plumbob.simulation.signals import Moves, Stack, constant

if TYPE_CHECKING:
    from matplotlib.figure import FigureBase

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


def _angles(imu: ImuData) -> Floats:
    """Yaw, pitch and roll (N, 3) by integration from level, degrees."""
    return to_deg(euler_zyx_from_quat(integrated(imu).q_nb))


def _through_bytes(work: Work, name: str, made: Simulation) -> ImuData:
    return recorded_samples(work.sent("fin", name, made).recording)


def clipping(work: Work) -> Part:
    """A swim at twice the frequency, which the ADXRS290's range cuts off, for 20 s through bytes."""
    taken = work.recorded(
        "fin", "fast", session=LIVE, unit="calibrated", duration=20.0, scenario="fin", set={"frequency": "1 Hz"}
    )
    imu = recorded_samples(taken.recording)
    made = simulate("fin", frame="NED", sensors="ideal", unit="calibrated", seed=0, duration=20.0, frequency=1.0)
    true, said = to_dps(gyr_rates(made.imu)), to_dps(gyr_rates(imu))
    at_end = (np.abs(said[:, :2]) >= 100.0).any(axis=1) | (np.abs(said[:, 2]) >= 300.0)
    flagged = (imu.flags & np.uint32(flags.GYR_CLIPPED)) != 0
    slow = without_noise(duration="4 s").peaks  # rates grow with the frequency, which is 0.5 Hz here
    outcomes = [
        *(FIN.row(f"clip.peak.{axis}", faithful=float(np.abs(true[:, i]).max())) for i, axis in enumerate("xy")),
        FIN.row("clip.missed", best=float(np.sum(at_end & ~flagged))),
        FIN.row("clip.share", best=100.0 * float(np.mean(flagged))),
        FIN.row("clip.error", faithful=float(np.abs(errors_deg(integrated(imu), read_track(taken.truth))).max())),
        FIN.row("clip.limit", best=0.5 * 100.0 / float(slow[:2].max())),
    ]

    def draw(canvas: "FigureBase") -> None:
        first = imu.t <= 2.0
        for i, (ax, name) in enumerate(zip(canvas.subplots(1, 2, sharey=True), "xy", strict=True)):
            ax.plot(imu.t[first], true[first, i], color=MUTED, linewidth=0.9, linestyle="--")
            ax.plot(imu.t[first], said[first, i], color=SERIES[i], linewidth=1.2)
            ax.set_ylabel(FIN.text("rate_s", name=name))

    return FIN.part("clipping", figures=[FIN.figure("rates_at_1", draw)]), outcomes


def high_pass(work: Work, still: Path) -> Part:
    """A turn and a rest, without and with a high-pass, through bytes.

    Parameters
    ----------
    work : Work
        Of the run.
    still : Path
        Recording at rest without a high-pass.
    """
    low, high = CORNERS
    yaw: dict[float, Floats] = {}
    t = np.empty(0)
    for corner in (0.0, low, high):
        unit = fin_unit(work.seed)
        unit = unit.with_high_pass(corner) if corner else unit
        made = simulate(Turn(), frame="NED", sensors=unit, unit="calibrated", seed=work.seed)
        imu = made.imu if corner == high else _through_bytes(work, f"turn-{corner:g}", made)
        t, yaw[corner] = imu.t, _angles(imu)[:, 0]
    passed = work.recorded("fin", "still-high-pass", high_pass=high, **AT_REST).recording
    n = np.unique(np.append(np.geomspace(1, 55_000, 80).astype(np.int64), 25_000))
    tau, dev, slopes, late = n / RATE, {}, {}, {}
    for corner, path in ((0.0, still), (high, passed)):
        rates = np.ascontiguousarray(to_dps(gyr_rates(recorded_samples(path)))[:, 2])
        dev[corner] = deviation(rates, n)
        use = (tau >= 2.0) & (tau <= 20.0)
        slopes[corner], late[corner] = slope(tau[use], dev[corner][use]), float(np.interp(50.0, tau, dev[corner]))
    outcomes = [
        FIN.row("highpass.hold.free", faithful=turned_without_noise(low)),
        FIN.row("highpass.hold", faithful=float(yaw[low][-1]), best=float(yaw[0.0][-1])),
        FIN.row("highpass.slope", faithful=slopes[high], best=slopes[0.0]),
        FIN.row("highpass.sigma", faithful=late[high], best=late[0.0], faithful_bar=at_most(0.1 * late[0.0])),
    ]

    def draw(canvas: "FigureBase") -> None:
        yaw_ax, allan_ax = canvas.subplots(1, 2)
        for corner, colour in zip((0.0, low, high), SERIES, strict=False):
            line(yaw_ax, t, yaw[corner], colour, linewidth=1.2)
        for corner, colour in ((0.0, SERIES[0]), (high, SERIES[2])):
            allan_ax.loglog(tau, dev[corner], color=colour, linewidth=1.2)
        for axis in (allan_ax.xaxis, allan_ax.yaxis):
            log_ticks(axis, (1,))

    return FIN.part("high_pass", figures=[FIN.figure("what_a_high", draw)]), outcomes


def turned_without_noise(corner: float) -> float:
    """Yaw at the end of the turn and hold behind a high-pass, noise-free and not rounded, degrees."""
    unit = draw_module("ideal", 0).with_high_pass(corner)
    return float(_angles(simulate(Turn(), frame="NED", sensors=unit, unit="calibrated", seed=0).imu)[-1, 0])


def temperature(work: Work) -> Part:
    """Warm up twice from cold; the first record makes the card, the second is scored.

    At 100 Hz: the temperature of a fin takes two minutes to settle.
    """
    unit = fin_unit(work.seed)
    assert unit.gyr is not None
    warm = replace(unit, gyr=replace(unit.gyr, bias_per_k=TEMPCO))
    how: dict[str, Any] = {"sensors": warm, "unit": "random", "rate": 100.0, "warm_up": WARM_UP}
    imus: list[ImuData] = []
    for number, duration in enumerate((600.0, LENGTH)):
        made = simulate("static", frame="NED", seed=work.seed + number, duration=duration, **how)
        imus.append(_through_bytes(work, f"warm-{number + 1}", made))
    card = calibrate(imus[0], "temperature", device=imus[0].meta.device).card
    assert card.gyr is not None
    t, records = imus[1].t, (imus[1], apply_card(card, imus[1]))
    before, after = (
        to_dps(gyr_rates(imu)[: 500 * (len(imu) // 500)].reshape(-1, 500, 3).mean(axis=1)) for imu in records
    )
    angles = [_angles(imu) for imu in records]
    outcomes = []
    for i, axis in enumerate("xyz"):
        uncorrected, corrected = (abs(float(np.mean(rates[-10:, i]))) for rates in (before, after))
        outcomes.append(
            FIN.row(f"warm.{axis}", faithful=uncorrected, best=corrected, best_bar=at_most(0.5 * uncorrected))
        )
    rows = [[NAMES[name], *(f"{np.max(np.abs(of[:, i])):.3f}" for of in angles)] for i, name in enumerate(ANGLES)]
    slopes = [
        [FIN.text("assumed"), *(f"{v:.4f}" for v in to_dps(TEMPCO))],
        [FIN.text("found_from_the_first"), *(f"{v:.4f}" for v in to_dps(np.atleast_2d(card.gyr.bias_per_k)[0]))],
    ]
    tables = [
        FIN.table("largest_error_of", rows),
        FIN.table("bias_per_kelvin", slopes, head=(FIN.text("axis"), *"xyz")),
    ]

    def draw(canvas: "FigureBase") -> None:
        rate_ax, error_ax = canvas.subplots(1, 2)
        middle = 5.0 * (np.arange(before.shape[0]) + 0.5)
        for i, colour in zip(range(3), SERIES, strict=False):
            for rates, dash in ((before, "--"), (after, "-")):
                rate_ax.plot(middle, rates[:, i], color=colour, linestyle=dash, linewidth=1.1)
            for errors, dash in zip(angles, ("--", "-"), strict=True):
                line(error_ax, t, errors[:, 2 - i], colour, linestyle=dash, linewidth=1.1)

    return FIN.part("temperature", tables=tables, figures=[FIN.figure("warm_up_before", draw)]), outcomes
