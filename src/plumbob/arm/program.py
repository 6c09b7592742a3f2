"""Teach-in: from recorded joint angles to a program that a controller may run.

A recording falls into stops, where all angles stood still, and motions between them. A stop is kept as it is: its pose
and its duration. A motion is a quintic spline with knots `smooth` apart, fitted by least squares; its first and last
three control points are the poses of the stops, so that it begins and ends at rest without acceleration, and all
control points lie inside the range of the joint, so that the curve does.

Its path is kept where a limit asks for less speed. With the recorded time s along the path and a speed u(s) ≤ 1,
``v = q' u``, ``a = q'' u² + q' u u'`` and ``j = q''' u³ + 3 q'' u² u' + q' (u² u'' + u u'²)``: u is lowered around the
places where these exceed a limit, and what is left of an excess is removed by one factor for the whole motion, which
divides v, a and j by itself, its square and its cube. Differences of samples are means of the derivatives, so that they
keep the limits as well.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from plumbob.arm.angles import RECORDED, TIME, JointTrack, read_table
from plumbob.core import check, units
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.findings import Note, as_json, warning
from plumbob.core.series import Series
from plumbob.core.text import counted
from plumbob.core.units import Quantity, to_deg
from plumbob.data.chain import Chain, Limits, load_chain

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

DEGREE: Final = 5
_ENDS: Final = 3  # control points at each end that are the pose there: position, no velocity, no acceleration
_PARTS: Final = 24
"""Points between two knots at which limits are looked at: between them, what is piecewise quadratic hides 1/2000."""
_MARGIN: Final = 0.998  # share of a limit that is used
_ROUNDS: Final = 12
_WINDOW: Final = 3.0  # knots on either side over which a lower speed is spread
_BENDING: Final = 1e-6
"""Weight of the third difference of control points against samples: it decides only where samples are missing."""
_INSTANT: Final = 1e-9  # shorter times are rounding, s
_LEAST: Final = 2  # rows of a motion, at least, less one
_NEAR: Final = (0.1, 0.5)
"""Shares of the tolerance: the ends of a stop are as near to its pose as its noise, but for these bounds."""
_FINEST: Final = 8.0  # a slow run of still samples is looked at with a tolerance down to this part of the first one


class Standstill(NamedTuple):
    """Where all angles stood still.

    `start`, `end`: when, in the program, s; `angles`: the pose, rad; `recorded`: when it began in the recording, s.
    """

    start: float
    end: float
    angles: tuple[float, ...]
    recorded: float


class PathDeviation(NamedTuple):
    """How far the program's path is from the recorded angles, at the same place along it, rad."""

    rms: float
    max: float


