"""Guided capture: what has been seen so far, what to do next, and when it is enough.

A guide takes a stream in parts and goes over it block by block, so that it does not matter how the stream was cut. It
judges with what the fits judge with, and promises nothing: the calibration is that of the fit of the whole capture.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.calib.guide.stream_blocks import Block, Blocks, Rest
from plumbob.calib.guide.turns import Turn
from plumbob.calib.regions import NAMES, names_of
from plumbob.data import ImuData

ENOUGH: Final = 15
"""Directions of the 18 from which on a good prediction ends the capture."""

_LASTS: Final = 2.0


class Moment(NamedTuple):
    """Something that happened in a capture: when, s from its start, and what."""

    t: float
    text: str


@dataclass(frozen=True, eq=False, kw_only=True)
class Progress:
    """State of a guided capture.

    Attributes
    ----------
    elapsed : float
        Time since the first sample, s.
    filled : ndarray (18,) of bool or None
        Directions that were seen, by `plumbob.calib.regions`; None where directions do not count, or as long as
        nothing tells them.
    direction : int or None
        The direction at present, where it is known.
    still_for : float
        How long the unit has been at rest until now, s; 0 while it moves.
    next_step : str
        What to do now, in words.
    turn : Turn or None
        The turn that the words ask for.
    goal : int or None
        The direction that it leads to.
    predicted : str
        Provisional figure that the grade judges, in words; empty as long as there is none.
    grade : str or None
        Its grade so far.
    share : float
        How much of the capture is done, from 0 to 1.
    warnings : tuple of str
        What is wrong at present.
    done : bool
        Whether it is enough.
    """

    elapsed: float
    filled: NDArray[np.bool_] | None
    direction: int | None = None
    still_for: float
    next_step: str
    turn: Turn | None = None
    goal: int | None = None
    predicted: str = ""
    grade: str | None = None
    share: float
    warnings: tuple[str, ...] = ()
    done: bool

    @property
    def at_rest(self) -> bool:
        """Whether the unit is at rest now."""
        return self.still_for > 0.0

    @property
    def missing(self) -> list[int]:
        """Directions that were not seen; all of them as long as nothing tells them."""
        return list(range(len(NAMES))) if self.filled is None else np.flatnonzero(~self.filled).tolist()


class Guide(ABC):
    """Guide of a capture.

    Attributes
    ----------
    timeline : list of Moment
        What has happened so far: directions that were seen, warnings, and the end.
    triad : str
        What is calibrated.
    """

    triad: str

    def __init__(self) -> None:
        self.timeline: list[Moment] = []
        self._blocks, self._rest = Blocks(), Rest()
        self._start: float | None = None
        self._now = 0.0
        self._known = 0.0
        self._warned: dict[str, float] = {}
        self._done = False

    def feed(self, part: ImuData) -> Progress:
        """Take a part of the stream, uncalibrated in what is calibrated; parts come in the order of time."""
        for block in self._blocks.feed(part):
            self._take(block)
        return self.progress()

    @abstractmethod
    def progress(self) -> Progress:
        """State after the last whole block."""

    @abstractmethod
    def _look(self, block: Block) -> None:
        """Take up a block."""

    def _take(self, block: Block) -> None:
        if self._start is None:
            self._start = float(block.t[0])
        self._now = float(block.t[-1]) - self._start
        self._rest.add(block)
        self._judge_triad(block)
        self._look(block)
        if not self._done and self.progress().done:
            self._done = True
            self._say("enough: the capture is good")

    def _judge_triad(self, block: Block) -> None:
        clipped = block.clipped[self.triad]
        if clipped.any():
            self._warn(f"{self.triad} is at the end of its range: move slower, or keep away from magnets")
        if np.isfinite(block.triads[self.triad]).all(axis=1).any():
            self._known = self._now
        elif self._now - self._known > _LASTS:
            self._warn(f"no {self.triad} comes: is it there, and switched on?")

    def _say(self, text: str) -> None:
        self.timeline.append(Moment(self._now, text))

    def _warn(self, text: str) -> None:
        """Warn now and for a while; the timeline gets it once as long as it lasts."""
        if text not in self._warnings:
            self._say(f"warning: {text}")
        self._warned[text] = self._now

    @property
    def _warnings(self) -> tuple[str, ...]:
        return tuple(text for text, when in self._warned.items() if self._now - when <= _LASTS)


class Seen:
    """Directions that a capture has seen, and the timeline's words about them."""

    def __init__(self) -> None:
        self.filled = np.zeros(len(NAMES), dtype=np.bool_)

    def update(self, filled: NDArray[np.bool_]) -> str | None:
        """Take what is filled now; words where that is new."""
        new = np.flatnonzero(filled & ~self.filled)
        self.filled = filled
        if not new.size:
            return None
        return f"{names_of(new.tolist())} seen, {int(filled.sum())} of {len(NAMES)}"
