"""One run through bytes, compared as the paper compares, with an AHRS500GA, and as it could not, with the truth.

The reference sits beside the sensors with its y axis along their x axis, so its attitude is turned by that rotation
before anything is compared. What the paper calls the error is the difference of two devices: the estimate's own error
less the reference's own, and what the reference sits off its declared place is in it too.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.units import deg, to_deg, to_dps
from plumbob.data import AttitudeTrack
from plumbob.door.calibrate import read_track
from plumbob.door.estimate import estimate
from plumbob.live.emulated import unit_file
from plumbob.live.rigs.plan import PLANS
from plumbob.papers.description import ROD
from plumbob.papers.outcome import Part, at_most
from plumbob.papers.rod.methods import LIMIT, SETTLE, SHAKEN, tilt_errors
from plumbob.papers.workspace import Taken, Work
from plumbob.protocols.format_toml import find_format
from plumbob.reporting.content import INK, MUTED, SERIES, SHADE, SOFT, Both, Figure
from plumbob.rotations import (
    euler_zyx_from_quat,
    quat_conjugate,
    quat_from_dcm,
    quat_from_euler_zyx,
    quat_multiply,
    quat_rotate,
    rotvec_from_quat,
    wrap,
)
from plumbob.simulation.presets import draw_module

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

BASE: Final = 0.61035e-3
"""Time base of the register SMPL_PRD, s, which the catalogue states in words."""
SESSION: Final = """
[imu]
device = "adis16355 #{seed}"
frame = "NED"

[reference]
north = "true"
unit = "ref"
"""
"""What the session of the rod says beside its format."""
RIG: Final[Mapping[str, Any]] = {"unit": "random", "warm_up": "15 K, 120 s", "mount_error": "0.2 deg"}
"""A unit as it left the line, warming up, beside a reference that sits 0.2° (1 sd) about each axis off its place."""
DOWN: Final = np.array([0.0, 0.0, 1.0])
_Q_BR: Final = np.array(PLANS["rod"].units[1].q_bs)
_BLUE, _RED, _GREEN = SERIES[:3]
_COLUMNS = 900


class EstimateLine(NamedTuple):
    """An estimate: its name, the filter, and its parameters."""

    name: Both
    filter: str
    params: Mapping[str, Any]


LINES: Final[Mapping[str, EstimateLine]] = {
    "accel": EstimateLine(ROD.text("accelerometer_only"), "tilt_compass", {}),
    "gyro": EstimateLine(ROD.text("gyroscope_only"), "integrate", {}),
    "ekf7": EstimateLine(ROD.text("ekf7_faithful"), "ekf7", {}),
    "mekf": EstimateLine(ROD.text("mekf_causal"), "mekf", {}),
    "smoother": EstimateLine(ROD.text("smoother_best"), "smoother", {}),
}
"""What is estimated from the recording, as `plumbob run` does."""


@dataclass(frozen=True, eq=False)
class Compared:
    """The run.

    `taken`: its files; `t` (N,): times, s, from the first sample; `tracks` (N, 4): attitudes of `LINES`, body to
    NED; `truth`: true attitude, with the true bias; `ahrs`, `ahrs_true` (N, 4): attitude of the reference in its
    own axes, as its packets say it and as it is; `rest` (N,): where the detector of "ekf7" finds rest; `bias` (N,
    3): bias that "ekf7" estimates, rad/s.
    """

    taken: Taken
    t: Floats
    tracks: Mapping[str, Floats]
    truth: AttitudeTrack
    ahrs: Floats
    ahrs_true: Floats
    rest: NDArray[np.bool_]
    bias: Floats

    @property
    def reference(self) -> Floats:
        """Attitude of the body by the reference (N, 4), with the mounting that is declared."""
        return mapped(self.ahrs)

    @property
    def mounting(self) -> Floats:
        """Rotation (4,) from the body's axes to those in which the reference says its attitude, found from gravity."""
        return mount_from_gravity(self.reference[self.scored], self.tracks["smoother"][self.scored])

    @property
    def true_mounting(self) -> Floats:
        """What `mounting` would be for sensors without an error (4,)."""
        return np.asarray(quat_multiply(quat_conjugate(mapped(self.ahrs_true[:1])), self.truth.q_nb[:1])[0])

    @property
    def scored(self) -> NDArray[np.bool_]:
        """Samples after the first second."""
        return np.asarray(self.t >= SETTLE)

    def errors(self, estimate: Floats, by: Floats) -> Floats:
        """Errors of roll and pitch (2, M), °, of the scored samples."""
        return tilt_errors(estimate[self.scored], by[self.scored])


