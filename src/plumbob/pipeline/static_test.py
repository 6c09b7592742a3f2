"""The static test of the buoy paper [Yu2018] on a pair of recordings: a unit at rest in many poses, and a reference."""

from collections.abc import Collection
from dataclasses import replace
from typing import Final

import numpy as np

from plumbob.calib.mean import mean_of_whole
from plumbob.calib.model import apply_card
from plumbob.calib.refusal import CaptureRefusedError, Reason
from plumbob.calib.still import stills
from plumbob.cards import CalibrationCard
from plumbob.check import Floats
from plumbob.data import AttitudeTrack, ImuData
from plumbob.evaluate import evaluate
from plumbob.evaluate.static_test import StaticTest
from plumbob.pipeline.offline import Stage, estimate
from plumbob.rotations import quat_mean

FEWEST: Final = 2
"""Rests that make a test: one alone shows no difference between headings."""


def static_test(
    imu: ImuData,
    reference: AttitudeTrack,
    card: CalibrationCard,
    *,
    align: Collection[str] = (),
    declination: float | None = None,
    least: float = 1.0,
) -> StaticTest:
    """Compare what accelerometer and magnetometer say at rest with a reference, before and after a calibration.

    Parameters
    ----------
    imu : ImuData
        The recording, uncalibrated, with acc and mag.
    reference : AttitudeTrack
        Attitude on the same time line.
    card : CalibrationCard
        Of the unit.
    align : collection of str
        Constants to find and remove, as in `plumbob.evaluate.evaluate`; by default none.
    declination : float, optional
        Of the place, rad, where one heading is true and the other magnetic.
    least : float
        Shortest rest, s.

    Raises
    ------
    CaptureRefusedError
        If the unit rested less than twice where the reference tells an attitude.
    CalibrationError
        If the card does not fit the recording.
    FrameError, ParameterError, ShapeError
        As in `plumbob.evaluate.evaluate`.
    """
    rests = stills(imu.t, imu.usable("acc"), None if imu.gyr is None else imu.usable("gyr"), least=least)
    spans = np.array([(imu.t[rest.start], imu.t[rest.stop - 1]) for rest in rests]).reshape(-1, 2)
    means = [_mean_attitude(reference, *span) for span in spans]
    known = [i for i, mean in enumerate(means) if mean is not None]
    if len(known) < FEWEST:
        raise CaptureRefusedError(_too_few(len(rests), len(known)))
    kept, spans = [rests[i] for i in known], spans[known]
    truth = AttitudeTrack(
        t=spans.mean(axis=1),
        q_nb=np.stack([mean for mean in means if mean is not None]),
        frame=reference.frame,
        north=reference.north,
        source=reference.source,
    )
    before, after = (
        evaluate(_tilt_and_compass(used, kept, truth), truth, align=align, declination=declination)
        for used in (imu, apply_card(card, imu))
    )
    return StaticTest(spans, before, after)


def _tilt_and_compass(imu: ImuData, rests: list[slice], truth: AttitudeTrack) -> AttitudeTrack:
    """Attitude of the mean specific force and field of each rest."""
    acc, mag = (np.stack([mean_of_whole(imu.usable(name)[rest]) for rest in rests]) for name in ("acc", "mag"))
    looks = ImuData(t=truth.t, acc=acc, mag=mag, meta=replace(imu.meta, rate_nominal=None))
    return estimate(looks, Stage("tilt_compass", {}), frame=imu.meta.frame or truth.frame)


def _mean_attitude(track: AttitudeTrack, first: float, last: float) -> Floats | None:
    """Mean attitude of a track over a time, (4,), or None where it has none."""
    q = track.q_nb[(track.t >= first) & (track.t <= last)]
    return quat_mean(q) if np.isfinite(q).all(axis=1).any() else None


def _too_few(rests: int, known: int) -> Reason:
    return Reason(
        "too-few",
        f"The unit was at rest {rests} times, {known} of them while the reference tells an attitude; a static test "
        f"needs {FEWEST} at least.",
        "Let the unit rest for some seconds in each pose, and let both recordings have one time line.",
    )
