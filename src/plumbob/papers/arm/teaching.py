"""A machine is taught by hand: bytes of six units on its links become joint angles, a program, and a model that moves.

The paper's system ends with the attitude of one place of an arm; what it is for, a program for a robot, is done here.
"""

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from plumbob.arm import JointTrack, align, export, replay, run, taught, urdf_text
from plumbob.arm.program import Program
from plumbob.arm.replayed import HandError, Replay
from plumbob.core.check import Floats
from plumbob.core.files import write_text
from plumbob.core.units import deg, to_deg
from plumbob.data.chain import Chain
from plumbob.data.chain_toml import load_chain
from plumbob.door.reading import read_array
from plumbob.papers.arm.simulated import ALL
from plumbob.papers.description import ARM
from plumbob.papers.outcome import Part
from plumbob.papers.workspace import Work
from plumbob.reporting.arm import stick_figure
from plumbob.reporting.content import INK, SERIES, SOFT
from plumbob.rotations import quat_conjugate, quat_multiply, rotvec_from_quat, wrap

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

WORLD: Final = {"mount_angle": "5 deg", "mount_shift": "2 cm", "bend": "20 uT"}
"""Units sit up to 5° and 2 cm from where the chain says, in a field that iron bends."""
_INSTANT: Final = {"mean_rate": False}  # a frame of the rig has the rate at its time
_HELD: Final = deg(0.5)
_DASHES: Final = (0.0, (5.0, 5.0))  # long enough to tell a line from the one below
_STILL: Final = 1.8
"""The program of alignment begins with two seconds at zero, s."""


@dataclass(frozen=True, slots=True)
class Taught:
    """What a teach-in gave.

    `chain`: the machine as it is known; `joints`, `true`: joint angles and hand, estimated and true, at the same
    times; `program`: what was exported; `model`: what the URDF does with it; `hand`: distance of that hand from the
    true one; `residual`: greatest distance of both kinematics, the chain's and the URDF's, m; `mounts_deg`: rms of
    the units' mounting errors before and after alignment, deg; `files`: what was written.
    """

    chain: Chain
    joints: JointTrack
    true: JointTrack
    program: Program
    model: Replay
    hand: HandError
    residual: float
    mounts_deg: tuple[float, float]
    files: tuple[Path, ...]

    @property
    def errors_deg(self) -> Floats:
        """Of the joint angles (N, K), deg."""
        return np.asarray(to_deg(wrap(self.joints.angles - self.true.angles)))

    @property
    def hand_away(self) -> Floats:
        """Distance (N,) of the estimated hand from the true one, m."""
        assert self.joints.hand is not None
        assert self.true.hand is not None
        distance: Floats = np.linalg.norm(self.joints.hand - self.true.hand, axis=1)
        return distance


def teach(work: Work, *, duration: float | None = None) -> Taught:
    """Align the units on one recording of `duration`, s, estimate another one, export its program, and replay it."""
    how: dict[str, Any] = {"session": ALL, "set": WORLD, "unit": "calibrated", "duration": duration}
    first = work.recorded("teach", "align", scenario="calibration", **how)
    take = work.recorded("teach", "teach", **how)
    chain = load_chain(take.truth.with_suffix(".chain.toml"))
    pose = 0.0, _STILL, [0.0] * len(chain.angles)
    card = align(chain, read_array(first.recording), poses=[pose], pose_sd=_HELD, params=_INSTANT)
    card.save(work.folder / "arm.card.json", overwrite=True)
    true = JointTrack.load(take.truth.with_stem(f"{take.truth.stem}-angles"))
    start = true.angles[0].tolist()
    joints = run(card, read_array(take.recording), frame="NED", pose=start, pose_sd=_HELD, params=_INSTANT).joints
    program = taught(joints, chain, rate="100 Hz")
    files = tuple(work.folder / f"program.{kind}" for kind in ("csv", "yaml", "mcap", "urdf"))
    for path in files[:3]:
        export(program, path, overwrite=True)
    write_text(files[3], urdf_text(chain), overwrite=True)
    loaded = Program.load(files[0])
    model, ours = replay(loaded, files[3]), replay(loaded, chain)
    assert true.hand is not None
    placed = load_chain(take.truth.with_name(f"{take.truth.stem}-true.chain.toml"))
    return Taught(
        chain,
        joints,
        true,
        program,
        model,
        model.against(true.t, true.hand),
        float(np.abs(model.hand - ours.hand).max()),
        (_mount_rms(chain, placed), _mount_rms(card.chain, placed)),
        files,
    )


