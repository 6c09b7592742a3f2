"""What a gyroscope's bias depends on: temperature, rate and specific force, as the trackball paper has it, corrected.

::

    N = A0 + k_T (T − 25 °C) + B_s ω + k_a a        drift [Chen2013] (1) to (5), corrected
    ω = measured − N                                compensated rate

k_T per axis, B_s per axis, k_a a full 3×3 matrix: axis i of a gyroscope answers to the specific force along any axis j.

Departures from [Chen2013]: its (5) has A, which contains the temperature already, where A0 belongs; its k_a is one
number times each axis' own acceleration in g, here k_a times the unit matrix, in SI; ω in B_s ω is the true rate, so
the compensated rate is divided by 1 + B_s. The random part i is not modelled: nothing that is known removes it.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Final, Self

import numpy as np
from numpy.typing import ArrayLike

from plumbob.core import check, flags
from plumbob.core.check import Floats
from plumbob.core.errors import CalibrationError, ParameterError
from plumbob.core.findings import Finding, info, warning
from plumbob.core.kernels import kernel
from plumbob.core.units import Quantity, dps, g, given, to_dps
from plumbob.data import ImuData
from plumbob.rotations.kernels import quat_exp, quat_mul

if TYPE_CHECKING:
    from plumbob.filters.channel import RateFilter


def rotation_vectors(rate: Floats, dt: Floats) -> Floats:
    """Rotation vectors (N−1, 3), rad, between instants with rates (N, 3), rad/s, and steps (N−1,), s.

    Exact where the rate changes linearly, up to the third order of the step: half the sum, and ω₁ × ω₂ dt²/12 for the
    turn of the axis itself [Bortz1971].
    """
    first, second, step = rate[:-1], rate[1:], dt[:, np.newaxis]
    return np.asarray(0.5 * step * (first + second) + step**2 / 12.0 * np.cross(first, second))  # [Bortz1971] (4)


@kernel
def accumulate(r: Floats, q: Floats) -> None:
    """Attitudes q (N, 4) from the identity on by rotation vectors r (N−1, 3) in the axes of the body."""
    q[0, 0], q[0, 1], q[0, 2], q[0, 3] = 1.0, 0.0, 0.0, 0.0
    for i in range(r.shape[0]):
        w, x, y, z = quat_exp(r[i, 0], r[i, 1], r[i, 2])
        a, b, c, d = quat_mul(q[i, 0], q[i, 1], q[i, 2], q[i, 3], w, x, y, z)
        q[i + 1, 0], q[i + 1, 1], q[i + 1, 2], q[i + 1, 3] = a, b, c, d


def _nothing() -> Floats:
    return np.zeros(3)


@dataclass(frozen=True, eq=False, kw_only=True)
class GyroDrift:
    """Drift of one gyroscope; where (3,) is asked for, one number stands for all three axes.

    One number for the g-sensitivity stands for that number times the unit matrix, the paper's form.
    """

    bias: Floats = field(default_factory=_nothing)
    bias_per_k: Floats = field(default_factory=_nothing)
    scale: Floats = field(default_factory=_nothing)
    g_sensitivity: Floats = field(default_factory=lambda: np.zeros((3, 3)))
    temp_ref_c: float = 25.0

    def __post_init__(self) -> None:
        """Bring every array to its shape and validate it."""
        for name in ("bias", "bias_per_k", "scale"):
            object.__setattr__(self, name, _shaped(name, getattr(self, name), np.ones(3)))
        object.__setattr__(self, "g_sensitivity", _shaped("g_sensitivity", self.g_sensitivity, np.eye(3)))
        object.__setattr__(self, "temp_ref_c", float(_shaped("temp_ref_c", self.temp_ref_c, np.ones(()))))
        if not (self.scale > -1.0).all():
            raise CalibrationError(f"scale must be above −1, but it is {self.scale.tolist()}.")

    def offset(self, temp_c: ArrayLike | None = None, acc: ArrayLike | None = None) -> Floats:
        """Part of the drift that does not depend on the rate, (3,) or (N, 3), rad/s.

        CalibrationError if temperature or specific force is needed and missing.
        """
        drift = self.bias
        if self.bias_per_k.any():
            warmer = _given("temp_c", temp_c) - self.temp_ref_c
            drift = drift + warmer[..., np.newaxis] * self.bias_per_k  # [Chen2013] (3)
        if self.g_sensitivity.any():
            x, y, z = np.moveaxis(check.last_axis("acc", _given("acc", acc), 3), -1, 0)
            # In components, because a matrix product may round a part of a recording otherwise than the whole.
            # [Chen2013] (4): by a matrix
            drift = drift + np.stack([row[0] * x + row[1] * y + row[2] * z for row in self.g_sensitivity], axis=-1)
        return np.asarray(drift)

    def compensate(self, gyr: ArrayLike, temp_c: ArrayLike | None = None, acc: ArrayLike | None = None) -> Floats:
        """Rate (3,) or (N, 3), rad/s, of which the drift has been taken off; NaN where an input is NaN."""
        # [Chen2013] (1)
        return np.asarray((check.last_axis("gyr", gyr, 3) - self.offset(temp_c, acc)) / (1.0 + self.scale))

    def at_rest(self, gyr: ArrayLike, temp_c: ArrayLike | None = None, acc: ArrayLike | None = None) -> Self:
        """Return this drift with the bias that rates at rest (N, 3) show: the paper's J, [Chen2013] (6).

        What temperature and gravity contribute is taken off first, else `compensate` would take it off twice. The
        Earth's rate, up to 0.004 °/s, stays in the bias.
        """
        rates = check.rows("gyr", gyr, 3) - replace(self, bias=np.zeros(3)).offset(temp_c, acc)
        finite = np.isfinite(rates).all(axis=1)
        if not finite.any():
            raise CalibrationError("no row of gyr, temp_c and acc is finite; give a stretch at rest with all of them.")
        return replace(self, bias=rates[finite].mean(axis=0))


def chen2013() -> GyroDrift:
    """Figures that [Chen2013] takes for every MPU-3050: k_T = 0.1 °/s/°C, k_a = 0.1 °/s/g, B_s = 0; no bias.

    They reproduce the paper, and calibrate nothing: the next part may have another coefficient or another sign, and
    where the true one is 0.03 °/s/°C, this "compensation" over 20 °C leaves 1.4 °/s where nothing would have left 0.6.
    """
    return GyroDrift(bias_per_k=dps(np.full(3, 0.1)), g_sensitivity=dps(0.1 * np.eye(3)) / g(1.0))


DRIFTS: Final[Mapping[str, Callable[[], GyroDrift]]] = {"chen2013": chen2013}  # drift models by name
_KEPT = np.uint32(flags.GYR_HELD | flags.TIME_FAULT)  # of the filter's flags; the others are the samples' own


class CompensatedRates:
    """Rates of a stream, or of a recording at once: less their drift and the constant of a rest, each axis filtered.

    `rate_filter` has three channels; other arguments are those of `plumbob.filter_rates`. The first samples that are
    taken hold the whole `rest`, whose end is `rest_ends`, s.
    """

    def __init__(
        self,
        rate_filter: "RateFilter",
        *,
        drift: str | GyroDrift | None = None,
        rest: Sequence[float | str] | None = None,
        say: Callable[[Finding], None] = lambda finding: None,
    ) -> None:
        self.filter = rate_filter
        self.drift = _model(drift)
        self._rest = None if rest is None else tuple(given("rest", end, Quantity.TIME) or 0.0 for end in rest)
        self.rest_ends = self._rest[1] if self._rest else 0.0
        self._say, self._begun = say, False

    def take(self, imu: ImuData) -> ImuData:
        """Take the next samples, and return them with their rates compensated and filtered.

        Raises ParameterError if no sample was taken in the rest.
        """
        if not self._begun:
            self._begin(imu)
        self._begun = True
        filtered = self.filter.process(imu.t, self.drift.compensate(imu.usable("gyr"), imu.temp_c, imu.acc))
        return imu.corrected(gyr=filtered.rate, meta=imu.meta).flagged(filtered.flags & _KEPT)

    def _begin(self, imu: ImuData) -> None:
        self.drift = _usable(self.drift, imu, self._say)
        if self._rest is not None:
            self.drift = _at_rest(self.drift, imu, self._rest[0], self.rest_ends, self._say)
        self._say(info("rates.filter", filter=self.filter.describe()))


def _model(drift: str | GyroDrift | None) -> GyroDrift:
    if drift is None or isinstance(drift, GyroDrift):
        return drift or GyroDrift()
    if drift not in DRIFTS:
        raise ParameterError(
            f"'{drift}' is not a drift model; known: {', '.join(DRIFTS)}. That of your own unit is a calibration "
            "card, as 'plumbob calibrate gyro' and 'plumbob calibrate temperature' write it: --calibration."
        )
    return DRIFTS[drift]()


def _usable(model: GyroDrift, imu: ImuData, say: Callable[[Finding], None]) -> GyroDrift:
    """Model without the parts whose sensor the recording lacks."""
    if model.bias_per_k.any() and imu.temp_c is None:
        say(warning("rates.no_temperature"))
        model = replace(model, bias_per_k=np.zeros(3))
    if model.g_sensitivity.any() and imu.acc is None:
        say(warning("rates.no_force"))
        model = replace(model, g_sensitivity=np.zeros((3, 3)))
    if model.bias_per_k.any():
        say(info("rates.drift_of_temperature", slope=_three(to_dps(model.bias_per_k)), from_c=model.temp_ref_c))
    if model.g_sensitivity.any():
        per_g = to_dps(model.g_sensitivity) * g(1.0)
        say(info("rates.drift_of_force", slope=", ".join(map(_three, per_g))))
    return model


def _at_rest(model: GyroDrift, imu: ImuData, start: float, stop: float, say: Callable[[Finding], None]) -> GyroDrift:
    rows = (imu.t >= start) & (imu.t < stop)
    still = imu.picked(rows) if rows.any() else None
    if still is None or still.gyr is None:
        raise ParameterError(
            f"rest = {start:g} to {stop:g} s holds no sample; the recording goes from {imu.t[0]:g} to {imu.t[-1]:g} s."
        )
    resting = model.at_rest(still.usable("gyr"), still.temp_c, still.acc)  # [Chen2013] (6)
    say(info("rates.constant", bias=_three(to_dps(resting.bias)), start=start, stop=stop))
    return resting


def _three(values: Floats) -> str:
    return " ".join(f"{value:.4g}" for value in values)


def _given(name: str, value: ArrayLike | None) -> Floats:
    if value is None:
        raise CalibrationError(f"the drift depends on {name}, but none is given; pass {name}.")
    return check.floats(name, value)


def _shaped(name: str, value: ArrayLike, unit: Floats) -> Floats:
    """Array of the shape of `unit`, or a number times it."""
    array = check.floats(name, value)
    shaped = array * unit if array.ndim == 0 else array
    if shaped.shape != unit.shape or not np.isfinite(shaped).all():
        raise CalibrationError(f"{name} must be a number or of shape {unit.shape}, finite, but it is {array.tolist()}.")
    return check.read_only(shaped)
