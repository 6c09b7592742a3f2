"""Compare two recordings of one motion, or two attitudes: clocks, mounting, biases, scales, and what then differs.

Of recordings, what is found is that of the second, b, seen from the first, a: ``t_a = t_b + offset + drift t_b`` and
``v_a = R(q_ab) v_b``. Offset and drift come from the rates: the correlation of their sizes, which no mounting changes,
gives the offset to a grid step; least squares over time, rotation, bias and scale at once give the fractions. Nothing
of it can be seen where the body hardly turns, and of the rotation nothing where it turns about a single axis; the
comparison says so.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.errors import ClockError
from plumbob.core.findings import Note, as_json, warning
from plumbob.core.result import Reported, plain
from plumbob.core.time import GAP_FACTOR, timing
from plumbob.core.units import to_deg
from plumbob.data import AttitudeTrack, ImuData
from plumbob.evaluation.align import FINEST_STEP, MIN_CORRELATION, MIN_RATE_SD, masked_correlation
from plumbob.evaluation.evaluation import Evaluation
from plumbob.rotations import IDENTITY, dcm_from_quat, euler_zyx_from_quat, quat_from_dcm, quat_from_rotvec, skew

if TYPE_CHECKING:
    from plumbob.data.recording import Recording

LONGEST_OFFSET: Final = 10.0  # Largest time offset sought by default, s
FEWEST: Final = 100  # Samples in common, fewer of which say nothing
PLANE: Final = 0.02  # Ratio of the second to the first principal rate, above which a rotation is seen about every axis
COARSE: Final = 0.05  # sd of the smoothing that both get before the fit, s: a motion below 3 Hz keeps half of its power
HALF_POWER: Final = 0.1325  # of a Gaussian: frequency at which it halves the power, times its sd, √(ln 2) / 2π
FARTHEST: Final = 0.5  # From the best correlation the fit goes no farther, s
ROUNDS: Final = 30  # Of the least squares at most; some five are enough
COHERENT: Final = 0.5  # Magnitude-squared coherence above which the two say the same at a frequency
_SEGMENTS: Final = 8


@dataclass(frozen=True, eq=False)
class Clock:
    """Clock of b against that of a."""

    # offset, offset_sd: what is added to b's stamps at the middle of the common time, s, and its standard deviation
    offset: float
    offset_sd: float
    # drift, drift_sd: how much more an interval is by a's clock than by b's, relative
    drift: float
    drift_sd: float
    middle: float  # that middle, by b's clock, s
    correlation: float  # of the sizes of the rates, at the grid step nearest to the offset

    def at(self, t: Floats) -> Floats:
        """Times of b (N,), s, by the clock of a."""
        return np.asarray(t + self.offset + self.drift * (t - self.middle))

    def back(self, t: Floats) -> Floats:
        """Times of a (N,), s, by the clock of b."""
        return np.asarray(self.middle + (t - self.offset - self.middle) / (1.0 + self.drift))


@dataclass(frozen=True, eq=False)
class Mounting:
    """Rotation between the bodies."""

    q_ab: Floats  # (4,), from the body axes of b to those of a
    sd: Floats  # (3,), its standard deviation about each axis of a, rad


SAME: Final = Clock(0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class TriadDifference:
    """How a triad of b differs from that of a, after what was aligned; b less a, in body axes of a."""

    samples: int  # compared
    bias: Floats  # (3,), mean difference, in the unit of the triad
    scale: Floats  # (3,), scale of b over that of a, of each axis that varies; NaN of others
    rms: float  # root mean square of the difference, all axes together
    relative: float  # the same over the root mean square of a
    residual: float  # root mean square without bias and scale
    bandwidth: float | None  # frequency up to which the two are coherent, Hz; None where they are nowhere
    ratio_db: float | None  # spectrum of b over that of a in this band, dB


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Reported):
    """Two recordings or two attitudes beside each other."""

    names: tuple[str, str]  # of a and b
    equal: bool  # whether times and values are equal to the bit
    first: str  # where the first difference is; empty where they are equal
    # clock, mounting, triads: of recordings, as far as the motion shows them
    clock: Clock | None = None
    mounting: Mounting | None = None
    triads: Mapping[str, TriadDifference] = field(default_factory=dict)
    evaluation: Evaluation | None = None  # of attitudes: a judged by b
    within: bool | None = None  # whether the difference is within the tolerance, where one is given
    counts: Sequence[tuple[str, str, str]] = ()  # samples, gaps, flags: name, of a, of b
    remarks: tuple[Note, ...] = ()  # what could not be seen, and why

    def facts(self) -> Mapping[str, str]:
        """What was compared, and whether it is equal."""
        return {
            "a": self.names[0],
            "b": self.names[1],
            "equal to the bit": "yes" if self.equal else f"no: {self.first}",
        }

    def summary(self) -> dict[str, Any]:
        """All numbers, ready for JSON: s, degrees, and the units of the triads."""
        numbers: dict[str, Any] = {"a": self.names[0], "b": self.names[1], "equal": self.equal}
        numbers |= {
            "first_difference": self.first or None,
            "within_tolerance": self.within,
            "remarks": as_json(self.remarks),
        }
        numbers |= {"counts": {name: {"a": a, "b": b} for name, a, b in self.counts}}
        if self.evaluation is not None:
            return dict(plain(numbers | {"attitude": self.evaluation.summary()}))
        m = self.mounting
        mount = None if m is None else {"q_ab": m.q_ab, "euler_zyx_deg": self.angles(), "sd_deg": to_deg(m.sd)}
        return dict(plain(numbers | {"clock": self.clock, "mounting": mount, "triads": dict(self.triads)}))

    def angles(self) -> list[float]:
        """Yaw, pitch and roll of the mounting, degrees."""
        assert self.mounting is not None
        return [float(to_deg(angle)) for angle in euler_zyx_from_quat(self.mounting.q_ab)]


def compare_attitudes(a: "Recording", b: "Recording", evaluation: Evaluation, limit: float | None) -> Comparison:
    """Compare two attitudes, of which the first has been judged by the second; `limit` is the largest error, rad."""
    assert a.track is not None
    assert b.track is not None
    first = _first({"t": a.track.t, "q_nb": a.track.q_nb}, {"t": b.track.t, "q_nb": b.track.q_nb})
    kind = "total" if "total" in evaluation.stats else "inclination"
    most = float(np.nanmax(evaluation.errors[kind][evaluation.match.scored]))
    within = None if limit is None else (not first if limit == 0.0 else most <= limit)
    names = a.name or "a", b.name or "b"
    return Comparison(names, not first, first, evaluation=evaluation, within=within, counts=_counts(a.track, b.track))


def _counts(a: ImuData | AttitudeTrack, b: ImuData | AttitudeTrack) -> list[tuple[str, str, str]]:
    times = [timing(samples.t) for samples in (a, b)]
    rows = [("samples", *(str(time.samples) for time in times)), ("rate [Hz]", *(f"{time.rate:.6g}" for time in times)),
            ("gaps", *(str(time.gaps) for time in times)),
            ("longest step [s]", *(f"{time.longest:.4g}" for time in times))]  # fmt: skip
    marks = [{} if samples.flags is None else flags.counts(samples.flags) for samples in (a, b)]
    rows += [(name, *(str(mark.get(name, 0)) for mark in marks)) for name in dict.fromkeys((*marks[0], *marks[1]))]
    return rows  # type: ignore[return-value]


def _first(a: Mapping[str, Any], b: Mapping[str, Any]) -> str:
    """Where the first difference is, by row; a NaN is equal to a NaN."""
    if gone := sorted(name for name in a.keys() | b.keys() if (a.get(name) is None) != (b.get(name) is None)):
        return f"{', '.join(gone)} in one of them alone"
    size = min(len(a["t"]), len(b["t"]))
    rows = {}
    for name, values in a.items():
        if values is not None:
            x, y = values[:size].reshape(size, -1), b[name][:size].reshape(size, -1)
            differ = ~((x == y) | (np.isnan(x) & np.isnan(y))).all(axis=1)
            if differ.any():
                rows[name] = int(np.argmax(differ))
    if rows:
        name = min(rows, key=lambda key: rows[key])
        return f"{name} in row {rows[name]}, t = {a['t'][rows[name]]:.6g} s"
    return "" if len(a["t"]) == len(b["t"]) else f"one ends after {size} rows"


def _columns(imu: ImuData) -> dict[str, Any]:
    return {"t": imu.t, "gyr": imu.gyr, "acc": imu.acc, "mag": imu.mag, "temp_c": imu.temp_c, "flags": imu.flags}


def compare_recordings(
    a: "Recording", b: "Recording", align: Collection[str], most: float, tolerance: float | None
) -> Comparison:
    """Compare the samples of two recordings; `most` is the largest offset, s, `tolerance` a share of each triad."""
    assert a.imu is not None
    assert b.imu is not None
    first, remarks = _first(_columns(a.imu), _columns(b.imu)), list[Note]()
    starts = [recording.imu.meta.t0_ns for recording in (a, b) if recording.imu is not None]
    shift = (starts[1] - starts[0]) / 1e9 if all(starts) else 0.0
    clock, mounting = _alignment(a.imu, b.imu, shift, most, remarks)
    applied = clock if clock is not None and "time" in align else replace(SAME, offset=shift)
    turn = mounting.q_ab if mounting is not None and "mounting" in align else IDENTITY
    triads = {
        name: difference
        for name in a.imu.triads
        if name in b.imu.triads and (difference := _difference(a.imu, b.imu, name, applied, turn, remarks)) is not None
    }
    within = None
    if tolerance is not None:
        within = not first or (
            tolerance > 0.0 and bool(triads) and all(t.relative <= tolerance for t in triads.values())
        )
    names = a.name or "a", b.name or "b"
    counts = _counts(a.imu, b.imu)
    return Comparison(names, not first, first, clock, mounting, triads, None, within, counts, tuple(remarks))


def _alignment(
    a: ImuData, b: ImuData, shift: float, most: float, remarks: list[Note]
) -> tuple[Clock | None, Mounting | None]:
    """Clock of b against a, and rotation; None, with a remark, what cannot be seen."""
    if not ("gyr" in a.triads and "gyr" in b.triads):
        remarks.append(warning("compare.no_gyroscopes"))
        return None, None
    try:
        offset, correlation = _coarse(a, b, shift, most)
        return _fine(a, b, offset, correlation, remarks)
    except ClockError as error:
        text = str(error)
        remarks.append(text[0].upper() + text[1:])
        return None, None


def _coarse(a: ImuData, b: ImuData, shift: float, most: float) -> tuple[float, float]:
    """Offset, s, by the correlation of the sizes of the rates on a grid."""
    step = max(FINEST_STEP, *(float(np.median(np.diff(imu.t))) for imu in (a, b)))
    begin, end = min(a.t[0], b.t[0] + shift), max(a.t[-1], b.t[-1] + shift)
    grid = begin + step * np.arange(int((end - begin) / step) + 1)
    if grid.size < FEWEST:
        raise ClockError(f"a comparison of clocks needs {FEWEST} steps of {step:.3g} s, but there are {grid.size}.")
    of_a, of_b = (_size_on(grid, imu.t + late, imu.usable("gyr"), step) for imu, late in ((a, 0.0), (b, shift)))
    for name, size in (("a", of_a), ("b", of_b)):
        if not float(np.nanstd(size)) > MIN_RATE_SD:
            raise ClockError(
                f"nothing of clocks and mounting can be seen: the rate of {name} varies by "
                f"{to_deg(float(np.nanstd(size))):.2g} °/s, but {to_deg(MIN_RATE_SD):.2g} °/s are needed. "
                "Record a motion."
            )
    lags, r = masked_correlation(of_a, of_b, int(np.ceil(most / step)))
    top = float(np.nanmax(r)) if np.isfinite(r).any() else 0.0
    if top < MIN_CORRELATION:
        raise ClockError(
            f"within ±{most:g} s the rates of a and b do not match: the best correlation is {top:.2f}, but "
            f"{MIN_CORRELATION} is needed. Search a wider range (max_offset), or check that both are of one motion."
        )
    return shift + float(lags[int(np.nanargmax(r))]) * step, top


def _size_on(grid: Floats, t: Floats, rates: Floats, step: float) -> Floats:
    """Size of the rates (N, 3) on a grid, averaged over its steps, NaN where there are none."""
    finite = np.isfinite(rates).all(axis=1)
    t, size = t[finite], np.linalg.norm(rates[finite], axis=1)
    place = np.clip(np.rint((t - grid[0]) / step).astype(np.int64), 0, grid.size - 1)
    count = np.bincount(place, minlength=grid.size)
    total = np.bincount(place, weights=size, minlength=grid.size)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(count > 0, total / count, np.nan))


def _fine(
    a: ImuData, b: ImuData, offset: float, correlation: float, remarks: list[Note]
) -> tuple[Clock, Mounting | None]:
    """Offset, drift, rotation, bias and scale by least squares of the rates, b brought to the times of a.

    Twice: first of all that the two say, then of the band in which they say the same, which is that of the motion.
    """
    middle = 0.5 * (float(b.t[0]) + float(b.t[-1]))
    clock, rotation, observed, width = Clock(offset, np.nan, 0.0, np.nan, middle, correlation), np.eye(3), False, COARSE
    for _ in range(2):
        curves = _TriadSpline(a, "gyr", width), _TriadSpline(b, "gyr", width)
        x = curves[0].interpolate(a.t)
        rotation, observed = _rotation(x[0], curves[1].interpolate(clock.back(a.t))[0])
        clock, rotation, turn_sd = _settled(a.t, x, curves[1], clock, rotation, observed)
        y = _TriadSpline(b, "gyr").interpolate(clock.back(a.t))[0] @ rotation.T
        raw = a.usable("gyr")
        both = np.isfinite(raw + y).all(axis=1)
        band, _ = _spectra(raw[both], y[both], float(np.median(np.diff(a.t))))
        if band is None:
            break
        width = min(COARSE, HALF_POWER / band)
    if not observed:
        remarks.append(warning("compare.single_axis"))
        return clock, None
    return clock, Mounting(quat_from_dcm(rotation, tolerance=1e-3), turn_sd)


def _settled(
    t: Floats, x: tuple[Floats, Floats], curve: "_TriadSpline", clock: Clock, rotation: Floats, observed: bool
) -> tuple[Clock, Floats, Floats]:
    """Gauss-Newton steps until they vanish."""
    begin, turn_sd = clock.offset, np.full(3, np.nan)
    for _ in range(ROUNDS):
        at = clock.back(t)
        y, slope = (values @ rotation.T for values in curve.interpolate(at))
        both = _common(x[0] + x[1] + y + slope)
        mine, its = (x[0][both], x[1][both]), (y[both], slope[both])
        step, sd = _solve(mine, its, at[both] - clock.middle, observed)
        clock = replace(clock, offset=clock.offset + step[9], drift=clock.drift + step[10], offset_sd=sd[9],
                        drift_sd=sd[10])  # fmt: skip
        rotation, turn_sd = dcm_from_quat(quat_from_rotvec(step[:3])) @ rotation, sd[:3]
        if abs(clock.offset - begin) > FARTHEST:
            raise ClockError(
                f"the time offset does not settle near {begin:.3f} s, where the rates match best: the motion hardly "
                "changes, or is not the same. Record a motion with starts and stops."
            )
        if abs(step[9]) < 1e-9 and abs(step[10]) < 1e-12 and np.abs(step[:3]).max() < 1e-12:
            break
    return clock, rotation, turn_sd


def _solve(x: tuple[Floats, Floats], y: tuple[Floats, Floats], t: Floats, observed: bool) -> tuple[Floats, Floats]:
    """Step of θ (3), bias (3), scale (3), offset and drift such that y becomes x, and their standard deviations.

    Values and slopes of x are the instruments of those of y: noise of one is foreign to the other, while a slope's own
    noise would shorten each step, and leave a bias where values between two samples are smoother than those at them.
    """
    rows, instruments = _design(*y, t, observed), _design(*x, t, observed)
    right = (x[0] - y[0]).reshape(-1)
    size = np.sqrt(np.mean(rows * rows, axis=0))
    used = size > 1e-9 * max(float(size.max()), 1e-30)
    rows, instruments = rows[:, used] / size[used], instruments[:, used] / size[used]
    inverse = np.linalg.pinv(instruments.T @ rows, rcond=1e-12)
    solution = inverse @ (instruments.T @ right)
    misfit = right - rows @ solution
    cov = inverse @ (instruments.T @ instruments) @ inverse.T * _memory(misfit) * float(misfit @ misfit) / misfit.size
    step, sd = np.zeros(11), np.full(11, np.nan)
    step[used], sd[used] = solution / size[used], np.sqrt(np.maximum(np.diag(cov), 0.0)) / size[used]
    return step, sd


def _design(values: Floats, slopes: Floats, t: Floats, observed: bool) -> Floats:
    design = np.zeros((values.shape[0], 3, 11))
    design[:, :, :3] = -skew(values) if observed else 0.0  # θ × y
    design[:, :, 3:6] = np.eye(3)
    design[:, range(3), range(6, 9)] = values - values.mean(axis=0)
    design[:, :, 9] = -slopes  # a later stamp of b shows an earlier value
    design[:, :, 10] = -slopes * t[:, np.newaxis]
    return design.reshape(-1, 11)


def _memory(residuals: Floats) -> float:
    """Samples for one independent one, of residuals (3 N,) that were smoothed: from the correlation of neighbours."""
    axes = residuals.reshape(-1, 3)
    power = float(np.sum(axes * axes))
    r = float(np.sum(axes[1:] * axes[:-1])) / power if power > 0.0 else 0.0
    r = min(max(r, 0.0), 0.999)
    return (1.0 + r) / (1.0 - r)


def _common(values: Floats) -> NDArray[np.bool_]:
    """Rows that are known in both, which are not too few."""
    both = np.asarray(np.isfinite(values).all(axis=1))
    if both.sum() < FEWEST:
        raise ClockError("a and b have too few samples in common at the offset that was found.")
    return both


def _rotation(x: Floats, y: Floats) -> tuple[Floats, bool]:
    """Rotation that brings y (N, 3) to x in least squares, and whether both turn about more than one axis."""
    both = _common(x + y)
    x, y = x[both] - x[both].mean(axis=0), y[both] - y[both].mean(axis=0)
    u, s, vt = np.linalg.svd(x.T @ y)  # [Kabsch]: the orthogonal Procrustes problem
    rotation = u @ np.diag([1.0, 1.0, float(np.sign(np.linalg.det(u @ vt)))]) @ vt
    return rotation, bool(s[1] > PLANE**2 * s[0])


class _TriadSpline:
    """A triad between its samples: cubic, never across a gap nor beyond the ends."""

    def __init__(self, imu: ImuData, name: str, width: float = 0.0) -> None:
        from scipy.interpolate import CubicSpline
        from scipy.ndimage import gaussian_filter1d

        values = imu.usable(name)
        finite = np.isfinite(values).all(axis=1)
        self.t, self.spline = imu.t[finite], None
        if self.t.size >= 4:
            step = float(np.median(np.diff(self.t)))
            smoothed = gaussian_filter1d(values[finite], width / step, axis=0) if width > step else values[finite]
            self.spline = CubicSpline(self.t, smoothed)
            self.longest = GAP_FACTOR * step

    def interpolate(self, t: Floats) -> tuple[Floats, Floats]:
        """Values and slopes (N, 3) at times (N,), s; NaN where there are none."""
        nothing = np.full((t.size, 3), np.nan)
        if self.spline is None:
            return nothing, nothing
        right = np.clip(np.searchsorted(self.t, t), 1, self.t.size - 1)
        there = (t >= self.t[0]) & (t <= self.t[-1]) & (self.t[right] - self.t[right - 1] <= self.longest)
        mask = there[:, np.newaxis]
        return np.where(mask, self.spline(t), np.nan), np.where(mask, self.spline(t, 1), np.nan)


def _difference(
    a: ImuData, b: ImuData, name: str, clock: Clock, q_ab: Floats, remarks: list[Note]
) -> TriadDifference | None:
    x = a.usable(name)
    same = clock is SAME and np.array_equal(a.t, b.t)
    y = b.usable(name) if same else _TriadSpline(b, name).interpolate(clock.back(a.t))[0]
    y = y if q_ab is IDENTITY else y @ dcm_from_quat(q_ab).T
    both = np.isfinite(x + y).all(axis=1)
    if both.sum() < FEWEST:
        remarks.append(warning("compare.too_few", name=name, samples=int(both.sum())))
        return None
    x, y = x[both], y[both]
    off = y - x
    x0, y0 = x - x.mean(axis=0), y - y.mean(axis=0)
    power = np.mean(x0 * x0, axis=0)
    # a slope through noise alone says nothing of the scale
    alike = np.mean(x0 * y0, axis=0) / np.sqrt(np.maximum(power * np.mean(y0 * y0, axis=0), 1e-300))
    scale = np.where(alike > 0.9, np.mean(x0 * y0, axis=0) / np.maximum(power, 1e-300), np.nan)
    misfit = y0 - np.where(np.isfinite(scale), scale, 1.0) * x0
    rms, size = float(np.sqrt(np.mean(np.sum(off**2, axis=1)))), float(np.sqrt(np.mean(np.sum(x**2, axis=1))))
    band, ratio = _spectra(x0, y0, float(np.median(np.diff(a.t[both]))))
    residual = float(np.sqrt(np.mean(np.sum(misfit**2, axis=1))))
    relative = rms / size if size else np.inf
    return TriadDifference(int(both.sum()), off.mean(axis=0), scale, rms, relative, residual, band, ratio)


def _spectra(x: Floats, y: Floats, step: float) -> tuple[float | None, float | None]:
    """Frequency up to which the two are coherent, Hz, and the ratio of their spectra there, dB."""
    from scipy.signal import csd, welch

    size = min(1024, x.shape[0] // _SEGMENTS)
    if size < 16:
        return None, None
    how: dict[str, Any] = {"fs": 1.0 / step, "nperseg": size, "axis": 0}
    f, pxx = welch(x, **how)
    pyy, pxy = welch(y, **how)[1], csd(x, y, **how)[1]
    pxx, pyy = pxx.sum(axis=1), pyy.sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        coherence = np.abs(pxy.sum(axis=1)) ** 2 / (pxx * pyy)
    good = np.flatnonzero(~(coherence[1:] >= COHERENT))
    last = int(good[0]) if good.size else f.size - 1
    if last < 1:
        return None, None
    band = slice(1, 1 + last)
    return float(f[last]), float(10.0 * np.log10(np.sum(pyy[band]) / np.sum(pxx[band])))
