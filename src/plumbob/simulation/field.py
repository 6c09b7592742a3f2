"""The magnetic field of the Earth as one vector."""

import math

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError
from plumbob.rotations import Frame


def earth_field(frame: Frame, *, strength: float, dip: float, declination: float) -> Floats:
    """Magnetic flux density of the Earth in a navigation frame, (3,), µT.

    Parameters
    ----------
    frame : Frame
        Navigation frame.
    strength : float
        Total flux density, µT.
    dip : float
        Angle below the horizontal, rad: positive down, as in the northern hemisphere.
    declination : float
        Angle of magnetic North from true North, rad: positive to the east.

    Raises
    ------
    ParameterError
        If the strength is not positive, or an angle is impossible.
    """
    if not (0.0 < strength < math.inf and abs(dip) <= 0.5 * math.pi and abs(declination) <= math.pi):
        raise ParameterError(
            f"the Earth's field needs strength > 0 µT, |dip| ≤ π/2 and |declination| ≤ π, "
            f"but got {strength:g} µT, {dip:g} rad and {declination:g} rad."
        )
    magnetic_north = math.cos(declination) * frame.north + math.sin(declination) * frame.east
    return np.asarray(strength * (math.cos(dip) * magnetic_north - math.sin(dip) * frame.up))