@dataclass(frozen=True, eq=False, repr=False)
class Program(Series):
    """What a controller is to do: angles at a fixed rate.

    Attributes
    ----------
    t : ndarray (N,)
        From 0, s.
    angles, velocities, accelerations : ndarray (N, K)
        rad, rad/s, rad/s².
    names : tuple of str
        Names of the angles.
    recorded : ndarray (N,)
        When the recording was at the same place of the path, s; as `t` where it was not taught.
    stops : tuple of Standstill
        In order of time.
    deviations : mapping of str to PathDeviation
        By angle.
    slowed : float
        Duration of the program over that of the recording.
    notes : tuple of str
        What a reader should know, each a sentence.
    """

    t: Floats
    angles: Floats
    names: tuple[str, ...]
    velocities: Floats
    accelerations: Floats
    recorded: Floats | None = None
    stops: tuple[Standstill, ...] = ()
    deviations: Mapping[str, PathDeviation] | None = None
    slowed: float = 1.0
    notes: tuple[Note, ...] = ()

    def __post_init__(self) -> None:
        """Validate."""
        t = check.column("t", self.t)
        check.increasing_time("t", t)
        object.__setattr__(self, "t", check.read_only(t))
        recorded = t if self.recorded is None else check.column("recorded", self.recorded, t.size)
        object.__setattr__(self, "recorded", check.read_only(recorded))
        for name in ("angles", "velocities", "accelerations"):
            values = check.rows(name, getattr(self, name), len(self.names), t.size)
            if not np.isfinite(values).all():
                raise ShapeError(f"the {name} of a program must be finite.")
            object.__setattr__(self, name, check.read_only(values))

    @classmethod
    def from_track(cls, track: JointTrack, recorded: Floats | None = None) -> "Program":
        """Take angles as they are for a program, as one that a file holds; its rates are differences of them."""
        if len(track) < 3:
            raise ShapeError(f"a program needs 3 samples, but it has {len(track)}.")
        velocities = np.gradient(track.angles, track.t, axis=0)
        accelerations = np.gradient(velocities, track.t, axis=0)
        return cls(track.t, track.angles, track.names, velocities, accelerations, recorded)

    @classmethod
    def load(cls, path: str | Path) -> "Program":
        """Read a program, or any angles, from a ``.csv`` or ``.parquet`` table; errors as of `JointTrack.load`."""
        return cls.from_track(JointTrack.load(path), read_table(path)[0].get(RECORDED))

    def __len__(self) -> int:
        return int(self.t.size)

    @property
    def rate(self) -> float:
        """Samples per second, Hz."""
        return (len(self) - 1) / float(self.t[-1] - self.t[0])

    def facts(self) -> Mapping[str, str]:
        """Angles, samples, stops, and how much slower than the recording it is."""
        return {
            "angles": ", ".join(self.names),
            "samples": f"{len(self)} at {self.rate:.6g} Hz",
            "duration": f"{self.t[-1] - self.t[0]:.3f} s",
            "stops": str(len(self.stops)),
            "slowed": f"{self.slowed:.3f} times the recording's duration",
        }

    def columns(self) -> Mapping[str, Floats]:
        """Time, angles and their rates."""
        columns = {TIME: self.t}
        for values, end, unit in (
            (self.angles, "", "rad"),
            (self.velocities, "_velocity", "rad/s"),
            (self.accelerations, "_acceleration", "rad/s2"),
        ):
            columns |= {f"{name}{end} [{unit}]": values[:, k] for k, name in enumerate(self.names)}
        return columns

    def track(self) -> JointTrack:
        """Its angles as any others."""
        return JointTrack(self.t, self.names, self.angles, source="program")

    def used(self, limits: "Chain | Limits | Sequence[Limits]") -> Mapping[str, float]:
        """How much of each limit its samples use, at most, by differences of neighbours: above 1, it is exceeded.

        Returns
        -------
        mapping of str to float
            ``position`` (of half the range, from its middle), ``velocity``, ``acceleration`` and ``jerk``.
        """
        return _used(self.angles, 1.0 / self.rate, _bounds(limits, self.names))

    def summary(self, limits: Chain | None = None) -> dict[str, Any]:
        """All numbers, as JSON can hold them; what is used of the limits of a chain where it is given."""
        stops = [{"at_s": stop.start, "for_s": stop.end - stop.start, "recorded_s": stop.recorded,
                  "angles_rad": list(stop.angles)} for stop in self.stops]  # fmt: skip
        return {
            "angles": list(self.names), "samples": len(self), "rate_hz": self.rate, "duration_s": float(self.t[-1]),
            "slowed": self.slowed, "stops": stops, "used": {} if limits is None else dict(self.used(limits)),
            "notes": as_json(self.notes),
            "deviation_deg": {name: {"rms": to_deg(deviation.rms), "max": to_deg(deviation.max)}
                              for name, deviation in (self.deviations or {}).items()},
        }  # fmt: skip

    def text(self, limits: Chain | None = None) -> str:
        """What a reader wants to know first, a line each; with the limits of a chain, what is used of them."""
        numbers = self.summary(limits)
        lines = [f"{name:12} {value}" for name, value in self.facts().items()]
        if away := numbers["deviation_deg"]:
            width = max(map(len, away))
            lines.append("deviation    of the program from the recording, rms and greatest:")
            lines += [f"             {name:{width}} {of['rms']:6.2f}° {of['max']:6.2f}°" for name, of in away.items()]
        if used := numbers["used"]:
            shares = ", ".join(f"{name} {100.0 * share:.1f} %" for name, share in used.items() if share)
            lines.append(f"limits       {shares}")
        return "\n".join(lines)


