"""The virtual unit of an array, with the differences of its units put right where that is asked for."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from plumbob.arm.array.monitoring import Monitored
from plumbob.arm.array.relative import ArrayInfo, corrected, info
from plumbob.arm.array.virtual_unit import Combined, combined
from plumbob.data.array import ImuArray

if TYPE_CHECKING:
    from plumbob.door.reading import Source


def combine(
    array: "ImuArray | Source | Sequence[Source]",
    *,
    weights: str = "noise",
    excluded: Monitored | Mapping[str, ArrayLike] | None = None,
    correct: bool | ArrayInfo = False,
    causal: bool = False,
) -> Combined:
    """Combine all units of an array to one.

    Every sensor axis that has a value takes part, in every row: an axis at the end of its range, a unit that is dead, a
    triad that is absent or slower is left out of that row alone. Accelerometers at lever arms are taken to the
    reference point: f_i = f + ω̇ × r_i + ω × (ω × r_i), with ω of the gyroscopes, and ω̇ an unknown beside f that the
    gyroscopes know by their differences, and the accelerometers where their levers span it.

    Parameters
    ----------
    array : ImuArray, or what `plumbob.read_array` reads
        The units. Clock offsets of its mounts are put right by interpolation.
    weights : {"noise", "range", "equal"}
        Inverse variances from the noise cards, equal where there are none; inverse squares of the ranges; or equal.
    excluded : Monitored or mapping of str to array_like (N, U) of bool, optional
        By triad: what is left out, as a monitor has found it.
    correct : bool or ArrayInfo
        Take off the small rotations, relative biases and clock offsets that `info` estimates, or has estimated.
    causal : bool
        Take the angular acceleration from samples before only; default: from both sides.

    Returns
    -------
    Combined

    Raises
    ------
    ShapeError
        If in no row the axes of any triad span the body, or a mask does not fit.

    Examples
    --------
    >>> import numpy as np
    >>> from plumbob import ImuData
    >>> from plumbob.arm.array import combine
    >>> from plumbob.data.array import ImuArray, Mount
    >>> t, up = np.arange(10) / 10, np.tile([0.0, 0.0, 9.8], (10, 1))
    >>> upside_down = Mount(q_bs=(0.0, 1.0, 0.0, 0.0))
    >>> array = ImuArray({"a": ImuData(t, acc=up), "b": ImuData(t, acc=-up)}, {"b": upside_down})
    >>> combine(array).imu.acc[0].tolist()
    [0.0, 0.0, 9.8]
    """
    from plumbob.door.reading import opened_array

    array = opened_array(array)
    if correct is not False:
        array = corrected(array, info(array) if correct is True else correct)
    return combined(array, weights, excluded, causal)
