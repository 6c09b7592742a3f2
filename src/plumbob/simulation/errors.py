"""What a triad of sensors makes of the truth: the error model, applied and inverted.

One equation holds for every triad; what a triad does not have is zero::

    measured = clip(step(F(G(T) (I + M) (W truth + h) + b(T) + S f + drift + white)))

G gain, M misalignment, W and h soft and hard iron (magnetometer), b bias, S g-sensitivity (gyroscope) to the specific
force f, drift = flicker + random walk + ramp, F a high-pass where the chain has one, T temperature. Units are those of
the triad, u: rad/s, m/s² or µT.

Random processes of IEEE Std 952, each at its own Allan level, and the random streams that drive them.

==============  ======  ====================  ============================
process         letter  two-sided PSD of rate  Allan deviation
==============  ======  ====================  ============================
white           N       N²                    N / √τ
flicker         B       B² / (2πf)            B √(2 ln 2 / π) = 0.6643 B
random walk     K       (K / 2πf)²            K √(τ/3)
ramp            R       –                     R τ / √2
==============  ======  ====================  ============================
"""

import math
from dataclasses import dataclass, field, fields, replace
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError
from plumbob.data.cards import TriadCalibration, TriadNoise
from plumbob.rotations import euler_zyx_from_quat, quat_from_euler_zyx


def stream(seed: int, *names: str) -> np.random.Generator:
    """Random generator of one error of one triad, independent of all others of the same seed."""
    if not isinstance(seed, int | np.integer) or seed < 0:
        raise ParameterError(f"seed must be a whole number of at least 0, but it is {seed!r}.")
    key = tuple(int.from_bytes(name.encode()) for name in names)
    return np.random.default_rng(np.random.SeedSequence(int(seed), spawn_key=key))


def unit_seed(seed: int, number: int) -> int:
    """Seed of one of several units, from 0: each has its own errors and noise, and the first has those of the seed."""
    return seed if number == 0 else 1000 * seed + number


def white(sd: Floats, count: int, rng: np.random.Generator) -> Floats:
    """White noise (count, 3) of standard deviation sd (3,)."""
    return sd * rng.standard_normal((count, 3))


def white_sd(n_rpsd: Floats, rate: float) -> Floats:
    """Standard deviation of one sample, N √rate, of white noise whose Allan deviation is N / √τ."""
    return n_rpsd * math.sqrt(rate)


def flicker(b: Floats, count: int, rng: np.random.Generator) -> Floats:
    """Flicker noise (count, 3) of bias instability b (3,), starting from nothing.

    White noise through the fractional integrator of order ½, whose pulse response falls as 1/√k [Kasdin1995]. White
    noise of standard deviation B gives the two-sided density B²/(2πf), at any sampling rate. The Allan deviation is
    flat at 0.6643 B from about ten samples on; at one sample it is B √(2/π) = 0.80 B, as sampling folds the spectrum.
    """
    k = np.arange(1, count)
    pulse = np.concatenate(([1.0], np.cumprod((k - 0.5) / k)))  # [Kasdin1995]
    size = 1 << (2 * count - 1).bit_length()  # room for the whole convolution, so that the end does not wrap round
    response = np.fft.rfft(pulse, size)[:, np.newaxis]
    return np.fft.irfft(response * np.fft.rfft(white(b, count, rng), size, axis=0), size, axis=0)[:count]


def random_walk(k_rpsd: Floats, count: int, rate: float, rng: np.random.Generator) -> Floats:
    """Random walk (count, 3) of rate K (3,), unit/s/√Hz; the first value is 0."""
    steps = white(k_rpsd / math.sqrt(rate), count, rng)
    return np.asarray(np.cumsum(steps, axis=0) - steps[0])


_MATRICES = ("misalignment", "soft_iron", "g_sensitivity")
_SIZES = ("white_rpsd", "white_sd", "flicker", "walk_rpsd", "lsb", "latency")
_DETERMINISTIC = (
    "bias", "bias_per_k", "scale", "scale_per_k", "misalignment", "soft_iron", "hard_iron", "g_sensitivity", "latency",
)  # fmt: skip


def _nothing() -> Floats:
    return np.zeros(3)


