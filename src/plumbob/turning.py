"""Whether the gyroscope turns as the accelerometer sees gravity turn: their units and signs, from their own data."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from plumbob.check import Floats
from plumbob.data import ImuData

WINDOW: Final = 0.2
"""Time over which samples are averaged before they are compared, s."""
LARGEST_TURN: Final = 0.5
"""Turns of the acceleration from window to window beyond it are left out, rad: they are no small angles."""
QUIET: Final = 0.05
"""Windows count whose mean acceleration is as long as usual, within this fraction: little but gravity."""
MOST_PAIRS = 50_000
"""About so many pairs of windows are compared, spread over the recording; more would only take longer."""
ENOUGH_WINDOWS: Final = 50
ENOUGH_EFFECTIVE: Final = 5.0
"""A body that lies still and starts to spin within one window says anything: that one outweighs all others."""
ENOUGH_CORRELATION: Final = 0.7
"""From here on the rates explain half of what the acceleration does, and their factor can be trusted."""


@dataclass(frozen=True, slots=True)
class Turning:
    """How the direction of the acceleration follows the rates.

    Attributes
    ----------
    factor : float
        Seen turning over that which the rates say; 1 where both are right.
    correlation : float
        Of the two, −1 to 1; the constant bias of the gyroscope is taken out first.
    windows : int
        Pairs of neighbouring windows that count.
    effective : float
        How many pairs the rates are spread over: 1 where a single one has them all.
    """

    factor: float
    correlation: float
    windows: int
    effective: float = 0.0

    @property
    def tells(self) -> bool:
        """Whether there is enough motion, and little enough acceleration, to judge the factor."""
        enough = self.windows >= ENOUGH_WINDOWS and self.effective >= ENOUGH_EFFECTIVE
        return enough and abs(self.correlation) >= ENOUGH_CORRELATION


def turning(imu: ImuData) -> Turning:
    """Compare the turning of the acceleration with the rates, where the recording has both.

    A fixed direction a seen from a turning body changes by −ω × a dt. The change of the mean direction from window to
    window is fitted by k (−ω × a) dt + b × a dt, by least squares, with the factor k and a constant b.
    """
    nothing = Turning(float("nan"), 0.0, 0)
    size = _window(imu.t)
    if imu.gyr is None or imu.acc is None or len(imu) < 3 * size:
        return nothing
    t = _means(imu.t[:, np.newaxis], size)[:, 0]
    rate, acc = _means(imu.usable("gyr"), size), _means(imu.usable("acc"), size)
    norm = np.sqrt(np.sum(acc * acc, axis=1))
    if not (np.isfinite(norm).any() and np.nanmedian(norm) > 0.0):
        return nothing
    quiet = np.abs(norm / np.nanmedian(norm) - 1.0) < QUIET  # False where unknown
    with np.errstate(divide="ignore", invalid="ignore"):
        up = acc / norm[:, np.newaxis]
    i = np.arange(0, t.size - 1, 1 + t.size // MOST_PAIRS)
    step = t[i + 1] - t[i]
    seen = up[i + 1] - up[i]
    middle = 0.5 * (up[i + 1] + up[i]) * step[:, np.newaxis]
    said = -np.cross(0.5 * (rate[i + 1] + rate[i]), middle)
    counts = quiet[i + 1] & quiet[i] & (step < 1.5 * np.median(step)) & np.isfinite(said).all(axis=1)
    counts &= np.sum(seen * seen, axis=1) < LARGEST_TURN**2
    return _fit(seen[counts], said[counts], middle[counts]) if counts.any() else nothing


def _window(t: Floats) -> int:
    return max(1, round(WINDOW / float(np.median(np.diff(t))))) if t.size > 1 else 1


def _means(values: Floats, size: int) -> Floats:
    """Means of windows of `size` samples; NaN where fewer than half of them are known."""
    windows = values[: values.shape[0] // size * size].reshape(-1, size, values.shape[1])
    known = np.isfinite(windows)
    count = known.sum(axis=1)
    total = np.where(known, windows, 0.0).sum(axis=1)
    return np.where(2 * count >= size, total / np.maximum(count, 1), np.nan)


def _fit(seen: Floats, said: Floats, middle: Floats) -> Turning:
    """Least squares with the constant taken out of both sides first."""
    x, y, z = middle.T
    zero = np.zeros_like(x)
    constant = np.stack(
        (np.column_stack((zero, -z, y)), np.column_stack((z, zero, -x)), np.column_stack((-y, x, zero))), axis=2
    ).reshape(-1, 3)  # columns e × a dt
    basis, _ = np.linalg.qr(constant)
    both = np.column_stack((seen.ravel(), said.ravel()))
    seen_left, said_left = (both - basis @ (basis.T @ both)).T
    product, seen_power, said_power = seen_left @ said_left, seen_left @ seen_left, said_left @ said_left
    if not (seen_power > 0.0 and said_power > 0.0):
        return Turning(float("nan"), 0.0, len(seen))
    correlation = float(product / np.sqrt(seen_power) / np.sqrt(said_power))
    share = np.sum(said_left.reshape(-1, 3) ** 2, axis=1) / said_power
    return Turning(float(product / said_power), correlation, len(seen), float(1.0 / (share @ share)))
