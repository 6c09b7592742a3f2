"""The virtual unit of an array: least squares of all sensor axes, what each measures beyond it, and its attitude."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob.arm.array import channels
from plumbob.arm.array.direction_filter import NAME, noise_params, track_directions
from plumbob.arm.array.monitoring import Monitored, MonitoringSettings, common_flags, monitor, virtual
from plumbob.arm.array.solve import combine_rows, force_rows
from plumbob.core import check, flags
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError, ShapeError, unknown_name
from plumbob.core.result import Described, plain
from plumbob.core.series import Series
from plumbob.core.text import FactsText
from plumbob.data import TRIADS, AttitudeTrack, ImuData
from plumbob.data.array import ImuArray
from plumbob.door.estimate import Estimated
from plumbob.door.estimate import estimate as estimate_one
from plumbob.filters import SMOOTHER, takes_noise
from plumbob.filters.offline import navigation_frame
from plumbob.rotations import Frame

if TYPE_CHECKING:
    from plumbob.data.cards import NoiseCard


@dataclass(frozen=True, eq=False, repr=False)
class Combined(Series, Described):
    """An array as one unit.

    Attributes
    ----------
    imu : ImuData
        The virtual unit in body axes, at the body's reference point. Its noise falls as one over the square root of the
        number of units.
    parity : mapping of str to ndarray (N, U, 3)
        By triad: what each sensor axis measures beyond it, in the axes of each unit.
    names : tuple of str
        Names of the units.
    noise : NoiseCard or None
        Of the virtual unit, where a unit has a card.
    """

    imu: ImuData
    parity: Mapping[str, Floats]
    names: tuple[str, ...]
    noise: "NoiseCard | None" = None

    def __len__(self) -> int:
        return len(self.imu)

    @property
    def parity_rms(self) -> dict[str, Floats]:
        """Root mean square of the parity of each sensor axis (U, 3), by triad; NaN where it has no value."""
        rms = {}
        for triad, residual in self.parity.items():
            finite = np.isfinite(residual)
            count = finite.sum(axis=0)
            total = np.sum(np.where(finite, residual, 0.0) ** 2, axis=0)
            rms[triad] = np.sqrt(np.where(count > 0, total, np.nan) / np.maximum(count, 1))
        return rms

    def facts(self) -> Mapping[str, str]:
        """Units and samples."""
        return {"units": ", ".join(self.names), **self.imu.facts()}

    def columns(self) -> Mapping[str, NDArray[Any]]:
        """Of the virtual unit."""
        return self.imu.columns()

    def summary(self) -> dict[str, Any]:
        """What each sensor axis measures beyond the virtual unit, as JSON can hold it; SI and µT."""
        parts = {triad: getattr(self.noise, triad, None) for triad in TRIADS}
        noise = {triad: part.n_rpsd for triad, part in parts.items() if part is not None}
        return dict(
            plain({"units": list(self.names), "samples": len(self), "parity_rms": self.parity_rms, "noise": noise})
        )


def combined(
    array: ImuArray, weights: str, excluded: "Monitored | Mapping[str, ArrayLike] | None", causal: bool
) -> Combined:
    """Combine the units as their mounts say; arguments and errors as of `plumbob.array.combine`."""
    array = channels.aligned(array)
    out = _masks(excluded, array)
    axes, arms = channels.directions(array.mounts), channels.levers(array.mounts)
    values = np.full((len(array), 3, 3), np.nan)
    parity: dict[str, Floats] = {}
    for i, triad in enumerate(TRIADS):
        if all(getattr(imu, triad) is None for imu in array.units.values()):
            continue
        y = channels.stacked(array, triad)
        if triad in out:
            y = np.where(out[triad][:, :, np.newaxis], np.nan, y)
        weight, x, residual = channels.weighting(array, triad, weights), np.empty((len(array), 3)), np.empty(y.shape)
        if triad == "acc" and arms.any() and "gyr" in parity:
            rate = np.ascontiguousarray(values[:, 0])
            _forces(array, y, axes, weight, arms, rate, x, residual, causal)
        else:
            combine_rows(y, axes, weight, x, residual)
        values[:, i], parity[triad] = x, residual
    if not np.isfinite(values).any():
        raise ShapeError(
            "the axes of the array's units do not span the body in any sample: three axes that do not lie in a plane "
            "are needed. Check the mounts."
        )
    any_out = np.any([mask.any(axis=1) for mask in out.values()], axis=0) if out else np.zeros(len(array), dtype=bool)
    excluded_flags = np.where(any_out, np.uint32(flags.UNIT_EXCLUDED), np.uint32(0)).astype(np.uint32)
    imu = virtual(array, values, common_flags(array) | excluded_flags)
    return Combined(imu, parity, array.names, channels.combined_noise(array, imu.meta.device))


def _forces(
    array: ImuArray, y: Floats, axes: Floats, weight: Floats, arms: Floats, rate: Floats, x: Floats, residual: Floats,
    causal: bool,
) -> None:  # fmt: skip
    """Specific force at the reference point; where there is no rate, that of a body that does not turn."""
    step = channels.nominal_step(array)
    turn = _causal_slope(rate, array.t) if causal or len(array) < 2 else np.gradient(rate, array.t, axis=0)
    noise2 = 1.0 / float(np.mean(np.sum(1.0 / channels.densities(array.mounts, "gyr") ** 2, axis=0))) / step
    slope_var = 2.0 * noise2 / step**2 * (1.0 if causal else 0.25)
    acc_var = float(np.mean(channels.densities(array.mounts, "acc") ** 2)) / step
    turn_weight = float(np.mean(weight)) * acc_var / slope_var  # in the units of the weights
    finite_rate = np.where(np.isfinite(rate), rate, 0.0)
    force_rows(y, axes, weight, arms, finite_rate, turn, turn_weight, x, residual, np.zeros((6, 6)), np.zeros(6))


def _causal_slope(values: Floats, t: Floats) -> Floats:
    slope = np.zeros_like(values)
    slope[1:] = np.diff(values, axis=0) / np.diff(t)[:, np.newaxis]
    return slope


def _masks(excluded: "Monitored | Mapping[str, ArrayLike] | None", array: ImuArray) -> dict[str, NDArray[np.bool_]]:
    if excluded is None:
        return {}
    if isinstance(excluded, Monitored):
        excluded = {triad: excluded.excluded(triad) for triad in TRIADS}
    masks, shape = {}, (len(array), len(array.units))
    for triad, mask in excluded.items():
        check.one_of("excluded", triad, TRIADS)
        out = np.asarray(mask, dtype=bool)
        if out.shape != shape:
            raise ShapeError(f"excluded['{triad}'] must be of shape {shape}, samples and units, but it is {out.shape}.")
        masks[triad] = out
    return masks


@dataclass(frozen=True, eq=False, repr=False)
class ArrayEstimated(FactsText):
    """Attitude of an array."""

    track: AttitudeTrack  # of the body at every sample; its flags say where a unit was left out
    monitored: Monitored  # the virtual unit, and the state of each unit
    estimated: Estimated | None = None  # what `plumbob.estimate` made of it; None where the filter is "directions"

    def facts(self) -> Mapping[str, str]:
        """Units, filter and faults."""
        return {**self.monitored.facts(), "estimated by": self.track.source}


def estimate(
    array: ImuArray, filter: str | None = None, *, causal: bool = False, lag: float | str | None = None,
    params: Mapping[str, Any] | None = None, frame: Frame | str | None = None, init: str | None = None,
    settings: MonitoringSettings | None = None,
) -> ArrayEstimated:  # fmt: skip
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
            raise unknown_name(
                "parameter", unknown[0], noises._fields, of="directions", hint=" They are numbers in SI."
            )
        return ArrayEstimated(track_directions(watched.imu, frame, noises._replace(**(params or {}))), watched)
    noise = watched.noise if takes_noise(filter or SMOOTHER) else None
    made = estimate_one(watched.imu, filter, causal=causal, lag=lag, params=params, frame=frame, init=init, noise=noise)
    return ArrayEstimated(made.track, watched, made)