def taught(
    track: JointTrack | str | Path, limits: "Chain | Limits | Sequence[Limits] | str | Path | None" = None, *,
    rate: float | str = "100 Hz", smooth: float | str = "0.2 s", still: float | str = "1 deg",
    dwell: float | str = "0.3 s",
) -> Program:  # fmt: skip
    """Make a program of recorded joint angles: stops are kept, the rest is smoothed and slowed where limits ask for it.

    Parameters
    ----------
    track : JointTrack or path
        What was recorded: a table of angles, .csv or .parquet.
    limits : Chain, path of its file, Limits or sequence of Limits, optional
        Of the chain's angles; one for all, or one for each.
    rate : float or str
        Samples of the program per second, Hz.
    smooth : float or str
        Distance of the spline's knots, s: what changes within less is smoothed away.
    still : float or str
        All angles stay within this, rad, at a stop.
    dwell : float or str
        Least duration of a stop, s.

    Returns
    -------
    Program
        Stops and ends are kept to the bit, except where they lie beyond the range of a joint, which a note says; limits
        are kept.

    Raises
    ------
    ParameterError
        If a parameter is not above 0, or limits do not fit the angles.
    ShapeError
        If fewer than 8 samples are known.
    """
    track = JointTrack.load(track) if isinstance(track, str | Path) else track
    limits = load_chain(limits) if isinstance(limits, str | Path) else limits
    rate, smooth = _size("rate", rate, Quantity.FREQUENCY), _size("smooth", smooth, Quantity.TIME)
    still, dwell = _size("still", still, Quantity.ANGLE), _size("dwell", dwell, Quantity.TIME)
    bounds = _bounds(Limits() if limits is None else limits, track.names)
    t, q, notes = _resampled(track, bounds)
    rests = find_stops(t, q, still=still, dwell=dwell, smooth=smooth)
    poses, clipped = _poses(q, rests, bounds, track.names, t)
    motions = [
        _Motion.fitted(t[start:end], q[start:end], poses[k : k + 2], smooth, bounds)
        for k, (start, end) in enumerate(_between(rests, t.size))
    ]
    factor = 1.0
    for _ in range(_ROUNDS):  # once; again where a peak between the points that were looked at shows in the samples
        times, angles, velocities, accelerations, when, spans = _sampled(t, rests, poses, motions, rate, factor)
        angles = np.clip(angles, [bound.low for bound in bounds], [bound.high for bound in bounds])  # by the last bit
        over = _over(angles, velocities, accelerations, rate, bounds)
        if over <= 1.0:
            break
        factor *= 1.001 * over
    else:
        raise ParameterError(
            f"no program at {rate:g} Hz keeps these limits: the rounding of an angle exceeds the jerk. Lower the "
            "rate, or raise the limits."
        )
    stops = [
        Standstill(*span, tuple(pose.tolist()), float(t[rest[0]]))
        for span, pose, rest in zip(spans, poses, rests, strict=True)
        if rest[1] > rest[0]
    ]
    deviations = dict(zip(track.names, _deviations(t, q, rests, poses, motions), strict=True))
    return Program(
        times, angles, track.names, velocities, accelerations, when, tuple(stops), deviations,
        slowed=float(times[-1] / (t[-1] - t[0])), notes=(*notes, *clipped),
    )  # fmt: skip


def _size(name: str, value: float | str, quantity: Quantity) -> float:
    number = units.given(name, value, quantity)
    if number is None or not 0.0 < number < np.inf:
        raise ParameterError(f"{name} must be above 0 {quantity}, but it is {value}.")
    return number