def _no_coupling() -> Floats:
    return np.zeros((3, 3))


@dataclass(frozen=True, eq=False, kw_only=True)
class TriadErrors:
    """Errors of one triad. Where (3,) is asked for, one number stands for all three axes.

    Parameters
    ----------
    white_rpsd : array_like (3,)
        White noise N, u/√Hz: its Allan deviation is N/√τ, and one sample scatters by N √rate.
    white_sd : array_like (3,)
        White noise whose scatter per sample does not depend on the rate, u. The two add as squares.
    flicker : array_like (3,)
        Bias instability B, u: the floor of the Allan deviation is 0.6643 B.
    walk_rpsd : array_like (3,)
        Random walk K of the bias, u/s/√Hz: its Allan deviation is K √(τ/3).
    ramp : array_like (3,)
        Steady drift R, u/s.
    bias : array_like (3,)
        Offset at turn-on, at `temp_ref_c`, u.
    bias_per_k : array_like (3,)
        Change of the offset per kelvin, u/K.
    temp_ref_c : float
        Temperature at which bias and scale hold, °C.
    scale : array_like (3,)
        Relative error of the gain: 0.01 reads 1 % too much.
    scale_per_k : array_like (3,)
        Change of the gain per kelvin, 1/K.
    misalignment : array_like (3, 3)
        Off-diagonal entry ij is what axis i picks up of the input along j; the diagonal is zero.
    soft_iron : array_like (3, 3)
        How iron on the body changes the field, identity without any.
    hard_iron : array_like (3,)
        Field of the body itself, µT.
    g_sensitivity : array_like (3, 3)
        Bias per specific force, rad/s per m/s².
    lsb : array_like (3,)
        Step of quantisation, u; 0 is continuous.
    full_scale : array_like (3,)
        End of the range, u; values beyond are clipped to it.
    latency : array_like (3,)
        How much older than its time stamp a value is, s.
    rate : float or None
        Own sampling rate, Hz, where it differs from the recording's; rows without a new value are NaN.
    high_pass : float or None
        Corner of a first-order high-pass between sensor and converter, Hz. The triad lay for long before the recording
        as at its first instant, so that what is steady then is gone from the first value on; of the noise before the
        recording nothing is left in the filter.

    Raises
    ------
    ParameterError
        If a number is not finite or outside its domain.
    """

    white_rpsd: Floats = field(default_factory=_nothing)
    white_sd: Floats = field(default_factory=_nothing)
    flicker: Floats = field(default_factory=_nothing)
    walk_rpsd: Floats = field(default_factory=_nothing)
    ramp: Floats = field(default_factory=_nothing)
    bias: Floats = field(default_factory=_nothing)
    bias_per_k: Floats = field(default_factory=_nothing)
    temp_ref_c: float = 25.0
    scale: Floats = field(default_factory=_nothing)
    scale_per_k: Floats = field(default_factory=_nothing)
    misalignment: Floats = field(default_factory=_no_coupling)
    soft_iron: Floats = field(default_factory=lambda: np.eye(3))
    hard_iron: Floats = field(default_factory=_nothing)
    g_sensitivity: Floats = field(default_factory=_no_coupling)
    lsb: Floats = field(default_factory=_nothing)
    full_scale: Floats = field(default_factory=lambda: np.full(3, math.inf))
    latency: Floats = field(default_factory=_nothing)
    rate: float | None = None
    high_pass: float | None = None

    def __post_init__(self) -> None:
        """Bring every array to its shape and validate it."""
        for name in (f.name for f in fields(self) if f.name not in {"temp_ref_c", "rate", "high_pass"}):
            shape = (3, 3) if name in _MATRICES else (3,)
            object.__setattr__(self, name, check.read_only(_shaped(name, getattr(self, name), shape)))
        if np.diag(self.misalignment).any():
            raise ParameterError("misalignment must have a zero diagonal; the gain of an axis is its scale.")
        for name in ("rate", "high_pass"):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < math.inf:
                raise ParameterError(f"{name} must be positive and finite, but it is {value:g} Hz.")

    def calibrated(self) -> Self:
        """Return the same triad after an ideal calibration: noise, quantisation, range, rate and high-pass stay."""
        perfect = type(self)()
        return replace(self, **{name: getattr(perfect, name) for name in _DETERMINISTIC})

    def with_range(self, full_scale: float) -> Self:
        """Return the same triad with another full scale, u, cut into as many counts."""
        finite = np.isfinite(self.full_scale)
        stretch = np.where(finite, full_scale / np.where(finite, self.full_scale, 1.0), 1.0)
        return replace(self, lsb=self.lsb * stretch, full_scale=np.full(3, full_scale))

    def with_noise(self, noise: TriadNoise) -> Self:
        """Return the same triad with N, B and K of a card; ramp and quantisation, which a card has not, stay."""
        return replace(self, white_rpsd=noise.n_rpsd, white_sd=np.zeros(3), flicker=noise.b, walk_rpsd=noise.k_rpsd)

    @property
    def response(self) -> Floats:
        """Matrix (3, 3) from truth to measurement at `temp_ref_c`."""
        return np.asarray(self._case @ self.soft_iron)

    @property
    def iron(self) -> Floats:
        """What the triad reads of the hard iron, (3,), µT, at `temp_ref_c`."""
        return np.asarray(self._case @ self.hard_iron)

    @property
    def _case(self) -> Floats:
        gain = 1.0 + self.scale
        return np.asarray(gain[:, np.newaxis] * (np.eye(3) + self.misalignment))

    def card(self, unit: str) -> TriadCalibration:
        """Calibration that undoes response, bias, iron, the bias's temperature and g-sensitivity: what is perfect.

        A card has no place for the temperature of the gain, for latency, and for a high-pass; they remain. Behind a
        high-pass nothing steady is left to take away.
        """
        steady = 1.0 if self.high_pass is None else 0.0
        return TriadCalibration(
            matrix=np.asarray(np.linalg.inv(self.response), dtype=np.float64),
            bias=steady * (self.bias + self.iron),
            unit_in=unit,
            unit_out=unit,
            bias_per_k=steady * self.bias_per_k,
            temp_ref_c=self.temp_ref_c,
            g_sensitivity=steady * self.g_sensitivity,
        )

    def noise_card(self, rate: float) -> TriadNoise:
        """N, B and K of the triad, before its high-pass, when it is sampled at `rate`, Hz, or at its own rate."""
        white = self.white_sd / math.sqrt(self.own_rate(rate))
        return TriadNoise(n_rpsd=np.hypot(self.white_rpsd, white), b=self.flicker, k_rpsd=self.walk_rpsd)

    def own_rate(self, rate: float) -> float:
        """Rate at which the triad yields values in a recording of `rate`, Hz."""
        return rate if self.rate is None else min(self.rate, rate)


