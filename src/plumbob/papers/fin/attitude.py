"""Page of the fin's attitude: real-time angles [Ou2017] (abstract, §1, §4), and each axis integrated on its own."""

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.units import to_deg, to_dps
from plumbob.data import AttitudeTrack, ImuData
from plumbob.door.calibrate import read_track
from plumbob.door.estimate import estimate
from plumbob.evaluation.metrics import euler_errors
from plumbob.files import write
from plumbob.filters import Filter
from plumbob.live.replay import replay
from plumbob.live.rigs.rig import fitted
from plumbob.papers.description import FIN
from plumbob.papers.fin.records import LENGTH, RATE, gyr_rates
from plumbob.papers.outcome import Outcome
from plumbob.papers.workspace import Work
from plumbob.protocols.find import find_format
from plumbob.reporting.report import Report
from plumbob.reporting.style import SERIES
from plumbob.rotations import Frame, euler_zyx_from_quat, quat_conjugate, quat_multiply, quat_normalize
from plumbob.simulation import Module, draw_module, simulate

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

Step = Callable[[str], None]
Part = tuple[Report, list[Outcome]]

PARTS: Final = "adxrs290+adxrs453"
ANGLES: Final = ("yaw", "pitch", "roll")
NAMES: Final = FIN.texts("attitude_names")
LIVE: Final = '\n[imu]\nframe = "NED"\n[estimate]\nfilter = "integrate"\ninit = "level"\n'
"""Of a session that estimates while it records: quaternion integration from a level start."""
_COLUMNS = 900
_PAGE: Final = {"yaw": 1.23, "pitch": 0.38, "roll": 0.26}
"""Errors that an earlier prototype had with noise of its own, degrees, for comparison alone."""


def part(work: Work, step: Step, seeds: int) -> tuple[list[Part], int]:
    """Both parts with their outcomes, and how many samples the swim had when it was decoded.

    Parameters
    ----------
    work : Work
        Of the run.
    step : callable
        Called before each step with its name.
    seeds : int
        Of swims with noise, simulated directly.
    """
    step("attitude while swimming")
    free, swum = without_noise(), swim(work)
    step("attitude over seeds")
    noisy, swinging = over_seeds(work, seeds), over_seeds(work, seeds, twist="0 deg")
    return [_real_time(swum, free, noisy[0], seeds), _per_axis(free, noisy[1], swinging)], swum.samples


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
    cone = coning()
    outcomes = [
        FIN.row("live.same", faithful=float(swum.same_live)),
        FIN.row("live.text", faithful=float(swum.same_text)),
    ]
    for axis, (name, value) in enumerate(live.items()):
        outcomes.append(FIN.row(f"swim.{name}", faithful=value, best=float(noisy[axis])))
        outcomes.append(FIN.row(f"swim.free.{name}", best=quiet[name]))
    outcomes.append(FIN.row("coning", best=cone))
    rows = [
        [NAMES[name], f"{quiet[name]:.7f}", f"{live[name]:.3f}", f"{noisy[i]:.3f}", f"{_PAGE[name]:.2f}"]
        for i, name in enumerate(ANGLES)
    ]
    figure = FIN.figure("yaw_pitch_and", partial(_draw_swim, swum=swum))
    report = FIN.part("real_time", tables=[FIN.table("largest_error_in", rows, seeds=seeds)], figures=[figure])
    return report, outcomes


def _draw_swim(canvas: "FigureBase", swum: Swum) -> None:
    top, bottom = canvas.subplots(2, 1)
    first = swum.t <= 6.0
    for axis, colour in zip(range(3), SERIES, strict=False):
        top.plot(swum.t[first], swum.live[first, axis], color=colour, linewidth=1.2)
        line(bottom, swum.t, swum.errors[:, axis], colour)


def line(ax: "Axes", t: Floats, y: Floats, colour: str, **how: Any) -> None:
    """Draw a line of many samples, thinned to its envelope."""
    from plumbob.reporting.drawing import envelope

    ax.plot(*envelope(t, y, _COLUMNS), color=colour, **{"linewidth": 0.9, **how})


def _per_axis(free: PerAxis, noisy: Floats, swinging: tuple[Floats, Floats]) -> Part:
    axis, quiet = largest(free.axis), largest(free.quaternion)
    outcomes = [FIN.row(f"axis.{name}", faithful=axis[name], best=quiet[name]) for name in ("pitch", "yaw")]
    outcomes.append(FIN.row("axis.swing", faithful=float(swinging[1][0]), best=float(swinging[0][0])))
    rows = [
        [FIN.text("swing_and_twist_noise"), *(f"{axis[n]:.1f}" for n in ANGLES)],
        [FIN.text("swing_and_twist_with"), *(f"{v:.1f}" for v in noisy)],
        [FIN.text("pure_swing_with_noise"), *(f"{v:.2f}" for v in swinging[1])],
    ]
    table = FIN.table("largest_error_when", rows, head=(FIN.text("motion"), *(NAMES[n] for n in ANGLES)))

    def draw(canvas: "FigureBase") -> None:
        ax = canvas.subplots()
        line(ax, free.t, free.axis[:, 0], SERIES[0])
        line(ax, free.t, free.axis[:, 1], SERIES[1])
        line(ax, free.t, free.quaternion[:, 0], SERIES[2], linewidth=1.4)

    return FIN.part("per_axis", tables=[table], figures=[FIN.figure("per_axis_integration", draw)]), outcomes