def mapped(q_nr: Floats) -> Floats:
    """Attitude of the body (N, 4) from that of the reference in its own axes: q_nb = q_nr ⊗ q_rb."""
    return quat_multiply(q_nr, quat_conjugate(_Q_BR))


def permuted(q_nr: Floats) -> Floats:
    """What exchanging its angles makes of it: the body's roll is the reference's pitch, its pitch less the roll."""
    yaw, pitch, roll = euler_zyx_from_quat(q_nr).T
    return quat_from_euler_zyx(np.stack((yaw + 0.5 * np.pi, -roll, pitch), axis=-1))


def permutation_error(roll: Floats, pitch: Floats, by: Callable[[Floats], Floats] = permuted) -> Floats:
    """Errors of roll and pitch (2, N), °, of exchanged angles, or by another way, at true angles (N,), rad."""
    q_nb = quat_from_euler_zyx(np.stack((np.zeros_like(roll), pitch, roll), axis=-1))
    q_nr = quat_multiply(q_nb, _Q_BR)
    return tilt_errors(by(q_nr), q_nb)


def mount_from_gravity(q_ref: Floats, q_est: Floats) -> Floats:
    """Rotation (4,) that the reference's attitudes (N, 4) lack to show gravity where the estimate does.

    It needs no heading: it is the least-squares rotation of one set of vertical directions onto the other.
    """
    ours, theirs = (quat_rotate(quat_conjugate(q), DOWN) for q in (q_est, q_ref))
    u, _, vt = np.linalg.svd(theirs.T @ ours)
    turn = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
    return np.asarray(quat_from_dcm(turn))


def compared(work: Work, duration: float = 600.0) -> Compared:
    """Emulate the rig into bytes, record them by a session, and estimate from the recording."""
    taken = work.recorded("rod", "rod", session=SESSION.format(seed=work.seed), duration=duration, **RIG)
    tracks, estimation = {}, None
    for key, line in LINES.items():
        estimation = estimate(taken.recording, line.filter, params=line.params)
        tracks[key] = estimation.track
    assert estimation is not None
    assert estimation.reference is not None
    truth, ahrs_true = (read_track(path) for path in (taken.truth, unit_file(taken.truth, "ref")))
    soft = tracks["ekf7"]
    assert soft.flags is not None
    assert soft.bias_b is not None
    return Compared(
        taken,
        soft.t - soft.t[0],
        {key: track.q_nb for key, track in tracks.items()},
        truth,
        estimation.reference.q_nb,
        ahrs_true.q_nb,
        (soft.flags & flags.AT_REST) != 0,
        soft.bias_b,
    )


class Budget(NamedTuple):
    """Parts of a difference between an estimate and the reference: largest and rms of roll and pitch, °."""

    name: Both
    largest: Floats
    rms: Floats

    @property
    def cells(self) -> list[str]:
        """Both, for a table."""
        return [f"{v:.3f}" for v in (*self.largest, *self.rms)]


def budget(run: Compared, key: str) -> list[Budget]:
    """What the paper's difference consists of, for one estimate."""
    truth, q_nb = run.truth.q_nb, run.tracks[key]
    parts = (
        (ROD.text("estimate_ahrs_as_the"), run.errors(q_nb, run.reference)),
        (ROD.text("estimate_ahrs_axes_aligned"), run.errors(q_nb, quat_multiply(run.reference, run.mounting))),
        (ROD.text("estimate_truth"), run.errors(q_nb, truth)),
        (ROD.text("ahrs_truth"), run.errors(run.reference, truth)),
        (ROD.text("it_the_ahrs_itself"), tilt_errors(run.ahrs[run.scored], run.ahrs_true[run.scored])),
        (ROD.text("it_how_it_is"), run.errors(mapped(run.ahrs_true), truth)),
    )
    return [Budget(name, np.abs(e).max(axis=1), np.sqrt((e**2).mean(axis=1))) for name, e in parts]


def reference_rms(count: int = 400) -> tuple[float, float]:
    """Root mean square errors, °, of the heading and of the tilt that the emulated reference gives in runs of 60 s."""
    errors = draw_module("ahrs500ga", 1).attitude
    assert errors is not None
    q_nb = quat_from_euler_zyx(np.tile([0.3, -0.1, 0.2], (60, 1)))
    every = [wrap(errors.said(q_nb, seed=seed, rate=1.0) - euler_zyx_from_quat(q_nb)) for seed in range(count)]
    heading, *tilts = to_deg(np.sqrt((np.array(every) ** 2).mean(axis=(0, 1))))
    return float(heading), float(np.sqrt(np.mean(np.square(tilts))))


