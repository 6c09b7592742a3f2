"""A filter started from the truth: the first attitude of a reference, in the frame and from the north of the filter."""

import numpy as np

from plumbob.check import Floats
from plumbob.data import AttitudeTrack, ImuData
from plumbob.errors import ParameterError
from plumbob.evaluate.align import turn_heading
from plumbob.evaluate.associate import default_max_gap, read_at
from plumbob.evaluate.headings import heading_policy
from plumbob.filters import Filter, Start
from plumbob.rotations import Frame, North, change_frame


def start_from(reference: AttitudeTrack | None, imu: ImuData, filter_: Filter) -> tuple[ImuData, Start]:
    """Samples from the first one on whose attitude a reference knows, and that attitude as the filter's start.

    Parameters
    ----------
    reference : AttitudeTrack or None
        The truth, on the time line of the samples.
    imu : ImuData
        The recording.
    filter_ : Filter
        What is started; it says frame, declination and whether a magnetometer tells its north.

    Raises
    ------
    ParameterError
        If there is no reference, or it knows no attitude at any sample.
    FrameError
        If its heading is true and the filter's magnetic, or the other way round, and no declination is known.
    """
    if reference is None:
        raise ParameterError(
            "init 'truth' takes the first attitude of the recording's reference, but it has none; give "
            "ROLL,PITCH,HEADING with units, or level."
        )
    reading = read_at(reference, imu.t_ns, max_gap=default_max_gap(reference))
    known = np.flatnonzero(np.isfinite(reading.q_nb).all(axis=1))
    if not known.size:
        raise ParameterError(
            "init 'truth' takes the first attitude of the reference, but that knows none at any sample of the "
            "recording; do both count time from the same start?"
        )
    first = int(known[0])
    return imu[first:], start_at(reading.q_nb[first], reference.frame, reference.north, filter_, "mag" in imu.triads)


def start_at(q_nb: Floats, frame: Frame, north: North, filter_: Filter, has_mag: bool) -> Start:
    """Start of a true attitude (4,), whose frame and north are given."""
    q_nb = change_frame(q_nb, to=filter_.frame, from_=frame)
    own = filter_.north(has_mag)
    if own is North.FREE or north is North.FREE:  # a gyroscope alone keeps the north that it is given
        return Start(q_nb, north)
    policy = heading_policy(own, north, aligned=False, declination=filter_.common.declination)
    return Start(turn_heading(q_nb, policy.turn, filter_.frame))