class Measured(NamedTuple):
    """What a triad says: values (N, 3), the bias in them with drift and g-sensitivity (N, 3), and clipping (N, 3)."""

    values: Floats
    bias: Floats
    clipped: NDArray[np.bool_]


def measure(
    errors: TriadErrors, truth_b: Floats, *, triad: str, seed: int, rate: float, temp_c: Floats, force_b: Floats
) -> Measured:
    """Let a triad measure true values (N, 3) in body axes, u, at evenly spaced instants, `rate` of them a second.

    `triad`, "gyr", "acc" or "mag", and `seed` name the random streams; `temp_c` (N,): temperature, °C; `force_b`
    (N, 3): specific force, m/s², for the g-sensitivity.
    """
    e, count = errors, truth_b.shape[0]
    warmer = (temp_c - e.temp_ref_c)[:, np.newaxis]
    gain_change = 1.0 + warmer * e.scale_per_k / (1.0 + e.scale)
    bias = e.bias + warmer * e.bias_per_k + force_b @ e.g_sensitivity.T + _drift(e, count, triad, seed, rate)
    exact = gain_change * (truth_b @ e.response.T + e.iron)
    noise = white(np.hypot(white_sd(e.white_rpsd, rate), e.white_sd), count, stream(seed, triad, "white"))
    if e.high_pass is not None:
        parts = ((exact, exact[0]), (bias, bias[0]), (noise, np.zeros(3)))
        exact, bias, noise = (high_passed(part, start, e.high_pass, rate) for part, start in parts)
    digital = _steps(exact + bias + noise, e.lsb)
    return Measured(np.clip(digital, -e.full_scale, e.full_scale), bias, np.abs(digital) >= e.full_scale)


