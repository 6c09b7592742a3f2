"""One sample at a time without a lag: between two keyframes the gyroscope alone goes on, and all else can wait."""

import math
from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.constants import IMPOSSIBLE_ACCELERATION, IMPOSSIBLE_FIELD, IMPOSSIBLE_RATE
from plumbob.core.errors import ShapeError
from plumbob.core.kernels import kernel
from plumbob.core.time import REMEMBERED
from plumbob.data import AttitudeTrack, ImuData, ImuMeta
from plumbob.data.imu import TRIADS
from plumbob.data.sample import ImuSample
from plumbob.filters.input_checks import watch
from plumbob.filters.layout import RISING
from plumbob.filters.smoother.keyframes import WRONG, turned_by
from plumbob.filters.smoother.model import B
from plumbob.filters.smoother.sweeps import corrected_rate
from plumbob.rotations.kernels import quat_mul

if TYPE_CHECKING:
    from plumbob.filters.smoother.live import Between

MORE: Final = -1  # the sample is more than one between two keyframes, or a value is not as usual
_WRONG: Final = WRONG[0]
_LIMITS: Final = {"gyr": IMPOSSIBLE_RATE, "acc": IMPOSSIBLE_ACCELERATION, "mag": IMPOSSIBLE_FIELD}


@kernel
def go_on(
    q: Floats, x: Floats, watched: Floats, since: float, key: float, spacing: float, longest: float, t: float,
    values: Floats, limits: Floats, mag: bool, turns: Floats, out: Floats,
) -> int:  # fmt: skip
    """Turn on by one sample behind time `since`, and write its attitude in the frame that was asked for.

    Returns its flags; or `MORE`, and nothing counts, where it ends the step that began at `key` or is not as usual.
    """
    dt = t - since
    if not 0.0 < dt <= longest or t - key >= spacing - 1e-6:  # as `arrive` has it
        return MORE
    absent = 0
    for i in range(9):
        if i > 5 and math.isnan(values[i]):
            absent += 1
        elif not abs(values[i]) < limits[i]:
            return MORE
    if 0 < absent < 3:
        return MORE
    mx, my, mz = (values[6], values[7], values[8]) if mag else (math.nan, math.nan, math.nan)
    gx, gy, gz = values[0] + 0.0, values[1] + 0.0, values[2] + 0.0  # no negative zero, as where values are held
    word = watch(watched, dt, gx, gy, gz, values[3], values[4], values[5], mx, my, mz)
    if word & _WRONG:
        return MORE
    wx, wy, wz = corrected_rate(x, gx, gy, gz)
    turned_by(q, dt * wx, dt * wy, dt * wz)
    q0, q1, q2, q3 = q[0], q[1], q[2], q[3]
    for k in range(turns.shape[0]):
        q0, q1, q2, q3 = quat_mul(turns[k, 0], turns[k, 1], turns[k, 2], turns[k, 3], q0, q1, q2, q3)
    out[0], out[1], out[2], out[3] = q0, q1, q2, q3
    return word | (flags.MAG_ABSENT if absent else 0)


class CurrentEstimate(NamedTuple):
    """What is known now: attitude in the frame that was asked for, bias, rad/s, covariance in body axes, rad²."""

    q: Floats
    bias: Floats
    cov: Floats


