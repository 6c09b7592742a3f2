"""A program moves a model: where the hand goes, by our chain or the URDF's own kinematics, and how far from truth."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from plumbob.arm.angles import JointTrack
from plumbob.arm.program import Program
from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import ClockError, ParameterError
from plumbob.core.series import Series
from plumbob.data.array import Quat, Vec
from plumbob.data.chain import Chain, Posture, load_chain


class HandError(NamedTuple):
    """Distance of the hand from where it truly was, m, and as a share of the arm's length."""

    rms: float
    max: float
    rms_share: float
    max_share: float


@dataclass(frozen=True, eq=False, repr=False)
class Replay(Series):
    """What a model did.

    Attributes
    ----------
    t : ndarray (N,)
        Times of the program, s.
    hand : ndarray (N, 3)
        The hand, in the axes of the root, m.
    length : float
        Of the arm, m.
    recorded : ndarray (N,)
        When the recording was there, s.
    postures : mapping of str to Posture
        Of each segment, where a chain was moved; empty for a URDF.
    """

    t: Floats
    hand: Floats
    length: float
    recorded: Floats
    postures: Mapping[str, Posture] = field(default_factory=dict)

    def facts(self) -> Mapping[str, str]:
        """Samples, and how far the hand goes."""
        way = float(np.linalg.norm(np.diff(self.hand, axis=0), axis=1).sum())
        return {
            "samples": f"{self.t.size} over {self.t[-1] - self.t[0]:.3f} s",
            "hand's way": f"{way:.3f} m",
            "arm": f"{self.length:.3f} m",
        }

    def columns(self) -> Mapping[str, Floats]:
        """Time and the hand."""
        return {"t [s]": self.t} | {f"hand_{axis} [m]": self.hand[:, k] for k, axis in enumerate("xyz")}

    def against(self, t: Floats, hand: Floats) -> HandError:
        """Distance from a true path of the hand (M, 3) at times (M,) of the recording, at the same recorded times.

        Raises
        ------
        ClockError
            If truth does not span the recorded times.
        """
        times = check.column("t", t)
        check.increasing_time("t", times)
        truth = check.rows("hand", hand, 3, times.size)
        slack = 2.0 * float(np.median(np.diff(times))) if times.size > 1 else 0.0
        if self.recorded[0] < times[0] - slack or self.recorded[-1] > times[-1] + slack:
            raise ClockError(
                f"truth goes from {times[0]:.3f} to {times[-1]:.3f} s, but the program was recorded from "
                f"{self.recorded[0]:.3f} to {self.recorded[-1]:.3f} s; give truth for all of it."
            )
        there = np.stack([np.interp(self.recorded, times, column) for column in truth.T], axis=1)
        away = np.linalg.norm(self.hand - there, axis=1)
        rms, most = float(np.sqrt(np.mean(away**2))), float(away.max())
        return HandError(rms, most, rms / self.length, most / self.length)


def replay(
    program: Program | JointTrack | str | Path, model: Chain | str | Path, *, hand: str = "",
    q_nb: Quat = (1.0, 0.0, 0.0, 0.0), pos_n: Vec = (0.0, 0.0, 0.0),
) -> Replay:  # fmt: skip
    """Move a model by a program.

    Parameters
    ----------
    program : Program, JointTrack or path
        What it does; a table of angles, ``.csv`` or ``.parquet``.
    model : Chain or path
        A chain, its ``.toml`` file, or a URDF file, which is moved by the kinematics of pytransform3d: not by ours.
    hand : str
        Link of a URDF whose origin is the hand; its last one where empty.
    q_nb, pos_n : tuple of floats
        Attitude (wxyz) and position (m) of the root.

    Raises
    ------
    ParameterError
        If the model lacks an angle of the program, or does not allow one.
    DecodeError
        If the file cannot be read.
    MissingExtraError
        If a URDF is given and pytransform3d is not installed.
    """
    program = Program.load(program) if isinstance(program, str | Path) else program
    done = Program.from_track(program) if isinstance(program, JointTrack) else program
    recorded = np.asarray(done.recorded)
    if not isinstance(model, Chain) and Path(model).suffix.lower() != ".toml":
        from plumbob.arm import urdf
        from plumbob.rotations import quat_rotate

        chain = urdf.chain_from_urdf(model, hand=hand)
        poses = urdf.moved(urdf.read_urdf(model), done.names, done.angles, chain.hand)
        path = quat_rotate(np.asarray(q_nb, dtype=np.float64), poses[:, :3, 3]) + np.asarray(pos_n)
        return Replay(done.t, path, chain.length, recorded)
    chain = model if isinstance(model, Chain) else load_chain(model)
    postures = chain.postures(in_order(chain, done), q_nb, pos_n)
    return Replay(done.t, chain.hand_at(postures), chain.length, recorded, postures)


def in_order(chain: Chain, program: Program | JointTrack) -> Floats:
    """Angles (N, all) of a chain in its order; an error if some are not there, or others are."""
    if sorted(chain.angles) != sorted(program.names):
        raise ParameterError(
            f"the program moves {', '.join(program.names)}, but the angles of {chain.name} are "
            f"{', '.join(chain.angles)}; they must be the same."
        )
    return program.angles[:, [program.names.index(name) for name in chain.angles]]
