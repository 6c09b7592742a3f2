"""The smoother as a user meets it: parameters, a recording in, a track out."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core import check, flags
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.params import build, describe, shown
from plumbob.core.text import Shown
from plumbob.core.units import deg
from plumbob.data import AttitudeTrack, ImuData, calibration_told
from plumbob.filters.base import CommonParams
from plumbob.filters.settling import considered
from plumbob.filters.smoother.attached import Attached, attached_field
from plumbob.filters.smoother.field import (
    Reference,
    bias_of_drift,
    heading_of,
    heading_variance,
    reference_of,
    weights,
)
from plumbob.filters.smoother.inertial import AGAIN_BIAS, Inertial, kinds, level, rest, speed_of
from plumbob.filters.smoother.keyframes import Bools, Keyframes, between
from plumbob.filters.smoother.model import (
    BIAS_PRIOR,
    NEEDS,
    SMOOTHER,
    Noise,
    Params,
    from_noise,
    start_covariance,
)
from plumbob.filters.smoother.sweeps import Sweep, sweep
from plumbob.rotations import (
    Frame,
    North,
    change_frame,
    dcm_from_quat,
    quat_conjugate,
    quat_from_rotvec,
    quat_multiply,
    quat_slerp,
)
from plumbob.rotations.headings import turn_heading

if TYPE_CHECKING:
    from plumbob.data.cards import NoiseCard

AGAIN_TILT: Final = deg(3.0)
AGAIN_HEADING: Final = deg(30.0)
"""Standard deviations of a smoothed attitude that is taken for a start, rad."""
PASSES: Final = 2
GATED: Final = 0.1
"""A field that counts with less than this was not used."""
DOUBTFUL: Final = deg(6.0)
"""With a larger standard deviation of the tilt, rad, the attitude is not converged."""


@dataclass(frozen=True, slots=True)
class Smoothed:
    """What the smoother found, at the keyframes.

    Attributes
    ----------
    frames : Keyframes
        Samples and steps.
    sweep : Sweep
        The last pass.
    resting : ndarray (K,) of bool
        Steps at rest.
    reference : Reference or None
        The field of the place; None where no field gives the heading.
    weight : ndarray (K,)
        How far the field of each step was believed.
    attached : Attached or None
        Field that turns with the sensor.
    """

    frames: Keyframes
    sweep: Sweep
    resting: Bools
    reference: Reference | None
    weight: Floats
    attached: Attached | None


class Smoother(Shown):
    """Attitude of a whole recording, each sample from what came before and after it.

    Parameters
    ----------
    frame : Frame or str
        Navigation frame of the result.
    params : Mapping, optional
        Parameters by name; numbers in SI, text with its unit. Those of every filter are taken too, but `max_gap`.
    noise : NoiseCard, optional
        Noise of the unit; `params` has the last word.

    Attributes
    ----------
    params : Params
        Its own parameters, SI.
    common : CommonParams
        Declination in use, use of the magnetometer.

    Raises
    ------
    ParameterError
        If a parameter is not known.

    Examples
    --------
    >>> from plumbob.filters.smoother import Smoother
    >>> Smoother(frame="ENU", params={"latency": "2.6 ms"}).params.latency
    0.0026
    """

    name = SMOOTHER

    def __init__(
        self, *, frame: Frame | str, params: Mapping[str, Any] | None = None, noise: "NoiseCard | None" = None
    ) -> None:
        self.frame = Frame.parse(frame)
        given = {**({} if noise is None else from_noise(noise)), **(params or {})}
        own = {p.name for p in describe(Params)}
        shared = {p.name for p in describe(CommonParams)} - {"max_gap"}
        for name in given:
            if name not in own | shared:
                raise ParameterError(
                    f"{SMOOTHER} has no parameter '{name}'; known are {', '.join((*sorted(own), *sorted(shared)))}."
                )
        self.params: Params = build(Params, {k: v for k, v in given.items() if k in own}, of=SMOOTHER)
        self.common: CommonParams = build(CommonParams, {k: v for k, v in given.items() if k in shared}, of=SMOOTHER)
        self._decided = "declination" in given

    @property
    def bias_prior(self) -> tuple[str, float]:
        """Parameter that is the standard deviation of the bias before the recording, and its value, rad/s."""
        return BIAS_PRIOR, float(getattr(self.params, BIAS_PRIOR))

    def facts(self) -> Mapping[str, str]:
        """Name, frame, and the parameters that differ from their defaults."""
        usual = Params()
        changed = [
            f"{p.name}={shown(p, value)}"
            for p in describe(Params)
            if (value := getattr(self.params, p.name)) != getattr(usual, p.name)
        ]
        return {"name": self.name, "frame": str(self.frame), "params": ", ".join(changed) or "defaults"}

    def describe(self) -> str:
        """Name and parameters in one line, for provenance."""
        pairs = [
            (p, getattr(holder, p.name))
            for holder in (self.params, self.common)
            for p in describe(type(holder))
            if p.name != "max_gap"
        ]
        return f"{self.name}({', '.join(f'{p.name}={shown(p, value)}' for p, value in pairs)})"

    def north(self, has_mag: bool) -> North:
        """What headings count from, of samples with or without a magnetometer."""
        if not (has_mag and self.common.mag):
            return North.FREE
        return North.MAGNETIC if self.common.declination is None else North.TRUE

    def process(self, data: ImuData, *, progress: Callable[[int], None] | None = None) -> AttitudeTrack:
        """Attitude, bias and covariance at every sample of a recording.

        Parameters
        ----------
        data : ImuData
            The recording.
        progress : callable, optional
            Called with the number of samples done since the last call.

        Raises
        ------
        ShapeError
            If a triad is missing that it needs, or a recording has fewer than two samples with a rate.
        """
        check.kind("data", data, ImuData, hint="Of a Recording take its .imu.")
        missing = [name for name in NEEDS if name not in data.triads]
        if missing:
            raise ShapeError(f"{SMOOTHER} needs {', '.join(NEEDS)}, but the recording has no {', '.join(missing)}.")
        if data.meta.declination is not None and not self._decided:
            self.common = self.common._replace(declination=data.meta.declination)
        found = self.smooth(data)
        track = self._track(data, found)
        if progress:
            progress(len(data))
        return track

    def smooth(self, data: ImuData) -> Smoothed:
        """What `process` makes its track of, at the keyframes."""
        p = self.params
        frames = Keyframes.of(data, p.keyframe, mag=self.common.mag)
        if frames.t.size < 2:
            raise ShapeError(f"{SMOOTHER} needs two samples with a rate, but the recording has {frames.t.size}.")
        inertial = level(frames, p)
        nothing = np.zeros(frames.gap.size, dtype=bool)
        if np.isfinite(frames.mag[:, 0]).any():
            own = attached_field(frames, _at_samples(frames, inertial.sweep, inertial.resting))
            clean = frames.without(own.field) if own.found else frames
            field = _field_of(clean, inertial.sweep, inertial.resting) if own.found else inertial.sweep.field
            if (reference := reference_of(clean, p, field, inertial, own.doubtful)) is not None:
                return _with_field(clean, p, inertial, field, reference, own)
        return Smoothed(frames, inertial.sweep, inertial.resting, None, nothing.astype(float), None)

    def _track(self, data: ImuData, found: Smoothed) -> AttitudeTrack:
        frames, p = found.frames, self.params
        q, rate = _at_samples(frames, found.sweep, found.resting), _rates(frames, found.sweep)
        place = np.searchsorted(frames.first, np.arange(frames.t.size))
        cov = _covariance(q, found, place, rate, p, data.meta.left)
        if p.latency:
            q = quat_multiply(q, quat_from_rotvec(p.latency * rate))
        has_field = found.reference is not None
        word = np.asarray(data.flags)[frames.rows] | _flags(found, place, cov)
        q_all, bias, cov_all, words = _everywhere(data, frames, q, found.sweep.bias[place], cov, word)
        turn = self.common.declination or 0.0
        q_n = change_frame(
            turn_heading(q_all, turn, Frame.ENU) if has_field and turn else q_all, to=self.frame, from_=Frame.ENU
        )
        return AttitudeTrack.trusted(
            t=data.t, q_nb=q_n, frame=self.frame, north=self.north(has_field), bias_b=bias, cov_b=cov_all, flags=words,
            source=f"{self.describe()}; calibration {calibration_told(data.meta.calibration)}",
        )  # fmt: skip


def _with_field(
    frames: Keyframes, p: Params, inertial: Inertial, field: Floats, reference: Reference, own: Attached
) -> Smoothed:
    """All sensors, from the attitude without heading and the heading that the field gives it."""
    weight = weights(reference, p, field, own.doubtful, directed=False)
    turn = heading_of(frames, inertial, field, weight)
    by = np.concatenate((turn[:1], turn))
    q = quat_multiply(_about_up(by), inertial.sweep.q)
    field = np.stack((*_turned(turn, field), field[:, 2]), axis=1)
    bias = inertial.sweep.bias + bias_of_drift(frames, inertial, turn)
    speed, resting, found = inertial.speed, inertial.resting, inertial.sweep
    p0 = start_covariance(p, tilt=AGAIN_TILT, heading=AGAIN_HEADING, bias=AGAIN_BIAS, rigid=False)
    for left in range(PASSES, 0, -1):
        seen = Inertial(found, resting, speed)
        reference = reference_of(frames, p, field, seen, own.doubtful) or reference
        weight = weights(reference, p, field, own.doubtful, directed=True)
        resting = rest(frames, p, bias[1:])
        var = heading_variance(frames, p, reference, weight)
        noise = Noise.of(p, reference.bend(p))
        kind, density = kinds(frames, resting), speed.density(p, resting)
        found = sweep(frames, kind, density, var, q, bias[0], p0, noise, covariance=left == 1)
        speed, q, bias, field = speed_of(frames, found.force[:, :2]), found.q, found.bias, found.field
    return Smoothed(frames, found, resting, reference, weight, own)


def _turned(by: Floats, field: Floats) -> tuple[Floats, Floats]:
    """Level part of fields turned about the vertical."""
    c, s = np.cos(by), np.sin(by)
    return c * field[:, 0] - s * field[:, 1], s * field[:, 0] + c * field[:, 1]


def _about_up(angle: Floats) -> Floats:
    zero = np.zeros_like(angle)
    return np.stack((np.cos(0.5 * angle), zero, zero, np.sin(0.5 * angle)), axis=1)


def _rates(frames: Keyframes, found: Sweep) -> Floats:
    """Corrected rates of the samples, rad/s, (N, 3)."""
    place = np.repeat(np.arange(frames.gap.size), np.diff(frames.first))
    bias = found.bias[np.concatenate(([0], place))]
    rate: Floats = frames.gyr - bias - frames.gyr @ found.matrix.reshape(3, 3).T
    return rate


def _at_samples(frames: Keyframes, found: Sweep, resting: Bools) -> Floats:
    return between(frames, ~resting & ~frames.gap, found.q, _rates(frames, found))


def _field_of(frames: Keyframes, found: Sweep, resting: Bools) -> Floats:
    """Mean field of each step in navigation axes, (K, 3), NaN where there was none."""
    q = _at_samples(frames, found, resting)
    middle = quat_slerp(q[:-1], q[1:], 0.5)
    seen = np.isfinite(frames.mag[1:, 0])
    field = (dcm_from_quat(middle) @ np.where(seen[:, np.newaxis], frames.mag[1:], 0.0)[:, :, np.newaxis])[:, :, 0]
    start = frames.first[:-1]
    count = np.add.reduceat(seen.astype(float), start)
    total = np.add.reduceat(field * seen[:, np.newaxis], start, axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean: Floats = total / count[:, np.newaxis]
    mean[frames.gap] = np.nan
    return mean


def _covariance(q: Floats, found: Smoothed, place: NDArray[np.int64], rate: Floats, p: Params, left: Any) -> Floats:
    """Covariance of the attitude error in body axes, (N, 3, 3): the smoother's own, and what it does not estimate."""
    c_nb = dcm_from_quat(q)
    in_n = found.sweep.cov[place, :3, :3].copy()
    offset = (p.acc_offset / G0) ** 2
    in_n[:, 0, 0] += offset
    in_n[:, 1, 1] += offset
    cov = np.swapaxes(c_nb, 1, 2) @ in_n @ c_nb
    cov += p.latency_sd**2 * rate[:, :, np.newaxis] * rate[:, np.newaxis, :]
    if any(left[0]) or any(left[1]):
        reference = found.reference
        seen = np.zeros(2) if reference is None else np.array([reference.level, reference.vertical])
        cov += considered(q, np.broadcast_to(seen, (len(q), 2)), 1.0, (0.0, 1.0), *left)
    return 0.5 * (cov + np.swapaxes(cov, 1, 2))


