"""What contradicts the declared units and signs: sizes of readings at rest, and gravity that turns with the rate."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Final, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.findings import Finding, warning
from plumbob.core.units import deg, to_deg
from plumbob.data.imu import BLOCK, ENOUGH, ImuData, known_rows, median, norms
from plumbob.rotations import Frame

LONGEST_STEP: Final = 0.5
"""A gyroscope whose usual step is longer tells no attitude, s; the slowest in use give some 10 samples a second."""
SHORTEST_STEP: Final = 3e-5  # no MEMS part gives samples faster, s: the fastest give 32 kHz (ICM-42688-P, DS-000347)
USUAL_RATE: Final = 10.0
"""A body that turns faster half of the time is rare, rad/s: 573 °/s. Walking, hands and vehicles stay far below."""
QUIET: Final = 0.2  # Specific forces count that are as long as usual within this fraction: mostly gravity
PAUSE: Final = 1.5  # Steps longer than so many mean ones are pauses between bursts
BURST: Final = 0.5  # Where the usual step is so much shorter than the mean one, rows come in bursts
FEW_PAUSES: Final = 0.005
STEADY: Final = 0.03  # Typical departure of the rows in a time of twenty bursts from their usual number
FEWEST_WINDOWS: Final = 5
THROUGHOUT: Final = 0.99
STEEP: Final = math.cos(float(deg(135.0)))
ALL_AXES: Final = 7
NOT_KNOWN: Final = 8
STUCK_SAMPLES: Final = 50
"""A sensor that says one value so many times, to the bit, is stuck. Noise of .3 of the last digit repeats an axis in
.82 of the samples and all three in .56: so many times once in 3e12."""


RATIO: Final = 2.0  # of a pile to the next level; the tail of noise thins
APEX: Final = 3.0  # the same in motion: a smooth apex is 1/(√2 − 1) times as long in its outermost step as in the next
FEWEST_VISITS: Final = 8  # of a pile; slow noise may stay at its outermost level for long, but not again and again
CLIPPED_SHARE: Final = 1e-4  # part of all samples that a pile has


class Pile(NamedTuple):
    """An outermost value, and how often it occurs."""

    value: float
    size: int


def clipped(columns: Mapping[str, Floats], *, moving: bool = False) -> dict[str, list[Pile]]:
    """Piles at the smallest and at the largest value of some channels that hold noise, or of axes that move.

    Each is visited again and again; or, in motion, all are at one size, as the range of all axes and signs is, and last
    as no other value: steady turns and rest, written coarsely, last alike. Of noise much smaller than a converter's
    step any level can be the outermost: do not ask then.
    """
    piles, ratio, sizes = list[tuple[str, Pile, int, bool]](), APEX if moving else RATIO, list[float]()
    for name, values in columns.items():
        levels, counts = np.unique(values, return_counts=True)
        if levels.size < 3:
            continue
        starts = np.flatnonzero(np.diff(values, prepend=np.nan) != 0.0)
        firsts, runs = values[starts], np.diff(starts, append=values.size)
        others = int(runs[(firsts != levels[0]) & (firsts != levels[-1])].max())
        for i, k in ((0, 1), (-1, -2)):
            size, visits = int(counts[i]), int(np.count_nonzero(firsts == levels[i]))
            lasting = moving and size > APEX * visits * others
            sizes += [abs(float(levels[i]))] * lasting
            if size > ratio * counts[k] and size >= CLIPPED_SHARE * values.size:
                piles.append((name, Pile(float(levels[i]), size), visits, lasting))
    made: dict[str, list[Pile]] = {}
    for name, pile, visits, lasting in piles:
        alike = sum(abs(abs(pile.value) - size) <= 1e-4 * size for size in sizes)  # −32768 and 32767
        if visits >= FEWEST_VISITS or (lasting and alike > 1):
            made.setdefault(name, []).append(pile)
    return made


@dataclass(frozen=True, slots=True, eq=False)
class Statistics:
    """What the usable samples of a triad are, in its unit."""

    samples: int  # how many there are
    # mean, std: (3,), their mean and standard deviation; NaN where there are none
    mean: Floats
    std: Floats
    norm: float  # the median of their magnitudes; NaN where there are none
    # (N,), of each sample of the recording, which axes repeat their last known value to the bit, as bits 0 to 2,
    # `ALL_AXES` being all of them; or `NOT_KNOWN`
    repeats: NDArray[np.uint8]
    piles: Mapping[str, Sequence[Pile]]  # by axis, where it ends as at the end of a range
    piled: int  # how many values of an axis lie at such ends


_MEASURED: Final[WeakKeyDictionary[ImuData, dict[str, Statistics]]] = WeakKeyDictionary()
_DOUBTS: Final[WeakKeyDictionary[ImuData, tuple[Finding, ...]]] = WeakKeyDictionary()


def stuck_runs(repeats: NDArray[np.bool_]) -> NDArray[np.int64]:
    """First row and the one after the last (K, 2) where a value stands `STUCK_SAMPLES` times, of repeats (N,)."""
    edges = np.flatnonzero(np.diff(repeats, prepend=False, append=False)).reshape(-1, 2) - [1, 0]
    return np.asarray(edges[edges[:, 1] - edges[:, 0] >= STUCK_SAMPLES])


def statistics(imu: ImuData, name: str) -> Statistics:
    """Measure a triad, in one pass; who asks again about the same recording is not made to wait again."""
    if (before := _MEASURED.setdefault(imu, {}).get(name)) is not None:
        return before
    count, at, sizes, repeats = 0, 0, np.empty(len(imu)), np.full(len(imu), NOT_KNOWN, dtype=np.uint8)
    total, square, last = np.zeros(3), np.zeros(3), np.full((3, 1), np.nan)
    middle, ends, at_ends = last, np.full((2, 3), -np.inf), np.zeros((2, 3), dtype=np.int64)
    for part in imu.only(name).chunks(BLOCK):
        values = part.usable(name)
        finite = known_rows(values)
        axes = np.ascontiguousarray((values if finite.all() else values[finite]).T)  # in one piece each: faster
        if size := axes.shape[1]:
            same = (axes == np.concatenate((last, axes[:, :-1]), axis=1)).view(np.uint8)
            repeats[at : at + len(values)][finite] = same[0] + 2 * same[1] + 4 * same[2]
            sizes[count : count + size] = norms(axes.T)
            middle, last = middle if count else axes.mean(axis=1, keepdims=True), axes[:, -1:]
            outer = np.stack((axes.max(axis=1), -axes.min(axis=1)))
            many = np.stack([np.count_nonzero(axes == end[:, None], axis=1) for end in (outer[0], -outer[1])])
            at_ends = np.where(outer < ends, at_ends, many + at_ends * (outer == ends))
            ends = np.maximum(ends, outer)
            off = axes - middle  # squares about a value near the mean lose no digits
            total, square, count = total + off.sum(axis=1), square + (off * off).sum(axis=1), count + size
        at += len(values)
    off = total / max(count, 1)
    std = np.sqrt(np.maximum(square / max(count, 1) - off * off, 0.0))
    piled = np.flatnonzero(np.any(at_ends >= max(FEWEST_VISITS, CLIPPED_SHARE * count), axis=0))
    triad = imu.usable(name) if piled.size else np.empty((0, 3))
    columns = {"xyz"[i]: triad[known_rows(triad), i] for i in piled}  # hardly ever one
    piles = clipped(columns, moving=True) if columns else {}
    made = _MEASURED[imu][name] = Statistics(
        count, middle[:, 0] + off, std if count else middle[:, 0], median(sizes[:count]), repeats, piles,
        sum(pile.size for of in piles.values() for pile in of),
    )  # fmt: skip
    return made


def doubts(imu: ImuData) -> tuple[Finding, ...]:
    """What contradicts the units of times and rates, and gyroscopes that turn against the accelerometer."""
    if "gyr" not in imu.triads or len(imu) < ENOUGH:
        return ()
    if imu not in _DOUBTS:
        _DOUBTS[imu] = tuple(islice(_doubts(imu), 1))  # the first may be why there are others
    return _DOUBTS[imu]


def upside_down(imu: ImuData, frame: Frame) -> tuple[Finding, ...]:
    """A finding where a unit is upside down throughout, as one is whose signs or axes are declared wrongly."""
    if "acc" not in imu.triads or len(imu) < ENOUGH:
        return ()
    usual, of_parts = statistics(imu, "acc").norm, list[Floats]()
    for part in imu.only("acc").chunks(BLOCK):
        acc = part.usable("acc")
        norm = norms(acc)
        counts = np.abs(norm - usual) < QUIET * usual
        of_parts.append(acc[counts, 2] * frame.up[2] / norm[counts])
    upward = np.concatenate(of_parts)
    if upward.size < ENOUGH or np.mean(upward < 0.0) < THROUGHOUT or median(upward) > STEEP:
        return ()
    return (warning("samples.upside_down", frame=str(frame), level="+g" if frame.up[2] > 0.0 else "−g"),)


def _doubts(imu: ImuData) -> Iterator[Finding]:
    t = imu.t
    usual, mean = median(np.diff(t)), float(t[-1] - t[0]) / (t.size - 1)
    if usual >= LONGEST_STEP:
        yield warning("samples.step_too_long", step=usual)
    elif mean <= SHORTEST_STEP:
        yield warning("samples.step_too_short", step=mean)
    elif (burst := bursts(t)) is not None:
        yield burst
    fit, times = turning(imu), to_deg(1.0)
    if fit.tells and fit.factor < 0.0:
        yield warning("samples.gyr_against_acc")
    elif fit.tells:
        for ratio, code in ((fit.factor * times, "samples.gyr_in_dps"), (fit.factor / times, "samples.gyr_in_rad_s")):
            # within a factor of two: a buoy in waves shows only 0.6 of its turning, since the waves push it, too
            if abs(math.log2(ratio)) < 1.0:
                yield warning(code, factor=times)
    gyr = statistics(imu, "gyr")
    if gyr.samples >= ENOUGH and gyr.norm > USUAL_RATE:
        yield warning("samples.rates_large", rate=gyr.norm, rate_dps=to_deg(gyr.norm), samples=gyr.samples)


def bursts(t: Floats) -> Finding | None:
    """Say that the times (N,), s, are those at which bursts of even samples came; None where they are not.

    Rows come at a steady rate over a second, but not from one to the next.
    """
    step = np.diff(t)
    if step.size < ENOUGH:
        return None
    span = float(t[-1] - t[0])
    mean = span / step.size
    pauses, usual = float(np.mean(step > PAUSE * mean)), median(step)
    if not (usual < BURST * mean and pauses > FEW_PAUSES):
        return None
    window = max(1.0, 20.0 / (pauses / mean))  # of twenty bursts
    counts = np.diff(np.searchsorted(t, np.arange(t[0], t[-1], window)))
    if counts.size < FEWEST_WINDOWS or np.median(np.abs(counts - np.median(counts))) > STEADY * np.median(counts):
        return None
    return warning("samples.bursts", step=usual, rows=t.size, span=span, mean=mean, rate=1.0 / mean)


WINDOW: Final = 0.2  # Time over which samples are averaged before they are compared, s
LARGEST_TURN: Final = 0.5  # of the acceleration from window to window, rad: beyond it angles are not small

QUIET_WHILE_TURNING: Final = 0.05
"""Windows count whose mean acceleration is as long as usual, within this fraction: little but gravity."""
MOST_PAIRS = 50_000  # of windows that are compared, about, spread over the recording; more would only take longer
ENOUGH_WINDOWS: Final = 50
ENOUGH_EFFECTIVE: Final = 5.0
"""A body that lies still and starts to spin within one window says anything: that one outweighs all others."""
ENOUGH_CORRELATION: Final = 0.7  # with more the rates explain half of the acceleration, and their factor can be trusted


@dataclass(frozen=True, slots=True)
class Turning:
    """How the direction of the acceleration follows the rates."""

    factor: float  # seen turning over that which the rates say; 1 where both are right
    correlation: float  # of the two, −1 to 1; the constant bias of the gyroscope is taken out first
    windows: int  # pairs of neighbouring windows that count
    effective: float = 0.0  # how many pairs the rates are spread over: 1 where a single one has them all

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
    t = imu.t
    size = max(1, round(WINDOW / median(np.diff(t)))) if t.size > 1 else 1
    if not {"gyr", "acc"} <= set(imu.triads) or len(imu) < 3 * size:
        return nothing
    windows = [
        (_means(part.t[:, np.newaxis], size)[:, 0], _means(part.usable("gyr"), size), _means(part.usable("acc"), size))
        for part in imu.only("gyr", "acc").chunks(size * max(1, BLOCK // size))
    ]
    t, rate, acc = map(np.concatenate, zip(*windows, strict=True))
    norm = np.sqrt(np.sum(acc * acc, axis=1))
    if not (np.isfinite(norm).any() and np.nanmedian(norm) > 0.0):
        return nothing
    quiet = np.abs(norm / np.nanmedian(norm) - 1.0) < QUIET_WHILE_TURNING  # False where unknown
    with np.errstate(divide="ignore", invalid="ignore"):
        up = acc / norm[:, np.newaxis]
    i = np.arange(0, t.size - 1, 1 + t.size // MOST_PAIRS)
    step = t[i + 1] - t[i]
    turn = up[i + 1] - up[i]
    middle = 0.5 * (up[i + 1] + up[i]) * step[:, np.newaxis]
    said = -np.cross(0.5 * (rate[i + 1] + rate[i]), middle)
    counts = quiet[i + 1] & quiet[i] & (step < 1.5 * np.median(step)) & np.isfinite(said).all(axis=1)
    counts &= np.sum(turn * turn, axis=1) < LARGEST_TURN**2
    if not counts.any():
        return nothing
    # least squares, with the constant taken out of both sides first
    x, y, z = middle[counts].T
    zero = np.zeros_like(x)
    constant = np.stack(
        (np.column_stack((zero, -z, y)), np.column_stack((z, zero, -x)), np.column_stack((-y, x, zero))), axis=2
    ).reshape(-1, 3)  # columns e × a dt
    basis, _ = np.linalg.qr(constant)
    both = np.column_stack((turn[counts].ravel(), said[counts].ravel()))
    turn_left, said_left = (both - basis @ (basis.T @ both)).T
    product, turn_power, said_power = turn_left @ said_left, turn_left @ turn_left, said_left @ said_left
    if not (turn_power > 0.0 and said_power > 0.0):
        return Turning(float("nan"), 0.0, x.size)
    correlation = float(product / np.sqrt(turn_power) / np.sqrt(said_power))
    share = np.sum(said_left.reshape(-1, 3) ** 2, axis=1) / said_power
    return Turning(float(product / said_power), correlation, x.size, float(1.0 / (share @ share)))


def _means(values: Floats, size: int) -> Floats:
    """Means of windows of `size` samples; NaN where fewer than half of them are known."""
    windows = np.ascontiguousarray(values[: len(values) // size * size].T).reshape(values.shape[1], -1, size)
    finite = np.isfinite(windows)
    count = finite.sum(axis=2)
    total = np.where(finite, windows, 0.0).sum(axis=2)
    return np.where(2 * count >= size, total / np.maximum(count, 1), np.nan).T
