"""Sea state of a burst: heights, periods and directions of waves by the acceleration of what floats on them.

The vertical acceleration's spectrum, less its noise, over (2πf)⁴ is that of the surface, E(f); its moments
``mₙ = Σ fⁿ E(f) Δf`` give ``Hm0 = 4 √m0``, ``Tm01 = m0 / m1``, ``Tm02 = √(m0 / m2)`` and ``Tm-10 = m-1 / m0``. With the
horizontal accelerations it gives the first Fourier coefficients of the directional distribution [LonguetHiggins1963],
which an accelerometer has as a displacement has them: the factor (2πf)⁴ cancels. Here a1 and a2 are northward and b1
and b2 eastward, of the direction that waves come **from**: ``atan2(b1, a1)`` counts from North over East.

Noise is what the spectrum holds below `LONGEST_WAVES`, where no wave of wind is, and no less than the noise card says.
Waves count from the lowest frequency at which two neighbouring densities stand above it that chance lifts so high once
in a hundred; longer ones may hide, and `SeaState.hidden` says how high.
"""

import math
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.quality.quality import FAIL, HOLE, PASS, SUSPECT
from plumbob.quality.spectra import Spectra, cross_spectra, peak_period

LONGEST_WAVES: Final = 0.03  # Hz; wind makes no swell longer than about 30 s
SHORTEST_WAVES: Final = 1.0  # Hz; shorter waves, of 1.6 m and less, pass below a float
NYQUIST_PART: Final = 0.8  # of half the rate: beyond it a sensor's own filter takes the waves away
PERIODS: Final = 2.0  # of the longest waves that a segment must hold, or they are taken for its mean and its drift
CHANCE: Final = 0.01  # that noise alone lifts a density so high that it counts as waves
CONFIDENCE: Final = 0.95  # of the bands
FOLLOWED: Final = 0.5  # response below which a hull is not used as a gauge: its table's errors would be doubled
CHECK_FACTOR: Final = (0.9, 1.1)  # [QARTODWaves]: of waves in deep water it is 1
SURE_FREEDOM: Final = 60.0
"""Degrees of freedom of moments by which their own errors are computed: with fewer, chance makes them look exact."""
TINY: Final = float(np.finfo(float).tiny)
STEEPNESS: Final = (0.1, 1.0 / 7.0)
"""Of Hm0 over the length of waves of Tm02: suspect [DNV205]; every wave would have broken [Michell1893]."""

BULK: Final = {  # numbers of a sea state, with their units here: angles are in rad
    "hm0": "m", "hm0_low": "m", "hm0_high": "m", "tp": "s", "tm01": "s", "tm02": "s", "tm_10": "s", "direction": "rad",
    "direction_sd": "rad", "spread": "rad", "spread_sd": "rad", "peak_direction": "rad", "peak_spread": "rad",
    "hidden": "m",
}  # fmt: skip


