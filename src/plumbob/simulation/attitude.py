"""What a reference makes of the true attitude: the angles that an attitude and heading reference says itself."""

import math
from dataclasses import dataclass

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError
from plumbob.rotations import euler_zyx_from_quat, quat_from_euler_zyx
from plumbob.simulation.errors import stream


@dataclass(frozen=True, slots=True)
class AttitudeErrors:
    """Errors of the angles that a reference says.

    A sheet states one root mean square error for each angle, and not how it is spread over time. Half of its square is
    taken as constant within a run, as from installation and calibration, half as a first-order Gauss-Markov process.

    Parameters
    ----------
    heading, tilt : float
        Root mean square error over many runs of the heading, and of roll and pitch, each, rad.
    time : float
        Time after which the process that varies has forgotten itself to 1/e, s.

    Raises
    ------
    ParameterError
        If a number is outside its domain.
    """

    heading: float
    tilt: float
    time: float = 10.0

    def __post_init__(self) -> None:
        """Validate."""
        if not (0.0 <= self.heading < math.inf and 0.0 <= self.tilt < math.inf and 0.0 < self.time < math.inf):
            raise ParameterError(f"an attitude's errors are 0 rad or more, and their time above 0 s: {self}.")

    def said(self, q_nb: Floats, *, seed: int, rate: float) -> Floats:
        """Heading, pitch and roll (N, 3), rad, that a reference says of true attitudes.

        Parameters
        ----------
        q_nb : ndarray (N, 4)
            True attitudes of its axes in NED, evenly spaced.
        seed : int
            Of the random streams.
        rate : float
            Attitudes per second, Hz.
        """
        half = math.sqrt(0.5) * np.array([self.heading, self.tilt, self.tilt])
        constant = half * stream(seed, "attitude", "constant").standard_normal(3)
        wrong = euler_zyx_from_quat(q_nb) + constant + half * self._varying(len(q_nb), seed, rate)
        return euler_zyx_from_quat(quat_from_euler_zyx(wrong))  # a pitch beyond 90 degrees is one from the other side

    def _varying(self, count: int, seed: int, rate: float) -> Floats:
        """First-order Gauss-Markov process (count, 3) of standard deviation 1, from its first value on."""
        from scipy.signal import lfilter

        kept = math.exp(-1.0 / (rate * self.time))
        fed = math.sqrt(1.0 - kept**2) * stream(seed, "attitude", "varying").standard_normal((count, 3))
        fed[0] /= math.sqrt(1.0 - kept**2)
        return np.asarray(lfilter([1.0], [1.0, -kept], fed, axis=0))