def _mount_rms(chain: Chain, other: Chain) -> float:
    """Rms of the angles between the mounts of two chains, deg."""
    pairs = [(a.mount.q_bs, b.mount.q_bs) for a, b in zip(chain.segments, other.segments, strict=True) if a.unit]
    turns = [rotvec_from_quat(quat_multiply(quat_conjugate(np.array(a)), np.array(b))) for a, b in pairs]
    return float(to_deg(np.sqrt(np.mean(np.sum(np.square(turns), axis=1)))))


def part(done: Taught) -> Part:
    """The teach-in as a part of the page."""
    names, errors, hand = done.program.names, done.errors_deg, done.hand_away
    angles = to_deg(done.true.angles)
    values = {
        "mounts": done.mounts_deg[1],
        "angles.rms": float(np.sqrt(np.mean(errors**2))),
        "angles.max": float(np.abs(errors).max()),
        "hand.rms": 1e3 * float(np.sqrt(np.mean(hand**2))),
        "hand.max": 1e3 * float(hand.max()),
        "program": 100.0 * done.hand.rms_share,
        "limits": 100.0 * max(done.program.used(done.chain).values()),
        "stops": float(len(done.program.stops)),
        "replay": 1e3 * done.residual,
    }
    rows = []
    for k, name in enumerate(names):
        span = f"{angles[:, k].min():.1f}", f"{angles[:, k].max():.1f}"
        error = errors[:, k]
        rows.append((name, *span, f"{np.sqrt(np.mean(error**2)):.2f}", f"{np.abs(error).max():.2f}"))
    truth, estimate, program = ARM.text("truth"), ARM.text("estimate"), ARM.text("program")
    key = [(truth, SOFT, "solid"), (estimate, SERIES[0], "solid"), (program, SERIES[1], "dashed")]
    by_joint = [*((name, SERIES[k], "solid") for k, name in enumerate(names)), (ARM.text("hand"), INK, "solid")]
    caption, shadow = ARM.text("motion_of_the_machine"), done.true.angles
    report = ARM.part(
        "teaching",
        mounts_deg=done.mounts_deg[0],
        done_mounts_deg=done.mounts_deg[1],
        files=", ".join(path.name for path in done.files),
        tables=[ARM.table("joint_angles", rows)],
        figures=[
            ARM.figure("joint_angles_over", partial(_draw_angles, done), lines=key),
            ARM.figure("position_of_the", partial(_draw_hand, done), lines=key),
            ARM.figure("errors_of_the", partial(_draw_errors, done), lines=by_joint),
        ],
        scenes=[stick_figure(done.chain, done.joints.t, done.joints.angles, shadow=shadow, caption=caption)],
    )
    return report, ARM.rows({f"teach.{name}": (None, value) for name, value in values.items()})


_EVERY: Final = slice(None, None, 6)


def _draw_angles(done: Taught, canvas: "FigureBase") -> None:
    panels = canvas.subplots(len(done.program.names), 1, sharex=True)
    for k, (ax, name) in enumerate(zip(panels, done.program.names, strict=True)):
        true, estimated, program = (to_deg(of.angles[_EVERY, k]) for of in (done.true, done.joints, done.program))
        _three(ax, done, true, estimated, np.asarray(done.program.recorded), program)
        ax.set_ylabel(f"{name} [°]")
    panels[-1].set_xlabel("time [s]")


def _draw_hand(done: Taught, canvas: "FigureBase") -> None:
    panels = canvas.subplots(3, 1, sharex=True)
    assert done.joints.hand is not None
    assert done.true.hand is not None
    for k, ax in enumerate(panels):
        true, estimated, program = (hand[_EVERY, k] for hand in (done.true.hand, done.joints.hand, done.model.hand))
        _three(ax, done, true, estimated, done.model.recorded, program)
        ax.set_ylabel(f"{'xyz'[k]} [m]")
    panels[-1].set_xlabel("time [s]")


def _three(ax: "Axes", done: Taught, true: Floats, estimated: Floats, recorded: Floats, program: Floats) -> None:
    """Truth, estimate, and the program at its recorded times (N,)."""
    ax.plot(done.true.t[_EVERY], true, color=SOFT, linewidth=2.6)
    ax.plot(done.joints.t[_EVERY], estimated, color=SERIES[0], linewidth=0.9)
    ax.plot(recorded[_EVERY], program, color=SERIES[1], linewidth=1.0, linestyle=_DASHES)


def _draw_errors(done: Taught, canvas: "FigureBase") -> None:
    ax, hand = canvas.subplots(2, 1, sharex=True)
    for k in range(len(done.program.names)):
        ax.plot(done.joints.t[_EVERY], done.errors_deg[_EVERY, k], color=SERIES[k], linewidth=0.9)
    hand.plot(done.joints.t[_EVERY], 1e3 * done.hand_away[_EVERY], color=INK, linewidth=0.9)
