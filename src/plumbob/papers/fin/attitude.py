"""Page of the fin's attitude [Ou2017] (abstract, §1, §4): real-time angles, each axis integrated on its own, the chain.

What the chain does to an angle: its range, a high-pass in it, and its temperature.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Final, NamedTuple

import numpy as np

from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.units import deg, dps, to_deg, to_dps
from plumbob.data import AttitudeTrack, ImuData
from plumbob.data.calibrated import apply_card
from plumbob.door.calibrate import calibrate, read_track
from plumbob.door.estimate import estimate
from plumbob.evaluation.metrics import euler_errors
from plumbob.files import write
from plumbob.filters import Filter
from plumbob.live.replay import replay
from plumbob.live.rigs.rig import fitted
from plumbob.noise import deviation
from plumbob.papers.description import FIN
from plumbob.papers.fin.algorithm import slope
from plumbob.papers.fin.records import LENGTH, RATE, gyr_rates
from plumbob.papers.outcome import Part, at_most
from plumbob.papers.workspace import Work, recorded_samples
from plumbob.protocols.format_toml import find_format
from plumbob.reporting.content import MUTED, SERIES
from plumbob.reporting.noise import log_ticks
from plumbob.rotations import Frame, euler_zyx_from_quat, quat_conjugate, quat_multiply, quat_normalize
from plumbob.simulation import EulerMotion, Module, Motion, Scenario, Simulation, draw_module, simulate
from plumbob.simulation.signals import Moves, Stack, constant

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

PARTS: Final = "adxrs290+adxrs453"
ANGLES: Final = ("yaw", "pitch", "roll")
NAMES: Final = FIN.texts("attitude_names")
LIVE: Final = '\n[imu]\nframe = "NED"\n[estimate]\nfilter = "integrate"\ninit = "level"\n'
"""Of a session that estimates while it records: quaternion integration from a level start."""
CORNERS: Final = (0.011, 0.5)
"""Of a high-pass, Hz: the ADXRS290's lowest, and one within the swimming."""
TEMPCO: Final = dps(np.array([0.004, -0.006, 0.004]))
"""Bias per kelvin that is assumed for x, y and z, rad/s/K: no sheet at hand states one."""
WARM_UP: Final = "15 K, 120 s"
AT_REST: Final[Mapping[str, Any]] = {"scenario": "static", "duration": LENGTH, "unit": "calibrated"}
"""Of an emulated record, so that no bias is in it."""
_COLUMNS = 900
_PAGE: Final = {"yaw": 1.23, "pitch": 0.38, "roll": 0.26}
"""Errors that an earlier prototype had with noise of its own, degrees, for comparison alone."""


