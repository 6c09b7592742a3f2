"""Messages that carry an attitude to other programs, ships and aircraft: pure encoders, a row in and bytes out.

Every encoder takes an `AttitudeSample`, in forward-right-down body axes and NED: roll is positive with port up and
starboard down, pitch with the bow up, and the heading grows clockwise seen from above, because these are the rotations
about forward, right and down axes. What is not known is None, and never goes out as a number.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Final

import numpy as np

from plumbob import rotations
from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.errors import FrameError
from plumbob.core.time import to_ns
from plumbob.core.units import to_deg
from plumbob.data import AttitudeTrack, ImuData
from plumbob.rotations.frames import euler_sd

UNRELIABLE: Final = flags.NOT_CONVERGED | flags.GAP | flags.TIME_FAULT | flags.GYR_HELD
"""Flags with which an attitude is not to be steered by: not converged, after a gap, or turned on without a rate."""
_LONGEST_STEP: Final = 1.0
_HALF_TURN: Final = np.array([0.0, 1.0, 0.0, 0.0])


class BodyAxes(StrEnum):
    """Body axes of an attitude: forward-right-down or forward-left-up."""

    FRD = "FRD"
    FLU = "FLU"

    @classmethod
    def parse(cls, name: str) -> "BodyAxes":
        """Body axes of that name."""
        try:
            return cls(name.strip().upper())
        except (ValueError, AttributeError):
            raise FrameError(f"{name!r} are not body axes that can be sent; known: {', '.join(cls)}.") from None


def default_body(frame: rotations.Frame) -> BodyAxes:
    """Body axes that go with a navigation frame, unless others are named: z points down in both, or up in both."""
    return BodyAxes.FRD if frame is rotations.Frame.NED else BodyAxes.FLU


@dataclass(frozen=True, slots=True)
class AttitudeSample:
    """An attitude at an instant, as encoders take it; None is not known."""

    t_ns: int  # UTC, ns since 1970, where `utc`; else ns since the start
    utc: bool  # whether it is UTC
    elapsed_ns: int  # ns since the first attitude
    q_nb: tuple[float, ...] | None  # forward-right-down body to NED, wxyz
    angles: tuple[float, float, float] | None  # roll, pitch, and heading in 0 to 2π, rad
    north: rotations.North  # what the heading counts from
    declination: float | None  # rad, east positive
    rates_b: tuple[float, ...] | None  # angular rate in forward-right-down axes, rad/s
    acc_b: tuple[float, ...] | None  # specific force in forward-right-down axes, m/s²
    # covariance of the attitude error in forward-right-down axes, rad², nine numbers row by row
    cov_b: tuple[float, ...] | None
    sigma: tuple[float | None, ...]  # standard deviations of roll, pitch and heading, rad; NaN is None
    flags: int  # from `plumbob.core.flags`

    @property
    def reliable(self) -> bool:
        """Whether it is known, and no flag says that it is not to be used."""
        return self.angles is not None and not self.flags & UNRELIABLE

    @property
    def roll_deg(self) -> float | None:
        """Roll, °, positive with port up."""
        return None if self.angles is None else float(to_deg(self.angles[0]))

    @property
    def pitch_deg(self) -> float | None:
        """Pitch, °, positive with the bow up."""
        return None if self.angles is None else float(to_deg(self.angles[1]))

    def heading_deg(self, north: rotations.North) -> float | None:
        """Heading from true or magnetic north, 0 to 360°; None where it is not known."""
        if self.angles is None or self.north is rotations.North.FREE or self.flags & flags.HEADING_FREE:
            return None
        turn = 0.0
        if north is not self.north:
            if self.declination is None:
                return None
            turn = self.declination if north is rotations.North.TRUE else -self.declination
        return float(to_deg(self.angles[2] + turn)) % 360.0

    @property
    def turn_rate(self) -> float | None:
        """Rate of the heading, rad/s, positive to starboard; None where it is not known."""
        if self.q_nb is None or self.rates_b is None:
            return None
        down = rotations.dcm_from_quat(np.array(self.q_nb))[2]
        return float(down @ np.array(self.rates_b))

    def acceleration(self, gravity: float = G0) -> tuple[float, float] | None:
        """Horizontal and upward acceleration without gravity, m/s²; None where they are not known."""
        if self.q_nb is None or self.acc_b is None:
            return None
        north, east, down = rotations.dcm_from_quat(np.array(self.q_nb)) @ np.array(self.acc_b)
        return float(np.hypot(north, east)), float(-down - gravity)


def sent_by(north: rotations.North, declination: float | None, to: rotations.North) -> bool:
    """Whether a heading from `north` can be sent as one from `to`."""
    return north is not rotations.North.FREE and (north is to or declination is not None)


def attitudes(
    track: AttitudeTrack,
    rows: Sequence[int],
    *,
    t0_ns: int,
    utc: bool,
    body: BodyAxes | None = None,
    declination: float | None = None,
    imu: ImuData | None = None,
    more: Sequence[int] = (),
) -> Iterator[AttitudeSample]:
    """Rows of a track as encoders take them; `t0_ns` is the time of its zero, UTC where `utc`.

    `body`: by default the axes of its frame; `declination`: rad, east positive; `imu`: samples in the same body axes,
    of which those at the very times of the attitudes are taken; `more`: flags to add to each row, as those of rows that
    were left out before it.
    """
    chosen = np.asarray(rows, dtype=np.intp)
    if not chosen.size:
        return
    body = default_body(track.frame) if body is None else body
    c = np.array([1.0, -1.0, -1.0]) if body is BodyAxes.FLU else np.ones(3)
    q = rotations.change_frame(track.q_nb[chosen], to=rotations.Frame.NED, from_=track.frame)
    q = rotations.quat_multiply(q, _HALF_TURN) if body is BodyAxes.FLU else q
    gyr, acc = (sensed[chosen] for sensed in _sensed(track, imu))
    if not np.isfinite(gyr).all():
        gyr = np.where(np.isfinite(gyr), gyr, _differences(track)[chosen])
    gyr, acc = gyr * c, acc * c
    q = np.where(q[:, :1] < 0.0, -q, q) + 0.0
    euler = rotations.euler_zyx_from_quat(q)
    cov = np.full((chosen.size, 3, 3), np.nan) if track.cov_b is None else track.cov_b[chosen] * np.outer(c, c)
    sigma = euler_sd(q, cov)[:, ::-1]
    words = np.zeros(len(track), dtype=np.uint32) if track.flags is None else track.flags
    stamps = to_ns(track.t)[chosen].tolist()
    for i, t_ns in enumerate(stamps):
        yaw, pitch, roll = euler[i].tolist()
        is_finite = bool(np.isfinite(q[i]).all())
        yield AttitudeSample(
            t_ns=t_ns + t0_ns,
            utc=utc,
            elapsed_ns=t_ns,
            q_nb=_finite(q[i]),
            angles=(roll, pitch, yaw % (2.0 * np.pi)) if is_finite else None,
            north=track.north,
            declination=declination,
            rates_b=_finite(gyr[i]),
            acc_b=_finite(acc[i]),
            cov_b=_finite(cov[i].ravel()) if (np.diagonal(cov[i]) > 0.0).all() else None,
            sigma=tuple(sd if np.isfinite(sd) else None for sd in sigma[i].tolist()),
            flags=int(words[chosen[i]]) | (more[i] if more else 0),
        )


def _finite(row: Floats) -> tuple[float, ...] | None:
    values: Any = row.tolist()
    return tuple(values) if np.isfinite(row).all() else None


def _sensed(track: AttitudeTrack, imu: ImuData | None) -> tuple[Floats, Floats]:
    """Rate, without the bias that is estimated, and specific force at the times of a track; NaN where there is none."""
    gyr, acc = np.full((len(track), 3), np.nan), np.full((len(track), 3), np.nan)
    if imu is None or not len(imu):
        return gyr, acc
    track_ns, imu_ns = to_ns(track.t), to_ns(imu.t)
    place = np.minimum(np.searchsorted(imu_ns, track_ns), imu_ns.size - 1)
    same = imu_ns[place] == track_ns
    if imu.gyr is not None:
        gyr[same] = imu.gyr[place[same]]
        gyr = gyr if track.bias_b is None else gyr - np.where(np.isfinite(track.bias_b), track.bias_b, 0.0)
    if imu.acc is not None:
        acc[same] = imu.acc[place[same]]
    return gyr, acc


def _differences(track: AttitudeTrack) -> Floats:
    """Mean rate (N, 3) since the attitude before, rad/s; NaN at the first, and behind a gap."""
    rates = np.full((len(track), 3), np.nan)
    if len(track) < 2:
        return rates
    dt = np.diff(track.t)
    turn = rotations.rotvec_from_quat(
        rotations.quat_multiply(rotations.quat_conjugate(track.q_nb[:-1]), track.q_nb[1:])
    )
    rates[1:] = np.where(dt[:, np.newaxis] <= _LONGEST_STEP, turn / dt[:, np.newaxis], np.nan)
    if track.flags is not None:
        rates[(track.flags & np.uint32(flags.GAP | flags.TIME_FAULT)) != 0] = np.nan
    return rates
