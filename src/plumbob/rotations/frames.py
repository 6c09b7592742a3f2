"""Navigation frames, body axes, and what headings count from. There is no default frame: who asks for one names it.

Navigation frames are local and level. Body axes are the 24 right-handed ways to stick three axes on a case.

Two headings may be compared where both count from the same zero.

* Same north, true or magnetic: yes.
* One true, one magnetic: only with the declination of the place, or where a constant heading is aligned anyway.
* One of them free (no magnetometer has set it): its zero is arbitrary, so heading, total and yaw mean nothing and are
  not scored; inclination, pitch and roll are. Aligning the heading makes all of them comparable.
"""

from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cache
from itertools import permutations, product
from typing import Any, Protocol, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import FrameError, UnitError
from plumbob.core.units import to_deg
from plumbob.rotations import quaternions


class _Named(StrEnum):
    """Values with names that a person may write in small or in large letters."""

    @classmethod
    def parse(cls, name: str) -> Self:
        """Value of that name; a value is its own."""
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
    return check.read_only(quaternions.quat_from_dcm(np.asarray(c)))


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
    return q.copy() if to == from_ else quaternions.quat_multiply(turn, q)


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


@dataclass(frozen=True, slots=True)
class HeadingPolicy:
    """How a reference's heading is treated."""

    turn: float = 0.0  # added to the reference's heading, clockwise seen from above, rad
    comparable: bool = True  # heading, total and yaw are scored
    reason: str = ""  # why they are not; empty where they are
    note: str = ""  # what a reader of the result should know; may be empty


def heading_policy(estimate: North, reference: North, *, aligned: bool, declination: float | None) -> HeadingPolicy:
    """Decide how headings that count from `estimate` and `reference` are compared.

    With `aligned` a constant heading is sought and removed. The declination, rad, east positive, is used only where it
    is needed: true heading = magnetic heading + declination. One true, one magnetic and nothing that bridges them is
    refused.
    """
    if declination is not None and not abs(declination) <= np.pi:
        raise UnitError(
            f"declination must be an angle of at most π rad, 180°, but it is {declination:g} rad; degrees are written "
            "declination=units.deg(3.2), or --declination 3.2deg."
        )
    if North.FREE in {estimate, reference}:
        return _free(estimate, reference, aligned)
    if estimate is reference:
        return HeadingPolicy()
    if declination is not None:
        turn = declination if estimate is North.TRUE else -declination
        note = f"the reference's heading was changed from {reference} to {estimate} north by {to_deg(turn):+.3f}°"
        return HeadingPolicy(turn=turn, note=note)
    if aligned:
        note = f"the heading found holds the declination: {estimate} north less {reference} north"
        return HeadingPolicy(note=note)
    raise FrameError(
        f"the estimate's heading counts from {estimate} north, the reference's from {reference} north; give "
        "the declination of the place, east positive (declination=, --declination), or align the heading (align=, "
        "--align heading)."
    )


def _free(estimate: North, reference: North, aligned: bool) -> HeadingPolicy:
    if aligned:
        return HeadingPolicy(note="a free heading was compared after its best constant was removed")
    who = " and the ".join(name for name, n in (("estimate", estimate), ("reference", reference)) if n is North.FREE)
    reason = f"the heading of the {who} counts from an arbitrary zero; to score it, align it (align=, --align heading)"
    return HeadingPolicy(comparable=False, reason=reason)


def turn_heading(q_nb: Floats, angle: float | Floats, frame: Frame) -> Floats:
    """Attitudes (N, 4) whose headings read `angle`, one or (N,), rad more, clockwise seen from above."""
    return quaternions.quat_multiply(quaternions.quat_from_rotvec(np.multiply.outer(-angle, frame.up)), q_nb)


def heading_of(q_nb: Floats, frame: Frame) -> Floats:
    """Heading (N,) of the body's x axis, rad, 0 to 2π clockwise from the zero of headings, of attitudes (N, 4)."""
    forward = quaternions.quat_rotate(q_nb, np.array([1.0, 0.0, 0.0]))
    return np.asarray(np.arctan2(forward @ frame.east, forward @ frame.north) % (2.0 * np.pi))


def claimed_sd(q_nb: Floats, cov_b: Floats) -> tuple[Floats, Floats]:
    """Standard deviations (N,), rad, that a covariance claims for inclination and heading, to first order.

    The error's two level parts in the navigation frame make the inclination, its vertical part the heading; so a
    consistent filter's errors have these rms values. NaN where nothing is claimed yet: a variance that is not positive.
    """
    c_nb = quaternions.dcm_from_quat(q_nb)
    xx, yy, zz = np.moveaxis(np.einsum("nij,njk,nik->ni", c_nb, cov_b, c_nb), -1, 0)
    return _sd(xx + yy), _sd(zz)


def euler_sd(q_nb: Floats, cov_b: Floats) -> Floats:
    """Standard deviations (N, 3), rad, that a covariance claims for yaw, pitch and roll, to first order.

    They grow without bound toward a pitch of ±90°, where yaw and roll are one; NaN where nothing is claimed yet.
    """
    _, pitch, roll = np.moveaxis(quaternions.euler_zyx_from_quat(q_nb), -1, 0)
    sr, cr, cp, tp = np.sin(roll), np.cos(roll), np.cos(pitch), np.tan(pitch)
    zeros, ones = np.zeros_like(roll), np.ones_like(roll)
    # derivatives of yaw, pitch and roll by a small turn in body axes
    turns = np.stack([[zeros, sr / cp, cr / cp], [zeros, cr, -sr], [ones, sr * tp, cr * tp]])
    return _sd(np.einsum("kin,nij,kjn->nk", turns, cov_b, turns))


def _sd(variance: Floats) -> Floats:
    return np.sqrt(np.where(variance > 0.0, variance, np.nan))


def heading_zero(north: str) -> str:
    """What a heading counts from, in words."""
    return "an arbitrary zero" if north == North.FREE else f"{north} north"


def counted_from(north: str, declination_deg: float | None) -> str:
    """What headings count from, in words, with the declination that makes them true."""
    return heading_zero(north) + ("" if declination_deg is None else f" (declination {declination_deg:+.3f}°)")