def _bounds(limits: "Chain | Limits | Sequence[Limits]", names: Sequence[str]) -> tuple[Limits, ...]:
    """Limits of each angle."""
    if isinstance(limits, Limits):
        return (limits,) * len(names)
    if not isinstance(limits, Chain):
        bounds = tuple(limits)
        if len(bounds) != len(names):
            raise ParameterError(f"{counted(len(names), 'angle')} need as many limits, but {len(bounds)} were given.")
        return bounds
    by_name = dict(zip(limits.angles, limits.limits, strict=True))
    unknown = [name for name in names if name not in by_name]
    if unknown:
        raise ParameterError(
            f"{limits.name} has no angle {', '.join(unknown)}; its angles are {', '.join(by_name) or 'none'}."
        )
    return tuple(by_name[name] for name in names)


def _resampled(track: JointTrack, bounds: Sequence[Limits]) -> tuple[Floats, Floats, tuple[str, ...]]:
    """Times and angles (N, K) without gaps and without jumps by a turn, from the first to the last that are known."""
    finite = np.asarray(np.isfinite(track.angles).all(axis=1))
    rows = np.flatnonzero(finite)
    if rows.size < 8 or not track.names:
        raise ShapeError(f"a program needs at least 8 samples of known angles, but it has {rows.size}.")
    t = track.t[rows[0] : rows[-1] + 1]
    steps = np.diff(t)
    step = float(np.median(steps))
    line = np.linspace(t[0], t[-1], 1 + max(8, round((t[-1] - t[0]) / step)))
    turned = np.unwrap(track.angles[rows], axis=0)
    for k, bound in enumerate(bounds):  # the turn on which most of it lies inside the range
        if np.isfinite(bound.low) and np.isfinite(bound.high):
            middle = 0.5 * (bound.low + bound.high)
            turned[:, k] -= 2.0 * np.pi * np.round((np.median(turned[:, k]) - middle) / (2.0 * np.pi))
    if np.ptp(steps) < 1e-3 * step and finite[rows[0] : rows[-1] + 1].all():
        line, q = t, turned
    else:
        q = np.stack([np.interp(line, track.t[rows], column) for column in turned.T], axis=1)
    longest = float(np.diff(track.t[rows]).max())
    note = f"Angles are not known for up to {longest:.3g} s; they were joined by straight lines."
    return line, q, (note,) if longest > 2.5 * step else ()


def find_stops(t: Floats, angles: Floats, *, still: float, dwell: float, smooth: float) -> list[tuple[int, int]]:
    """Rows (first, last) of each stop; the first and the last row are stops of no length where nothing stands still.

    Of angles (N, K), rad, at times with equal steps, s: `still`, `dwell`: range of each angle, rad, and least duration,
    s; `smooth`: noise is averaged over this time before, s.
    """
    from scipy.ndimage import uniform_filter1d

    step = (t[-1] - t[0]) / (t.size - 1)
    mean = uniform_filter1d(angles, 2 * round(0.5 * smooth / step) + 1, axis=0, mode="nearest")
    width = max(2, 1 + int(np.ceil(dwell / step - 1e-6)))
    stops = [_trimmed(mean, rest, width, still) for rest in _still(mean, 0, width, still, still / _FINEST)]
    last = t.size - 1
    stops = [(0 if a <= _LEAST else a, last if b >= last - _LEAST else b) for a, b in stops]
    if not stops or stops[0][0] > 0:
        stops.insert(0, (0, 0))
    if stops[-1][1] < last:
        stops.append((last, last))
    return stops


