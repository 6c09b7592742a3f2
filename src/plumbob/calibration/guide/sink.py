"""Guided captures: a guide beside a line, or over a recording."""

from collections.abc import Callable
from typing import Final

import numpy as np

from plumbob.acquisition.transport import Event, Stop
from plumbob.calibration.ellipsoid.ellipsoid_fit import Ellipsoid, Shape, fit_norm
from plumbob.calibration.guide.accel import AccelGuide
from plumbob.calibration.guide.guide import Guide, Progress, RestGuide
from plumbob.calibration.guide.mag import MagGuide
from plumbob.calibration.predicted import REGIONS
from plumbob.data import ImuData
from plumbob.session.stream import Part

GUIDES: Final[dict[str, type[Guide]]] = {"mag": MagGuide, "accel": AccelGuide, "gyro": RestGuide}
"""Guide of each kind of `plumbob calibrate` that has one."""

_CHUNK: Final = 4096


class GuideSink:
    """Hands the samples of a line to a guide, shows its progress, and stops the line when it is enough.

    Parameters
    ----------
    guide : Guide
        The guide.
    stop : Stop
        Set when the capture is good.
    show : callable
        Gets the progress after each part.
    """

    def __init__(self, guide: Guide, stop: Stop, show: Callable[[Progress], None]) -> None:
        self._guide, self._stop, self._show = guide, stop, show

    def on_part(self, part: Part) -> None:
        """Go on, and stop when it is enough."""
        progress = self._guide.feed(part.sensed)
        self._show(progress)
        if progress.done:
            self._stop.set()

    def on_event(self, event: Event) -> None:
        """Go on: a line that comes back goes on with the same unit in the same capture."""

    def close(self) -> None:
        """Nothing is held open."""


def guided(guide: Guide, imu: ImuData) -> Progress:
    """Progress at the end of a recording, uncalibrated in what is calibrated; the guide's timeline shows the way."""
    for part in imu.chunks(_CHUNK):
        progress = guide.feed(part)
    return progress


def warm_up() -> None:
    """Compile what guides need now, so that no sample has to wait for it."""
    fit_norm(10.0 * REGIONS, Shape.SPHERE, Ellipsoid(np.zeros(3), 0.1 * np.eye(3)))