def high_passed(values: Floats, settled: Floats, corner: float, rate: float) -> Floats:
    """Values (N, 3) behind a first-order high-pass, exact for what is constant between the instants.

    `settled` (3,): what had gone in for long before the first instant, u; `corner`: corner frequency, Hz: a step
    decays as exp(-2π corner t); `rate`: of the instants, which are evenly spaced, Hz.
    """
    from scipy.signal import lfilter

    decay = math.exp(-2.0 * math.pi * corner / rate)
    return np.asarray(lfilter([1.0, -1.0], [1.0, -decay], values, axis=0, zi=-settled[np.newaxis])[0])


def _drift(e: TriadErrors, count: int, triad: str, seed: int, rate: float) -> Floats:
    drift = np.outer(np.arange(count) / rate, e.ramp)
    if e.flicker.any():
        drift += flicker(e.flicker, count, stream(seed, triad, "flicker"))
    if e.walk_rpsd.any():
        drift += random_walk(e.walk_rpsd, count, rate, stream(seed, triad, "walk"))
    return drift


def _steps(analogue: Floats, lsb: Floats) -> Floats:
    step = np.where(lsb > 0.0, lsb, 1.0)
    return np.where(lsb > 0.0, step * np.rint(analogue / step), analogue)


def _shaped(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Floats:
    array = check.floats(name, value)
    if array.shape != shape and (array.shape or name in _MATRICES):
        raise ParameterError(f"{name} must be of shape {shape}, but its shape is {array.shape}.")
    finite = np.isfinite(array) | (array == np.inf) if name == "full_scale" else np.isfinite(array)
    low = 0.0 if name in _SIZES or name == "full_scale" else -math.inf
    if not (finite & (array >= low)).all():
        raise ParameterError(f"{name} must be finite and not below {low:g}, but it is {array.tolist()}.")
    return np.array(np.broadcast_to(array, shape))


@dataclass(frozen=True, slots=True)
class AttitudeErrors:
    """Errors of the angles that a reference says.

    A sheet states one root mean square error for each angle, and not how it is spread over time. Half of its square is
    taken as constant within a run, as from installation and calibration, half as a first-order Gauss-Markov process.
    """

    heading: float  # root mean square error over many runs, rad
    tilt: float  # of roll and of pitch, rad
    time: float = 10.0  # after which the process that varies has forgotten itself to 1/e, s

    def __post_init__(self) -> None:
        """Validate."""
        if not (0.0 <= self.heading < math.inf and 0.0 <= self.tilt < math.inf and 0.0 < self.time < math.inf):
            raise ParameterError(f"the errors of an attitude must be 0 rad or more, and their time above 0 s: {self}.")

    def said(self, q_nb: Floats, *, seed: int, rate: float) -> Floats:
        """Heading, pitch and roll (N, 3), rad, that a reference says of true attitudes (N, 4) of its axes in NED.

        They are evenly spaced, `rate` of them a second.
        """
        half = math.sqrt(0.5) * np.array([self.heading, self.tilt, self.tilt])
        constant = half * stream(seed, "attitude", "constant").standard_normal(3)
        wrong = euler_zyx_from_quat(q_nb) + constant + half * self._varying(len(q_nb), seed, rate)
        return euler_zyx_from_quat(quat_from_euler_zyx(wrong))  # a pitch beyond 90 degrees is one from the other side

    def _varying(self, count: int, seed: int, rate: float) -> Floats:
        """First-order Gauss-Markov process (count, 3) of standard deviation 1, from its first value on."""
        from scipy.signal import lfilter

        decay = math.exp(-1.0 / (rate * self.time))
        fed = math.sqrt(1.0 - decay**2) * stream(seed, "attitude", "varying").standard_normal((count, 3))
        fed[0] /= math.sqrt(1.0 - decay**2)
        return np.asarray(lfilter([1.0], [1.0, -decay], fed, axis=0))
