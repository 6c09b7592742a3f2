"""Navigation frames and body axes. There is no default frame anywhere: who asks for an attitude names one.

Navigation frames are local and level. Body axes are the 24 right-handed ways to stick three axes on a case.
"""

from dataclasses import replace
from enum import StrEnum
from functools import cache
from itertools import permutations, product
from typing import Any, Protocol, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import FrameError
from plumbob.rotations.quaternions import quat_from_dcm, quat_multiply


class _Named(StrEnum):
    """Values with names that a person may write in small or in large letters."""

    @classmethod
    def parse(cls, name: str) -> Self:
        """Value of that name; a value is its own.

        Raises
        ------
        FrameError
            If there is none.
        """
        for value in cls:
            if isinstance(name, str) and name.strip().lower() == value.lower():
                return value
        raise FrameError(f"{check.said(name)} is not a {_KINDS[cls.__name__]}; known: {', '.join(cls)}.")


_KINDS = {"Frame": "navigation frame", "North": "heading reference"}


class Frame(_Named):
    """A local level navigation frame; the letters name its x, y and z axes."""

    ENU = "ENU"
    NED = "NED"
    NWU = "NWU"

    @property
    def east(self) -> Floats:
        """Unit vector to the east, in this frame."""
        return {"ENU": np.array([1.0, 0, 0]), "NED": np.array([0, 1.0, 0]), "NWU": np.array([0, -1.0, 0])}[self.value]

    @property
    def north(self) -> Floats:
        """Unit vector to the north, in this frame."""
        return np.array([0.0, 1.0, 0.0]) if self is Frame.ENU else np.array([1.0, 0.0, 0.0])

    @property
    def up(self) -> Floats:
        """Unit vector away from the centre of gravity, in this frame."""
        return np.array([0.0, 0.0, -1.0 if self is Frame.NED else 1.0])


class North(_Named):
    """What a heading counts from."""

    TRUE = "true"
    MAGNETIC = "magnetic"
    FREE = "free"


@cache  # every part of a stream asks
def frame_rotation(to: Frame, from_: Frame) -> Floats:
    """Quaternion q_to_from between two navigation frames, shape (4,); read-only."""
    c = sum(np.outer(a, b) for a, b in zip(_axes(to), _axes(from_), strict=True))
    return check.read_only(quat_from_dcm(np.asarray(c)))


def change_frame(q_nb: ArrayLike, *, to: Frame, from_: Frame) -> Floats:
    """Attitude of the same body seen from another navigation frame; the body's own axes stay as they are.

    Parameters
    ----------
    q_nb : array_like (..., 4)
        Body to `from_`, wxyz.
    to, from_ : Frame
        Navigation frames.

    Returns
    -------
    ndarray (..., 4)
        Body to `to`.
    """
    q = check.last_axis("q_nb", q_nb, 4)
    turn = frame_rotation(to, from_)
    return q.copy() if to == from_ else quat_multiply(turn, q)


def in_body_axes(spec: str, vectors: Floats) -> Floats:
    """Vectors (..., 3) of the sensor case in body axes; picking spoils no component where another is missing.

    Parameters
    ----------
    spec : str
        As `signed_axes` takes it.
    vectors : ndarray (..., 3)
        In sensor-case axes.
    """
    c_bs = signed_axes(spec)
    return np.asarray(vectors[..., np.abs(c_bs).argmax(axis=1)] * c_bs.sum(axis=1))


def body_axes(spec: str) -> Floats:
    """Matrix C_bs that takes sensor-case coordinates to body coordinates.

    Parameters
    ----------
    spec : str
        Three signed letters: which sensor axis the body's x, y and z are. ``"x y z"`` changes nothing, ``"x -y -z"``
        turns forward-right-down into forward-left-up, ``"y -x z"`` is a quarter turn about z.

    Returns
    -------
    ndarray (3, 3)
        A rotation by quarter turns, entries 0 and ±1.

    Raises
    ------
    FrameError
        If the letters are not three different axes, or the set is left-handed.
    """
    c = signed_axes(spec)
    if np.linalg.det(c) < 0.0:
        raise FrameError(f"body axes {spec!r} are left-handed; no rotation of a case gives them. Check one sign.")
    return c


def signed_axes(spec: str) -> Floats:
    """Matrix (3, 3) of three signed letters as `body_axes` takes them, left-handed sets too.

    Raises
    ------
    FrameError
        If the letters are not three different axes.
    """
    words = check.kind("axes", spec, str, hint="Write them as 'x y z'.", error=FrameError).replace(",", " ").split()
    letters = [w.lstrip("+-") for w in words]
    if sorted(letters) != ["x", "y", "z"] or any(len(w) - len(v) > 1 for w, v in zip(words, letters, strict=True)):
        raise FrameError(f"body axes {spec!r} must name x, y and z once each, with a sign or none, as in 'y -x z'.")
    c = np.zeros((3, 3))
    for row, (word, letter) in enumerate(zip(words, letters, strict=True)):
        c[row, "xyz".index(letter)] = -1.0 if word.startswith("-") else 1.0
    return c


def axes_letters(c: Floats) -> str:
    """Three signed letters of a matrix (3, 3), as `signed_axes` reads them."""
    places = np.abs(c).argmax(axis=1)
    return " ".join("-" * bool(row[i] < 0.0) + "xyz"[i] for row, i in zip(c, places, strict=True))


def axes_words(c: Floats) -> str:
    """The same for a sentence: "y, −x, z"."""
    return ", ".join(axes_letters(c).replace("-", "−").split())


def every_axes() -> tuple[Floats, ...]:
    """The 48 matrices (3, 3) that `signed_axes` gives, the identity first; 24 of them are left-handed."""
    ways = product(permutations(range(3)), product((1.0, -1.0), repeat=3))
    return tuple(np.diag(signs)[list(order)] for order, signs in ways)


class _Framed(Protocol):
    @property
    def frame(self) -> Frame: ...


Track = TypeVar("Track", bound=_Framed)


def assert_same(track: Track, from_: Frame, to: Frame, *, because: str) -> Track:
    """Relabel a track's frame without turning it: the one door for data whose label was wrong.

    Parameters
    ----------
    track : object with a frame
        Such as an `AttitudeTrack`.
    from_ : Frame
        The label that it carries now.
    to : Frame
        The label that it should have carried.
    because : str
        Why; it must not be empty.

    Raises
    ------
    FrameError
        If the track does not carry `from_`, or no reason is given.
    """
    from_, to = Frame.parse(from_), Frame.parse(to)
    if track.frame is not from_:
        raise FrameError(f"the track's frame is {track.frame}, not {from_}; nothing was relabelled.")
    if not because.strip():
        raise FrameError("relabelling a frame needs a reason: because='...'.")
    changed: Any = replace(track, frame=to)  # type: ignore[type-var]
    return changed  # type: ignore[no-any-return]


def _axes(frame: Frame) -> tuple[Floats, Floats, Floats]:
    frame = Frame.parse(frame)
    return frame.east, frame.north, frame.up
