"""Attitude of an array: the units combined, watched, and estimated as one virtual unit."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from plumbob.arm.array.direction_filter import NAME, noise_params, track_directions
from plumbob.arm.array.monitoring import Monitored, MonitoringSettings, monitor
from plumbob.core.errors import ParameterError
from plumbob.core.text import FactsText
from plumbob.data import AttitudeTrack
from plumbob.data.array import ImuArray
from plumbob.door.estimate import Estimated
from plumbob.door.estimate import estimate as estimate_one
from plumbob.filters import SMOOTHER, takes_noise
from plumbob.filters.offline import navigation_frame
from plumbob.rotations import Frame


@dataclass(frozen=True, eq=False, repr=False)
class ArrayEstimated(FactsText):
    """Attitude of an array.

    Attributes
    ----------
    track : AttitudeTrack
        Attitude of the body at every sample; its flags say where a unit was left out.
    monitored : Monitored
        The virtual unit, and the state of each unit.
    estimated : Estimated or None
        What `plumbob.estimate` made of it; None where the filter is "directions".
    """

    track: AttitudeTrack
    monitored: Monitored
    estimated: Estimated | None = None

    def facts(self) -> Mapping[str, str]:
        """Units, filter and faults."""
        return {**self.monitored.facts(), "estimated by": self.track.source}


def estimate(
    array: ImuArray,
    filter: str | None = None,
    *,
    causal: bool = False,
    lag: float | str | None = None,
    params: Mapping[str, Any] | None = None,
    frame: Frame | str | None = None,
    init: str | None = None,
    settings: MonitoringSettings | None = None,
) -> ArrayEstimated:
    """Estimate the attitude of the body of an array from all units that agree.

    Parameters
    ----------
    array : ImuArray
        The units; the noise cards of their mounts give the noise of the virtual unit.
    filter : str, optional
        As of `plumbob.estimate`, whose default is the smoother, or "directions": a small causal filter of the noise
        alone, for an array that hardly accelerates in a field that nothing disturbs.
    causal, lag, params, frame, init
        As of `plumbob.estimate`. The monitor is always causal: what it leaves out is known from samples before.
    settings : MonitoringSettings, optional
        Of the monitor; its `gyr_bias` is what "directions" starts from, over the square root of the number of units.

    Returns
    -------
    ArrayEstimated

    Raises
    ------
    FrameError
        If neither `frame` nor the recording names a frame.
    ParameterError
        If the filter or a parameter is not known.
    """
    watched = monitor(array, settings=settings)
    if filter == NAME:
        if lag is not None or init is not None:
            raise ParameterError(
                "the filter 'directions' takes neither lag nor init; it is causal and starts by itself."
            )
        frame = navigation_frame(watched.imu, None if frame is None else Frame.parse(frame), where="the array")
        start = (settings or MonitoringSettings()).gyr_bias / math.sqrt(len(array.units))
        noises = noise_params(watched.noise, start)
        unknown = [name for name in params or {} if name not in noises._fields]
        if unknown:
            raise ParameterError(
                f"directions has no parameter '{unknown[0]}'; known are {', '.join(noises._fields)}, as numbers in SI."
            )
        return ArrayEstimated(track_directions(watched.imu, frame, noises._replace(**(params or {}))), watched)
    noise = watched.noise if takes_noise(filter or SMOOTHER) else None
    made = estimate_one(watched.imu, filter, causal=causal, lag=lag, params=params, frame=frame, init=init, noise=noise)
    return ArrayEstimated(made.track, watched, made)