class WaveSettings(NamedTuple):
    """How sea states are computed."""

    noise: float = 0.0  # root density of the vertical acceleration's white noise by a noise card, m/s²/√Hz
    # low, high: frequencies from which to which waves count, Hz; from where they stand above the noise without `low`
    low: float | None = None
    high: float = SHORTEST_WAVES
    response: tuple[tuple[float, ...], tuple[float, ...]] | None = (
        None  # frequencies, Hz, and how much of a wave's height the hull rises
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class SeaState:
    """Sea state of a burst. What is not known is NaN; so are all directions without a heading."""

    frequency: Floats  # (F,), Hz
    density: Floats  # (F,), E, m²/Hz; NaN outside of `low` to `high`
    # a1, b1, a2, b2: (F,), coefficients of the direction that waves come from
    a1: Floats
    b1: Floats
    a2: Floats
    b2: Floats
    check: Floats  # (F,), check factor: horizontal over vertical motion, 1 in deep water
    freedom: float  # degrees of freedom of each density
    # low, high: the frequencies from which to which waves count, Hz
    low: float
    high: float
    noise: float  # density of the vertical acceleration that was taken off, (m/s²)²/Hz
    hm0: float = math.nan  # significant wave height, m
    # hm0_low, hm0_high: its band of `CONFIDENCE` for the sea that the burst is a sample of
    hm0_low: float = math.nan
    hm0_high: float = math.nan
    tp: float = math.nan  # period of the spectrum's peak, s
    # tm01, tm02, tm_10: mean periods, s
    tm01: float = math.nan
    tm02: float = math.nan
    tm_10: float = math.nan
    # direction, spread: mean of all waves, rad from North over East, and circular standard deviation
    direction: float = math.nan
    direction_sd: float = math.nan  # standard deviation of the mean direction, with the heading's
    spread: float = math.nan
    spread_sd: float = math.nan  # standard deviation of the spread
    # peak_direction, peak_spread: at the spectrum's peak
    peak_direction: float = math.nan
    peak_spread: float = math.nan
    hidden: float = math.nan  # significant height of waves longer than those that count which noise may hide, m
    tests: dict[str, int] = field(default_factory=dict)  # QARTOD's flags of the tests, by name

    @property
    def flag(self) -> int:
        """Worst flag of the tests."""
        return max(self.tests.values(), default=PASS)

    @property
    def band(self) -> tuple[float, float]:
        """Factors of E(f) that bound the sea's own with `CONFIDENCE`."""
        return _band(self.freedom)

    def summary(self) -> dict[str, Any]:
        """All numbers, as JSON can hold them, angles in degrees."""
        from plumbob.core.units import to_deg

        bulk = {
            f"{name}_deg" if unit == "rad" else f"{name}_{unit}": getattr(self, name) for name, unit in BULK.items()
        }
        degrees = {name: float(to_deg(value)) if name.endswith("_deg") else value for name, value in bulk.items()}
        spectrum = {name: getattr(self, name) for name in ("a1", "b1", "a2", "b2", "check")}
        return {
            **degrees, "low_hz": self.low, "high_hz": self.high, "degrees_of_freedom": self.freedom,
            "noise_density": self.noise, "flag": self.flag, "tests": dict(self.tests),
            "spectrum": {"frequency_hz": self.frequency, "density_m2_per_hz": self.density, **spectrum},
        }  # fmt: skip


def sea_state(
    t: Floats,
    acc_enu: Floats,
    *,
    step: float,
    segment: float,
    settings: WaveSettings | None = None,
    scale_sd: float = 0.0,
    heading_sd: float = math.nan,
) -> SeaState:
    """Sea state by the acceleration of a float.

    Parameters
    ----------
    t : ndarray (N,)
        Times, s.
    acc_enu : ndarray (N, 3)
        Acceleration without gravity east, north and up, m/s²; NaN where it is not known.
    step, segment : float
        Usual time between samples, and length of the segments of Welch's method, s.
    settings : WaveSettings, optional
        Noise card, frequencies that count, and the hull's response.
    scale_sd : float
        Standard deviation of the vertical acceleration's scale.
    heading_sd : float
        Standard deviation of the heading, rad; NaN where there is none, and then no direction.
    """
    settings = settings or WaveSettings()
    low, response = settings.low, settings.response
    at, values = bridged(t, acc_enu, step)
    is_short = segment * (LONGEST_WAVES if low is None else low) < PERIODS
    spectra = cross_spectra(at, values, step=step, segment=segment)
    f, density, nu = spectra.frequency, spectra.density, spectra.freedom
    follows = np.ones(f.size) if response is None else np.interp(f, *response, right=0.0)
    high = min(settings.high, NYQUIST_PART * 0.5 / step)
    if response is not None and (weak := (f > LONGEST_WAVES) & (follows < FOLLOWED)).any():
        high = min(high, float(f[weak][0]))
    vertical = density[:, 2, 2].real
    level, threshold = _noise(f, vertical, nu, settings.noise, high)
    nothing = np.full(f.size, math.nan)
    if low is None:
        low = _lowest(f, vertical > threshold * level, high)
    counts = (f >= low) & (f <= high) & (not is_short)
    to_height = 1.0 / ((2.0 * np.pi * f) ** 4 * np.where(follows >= FOLLOWED, follows, 1.0) ** 2)
    if not counts.any():
        hidden = _height(f, threshold * level * to_height, (f >= LONGEST_WAVES) & (f <= high))
        tests = {"gap": FAIL} if not spectra.segments else {"short": FAIL} if is_short else {"above noise": SUSPECT}
        return SeaState(
            frequency=f, density=nothing, a1=nothing, b1=nothing, a2=nothing, b2=nothing, check=nothing, freedom=nu,
            low=math.nan, high=high, noise=level, hidden=hidden if "above noise" in tests else math.nan, tests=tests,
        )  # fmt: skip
    height = np.where(counts, (vertical - level) * to_height, 0.0)
    east, north = density[:, 0, 0].real, density[:, 1, 1].real
    flat = np.maximum(east + north, TINY)
    above = vertical - level
    usable = counts & (above > 0.0)  # by chance one may lie below the noise, and then has no direction
    lifted = np.sqrt(np.where(usable, above * flat, 1.0))
    first = np.stack((density[:, 2, 1].imag, density[:, 2, 0].imag), axis=1) / lifted[:, np.newaxis]
    second = np.stack((north - east, 2.0 * density[:, 1, 0].real), axis=1) / flat[:, np.newaxis]
    is_directed = usable & math.isfinite(heading_sd)
    masked = [np.where(is_directed, column, math.nan) for column in (*first.T, *second.T)]
    first, second = (np.where(is_directed[:, np.newaxis], moment, 0.0) for moment in (first, second))
    check, least = (
        np.sqrt(np.divide(part, above, out=np.full(f.size, math.nan), where=usable))
        for part in (flat, np.maximum(flat - _tilt_noise(f, flat, vertical > threshold * level, low), 0.0))
    )
    hidden = _height(f, np.maximum(threshold * level, vertical) * to_height, (f >= LONGEST_WAVES) & (f < low))
    bulk = _heights(f, height, spectra.effective, nu, scale_sd)
    bulk |= _directions(f, height, first, second, spectra.effective, nu, heading_sd)
    return SeaState(
        frequency=f, density=np.where(counts, height, math.nan), a1=masked[0], b1=masked[1], a2=masked[2],
        b2=masked[3], check=check, freedom=nu, low=low, high=high, noise=level, hidden=hidden,
        tests=_tests(height, check, least, bulk, hidden), **bulk,
    )  # fmt: skip


def bridged(t: Floats, values: Floats, step: float) -> tuple[Floats, Floats]:
    """Times and rows (N, C) with the unknown left out, and holes of up to `quality.HOLE` filled by straight lines."""
    finite = np.isfinite(values).all(axis=1)
    at, rows = t[finite], values[finite]
    holes = np.diff(at)
    missing = np.where(holes <= HOLE[0] + step, np.rint(holes / step).astype(np.int64) - 1, 0).clip(min=0)
    if not missing.any():
        return at, rows
    place = np.repeat(np.arange(at.size - 1), missing)
    order = np.arange(place.size) - np.repeat(np.cumsum(missing) - missing, missing) + 1
    part = order / (missing[place] + 1)
    filled_t = at[place] + part * holes[place]
    filled = rows[place] + part[:, np.newaxis] * (rows[place + 1] - rows[place])
    return np.insert(at, place + 1, filled_t), np.insert(rows, place + 1, filled, axis=0)


def displacement(t: Floats, acc: Floats, *, step: float, low: float, high: float) -> Floats:
    """Displacement (N, C), m, of accelerations (N, C), m/s², in the frequencies from `low` to `high`, Hz.

    NaN beside holes that no straight line bridges, and for half of the longest period at each end of a stretch, where
    what came before is not known.
    """
    from scipy.fft import irfft, rfft, rfftfreq

    out = np.full_like(acc, math.nan)
    at, rows = bridged(t, acc, step)
    edges = np.flatnonzero(np.diff(at) > HOLE[0] + step) + 1
    margin = 0.5 / low
    for part_t, part in zip(np.split(at, edges), np.split(rows, edges), strict=True):
        if part_t.size < 2 or part_t[-1] - part_t[0] < 4.0 * margin:
            continue
        grid = part_t[0] + step * np.arange(int((part_t[-1] - part_t[0]) / step) + 1)
        even = np.stack([np.interp(grid, part_t, column) for column in part.T], axis=1)
        ramp = np.clip(np.minimum(grid - grid[0], grid[-1] - grid) / margin, 0.0, 1.0)
        tapered = (even - np.mean(even, axis=0)) * (0.5 - 0.5 * np.cos(np.pi * ramp))[:, np.newaxis]
        f = rfftfreq(grid.size, step)
        passes = (f >= low) & (f <= high)
        gain = np.divide(-1.0, (2.0 * np.pi * f) ** 2, out=np.zeros(f.size), where=passes)
        moved = irfft(rfft(tapered, axis=0) * gain[:, np.newaxis], grid.size, axis=0)
        inside = (t >= part_t[0] + margin) & (t <= part_t[-1] - margin) & np.isfinite(acc).all(axis=1)
        out[inside] = np.stack([np.interp(t[inside], grid, column) for column in moved.T], axis=1)
    return out


def _noise(f: Floats, vertical: Floats, nu: float, card: float, high: float) -> tuple[float, float]:
    """Density of the noise, and by which factor chance alone lifts a density above it."""
    from scipy.special import fdtri

    quiet = _below_waves(f)
    if not quiet.any():  # a short burst: what is above the waves is a sensor's own noise, as white as below
        quiet = f > high
    measured = float(np.mean(vertical[quiet])) if quiet.any() else 0.0
    measured = measured if math.isfinite(measured) else 0.0
    several = max(1.0, nu * np.count_nonzero(quiet))
    return max(measured, card**2), float(fdtri(max(nu, 1.0), several, 1.0 - CHANCE))


def _below_waves(f: Floats) -> NDArray[np.bool_]:
    """Densities that hold no wave; the first has the end of the mean's."""
    return (np.arange(f.size) > 0) & (f < LONGEST_WAVES)


def _lowest(f: Floats, above: NDArray[np.bool_], high: float) -> float:
    """Lowest frequency at which a density and its neighbour stand above the noise; NaN where none do."""
    usable = above & (f >= LONGEST_WAVES) & (f <= high) & (np.arange(f.size) > 0)
    pairs = np.flatnonzero(usable[:-1] & usable[1:])
    return float(f[pairs[0]]) if pairs.size else math.nan


def _tilt_noise(f: Floats, flat: Floats, above: NDArray[np.bool_], low: float) -> float:
    """Density of the horizontal acceleration next below the waves that count, where the vertical shows none."""
    quiet = ~above & (f < low) & (np.arange(f.size) > 0)
    near = quiet & (f >= LONGEST_WAVES)
    return float(np.mean(flat[near if near.any() else quiet])) if quiet.any() else 0.0


def _band(freedom: float) -> tuple[float, float]:
    """Factors that bound what a mean of squares with so many degrees of freedom estimates."""
    from scipy.special import chdtri

    beyond = 0.5 * (1.0 - CONFIDENCE)
    if not freedom > 0.0:
        return math.nan, math.nan
    return float(freedom / chdtri(freedom, beyond)), float(freedom / chdtri(freedom, 1.0 - beyond))


def _height(f: Floats, density: Floats, which: NDArray[np.bool_]) -> float:
    """Significant height of the waves of some frequencies, m."""
    return 4.0 * math.sqrt(max(0.0, float(np.sum(density[which]) * f[0])))


def _heights(f: Floats, height: Floats, effective: float, nu: float, scale_sd: float) -> dict[str, float]:
    """Height with its band, and periods."""
    m = {n: float(np.sum(f**n * height) * f[0]) for n in (-1, 0, 1, 2)}
    if not min(m.values()) > 0.0:
        return {}
    chance = float(np.sum(height**2) * f[0]) / (1.0 + 2.0 / nu) / effective / m[0] ** 2
    below, above = _band(2.0 / (chance + (2.0 * scale_sd) ** 2))
    hm0, spectrum = 4.0 * math.sqrt(m[0]), Spectra(f, height[:, np.newaxis], np.ones(1, np.int64), math.nan, 0)
    return {
        "hm0": hm0, "hm0_low": hm0 * math.sqrt(below), "hm0_high": hm0 * math.sqrt(above),
        "tp": peak_period(spectrum, 0), "tm01": m[0] / m[1], "tm02": math.sqrt(m[0] / m[2]),
        "tm_10": m[-1] / m[0],
    }  # fmt: skip


def _directions(
    f: Floats, height: Floats, first: Floats, second: Floats, effective: float, nu: float, heading_sd: float
) -> dict[str, float]:
    """Mean direction and spread of all waves, and at the peak."""
    if not math.isfinite(heading_sd) or not np.sum(height) > 0.0:
        return {}
    mean = height @ first / np.sum(height)
    direction = float(np.arctan2(mean[1], mean[0]))
    length = float(np.hypot(*mean))
    beside = np.ones(min(2 * math.ceil(0.5 * SURE_FREEDOM / nu) + 1, height.size))
    energy = np.maximum(height, 0.0)
    smooth = [
        np.convolve(energy * each, beside, "same") / np.maximum(np.convolve(energy, beside, "same"), TINY)
        for each in (*first.T, *second.T)
    ]
    along, across, excess = _moment_errors(*smooth, direction=direction, length=length)
    quotient = nu / max(nu - 2.0, 1.0)  # mean of ν/χ², as a moment's denominator has so many degrees of freedom
    share = quotient * height**2 * f[0] / (1.0 + 2.0 / nu) / effective / max(float(np.sum(height)) * f[0], TINY) ** 2
    chance = math.sqrt(float(share @ across)) / max(length, TINY)
    spread = _spread(length - float(height @ excess) / float(np.sum(height)) * 2.0 / nu)
    top = slice(max(0, int(np.argmax(height)) - 1), int(np.argmax(height)) + 2)
    peak = height[top] @ first[top] / np.sum(height[top])
    return {
        "direction": direction % (2.0 * np.pi), "direction_sd": math.hypot(chance, heading_sd),
        "spread": spread, "spread_sd": math.sqrt(float(share @ along)) / max(spread, TINY),
        "peak_direction": float(np.arctan2(peak[1], peak[0])) % (2.0 * np.pi),
        "peak_spread": _spread(float(np.hypot(*peak))),
    }  # fmt: skip


def _moment_errors(
    a1: Floats, b1: Floats, a2: Floats, b2: Floats, *, direction: float, length: float
) -> tuple[Floats, Floats, Floats]:
    """Of one transform's part in the mean moment, (F,): variances along its direction and across, excess along it.

    Vertical, along and across, the last two a quarter period later, are Gaussian with the covariance Σ of the moments.
    To first order a moment's error is a quadratic form x'Ax of them, whose variance is tr(AΣAΣ) [Kuik1988]; its mean is
    of the second order, as a moment is a quotient.
    """
    turn = np.exp(-1j * direction)
    once, twice = (a1 + 1j * b1) * turn, (a2 + 1j * b2) * turn**2
    m, n, m2, n2 = once.real, once.imag, twice.real, twice.imag
    ones, none, half = np.ones_like(m), np.zeros_like(m), np.full_like(m, 0.5)
    sigma = _symmetric(ones, m, n, half * (1.0 + m2), half * n2, half * (1.0 - m2))
    forms = (
        _symmetric(half * m - length, half, none, -half * m, none, -half * m),
        _symmetric(half * n, none, half, -half * n, none, -half * n),
    )
    along, across = (np.einsum("fij,fjk,fkl,fli->f", form, sigma, form, sigma, optimize=True) for form in forms)
    excess = 0.125 * m + 0.1875 * m * (m2**2 + n2**2 + 1.0) - 0.25 * (m * m2 + n * n2) - 0.25 * m * (m**2 + n**2)
    return np.maximum(along, 0.0), np.maximum(across, 0.0), excess


def _symmetric(*upper: Floats) -> Floats:
    """Matrices (F, 3, 3) of their upper triangle, row by row."""
    return np.stack(upper, axis=-1)[:, [[0, 1, 2], [1, 3, 4], [2, 4, 5]]]


def _spread(length: float) -> float:
    """Circular standard deviation, rad, of a distribution whose first moment is so long [Kuik1988]."""
    return math.sqrt(2.0 * max(0.0, 1.0 - length))


def _tests(height: Floats, check: Floats, least: Floats, bulk: dict[str, float], hidden: float) -> dict[str, int]:
    """Flags of QARTOD's tests of waves over a burst; the check factor counts at the peak, and over all waves.

    It must pass also as `least`, without the noise of the horizontal motion, which may lift it to 1.
    """
    if not bulk:
        return {"above noise": SUSPECT}
    energy, top = np.where(np.isfinite(check), np.maximum(height, 0.0), 0.0), int(np.argmax(height))
    at_peak, (low, high) = energy * (np.abs(np.arange(height.size) - top) <= 1), CHECK_FACTOR
    factors = [float(np.nansum(part * each) / np.sum(part)) for part in (energy, at_peak) for each in (check, least)]
    steepness = 2.0 * np.pi * bulk["hm0"] / (G0 * bulk["tm02"] ** 2)
    return {
        "check factor": PASS if low <= min(factors) and max(factors) <= high else SUSPECT,
        "low-frequency energy": PASS if math.hypot(bulk["hm0"], hidden) <= bulk["hm0_high"] else SUSPECT,
        "steepness": FAIL if steepness > STEEPNESS[1] else SUSPECT if steepness > STEEPNESS[0] else PASS,
    }
