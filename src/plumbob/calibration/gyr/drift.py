"""What a gyroscope's bias depends on: temperature, rate and specific force, as the trackball paper has it, corrected.

::

    N = A0 + k_T (T − 25 °C) + B_s ω + k_a a        drift [Chen2013] (1) to (5), corrected
    ω = measured − N                                compensated rate

It is kept as a `TriadCalibration`: k_T per axis, k_a a full 3×3 matrix, for axis i of a gyroscope answers to the
specific force along any axis j; the paper takes B_s as zero.

Departures from [Chen2013]: its (5) has A, which contains the temperature already, where A0 belongs; its k_a is one
number times each axis' own acceleration in g, here k_a times the unit matrix, in SI. The random part i is not modelled:
nothing that is known removes it.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np

from plumbob.calibration.fit import mean_of_whole
from plumbob.calibration.gyr.rest import UNCALIBRATED, Rates, without_known
from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.errors import CalibrationError, ParameterError
from plumbob.core.findings import Finding, info, warning
from plumbob.core.kernels import kernel
from plumbob.core.units import Quantity, dps, g, given, to_dps
from plumbob.data import ImuData
from plumbob.data.cards import TriadCalibration
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


def chen2013() -> TriadCalibration:
    """Figures that [Chen2013] takes for every MPU-3050: k_T = 0.1 °/s/°C, k_a = 0.1 °/s/g, B_s = 0; no bias.

    They reproduce the paper, and calibrate nothing: the next part may have another coefficient or another sign, and
    where the true one is 0.03 °/s/°C, this "compensation" over 20 °C leaves 1.4 °/s where nothing would have left 0.6.
    """
    per_g = dps(0.1 * np.eye(3)) / g(1.0)  # [Chen2013] (4): by a matrix
    return replace(UNCALIBRATED, bias_per_k=dps(np.full(3, 0.1)), g_sensitivity=per_g)  # [Chen2013] (3)


DRIFTS: Final[Mapping[str, Callable[[], TriadCalibration]]] = {"chen2013": chen2013}  # drift models by name
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
        drift: str | None = None,
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
        filtered = self.filter.process(imu.t, _without(self.drift, imu) - self.drift.bias)  # [Chen2013] (1)
        return imu.corrected(gyr=filtered.rate, meta=imu.meta).flagged(filtered.flags & _KEPT)

    def _begin(self, imu: ImuData) -> None:
        self.drift = _usable(self.drift, imu, self._say)
        if self._rest is not None:
            self.drift = _at_rest(self.drift, imu, self._rest[0], self.rest_ends, self._say)
        self._say(info("rates.filter", filter=self.filter.describe()))


def _without(drift: TriadCalibration, imu: ImuData) -> Floats:
    return without_known(Rates(imu.t, imu.usable("gyr"), imu.acc, temp_c=imu.temp_c, known=drift))


def _model(drift: str | None) -> TriadCalibration:
    if drift is None:
        return UNCALIBRATED
    if drift not in DRIFTS:
        raise ParameterError(
            f"'{drift}' is not a drift model; known: {', '.join(DRIFTS)}. That of your own unit is a calibration "
            "card, as 'plumbob calibrate gyro' and 'plumbob calibrate temperature' write it: --calibration."
        )
    return DRIFTS[drift]()


def _usable(model: TriadCalibration, imu: ImuData, say: Callable[[Finding], None]) -> TriadCalibration:
    """Model without the parts whose sensor the recording lacks."""
    if model.bias_per_k.any() and imu.temp_c is None:
        say(warning("rates.no_temperature"))
        model = replace(model, bias_per_k=np.zeros(3))
    if model.g_sensitivity.any() and imu.acc is None:
        say(warning("rates.no_force"))
        model = replace(model, g_sensitivity=np.zeros((3, 3)))
    if model.bias_per_k.any():
        say(info("rates.drift_of_temperature", slope=_three(to_dps(model.bias_per_k[0])), from_c=model.temp_ref_c))
    if model.g_sensitivity.any():
        per_g = to_dps(model.g_sensitivity) * g(1.0)
        say(info("rates.drift_of_force", slope=", ".join(map(_three, per_g))))
    return model


def _at_rest(
    model: TriadCalibration, imu: ImuData, start: float, stop: float, say: Callable[[Finding], None]
) -> TriadCalibration:
    rows = (imu.t >= start) & (imu.t < stop)
    rest = imu.picked(rows) if rows.any() else None
    if rest is None or rest.gyr is None:
        raise ParameterError(
            f"rest = {start:g} to {stop:g} s holds no sample; the recording goes from {imu.t[0]:g} to {imu.t[-1]:g} s."
        )
    bias = mean_of_whole(_without(model, rest))  # [Chen2013] (6)
    if not np.isfinite(bias).all():
        raise CalibrationError("no row of gyr, temp_c and acc is finite; give a stretch at rest with all of them.")
    resting = replace(model, bias=bias)
    say(info("rates.constant", bias=_three(to_dps(resting.bias)), start=start, stop=stop))
    return resting


def _three(values: Floats) -> str:
    return " ".join(f"{value:.4g}" for value in values)