def _flags(found: Smoothed, place: NDArray[np.int64], cov: Floats) -> NDArray[np.uint32]:
    """What to know of each sample."""
    step = np.maximum(place - 1, 0)
    word = np.where(found.resting[step], flags.AT_REST, 0)
    if found.reference is None:
        word |= flags.HEADING_FREE
    else:
        word |= np.where(found.weight[step] < GATED, flags.MAG_GATED, 0)
    tilt = found.sweep.cov[place, 0, 0] + found.sweep.cov[place, 1, 1]
    word |= np.where(tilt > 2.0 * DOUBTFUL**2, flags.NOT_CONVERGED, 0)
    return word.astype(np.uint32)


def _everywhere(
    data: ImuData, frames: Keyframes, q: Floats, bias: Floats, cov: Floats, word: NDArray[np.uint32]
) -> tuple[Floats, Floats, Floats, NDArray[np.uint32]]:
    """The same at all samples, those in holes too: the shortest way between, as uncertain as it is long."""
    n = len(data)
    if frames.rows.size == n:
        return q, bias, cov, word
    t = np.asarray(data.t)
    after = np.clip(np.searchsorted(frames.rows, np.arange(n)), 0, frames.rows.size - 1)
    before = np.where(frames.rows[after] == np.arange(n), after, np.maximum(after - 1, 0))
    inside = before != after
    span = np.where(inside, frames.t[after] - frames.t[before], 1.0)
    share = np.clip(np.where(inside, (t - frames.t[before]) / span, 0.0), 0.0, 1.0)
    q_all = quat_slerp(q[before], q[after], share)
    step = quat_multiply(quat_conjugate(q[before]), q[after])
    angle = 2.0 * np.arccos(np.clip(np.abs(step[:, 0]), 0.0, 1.0))
    held = ~np.isin(np.arange(n), frames.rows)
    cov_all = cov[before] + (held * (0.5 * angle + np.where(inside, 0.0, math.pi)) ** 2)[
        :, np.newaxis, np.newaxis
    ] * np.eye(3)
    words = word[before] | np.asarray(data.flags)
    words = np.where(held, (words & ~np.uint32(flags.AT_REST)) | flags.GYR_HELD | flags.NOT_CONVERGED, words).astype(
        np.uint32
    )
    return q_all, bias[before], cov_all, words
