"""What a chain does: programs of joint angles, each an exact function of time."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError, unknown_name
from plumbob.core.units import deg, dps
from plumbob.data.chain import Chain, Limits
from plumbob.rotations import Frame
from plumbob.simulation.motion import EulerMotion, Motion
from plumbob.simulation.signals import (
    Linear,
    Moves,
    Ramps,
    Signal,
    Sinusoids,
    Stack,
    Windowed,
    constant,
    random_phases,
    sinusoid,
)

_PEAKS: Final = (15.0 / 8.0, 10.0 / math.sqrt(3.0), 60.0)
"""Greatest velocity, acceleration and jerk of `quintic`, which goes from 0 to 1 in 1."""

_FREE: Final = deg(75.0)  # range to both sides of an angle without limits, rad

_LEAD: Final = 2.0  # s at rest before the first motion


@dataclass(frozen=True, eq=False)
class ChainProgram:
    """Motion of a chain.

    Attributes
    ----------
    name : str
        What it is, for people.
    angles : Signal with one component for each angle
        rad, in the order of `Chain.angles`.
    duration : float
        Time that it takes, s.
    stops : tuple of (float, float)
        When all joints stand still: start and end, s.
    root : Motion or None
        Of the first segment; None: it stands still.
    """

    name: str
    angles: Signal
    duration: float
    stops: tuple[tuple[float, float], ...] = ()
    root: Motion | None = None


class _Span(NamedTuple):
    """Where the angles of a chain may go: ends (dof,), and the pose to start from (dof,), rad."""

    low: Floats
    high: Floats
    home: Floats


def _span(chain: Chain) -> _Span:
    low = np.array([limit.low if np.isfinite(limit.low) else -_FREE for limit in chain.limits])
    high = np.array([limit.high if np.isfinite(limit.high) else _FREE for limit in chain.limits])
    # no wrist is turned round and round, so that a long range is not used to its ends
    middle = 0.5 * (low + high)
    low, high = np.maximum(low, middle - deg(150.0)), np.minimum(high, middle + deg(150.0))
    margin = 0.2 * (high - low)
    return _Span(low, high, np.clip(np.zeros_like(low), low + margin, high - margin))


def move_times(steps: ArrayLike, limits: tuple[Limits, ...], *, speed: float) -> Floats:
    """Shortest times (m,), s, in which moves of least jerk keep all limits, and a greatest speed of any angle, rad/s.

    `steps` (m, angles): change of each angle in each move, rad.
    """
    size = np.abs(check.rows("steps", steps, len(limits)))
    orders = enumerate(zip(*((min(lim.velocity, speed), lim.acceleration, lim.jerk) for lim in limits), strict=True), 1)
    needed = [(_PEAKS[k - 1] * size / np.array(most)) ** (1.0 / k) for k, most in orders]
    return np.asarray(np.maximum(np.max(needed, axis=(0, 2)), 1e-3))


def waypoints(
    chain: Chain, poses: ArrayLike, *, dwell: ArrayLike = 1.0, speed: float = dps(60.0), name: str = "waypoints"
) -> ChainProgram:
    """Program from pose to pose, each move with least jerk and as fast as limits allow, at rest in between.

    Parameters
    ----------
    chain : Chain
        Whose limits are kept.
    poses : array_like (m, angles)
        rad.
    dwell : float or array_like (m,)
        Time at each pose, s.
    speed : float
        Greatest speed of any angle, rad/s.
    name : str
        Of the program.

    Raises
    ------
    ShapeError
        If poses are not as wide as the chain has angles.
    ParameterError
        If there are fewer than two, or one is outside its limits.
    """
    table = check.rows("poses", poses, len(chain.angles))
    low, high = (np.array([getattr(limit, end) for limit in chain.limits]) for end in ("low", "high"))
    beyond = (table < low - 1e-9) | (table > high + 1e-9)
    if len(table) < 2 or beyond.any():
        row, column = np.argwhere(beyond)[0] if beyond.any() else (0, 0)
        raise ParameterError(
            f"pose {row} takes {chain.angles[column]} to {np.rad2deg(table[row, column]):.1f}°, beyond its limits."
            if beyond.any()
            else f"a program needs at least two poses, but it has {len(table)}."
        )
    rest = np.broadcast_to(np.asarray(dwell, dtype=np.float64), len(table))
    steps = np.diff(table, axis=0)
    time = move_times(steps, chain.limits, speed=speed)
    start = np.cumsum(rest[:-1]) + np.cumsum(time) - time
    begin = np.concatenate(([0.0], start + time))
    stops = tuple(zip(begin.tolist(), (begin + rest).tolist(), strict=True))
    angles = constant(table[0]) + Moves(start, time, steps)
    return ChainProgram(name, angles, float(begin[-1] + rest[-1]), stops)


def _teach(chain: Chain, rng: np.random.Generator, duration: float) -> ChainProgram:
    """Pick and place: over the place, down to it, a stop, up again, and so on between drawn places."""
    span = _span(chain)
    poses, dwell = [span.home], [_LEAD]
    for _ in range(math.ceil(duration / 4.0)):
        place = span.low + (span.high - span.low) * rng.uniform(0.25, 0.75, span.low.size)
        above = place + 0.15 * (span.home - place)
        poses += [above, place, above]
        dwell += [0.1, float(rng.uniform(0.5, 1.2)), 0.1]
    return waypoints(chain, poses, dwell=dwell, speed=dps(90.0), name="teach-in, pick and place")


def _slow(chain: Chain, rng: np.random.Generator, duration: float) -> ChainProgram:
    """Slow moves of all joints from drawn pose to drawn pose, with stops of a second."""
    span = _span(chain)
    count = math.ceil(duration / 2.0) + 1
    drawn = span.low + (span.high - span.low) * rng.uniform(0.15, 0.85, (count, span.low.size))
    rest = [_LEAD, *(1.0 for _ in drawn)]
    return waypoints(chain, np.vstack((span.home, drawn)), dwell=rest, speed=dps(30.0), name="slow moves")


def _amplitude(k: int, chain: Chain, weights: Floats, omega: Floats, speed: float) -> float:
    """Largest factor with which sinusoids of angle `k`, grown in a second, keep range, velocity and acceleration."""
    span, limit = _span(chain), chain.limits[k]
    size, rate, acc = float(weights.sum()), float(weights @ omega), float(weights @ omega**2)
    room = 0.9 * min(span.high[k] - span.home[k], span.home[k] - span.low[k])
    fastest = rate + _PEAKS[0] * size
    hardest = acc + 2.0 * _PEAKS[0] * rate + _PEAKS[1] * size
    return float(min(room / size, speed / rate, limit.velocity / fastest, limit.acceleration / hardest))


def _wave(chain: Chain, rng: np.random.Generator, *, low: float, high: float, speed: float) -> Signal:
    """Three sinusoids for each angle about the home pose, Hz; within its limits, and below a speed, rad/s."""
    edges = np.geomspace(low, high, 4)
    columns = []
    for k in range(len(chain.angles)):
        omega = 2.0 * math.pi * rng.uniform(edges[:-1], edges[1:])
        weights = np.array([1.0, 0.7, 0.4]) * rng.uniform(0.7, 1.0, 3)
        amplitude = _amplitude(k, chain, weights, omega, speed)
        columns.append(Sinusoids.from_phasors(omega, amplitude * weights * random_phases(3, rng)))
    return Stack(tuple(columns))


def _window(start: float, end: float, ramp: float = 1.0) -> Signal:
    """1 from `start` to `end`, growing and fading within it."""
    return Moves((start, end - ramp), (ramp, ramp), (1.0, -1.0))


def _fast(chain: Chain, rng: np.random.Generator, duration: float) -> ChainProgram:
    """Fast movement of a person: all joints at once, up to 300 °/s each, 0.25 to 1.6 Hz."""
    wave = _wave(chain, rng, low=0.25, high=1.6, speed=dps(300.0))
    begun = Windowed(wave, Moves((_LEAD,), (1.0,), (1.0,)))
    return ChainProgram("fast movement", constant(_span(chain).home) + begun, duration, ((0.0, _LEAD),))


def _calibration(chain: Chain, rng: np.random.Generator, duration: float) -> ChainProgram:
    """Each angle in turn, two swings of two seconds, then ten seconds of all together; again until the end."""
    count = len(chain.angles)
    angles: Signal = constant(_span(chain).home)
    rounds = max(1, math.ceil((duration - _LEAD) / (4.0 * count + 10.0)))
    swings: list[Signal] = []
    for k in range(count):
        windows: Signal = constant(0.0)
        for cycle in range(rounds):
            start = _LEAD + cycle * (4.0 * count + 10.0) + 4.0 * k
            windows = windows + _window(start, start + 4.0)
        size = min(deg(45.0), _amplitude(k, chain, np.ones(1), np.array([math.pi]), math.inf))
        swings.append(Windowed(sinusoid(size, 0.5, float(rng.uniform(0.0, 2.0 * math.pi))), windows))
    angles = angles + Stack(tuple(swings)) if swings else angles
    together: Signal = constant(0.0)
    for cycle in range(rounds):
        start = _LEAD + cycle * (4.0 * count + 10.0) + 4.0 * count
        together = together + _window(start, start + 10.0)
    wave = _wave(chain, rng, low=0.2, high=1.0, speed=dps(150.0))
    return ChainProgram("calibration motion", angles + Windowed(wave, together), duration, ((0.0, _LEAD),))


def _still(chain: Chain, rng: np.random.Generator, duration: float) -> ChainProgram:
    """At rest in the home pose."""
    return ChainProgram("at rest", constant(_span(chain).home), duration, ((0.0, duration),))


_STRIDE: Final[Mapping[str, tuple[float, ...]]] = {
    "hip1": (28, 24, 15, 6, -3, -9, -4, 12, 25, 30), "hip2": (0, 5, 5, 3, 1, -2, -5, -4, -2, -1),
    "hip3": (-2, 0, 2, 2, 2, 3, 0, -2, -3, -2), "knee": (4, 15, 17, 11, 5, 8, 32, 59, 48, 16),
    "ankle1": (0, -3, 3, 6, 9, 6, -15, -9, 0, 1), "ankle2": (1, -3, -3, -2, -1, 2, 5, 3, 2, 1),
    "ankle3": (0, 1, 2, 2, 1, 0, -2, -3, -1, 0),
}  # fmt: skip
"""Angles of walking at each tenth of a stride from the heel's contact on, °, read off the means of Winter 1991."""