def part(work: Work, step: Callable[[str], None], seeds: int, still: Path) -> tuple[Part, int]:
    """Attitude and what the chain does to it, and how many samples the swim had when it was decoded.

    `seeds`: of swims with noise, simulated directly; `still`: recording at rest without a high-pass.
    """
    step("attitude while swimming")
    free, swum = without_noise(), swim(work)
    step("attitude over seeds")
    noisy, swinging = over_seeds(work, seeds), over_seeds(work, seeds, twist="0 deg")
    parts = [_real_time(swum, free, noisy[0], seeds), _per_axis(free, noisy[1], swinging)]
    step("clipping")
    parts.append(clipping(work))
    step("high-pass")
    parts.append(high_pass(work, still))
    step("temperature compensation")
    parts.append(temperature(work))
    report = FIN.part("attitude", parts=[report for report, _ in parts])
    return (report, [row for _, rows in parts for row in rows]), swum.samples


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
    """What one swim through bytes gave; times (N,), s, angles and errors (N, 3) of yaw, pitch and roll, degrees.

    `same_live` and `same_text` say whether the replay, and the rates that were stored as TXT and read back, give the
    same attitude to the bit.
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

    `t` (N,): times, s; `axis`, `quaternion` (N, 3): errors of yaw, pitch and roll, degrees; `peaks` (3,): largest
    rates about x, y and z, °/s.
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
    made = simulate("coning", frame="NED", sensors="ideal", unit="calibrated", seed=0, rate=RATE, duration=LENGTH)
    track = integrated(made.imu, made.truth.q_nb[0])
    off = quat_normalize(quat_multiply(quat_conjugate(made.truth.q_nb), track.q_nb))
    return float(to_deg(2.0 * np.max(np.arcsin(np.linalg.norm(off[:, 1:], axis=1)))))


def _real_time(swum: Swum, free: PerAxis, noisy: Floats, seeds: int) -> Part:
    quiet, live = largest(free.quaternion), largest(swum.errors)
    figures: dict[str, float | tuple[float | None, float]] = {
        "live.same": float(swum.same_live),
        "live.text": float(swum.same_text),
    }
    rows = []
    for name, noise in zip(ANGLES, noisy.tolist(), strict=True):
        figures |= {f"swim.{name}": (live[name], noise), f"swim.free.{name}": (None, quiet[name])}
        numbers = f"{quiet[name]:.7f}", f"{live[name]:.3f}", f"{noise:.3f}", f"{_PAGE[name]:.2f}"
        rows.append([NAMES[name], *numbers])
    figures["coning"] = None, coning()

    def draw(canvas: "FigureBase") -> None:
        top, bottom = canvas.subplots(2, 1)
        first = swum.t <= 6.0
        for axis, colour in zip(range(3), SERIES, strict=False):
            top.plot(swum.t[first], swum.live[first, axis], color=colour, linewidth=1.2)
            line(bottom, swum.t, swum.errors[:, axis], colour)

    tables = [FIN.table("largest_error_in", rows, seeds=seeds)]
    return FIN.part("real_time", tables=tables, figures=[FIN.figure("yaw_pitch_and", draw)]), FIN.rows(figures)


def line(ax: "Axes", t: Floats, y: Floats, colour: str, **how: Any) -> None:
    """Draw a line of many samples, thinned to its envelope."""
    from plumbob.reporting.drawing import envelope

    ax.plot(*envelope(t, y, _COLUMNS), color=colour, **{"linewidth": 0.9, **how})


def _per_axis(free: PerAxis, noisy: Floats, swinging: tuple[Floats, Floats]) -> Part:
    axis, quiet = largest(free.axis), largest(free.quaternion)
    outcomes = FIN.rows({f"axis.{name}": (axis[name], quiet[name]) for name in ("pitch", "yaw")})
    outcomes += FIN.rows({"axis.swing": (float(swinging[1][0]), float(swinging[0][0]))})
    rows = [
        [FIN.text("swing_and_twist_noise"), *(f"{axis[n]:.1f}" for n in ANGLES)],
        [FIN.text("swing_and_twist_with"), *(f"{v:.1f}" for v in noisy)],
        [FIN.text("pure_swing_with_noise"), *(f"{v:.2f}" for v in swinging[1])],
    ]
    table = FIN.table("largest_error_when", rows, head=(FIN.text("motion"), *(NAMES[n] for n in ANGLES)))

    def draw(canvas: "FigureBase") -> None:
        ax = canvas.subplots()
        lines = ((free.axis[:, 0], 0.9), (free.axis[:, 1], 0.9), (free.quaternion[:, 0], 1.4))
        for (errors, width), colour in zip(lines, SERIES, strict=False):
            line(ax, free.t, errors, colour, linewidth=width)

    return FIN.part("per_axis", tables=[table], figures=[FIN.figure("per_axis_integration", draw)]), outcomes


@dataclass(frozen=True, kw_only=True)
class Turn(Scenario):
    """A turn of 90° about the vertical within 4 s, and then a hold."""

    rate: ClassVar[float] = RATE
    lasts: ClassVar[float] = LENGTH

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
    outcomes = FIN.rows(
        {
            **{f"clip.peak.{axis}": float(np.abs(true[:, i]).max()) for i, axis in enumerate("xy")},
            "clip.missed": (None, float(np.sum(at_end & ~flagged))),
            "clip.share": (None, 100.0 * float(np.mean(flagged))),
            "clip.error": float(np.abs(errors_deg(integrated(imu), read_track(taken.truth))).max()),
            "clip.limit": (None, 0.5 * 100.0 / float(slow[:2].max())),
        }
    )

    def draw(canvas: "FigureBase") -> None:
        first = imu.t <= 2.0
        for i, (ax, name) in enumerate(zip(canvas.subplots(1, 2, sharey=True), "xy", strict=True)):
            ax.plot(imu.t[first], true[first, i], color=MUTED, linewidth=0.9, linestyle="--")
            ax.plot(imu.t[first], said[first, i], color=SERIES[i], linewidth=1.2)
            ax.set_ylabel(FIN.text("rate_s", name=name))

    return FIN.part("clipping", figures=[FIN.figure("rates_at_1", draw)]), outcomes


def high_pass(work: Work, still: Path) -> Part:
    """A turn and a rest, without a high-pass as in the recording `still`, and with one, through bytes."""
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
    figures: dict[str, float | tuple[float | None, float]] = {
        "highpass.hold.free": turned_without_noise(low),
        "highpass.hold": (float(yaw[low][-1]), float(yaw[0.0][-1])),
        "highpass.slope": (slopes[high], slopes[0.0]),
    }
    bar = at_most(0.1 * late[0.0])
    sigma = FIN.row("highpass.sigma", faithful=late[high], best=late[0.0], faithful_bar=bar)

    def draw(canvas: "FigureBase") -> None:
        yaw_ax, allan_ax = canvas.subplots(1, 2)
        for corner, colour in zip((0.0, low, high), SERIES, strict=False):
            line(yaw_ax, t, yaw[corner], colour, linewidth=1.2)
        for corner, colour in ((0.0, SERIES[0]), (high, SERIES[2])):
            allan_ax.loglog(tau, dev[corner], color=colour, linewidth=1.2)
        for axis in (allan_ax.xaxis, allan_ax.yaxis):
            log_ticks(axis, (1,))

    return FIN.part("high_pass", figures=[FIN.figure("what_a_high", draw)]), [*FIN.rows(figures), sigma]


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
        bar = at_most(0.5 * uncorrected)
        outcomes.append(FIN.row(f"warm.{axis}", faithful=uncorrected, best=corrected, best_bar=bar))
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