def system(run: Compared) -> Part:
    """The measuring system: rates, packets, accuracy of the reference."""
    reset = next(register.reset for register in find_format("adis16355").registers if register.name == "SMPL_PRD")
    assert reset is not None
    packet = find_format("ahrs500ga").messages[0]
    step = float(np.median(np.diff(run.t)))
    heading, tilt = reference_rms()
    outcomes = ROD.rows(
        {
            "chain.sps": 1.0 / (BASE * (reset + 1)),
            "ref.heading": heading,
            "ref.tilt": tilt,
            "chain.ahrs_rate": 1.0 / step,
            "chain.packet": float(packet.length),
            "chain.first": next(field.at for field in packet.fields if field.name == "roll") + 1.0,
            "chain.synchronous": 100.0 * float(np.isfinite(run.ahrs).all(axis=1).mean()),
            "chain.step": step,
            "chain.duration": float(run.t[-1]) + step,
        }
    )
    return ROD.part("system", tables=[ROD.table("chain_and_what")]), outcomes


def part(run: Compared) -> Part:
    """What the paper's comparison gives on the recording, and what it is made of; Figure 6."""
    faithful, best = budget(run, "ekf7"), budget(run, "smoother")
    figures: dict[str, float | tuple[float | None, float]] = {}
    for i, axis in enumerate(("roll", "pitch")):
        for key, k in (("ahrs", 0), ("truth", 2)):
            figures[f"bytes.{key}.{axis}"] = float(faithful[k].largest[i]), float(best[k].largest[i])
    for key in ("accel", "gyro"):
        figures[f"bytes.{key}"] = float(np.abs(run.errors(run.tracks[key], run.truth.q_nb)).max())
    for key, k in (("reference", 3), ("own", 4), ("mounted", 5)):
        theirs, ours = (100.0 * float((p[k].rms ** 2).sum() / (p[0].rms ** 2).sum()) for p in (faithful, best))
        figures[f"bytes.share.{key}"] = theirs, ours
    outcomes = ROD.rows(figures)
    true = run.truth.bias_b
    assert true is not None
    late = run.t > run.t[-1] - 100.0
    after, before = (float(to_deg(np.sqrt((bias[late] ** 2).mean()))) for bias in (run.bias - true, true))
    outcomes.append(ROD.row("bytes.bias", faithful=after, faithful_bar=at_most(before), was=before))
    rows = []
    for key, line in LINES.items():
        parts = budget(run, key)
        for p in parts[:3] if key in ("ekf7", "mekf", "smoother") else parts[2:3]:
            rows.append([ROD.text("line_and_part", name=line.name, part_name=p.name), *p.cells])
    rows += [[p.name, *p.cells] for p in faithful[3:]]
    estimated, declared = (
        ", ".join(f"{v:.2f}".replace("-", "−") for v in to_deg(rotvec_from_quat(q)))
        for q in (run.mounting, run.true_mounting)
    )
    draws = {
        "figure_6": partial(_angles, run, 2),
        "figure_6_c": partial(_angles, run, 1),
        "errors_against_the": partial(_errors, run),
        "differences_to_the": partial(_differences, run),
        "motion_state_and": partial(_bias, run),
    }
    report = ROD.part(
        "compared",
        mean=100.0 * run.rest.mean(),
        estimated=estimated,
        true=declared,
        tables=[ROD.table("what_the_paper", rows)],
        figures=[ROD.figure(key, draw) for key, draw in draws.items()],
    )
    return report, outcomes


ZOOM: Final = 380.0, 420.0
"""Window of the enlargements, s: the vibration begins in its middle."""
CLOSE: Final = 405.5, 409.5
"""Window in which the lines can be distinguished, s."""


def _line(ax: "Axes", t: Floats, y: Floats, jump: float = np.inf, **style: Any) -> None:
    from plumbob.reporting.drawing import envelope

    ax.plot(*envelope(t, y, _COLUMNS, jump=jump), linewidth=0.8, **style)