def _angles(values: Floats) -> Floats:
    return values[:, :3]


def _place(values: Floats) -> Floats:
    return values[:, 3:]


def _walk(chain: Chain, rng: np.random.Generator, duration: float) -> ChainProgram:
    """Walking, after standing upright to 1° in each angle: strides of 1.0 to 1.2 s, each some per cent different."""
    if unknown := [name for name in chain.angles if name not in _STRIDE]:
        raise ParameterError(f"walking moves {', '.join(_STRIDE)}, but {chain.name} has {', '.join(unknown)}.")
    stride, phase = float(rng.uniform(1.0, 1.2)), float(rng.uniform(0.0, 1.0))
    base, modulated = 2.0 * math.pi / stride, 2.0 * math.pi * rng.uniform(0.05, 0.15, 2)
    steps = Moves((_LEAD, duration - 2.0), (1.5, 1.5), (1.0, -1.0))

    def periodic(phasors: NDArray[np.complex128]) -> Signal:
        """Harmonics (K, n) of a stride from the mean on, whose size varies by some per cent."""
        n = np.arange(len(phasors))
        turned = phasors * np.exp(2j * math.pi * phase * n)[:, np.newaxis]
        omega, sides = base * n, [(0.0, 1.0), *((sign * w, 0.02) for w in modulated for sign in (1.0, -1.0))]
        frequencies = np.concatenate([np.abs(omega + shift) for shift, _ in sides])
        flips = np.concatenate([np.where(omega + shift < 0.0, -1.0, 1.0) for shift, _ in sides])[:, np.newaxis]
        sizes = np.concatenate([size * turned for _, size in sides])
        return Sinusoids.from_phasors(frequencies, np.where(flips < 0.0, sizes.conj(), sizes))

    curves = np.deg2rad(np.array([_STRIDE[name] for name in chain.angles]).T)
    harmonics = np.fft.rfft(curves, axis=0)[:5] / 5.0
    harmonics[0] *= 0.5
    sway = np.zeros((3, 6), dtype=np.complex128)  # pelvis: yaw, pitch, roll, rad; East, North and up, m
    sway[1, [0, 2, 4]], sway[2, [1, 3, 5]] = (deg(4.0), deg(3.0), 0.025), (deg(1.5), 0.015, 0.022j)
    winding = Sinusoids.from_phasors(2.0 * math.pi * np.array([0.021, 0.034]), deg(5.0) * random_phases(2, rng))
    pelvis = Windowed(periodic(sway), steps)
    still = np.zeros(6)
    still[2] = 0.5 * math.pi  # y up
    ends = np.array([_LEAD, _LEAD + 1.5, duration - 2.0, duration - 0.5])
    way = Ramps(ends, np.array([0.0, 1.0, 1.0, 0.0]) * 1.4 / stride)  # 1.4 m each stride
    turn = (
        Stack((Windowed(winding, steps), *(constant(0.0),) * 2, way, *(constant(0.0),) * 2)) + pelvis + constant(still)
    )
    root = EulerMotion(Frame.ENU, Linear(turn, _angles), Linear(turn, _place))
    posture = constant(deg(1.0) * rng.standard_normal(len(chain.angles)))  # nobody stands exactly upright
    angles = Windowed(periodic(harmonics), steps) + Windowed(posture, constant(1.0) + -1.0 * steps)
    return ChainProgram("walking", angles, duration, ((0.0, _LEAD),), root)


