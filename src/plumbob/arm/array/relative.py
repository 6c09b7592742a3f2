"""How the units of an array differ, and one unit made of them all with these differences put right.

Differences are small rotations, relative biases and clock offsets, each with its uncertainty.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from plumbob.arm.array.channels import aligned, densities, nominal_step, stacked, with_noise
from plumbob.arm.array.monitoring import Monitored
from plumbob.arm.array.virtual_unit import Combined, combined
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError
from plumbob.core.result import Reported, plain
from plumbob.data import TRIADS, ImuData
from plumbob.data.array import ImuArray
from plumbob.rotations import quat_from_rotvec, quat_multiply, skew

if TYPE_CHECKING:
    from plumbob.door.reading import Source

PRIOR: Final = {"rotation": 0.2, "gyr": 0.1, "acc": 0.3, "mag": 5.0, "clock": 1.0}
"""Standard deviations before anything is seen: rad, rad/s, m/s², µT, s."""
MOVES: Final = 5.0
"""A rate of so many standard deviations of its noise is a motion; only then does it show rotation and clock."""
RELIABLE: Final = 0.5
"""The angular acceleration must be at least this share motion and not noise, or the clock stays unknown."""
ROUNDS: Final = 4
_SIZE = 13  # rotation, three biases, clock
_SEARCHED = 1.0  # s, on both sides


@dataclass(frozen=True, slots=True, eq=False)
class UnitInfo:
    """How a unit differs from the mean of all, each with its standard deviation.

    `rotation` (3,): small rotation beyond its mount, body axes, rad: true C_bs = exp(rotation) C_bs of the mount;
    `bias` (3,): by triad, body axes; `clock_offset`: by how much later than the mount says its values were taken, s,
    NaN where nothing has shown it; `parity_rms`: by triad, what its axes measure beyond the mean.
    """

    name: str
    rotation: Floats
    rotation_sd: Floats
    bias: Mapping[str, Floats]
    bias_sd: Mapping[str, Floats]
    clock_offset: float
    clock_sd: float
    parity_rms: Mapping[str, float]


@dataclass(frozen=True, eq=False, repr=False)
class ArrayInfo(Reported):
    """How the units of an array differ.

    Attributes
    ----------
    units : tuple of UnitInfo
        One each, in order.
    samples : int
        That were looked at.
    duration : float
        Their time, s.
    """

    units: tuple[UnitInfo, ...]
    samples: int
    duration: float

    def facts(self) -> Mapping[str, str]:
        """Units and samples."""
        return {"units": ", ".join(u.name for u in self.units), "samples": f"{self.samples}, {self.duration:.6g} s"}

    def __getitem__(self, name: str) -> UnitInfo:
        """Of one unit; ParameterError if the array lacks it."""
        for unit in self.units:
            if unit.name == name:
                return unit
        raise ParameterError(f"there is no unit '{name}'; units are {', '.join(unit.name for unit in self.units)}.")

    def summary(self) -> dict[str, Any]:
        """All numbers, as JSON can hold them; SI."""
        return dict(plain({"samples": self.samples, "duration_s": self.duration, "units": list(self.units)}))


def info(array: "ImuArray | Source | Sequence[Source]") -> ArrayInfo:
    """Estimate how the units of an array differ from their mean.

    A small rotation of each unit shows in rates, forces and fields; a relative bias in each of them; a clock offset in
    what the rates change. All of a unit are estimated together by least squares, with priors that hold what nothing
    shows: at rest in one pose a rotation about the vertical shows in the field alone, and about a level axis it cannot
    be separated from a bias of the accelerometer.

    Parameters
    ----------
    array : ImuArray, or what `plumbob.read_array` reads
        The units. They should have been turned about all axes.

    Returns
    -------
    ArrayInfo

    Raises
    ------
    ParameterError
        If there is one unit only.
    """
    from plumbob.door.reading import opened_array

    array = opened_array(array)
    if len(array.units) < 2:
        raise ParameterError("one unit cannot be compared with others; an array needs two units at least.")
    array = with_noise(array)
    late = _coarse(array)
    fits: list[_RelativeFit] = []
    for _ in range(ROUNDS):
        mounts = {
            name: replace(mount, clock_offset=mount.clock_offset + float(more))
            for (name, mount), more in zip(array.mounts.items(), late, strict=True)
        }
        shifted = aligned(ImuArray(array.units, mounts))
        virtual = combined(shifted, "noise", None, causal=False)
        fits = [_fit(shifted, virtual, u) for u in range(len(array.units))]
        steps = np.array([0.0 if np.isnan(fit.clock_sd) else fit.x[12] for fit in fits])
        late += steps
        if (np.abs(steps) < 1e-6).all():
            break
    rms = virtual.parity_rms
    places = {triad: slice(3 + 3 * i, 6 + 3 * i) for i, triad in enumerate(TRIADS)}
    units = []
    for u, (name, fit) in enumerate(zip(array.names, fits, strict=True)):
        bias, bias_sd = ({triad: of[places[triad]] for triad in rms} for of in (fit.x, fit.sd))
        clock = float("nan") if np.isnan(fit.clock_sd) else float(late[u] - late.mean())
        residual = {k: float(np.sqrt(np.nanmean(of[u] ** 2))) for k, of in rms.items() if np.isfinite(of[u]).any()}
        units.append(UnitInfo(name, fit.x[:3], fit.sd[:3], bias, bias_sd, clock, fit.clock_sd, residual))
    return ArrayInfo(tuple(units), len(array), float(array.t[-1] - array.t[0]))


def corrected(array: ImuArray, found: ArrayInfo) -> ImuArray:
    """Array with what `info` found put right: its mounts turned, biases taken off, clocks set."""
    units, mounts = {}, {}
    for name, imu in array.units.items():
        unit, mount = found[name], array.mounts[name]
        late = 0.0 if np.isnan(unit.clock_offset) else unit.clock_offset
        q_bs = quat_multiply(quat_from_rotvec(unit.rotation), np.array(mount.q_bs))
        mounts[name] = replace(mount, q_bs=tuple(q_bs.tolist()), clock_offset=mount.clock_offset + late)
        less = {t: getattr(imu, t) - unit.bias[t] @ mount.dcm for t in imu.triads if t in unit.bias}
        units[name] = ImuData(
            imu.t, **less, temp_c=imu.temp_c, flags=imu.flags, meta=replace(imu.meta, unit_check=False)
        )
    return ImuArray(units, mounts)


def _coarse(array: ImuArray) -> Floats:
    """Clock offsets to the nearest sample, from the correlation of the sizes of rates with the first unit's."""
    late = np.zeros(len(array.units))
    if len(array) < 16:
        return late
    step = nominal_step(array)
    reach = min(round(_SEARCHED / step), len(array) // 4)
    sizes = np.linalg.norm(stacked(array, "gyr"), axis=2)
    sizes = np.where(np.isfinite(sizes), sizes, 0.0)
    noise = float(np.mean(densities(array.mounts, "gyr"))) / np.sqrt(step)
    if not float(np.std(sizes, axis=0).min()) > MOVES * noise:
        return late
    sizes = sizes - sizes.mean(axis=0)
    size = 1 << (2 * len(array) - 1).bit_length()
    spectra = np.fft.rfft(sizes, size, axis=0)
    for u in range(1, late.size):
        alike = np.fft.irfft(spectra[:, 0].conj() * spectra[:, u], size)
        near = np.concatenate((alike[-reach:], alike[: reach + 1]))
        late[u] = -(int(near.argmax()) - reach) * step  # its values come so much earlier
    centred: Floats = late - late.mean()
    return centred


class _RelativeFit(NamedTuple):
    x: Floats
    sd: Floats
    clock_sd: float


def _fit(array: ImuArray, combined: Combined, u: int) -> _RelativeFit:
    """Rotation, biases and clock offset of a unit, by least squares of its parity in body axes."""
    step, mount = nominal_step(array), list(array.mounts.values())[u]
    weights = [PRIOR["rotation"], PRIOR["gyr"], PRIOR["acc"], PRIOR["mag"]]
    normal = np.diag(np.concatenate((np.repeat(1.0 / np.square(weights), 3), [1.0 / PRIOR["clock"] ** 2])))
    right = np.zeros(_SIZE)
    reliable = 0.0
    for i, triad in enumerate(TRIADS):
        if triad not in combined.parity:
            continue
        parity = combined.parity[triad][:, u] @ mount.dcm.T
        mean = getattr(combined.imu, triad)
        there = np.isfinite(parity).all(axis=1) & np.isfinite(mean).all(axis=1)
        if there.sum() < 2:
            continue
        noise = float(np.mean(densities(array.mounts, triad)[u])) / np.sqrt(step)
        design = np.zeros((len(array), 3, _SIZE))
        design[:, :, 3 + 3 * i : 6 + 3 * i] = np.eye(3)
        moving = np.ones(len(array), dtype=bool)
        if triad == "gyr":
            moving = np.linalg.norm(mean, axis=1) > MOVES * noise
            slope = np.gradient(mean, array.t, axis=0)
            reliable = _reliable(slope[moving & there], noise / np.sqrt(len(array.units)), step)
            design[moving, :, 12] = slope[moving] if reliable > RELIABLE else 0.0
        design[moving, :, :3] = skew(mean[moving])
        a, b = design[there].reshape(-1, _SIZE), parity[there].reshape(-1)
        spread = max(noise, _robust(b))
        information = a.T @ a
        of_noise = 2.0 * float((moving & there).sum()) * noise**2 / len(array.units)
        information[:3, :3] = _less(information[:3, :3], of_noise)  # the noise of the mean shows no rotation
        normal += information / spread**2
        right += a.T @ b / spread**2
    cov = np.linalg.inv(normal)
    x, sd = cov @ right, np.sqrt(np.diag(cov))
    has_clock = reliable > RELIABLE
    return _RelativeFit(x, sd, float(sd[12]) if has_clock else float("nan"))


def _reliable(slope: Floats, noise: float, step: float) -> float:
    """Share of the slope's variance that is motion."""
    if len(slope) < 10:
        return 0.0
    share: float = 1.0 - 0.5 * (noise / step) ** 2 / float(np.mean(slope**2))
    return share


def _less(matrix: Floats, size: float) -> Floats:
    """Symmetric matrix less a multiple of one, but never below zero."""
    values, vectors = np.linalg.eigh(matrix)
    reduced: Floats = (vectors * np.maximum(values - size, 0.0)) @ vectors.T
    return reduced


def _robust(values: Floats) -> float:
    """Scatter of values about their median, as a standard deviation."""
    return 1.4826 * float(np.median(np.abs(values - np.median(values))))


def combine(
    array: "ImuArray | Source | Sequence[Source]", *, weights: str = "noise",
    excluded: Monitored | Mapping[str, ArrayLike] | None = None, correct: bool | ArrayInfo = False,
    causal: bool = False,
) -> Combined:  # fmt: skip
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