def _still(mean: Floats, offset: int, width: int, still: float, least: float) -> list[tuple[int, int]]:
    """Runs of windows in which all angles stay within `still`; one that drifts is looked at more closely."""
    from numpy.lib.stride_tricks import sliding_window_view

    if len(mean) < width:
        return []
    windows = sliding_window_view(mean, width, axis=0)
    quiet = ((windows.max(axis=-1) - windows.min(axis=-1)) <= still).all(axis=1)
    rests: list[tuple[int, int]] = []
    for start, end in check.runs(quiet):
        run = mean[start : end + width - 1]
        first = start + offset
        if (np.ptp(run, axis=0) <= 2.0 * still).all():
            rests.append((first, first + len(run) - 1))
        elif 0.5 * still >= least:
            rests += _still(run, first, width, 0.5 * still, least)
    apart: list[tuple[int, int]] = []
    for first, last in rests:  # two runs of windows may share rows, and a motion needs some
        begin = max(first, apart[-1][1] + _LEAST + 1) if apart else first
        if last - begin + 1 >= width:
            apart.append((begin, last))
    return apart


def _trimmed(mean: Floats, rest: tuple[int, int], width: int, still: float) -> tuple[int, int]:
    """Rows of a stop without those at its ends that already leave its pose, as far as it stays long enough."""
    first, last = rest
    run = mean[first : last + 1]
    away = np.abs(run - np.median(run, axis=0))
    noise = 1.4826 * np.median(away, axis=0)  # standard deviation of what is normally distributed
    near = (away <= np.clip(3.0 * noise, _NEAR[0] * still, _NEAR[1] * still)).all(axis=1)
    rows = np.flatnonzero(near)
    if rows.size == 0 or rows[-1] - rows[0] + 1 < width:
        return rest
    return first + int(rows[0]), first + int(rows[-1])


def _poses(
    q: Floats, rests: Sequence[tuple[int, int]], bounds: Sequence[Limits], names: Sequence[str], t: Floats
) -> tuple[Floats, list[Note]]:
    """Pose of each stop, the median of its rows, inside the ranges; and what that changed."""
    poses = np.stack([np.median(q[first : last + 1], axis=0) for first, last in rests])
    inside = np.clip(poses, [bound.low for bound in bounds], [bound.high for bound in bounds])
    notes: list[Note] = [
        warning(
            "arm.pose_beyond",
            t=t[rests[row][0]],
            beyond_deg=to_deg(abs(poses[row, k] - inside[row, k])),
            joint=names[k],
        )
        for row, k in np.argwhere(inside != poses)
    ]
    return inside, notes


def _between(rests: Sequence[tuple[int, int]], count: int) -> list[tuple[int, int]]:
    """Rows (first, behind the last) of each motion, which begins and ends on a row of a stop."""
    return [(rest[1], min(count, after[0] + 1)) for rest, after in pairwise(rests)]