class Single:
    """The samples of a stream one after the other.

    Those between two keyframes turn the attitude on and wait; all that wait are taken together, with the same bits,
    with the sample that ends the step, or where somebody asks for the covariance.

    `take`: takes samples as a part of the stream; `between`: what a next sample goes on from, and the turns to the
    frame that was asked for; None where it must be taken; `meta`: of the samples; `mag`: use the magnetometer; `now`:
    what is known before the first.
    """

    def __init__(
        self,
        take: Callable[[ImuData], AttitudeTrack],
        between: "Callable[[], tuple[Between, Floats] | None]",
        meta: ImuMeta,
        mag: bool,
        now: CurrentEstimate,
    ) -> None:
        self._take, self._between, self._meta, self._mag, self._now = take, between, meta, mag, now
        ends = [(meta.full_scale(name), _LIMITS[name]) for name in TRIADS]
        self._limits = np.concatenate(
            [np.full(3, most) if end is None else np.minimum(0.999 * end, most) for end, most in ends]
        )
        self._go_on, self._q = go_on.compiled, now.q.copy()
        self._known: Between | None = None
        self._turns = np.empty((0, 4))
        self._waiting: list[ImuSample] = []
        self._times: list[int] = []
        self._clock: int | None = None  # of the last sample, ns, by the source's clock; and since the first
        self._ns, self._t, self._word, self._late = 0, 0.0, 0, list[int]()
        self._past = deque[tuple[int, bytes]](maxlen=REMEMBERED)  # one of these that comes again was sent twice

    def update(self, sample: ImuSample) -> int:
        """Take the next sample and return its flags."""
        if not isinstance(sample, ImuSample):
            raise ShapeError(f"update takes an ImuSample, but got {type(sample).__name__}.")
        said = sample.t_ns, sample.values.tobytes()
        if self._clock is not None and (
            (sample.t_ns <= self._clock and said in self._past) or not self._later(said[0])
        ):
            return self._word | sample.flags | flags.TIME_FAULT
        self._past.append(said)
        self._ns += 0 if self._clock is None else sample.t_ns - self._clock
        self._clock, t = sample.t_ns, self._ns / 1e9
        self._waiting.append(sample)
        self._times.append(self._ns)
        state, word = self._known, MORE
        if state is not None and not sample.flags:
            word = self._go_on(
                state.q, state.x, state.watched, self._t, state.key, state.spacing, state.longest, t, sample.values,
                self._limits, self._mag, self._turns, self._q,
            )  # fmt: skip
        self._t = t
        if state is None or word == MORE:
            return self._flush()
        self._word = state.word
        return state.word | word

    def _later(self, t_ns: int) -> bool:
        """Whether a time is behind the last one, or behind others in a row that say that the clock was set back."""
        assert self._clock is not None
        if t_ns > self._clock:
            self._late.clear()
            return True
        if self._late and t_ns <= self._late[-1]:
            self._late.clear()
        self._late.append(t_ns)
        if len(self._late) < RISING:
            return False
        self._clock = self._late[0] - (t_ns - self._late[-2])  # what the late ones did not turn is made up for
        self._late.clear()
        return True

    def _flush(self) -> int:
        """Take what waits; flags of its last sample."""
        values = np.stack([sample.values for sample in self._waiting])
        triads = {name: values[:, 3 * i : 3 * i + 3] for i, name in enumerate(TRIADS)}
        words = np.array([sample.flags for sample in self._waiting], dtype=np.uint32)
        times: NDArray[np.int64] = np.array(self._times, dtype=np.int64)
        self._waiting.clear()
        self._times.clear()
        track = self._take(ImuData.live(times, triads, flags=words, meta=self._meta))
        assert track.bias_b is not None
        assert track.cov_b is not None
        assert track.flags is not None
        self._now = CurrentEstimate(track.q_nb[-1], track.bias_b[-1], track.cov_b[-1])
        self._q, self._word = track.q_nb[-1].copy(), int(track.flags[-1])
        basis = self._between()
        self._known, self._turns = (None, self._turns) if basis is None else basis
        return self._word

    @property
    def q_nb(self) -> Floats:
        """Attitude now, (4,)."""
        return self._q.copy()

    @property
    def bias_b(self) -> Floats:
        """Bias now, rad/s, (3,)."""
        return self._now.bias.copy() if self._known is None else self._known.x[B : B + 3].copy()

    @property
    def cov_b(self) -> Floats:
        """Covariance now, rad², (3, 3)."""
        if self._waiting:
            self._flush()
        return self._now.cov.copy()
