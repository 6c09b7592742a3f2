"""May two headings be compared? They may where both count from the same zero.

* Same north, true or magnetic: yes.
* One true, one magnetic: only with the declination of the place, or where a constant heading is aligned anyway.
* One of them free (no magnetometer has set it): its zero is arbitrary, so heading, total and yaw mean nothing and are
  not scored; inclination, pitch and roll are. Aligning the heading makes all of them comparable.
"""

from dataclasses import dataclass

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.errors import FrameError, UnitError
from plumbob.core.units import to_deg
from plumbob.rotations.frames import Frame, North
from plumbob.rotations.quaternions import (
    dcm_from_quat,
    euler_zyx_from_quat,
    quat_from_rotvec,
    quat_multiply,
    quat_rotate,
)


@dataclass(frozen=True, slots=True)
class HeadingPolicy:
    """How a reference's heading is treated."""

    turn: float = 0.0  # added to the reference's heading, clockwise seen from above, rad
    comparable: bool = True  # heading, total and yaw are scored
    reason: str = ""  # why they are not; empty where they are
    note: str = ""  # what a reader of the result should know; may be empty


def heading_policy(estimate: North, reference: North, *, aligned: bool, declination: float | None) -> HeadingPolicy:
    """Decide how headings that count from `estimate` and `reference` are compared.

    Parameters
    ----------
    estimate, reference : North
        What the two headings count from.
    aligned : bool
        A constant heading is sought and removed.
    declination : float or None
        Of the place, rad, east positive: true heading = magnetic heading + declination. Used only where it is needed.

    Raises
    ------
    FrameError
        If one is true, the other magnetic, and nothing bridges them.
    UnitError
        If the declination is not an angle in radians.
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
    return quat_multiply(quat_from_rotvec(np.multiply.outer(-angle, frame.up)), q_nb)


def heading_of(q_nb: Floats, frame: Frame) -> Floats:
    """Heading (N,) of the body's x axis, rad, 0 to 2π clockwise from the zero of headings, of attitudes (N, 4)."""
    forward = quat_rotate(q_nb, np.array([1.0, 0.0, 0.0]))
    return np.asarray(np.arctan2(forward @ frame.east, forward @ frame.north) % (2.0 * np.pi))


def claimed_sd(q_nb: Floats, cov_b: Floats) -> tuple[Floats, Floats]:
    """Standard deviations (N,), rad, that a covariance claims for inclination and heading, to first order.

    The error's two level parts in the navigation frame make the inclination, its vertical part the heading; so a
    consistent filter's errors have these rms values. NaN where nothing is claimed yet: a variance that is not positive.
    """
    c_nb = dcm_from_quat(q_nb)
    xx, yy, zz = np.moveaxis(np.einsum("nij,njk,nik->ni", c_nb, cov_b, c_nb), -1, 0)
    return _sd(xx + yy), _sd(zz)


def euler_sd(q_nb: Floats, cov_b: Floats) -> Floats:
    """Standard deviations (N, 3), rad, that a covariance claims for yaw, pitch and roll, to first order.

    They grow without bound toward a pitch of ±90°, where yaw and roll are one; NaN where nothing is claimed yet.
    """
    _, pitch, roll = np.moveaxis(euler_zyx_from_quat(q_nb), -1, 0)
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