@dataclass(frozen=True)
class _Motion:
    """A path from rest to rest: angles (K), and time of the program, over recorded time, all times from 0."""

    path: "BSpline"
    clock: "BSpline"

    @classmethod
    def fitted(cls, t: Floats, q: Floats, ends: Floats, smooth: float, bounds: Sequence[Limits]) -> "_Motion":
        """Path along samples between two poses, as fast as limits allow and the recording was."""
        path = _path(t - t[0], q, ends, smooth, bounds)
        return cls(path, _clock(path, bounds))

    @property
    def duration(self) -> float:
        """In the program, s."""
        return float(self.clock(self.path.t[-1]))

    def states(self, times: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Angles, velocities and accelerations (M, K) at times of the program, and recorded times (M,)."""
        s = np.interp(times, self.clock(self.path.t), self.path.t)
        slope, bend = self.clock.derivative(), self.clock.derivative(2)
        for _ in range(8):  # Newton; the slope is at least 1
            s = np.clip(s - (self.clock(s) - times) / slope(s), 0.0, self.path.t[-1])
        u = 1.0 / slope(s)[:, np.newaxis]
        first, second = self.path.derivative()(s), self.path.derivative(2)(s)
        # u' = −t'' / t'², so that a = q'' u² − q' u³ t''.
        return self.path(s), first * u, second * u**2 - first * u**3 * bend(s)[:, np.newaxis], s


def _path(t: Floats, q: Floats, ends: Floats, smooth: float, bounds: Sequence[Limits]) -> "BSpline":
    """Quintic spline from rest to rest that comes nearest to samples; convex, so that its control points bound it."""
    from scipy.interpolate import BSpline
    from scipy.sparse import csc_array, diags_array
    from scipy.sparse.linalg import spsolve

    spans = max(1, round(t[-1] / smooth))
    inner = np.linspace(0.0, t[-1], spans + 1)
    knots = np.concatenate((np.zeros(DEGREE), inner, np.full(DEGREE, t[-1])))
    count = spans + DEGREE
    control = np.empty((count, q.shape[1]))
    control[:_ENDS], control[-_ENDS:] = ends[0], ends[1]
    free = slice(_ENDS, count - _ENDS)
    if count > 2 * _ENDS:
        design = BSpline.design_matrix(np.clip(t, 0.0, t[-1]), knots, DEGREE).tocsr()
        third = diags_array([-1.0, 3.0, -3.0, 1.0], offsets=[0, 1, 2, 3], shape=(count - 3, count))
        normal = csc_array(design.T @ design + _BENDING * (third.T @ third))
        fixed = control.copy()
        fixed[free] = 0.0
        right = (design.T @ q - normal @ fixed)[free]
        control[free] = spsolve(normal[free, free], right).reshape(-1, q.shape[1])
        control[free] = np.clip(control[free], [bound.low for bound in bounds], [bound.high for bound in bounds])
    return BSpline(knots, control, DEGREE)


def _clock(path: "BSpline", bounds: Sequence[Limits]) -> "BSpline":
    """Time of the program over recorded time: the shortest of some that keep the limits, none faster than recorded."""
    from scipy.interpolate import make_interp_spline

    spans = path.t.size - 2 * DEGREE - 1
    grid = np.linspace(0.0, float(path.t[-1]), 1 + max(_PARTS * spans, 4 * _PARTS))
    width = round(_WINDOW * (grid.size - 1) / spans)
    shape = [path.derivative(order)(grid) for order in (1, 2, 3)]
    allowed = np.ones(grid.size)
    best: tuple[float, BSpline] | None = None
    for _ in range(_ROUNDS):
        speed = make_interp_spline(grid, _smoothed_below(allowed, width), k=DEGREE)
        ratio = _ratio(shape, [speed(grid), speed.derivative()(grid), speed.derivative(2)(grid)], bounds)
        worst = max(1.0, float(ratio.max()))
        clock = make_interp_spline(grid, worst / speed(grid), k=DEGREE).antiderivative()
        duration = float(clock(grid[-1]))
        if best is None or duration < best[0]:
            best = duration, clock
        if worst == 1.0:
            break
        allowed = allowed / np.maximum(ratio, 1.0)
    assert best is not None
    return best[1]


def _smoothed_below(values: Floats, width: int) -> Floats:
    """Smooth curve that is nowhere above the values: means of the least values around, both over `width` each side."""
    from scipy.ndimage import minimum_filter1d, uniform_filter1d

    if (values == values[0]).all():
        return values
    least = minimum_filter1d(values, 2 * width + 1, mode="nearest")
    part = 2 * max(1, width // 5) + 1  # five means of it reach as far as the least values do, and are C³
    for _ in range(5):
        least = uniform_filter1d(least, part, mode="nearest")
    return np.asarray(least)


def _ratio(shape: Sequence[Floats], speed: Sequence[Floats], bounds: Sequence[Limits]) -> Floats:
    """By which factor (N,) the motion would have to be slower at each place to keep all limits."""
    q1, q2, q3 = shape
    u, u1, u2 = (curve[:, np.newaxis] for curve in speed)
    rates = (q1 * u, q2 * u**2 + q1 * u * u1, q3 * u**3 + 3.0 * q2 * u**2 * u1 + q1 * (u**2 * u2 + u * u1**2))
    tops = np.array([bound[2:] for bound in bounds]).T  # (3, K)
    ratios = [
        (np.abs(values) / (_MARGIN * top)).max(axis=1) ** (1.0 / order)
        for order, (values, top) in enumerate(zip(rates, tops, strict=True), 1)
    ]
    return np.asarray(np.max(ratios, axis=0))


def _sampled(
    t: Floats, rests: Sequence[tuple[int, int]], poses: Floats, motions: Sequence[_Motion], rate: float, factor: float
) -> tuple[Floats, Floats, Floats, Floats, Floats, list[tuple[float, float]]]:
    """Times, angles, velocities, accelerations and recorded times at a rate, and when each stop begins and ends.

    Motions are slower by `factor`.
    """
    spans, now = [], 0.0
    for k, (first, last) in enumerate(rests):
        spans.append((now, now + float(t[last] - t[first])))
        now = spans[-1][1] + (motions[k].duration * factor if k < len(motions) else 0.0)
    times = np.arange(1 + int(np.ceil((spans[-1][1] - _INSTANT) * rate))) / rate
    angles = np.repeat(poses[-1:], times.size, axis=0)
    velocities, accelerations = np.zeros_like(angles), np.zeros_like(angles)
    angles[times <= spans[0][1]] = poses[0]
    when = np.minimum(t[0] + times, t[-1])
    for k, motion in enumerate(motions):
        start, end = spans[k][1], spans[k + 1][0]
        rows = (times > start) & (times < end - _INSTANT)
        states = motion.states((times[rows] - start) / factor)
        angles[rows], velocities[rows], accelerations[rows] = states[0], states[1] / factor, states[2] / factor**2
        when[rows] = t[rests[k][1]] + states[3]
        after = times >= end - _INSTANT
        angles[after] = poses[k + 1]
        when[after] = np.minimum(t[rests[k + 1][0]] + times[after] - end, t[-1])
    return times, angles, velocities, accelerations, when, spans


def _used(angles: Floats, step: float, bounds: Sequence[Limits]) -> dict[str, float]:
    """Share of the limits that samples use at most."""
    shares = {"position": 0.0, "velocity": 0.0, "acceleration": 0.0, "jerk": 0.0}
    for k, bound in enumerate(bounds):
        if np.isfinite(bound.low) and np.isfinite(bound.high):
            away = np.abs(angles[:, k] - 0.5 * (bound.low + bound.high)).max() / (0.5 * (bound.high - bound.low))
            shares["position"] = max(shares["position"], float(away))
        for order, name in enumerate(("velocity", "acceleration", "jerk"), 1):
            if len(angles) > order:
                most = np.abs(np.diff(angles[:, k], order)).max() / step**order
                shares[name] = max(shares[name], float(most / getattr(bound, name)))
    return shares


def _over(angles: Floats, velocities: Floats, accelerations: Floats, rate: float, bounds: Sequence[Limits]) -> float:
    """By which factor the motions would have to be slower to keep the limits in every sample."""
    used = _used(angles, 1.0 / rate, bounds)
    for name, values in (("velocity", velocities), ("acceleration", accelerations)):
        tops = [getattr(bound, name) for bound in bounds]
        used[name] = max(used[name], float((np.abs(values).max(axis=0) / tops).max()))
    return max(float(used[name] ** (1.0 / order)) for order, name in enumerate(("velocity", "acceleration", "jerk"), 1))


def _deviations(
    t: Floats, q: Floats, rests: Sequence[tuple[int, int]], poses: Floats, motions: Sequence[_Motion]
) -> list[PathDeviation]:
    """Of the path from the recorded angles, at the same recorded time."""
    path = np.empty_like(q)
    for k, (start, end) in enumerate(_between(rests, t.size)):
        path[start:end] = motions[k].path(np.clip(t[start:end] - t[start], 0.0, motions[k].path.t[-1]))
    for (first, last), pose in zip(rests, poses, strict=True):
        path[first : last + 1] = pose
    away = np.abs(path - q)
    return [PathDeviation(float(np.sqrt(np.mean(errors**2))), float(errors.max())) for errors in away.T]