PROGRAMS: Final[Mapping[str, Callable[[Chain, np.random.Generator, float], ChainProgram]]] = {
    "teach": _teach,
    "calibration": _calibration,
    "slow": _slow,
    "fast": _fast,
    "still": _still,
    "walk": _walk,
}
"""Programs by name: each is made for a chain, from a source of chance, to last a duration, s."""


def _wander(rng: np.random.Generator, *, still: bool) -> Motion:
    """Root of a chain that is carried by hand: turned by some 40°, moved by some 0.2 m, 0.1 to 0.6 Hz."""
    omega = 2.0 * math.pi * rng.uniform((0.1, 0.2, 0.35), (0.2, 0.35, 0.6))
    strength = np.array([1.0, 0.6, 0.4])[:, np.newaxis]
    if still:
        return EulerMotion(Frame.ENU, constant(rng.uniform(-0.3, 0.3, 3)))
    grown = Moves((_LEAD,), (1.0,), (1.0,))
    turn = Sinusoids.from_phasors(omega, deg(25.0) * strength * random_phases((3, 3), rng))
    way = Sinusoids.from_phasors(omega, 0.12 * strength * random_phases((3, 3), rng))
    return EulerMotion(Frame.ENU, Windowed(turn, grown), Windowed(way, grown))


def named_program(name: str, chain: Chain, *, rng: np.random.Generator, duration: float) -> ChainProgram:
    """Program of that name for a chain; a chain without a fixed base is carried about meanwhile, unless it is "still".

    What is longer than `duration`, s, is cut.

    Raises
    ------
    ParameterError
        If the name is unknown, or the duration is not positive.
    """
    if name not in PROGRAMS:
        raise unknown_name("program of a chain", name, PROGRAMS)
    if not 0.0 < duration < math.inf:
        raise ParameterError(f"duration must be positive, but it is {duration:g} s.")
    made = (PROGRAMS[name] if chain.angles else _still)(chain, rng, duration)
    root = made.root or (None if chain.base_fixed else _wander(rng, still=name == "still"))
    rests = root is None or name == "still"  # one that is carried stands still before it is taken up, and never again
    stops = tuple(
        (start, min(end, duration)) for start, end in made.stops if start < duration and (rests or end <= _LEAD)
    )
    return ChainProgram(f"{made.name} of {chain.name}", made.angles, duration, stops, root)