def _angles(run: Compared, column: int, canvas: "FigureBase") -> None:
    full, near, close = canvas.subplots(3, 1)
    lines: tuple[tuple[Floats, dict[str, Any]], ...] = (
        (run.tracks["accel"], {"color": SOFT}),
        (run.reference, {"color": INK}),
        (run.tracks["ekf7"], {"color": _BLUE}),
        (run.tracks["smoother"], {"color": _GREEN, "linestyle": "--"}),
    )
    for ax, window in ((full, (0.0, float(run.t[-1]))), (near, ZOOM), (close, CLOSE)):
        inside = (run.t >= window[0]) & (run.t <= window[1])
        for q_nb, style in lines:
            _line(ax, run.t[inside], to_deg(euler_zyx_from_quat(q_nb[inside])[:, column]), **style)
        ax.set_xlim(*window)
        if window[0] <= SHAKEN <= window[1]:
            ax.axvline(SHAKEN, color=MUTED, linewidth=0.6, linestyle=":")
    inside = (run.t >= CLOSE[0]) & (run.t <= CLOSE[1])
    if inside.any():
        shown = to_deg(euler_zyx_from_quat(run.reference[inside])[:, column])
        close.set_ylim(float(shown.min()) - 2.0, float(shown.max()) + 2.0)


def _pair(ax: "Axes", t: Floats, errors: Floats, most: float | None = None) -> None:
    for error, colour in zip(errors, (_BLUE, _RED), strict=True):
        _line(ax, t, error, jump=180.0, color=colour)
    for limit in (-LIMIT, LIMIT):
        ax.axhline(limit, color=MUTED, linewidth=0.7, linestyle="--")
    ax.axvline(SHAKEN, color=MUTED, linewidth=0.6, linestyle=":")
    ax.set_xlim(0.0, t[-1])
    if most is not None:
        ax.set_ylim(-most, most)


def _errors(run: Compared, canvas: "FigureBase") -> None:
    limits = {"accel": None, "gyro": None, "ekf7": 1.4, "smoother": 1.4}
    for ax, (key, most) in zip(canvas.subplots(len(limits), 1, sharex=True), limits.items(), strict=True):
        _pair(ax, run.t[run.scored], run.errors(run.tracks[key], run.truth.q_nb), most)


def _differences(run: Compared, canvas: "FigureBase") -> None:
    pairs = (run.tracks["ekf7"], run.reference), (run.reference, run.truth.q_nb)
    for ax, pair in zip(canvas.subplots(len(pairs), 1, sharex=True), pairs, strict=True):
        _pair(ax, run.t[run.scored], run.errors(*pair), 1.4)


def _bias(run: Compared, canvas: "FigureBase") -> None:
    from plumbob.reporting.drawing import runs

    assert run.truth.bias_b is not None
    axes = canvas.subplots(3, 1, sharex=True)
    rests = runs(run.t, run.rest, _COLUMNS)
    for i, (ax, axis) in enumerate(zip(axes, "xyz", strict=True)):
        ax.broken_barh(rests, (0.0, 1.0), transform=ax.get_xaxis_transform(), facecolors=SHADE, linewidth=0, zorder=0)
        _line(ax, run.t, to_dps(run.truth.bias_b[:, i]), color=SOFT)
        _line(ax, run.t, to_dps(run.bias[:, i]), color=_BLUE)
        ax.set_ylabel(ROD.text("bias_s", axis=axis))
        ax.set_xlim(0.0, run.t[-1])
        low, high = np.percentile(to_dps(run.bias[run.t > 10.0, i]), (0.5, 99.5))
        spread = max(high - low, 0.1)
        ax.set_ylim(low - spread, high + spread)


def exchanged(run: Compared) -> Figure:
    """What exchanging Euler angles costs, by tilt and on the recording."""

    def draw(canvas: "FigureBase") -> None:
        ax, run_ax = canvas.subplots(1, 2)
        tilt = np.linspace(0.0, 35.0, 141)
        by_angles, by_turn = (np.abs(permutation_error(deg(tilt), deg(tilt), by=by)) for by in (permuted, mapped))
        for error, colour in zip((*by_angles, by_turn.max(axis=0)), (_BLUE, _RED, _GREEN), strict=True):
            ax.plot(tilt, error, color=colour, linewidth=1.0)
        ax.axhline(LIMIT, color=MUTED, linewidth=0.7, linestyle="--")
        _pair(run_ax, run.t, tilt_errors(permuted(run.ahrs_true), mapped(run.ahrs_true)))

    return ROD.figure("exchanged_euler_angles", draw)
