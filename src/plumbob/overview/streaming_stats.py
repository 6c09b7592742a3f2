"""What a page says of a recording, gathered from its samples and attitudes as they come: memory does not grow.

Statistics are those of bursts, and of all of them together; a burst is held until it is over. Values over time for a
plot are every sample of a short recording, smallest and largest values of a long one.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core import check, flags
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.errors import ShapeError
from plumbob.core.time import to_ns, usual_step
from plumbob.core.units import to_deg
from plumbob.data import AttitudeTrack, ImuData
from plumbob.data.cards.residuals import Half
from plumbob.filters.settling import error_sensitivity, residual_covariance
from plumbob.quality import quality
from plumbob.quality.spectra import Spectra, peak_period, segment_length, welch
from plumbob.quality.tilt import LIMIT, Headings, Inclination, TiltMotion, TiltStatistics
from plumbob.quality.waves import SeaState, WaveSettings, sea_state
from plumbob.rotations import North, dcm_from_quat, euler_zyx_from_quat, quat_rotate
from plumbob.rotations.frames import euler_sd, heading_of

WHOLE: Final = 400_000  # up to so many samples every one is kept: an hour at 100 Hz has 360 000
# Of a longer recording, about so many stretches are kept, each with its smallest and largest value.
BUCKETS: Final = 20_000
# At most so many breaks of the line are kept in a long recording; shorter ones are in the counts alone.
HOLES: Final = 4_000

Singles = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Traces:
    """Channels over time."""

    t: Floats  # (M,), times, s; in a long recording two for each stretch
    values: Singles  # (M, C), by channel, SI; a row of NaN where the line breaks
    each: int  # how many samples a pair of rows stands for; 1 where every row is a sample


NOTHING: Final = Traces(np.empty(0), np.empty((0, 0), dtype=np.float32), 1)  # of no samples


class Tracing:
    """Gathers traces of `total` samples as they come; up to `most`, every one is kept.

    Of `circular` channels, which are angles, smallest and largest value are meant about the first.
    """

    def __init__(
        self, names: tuple[str, ...], total: int, *, most: int = WHOLE, circular: tuple[str, ...] = ()
    ) -> None:
        self._names = names
        self._each = 1 if total <= most else -(-total // max(1, min(BUCKETS, most // 2)))
        self._circular = [names.index(name) for name in circular if name in names]
        self._t: list[Floats] = []
        self._values: list[Singles] = []
        self._holes = 0
        self._odd = False
        self._left_t, self._left = np.empty(0), np.empty((0, len(names)))

    def add(self, t: Floats, values: Floats, broken: NDArray[np.bool_]) -> None:
        """Take samples (n,) and (n, C); `broken` (n,) marks those before which the line breaks."""
        if self._each == 1:
            places = np.flatnonzero(broken)
            before = np.concatenate(([self._t[-1][-1] if self._t else t[0]], t[:-1]))
            self._t.append(np.insert(t, places, 0.5 * (before[places] + t[places])))
            self._values.append(np.insert(values, places, np.nan, axis=0).astype(np.float32))
            return
        begins = np.concatenate((np.zeros(self._left_t.size, dtype=bool), broken))
        t, values = np.concatenate((self._left_t, t)), np.concatenate((self._left, values))
        edges = [0, *np.flatnonzero(begins).tolist(), t.size]
        for start, stop in pairwise(edges):
            if start and stop > start:
                self._holes += 1
                if self._holes <= HOLES:
                    self._t.append(np.array([0.5 * (t[start - 1] + t[start])]))
                    self._values.append(np.full((1, len(self._names)), np.nan, dtype=np.float32))
            last = stop == t.size
            full = start + (stop - start) // self._each * self._each if last else stop
            if full > start:
                self._add_extremes(t[start:full], values[start:full])
            if last:
                self._left_t, self._left = t[full:].copy(), values[full:].copy()

    def done(self) -> Traces:
        """All of them."""
        if self._left_t.size:
            self._add_extremes(self._left_t, self._left)
            self._left_t, self._left = self._left_t[:0], self._left[:0]
        return Traces(np.concatenate(self._t), np.concatenate(self._values), self._each)

    def _add_extremes(self, t: Floats, values: Floats) -> None:
        starts = np.arange(0, t.size, self._each)
        sizes = np.diff(np.append(starts, t.size))
        zero = np.zeros((starts.size, len(self._names)))
        for c in self._circular:  # about the first one that is known
            column = values[:, c]
            zero[:, c] = np.nan_to_num(column[starts])
        off = values - np.repeat(zero, sizes, axis=0)
        for c in self._circular:
            off[:, c] = (off[:, c] + np.pi) % (2.0 * np.pi) - np.pi
        low = np.fmin.reduceat(off, starts, axis=0) + zero
        high = np.fmax.reduceat(off, starts, axis=0) + zero
        pairs = np.stack((low, high), axis=1)
        odd = (np.arange(starts.size) + self._odd) % 2 == 1
        pairs[odd] = pairs[odd, ::-1]  # so that a line goes up in one stretch and down in the next
        self._odd = bool((starts.size + self._odd) % 2)
        last = np.append(starts[1:], t.size) - 1
        self._t.append(np.stack((t[starts], 0.5 * (t[starts] + t[last])), axis=1).ravel())
        self._values.append(pairs.reshape(-1, len(self._names)).astype(np.float32))


BURST: Final = 1200.0  # length of a burst unless another is given, s: buoys report every 20 to 30 minutes

TRACED: Final = (  # channels over time; SI and rad
    "roll", "pitch", "heading", "tilt", "roll_sd", "pitch_sd", "heading_sd",
    "gyr_x", "gyr_y", "gyr_z", "acc_x", "acc_y", "acc_z", "mag_x", "mag_y", "mag_z", "temp",
    "bias_x", "bias_y", "bias_z",
)  # fmt: skip
# Channels whose spectra are taken: rad, rad, rad/s, m/s².
SPECTRAL: Final = ("roll", "pitch", "heading_rate", "vertical")
AXES: Final = {name: tuple(f"{name}_{axis}" for axis in "xyz") for name in ("gyr", "acc", "mag")}
UNITS: Final = {"gyr": "°/s", "acc": "m/s²", "mag": "µT", "temp": "°C"}  # in which traced channels are shown
# Of densities, by channel.
SPECTRAL_UNITS: Final = dict(zip(SPECTRAL, ("°²/Hz", "°²/Hz", "(°/s)²/Hz", "(m/s²)²/Hz"), strict=True))
MOTION_NAMES: Final = {name: name for name in ("mean", "std", "rms", "least", "greatest", "significant", "largest")} | {
    "std": "sd"
}
# Names of angles in tables and numbers, and the attributes that have them.
TILT_NAMES: Final = {name: MOTION_NAMES[name] for name in ("mean", "std", "rms", "greatest")}
# What turns traced and spectral channels from SI to what is shown: rad to degrees; 1 for all others.
SHOWN_SCALE: Final = {
    name: float(to_deg(1.0)) if name.partition("_")[0] in ("roll", "pitch", "heading", "tilt", "gyr", "bias") else 1.0
    for name in (*TRACED, *SPECTRAL)
}
_RUNS: Final = 4_000
_ROW: Final = np.dtype(  # rate: of the heading; enu: acceleration without gravity east, north and up; SI and rad
    [("t", float), ("traced", float, len(TRACED)), ("rate", float), ("enu", float, 3), ("words", np.uint32)],
    align=True,
)
Rows = NDArray[np.void]  # of `_ROW`

_zeros = partial(np.zeros, len(TRACED))


@dataclass(slots=True)
class Moments:
    """Count, mean, sum of squares about it, and extremes of each of the traced channels."""

    count: Floats = field(default_factory=_zeros)
    mean: Floats = field(default_factory=_zeros)
    square: Floats = field(default_factory=_zeros)
    least: Floats = field(default_factory=partial(np.full, len(TRACED), np.inf))
    greatest: Floats = field(default_factory=partial(np.full, len(TRACED), -np.inf))
    sd: Floats = field(default_factory=partial(np.full, len(TRACED), np.nan))  # NaN where there is nothing

    def add(self, values: Floats) -> None:
        """Take rows (n, C)."""
        finite = np.isfinite(values)
        count = finite.sum(axis=0).astype(np.float64)
        filled = np.where(finite, values, 0.0)
        mean = filled.sum(axis=0) / np.maximum(count, 1.0)
        square = np.where(finite, (values - mean) ** 2, 0.0).sum(axis=0)
        total = self.count + count
        off = mean - self.mean
        self.square += square + off**2 * self.count * count / np.maximum(total, 1.0)
        self.mean += off * count / np.maximum(total, 1.0)
        self.count = total
        self.least = np.fmin(self.least, np.where(finite, values, np.inf).min(axis=0))
        self.greatest = np.fmax(self.greatest, np.where(finite, values, -np.inf).max(axis=0))
        self.sd = np.where(total > 0, np.sqrt(self.square / np.maximum(total, 1.0)), np.nan)


@dataclass(slots=True)
class FlagRuns:
    """When a flag was up: stretches of time, and how many samples."""

    samples: int = 0
    stretches: list[tuple[float, float]] = field(default_factory=list)
    coarse: bool = False

    def thin(self, apart: float) -> None:
        """Join stretches that are nearer than this, s, where there are too many of them to be drawn."""
        if len(self.stretches) <= _RUNS:
            return
        self.coarse = True
        merged = self.stretches[:1]
        for begin, end in self.stretches[1:]:
            if begin - merged[-1][1] <= apart:
                merged[-1] = (merged[-1][0], end)
            else:
                merged.append((begin, end))
        self.stretches = merged


@dataclass(frozen=True, eq=False)
class Burst:
    """What one burst gave."""

    # begin, end: its time, s; the last one ends with the recording, and may be half as long or half as long again
    begin: float
    end: float
    samples: int  # samples in it
    tilt: TiltStatistics  # roll, pitch and inclination
    headings: Headings
    verdicts: Mapping[str, quality.BurstVerdict]  # quality of each channel
    waves: SeaState | None = None  # None where nobody asked


@dataclass(eq=False)
class Gathered:
    """All that was gathered of a recording."""

    # begin, end: times of the first and the last sample, s
    begin: float
    end: float
    duration: float  # from the one to the other, s
    step: float  # usual time between samples, s
    triads: tuple[str, ...]  # sensors
    burst: float  # length of a burst, s
    samples: int = 0  # how many
    gaps: list[tuple[float, float]] = field(default_factory=list)  # times of the samples before and behind each gap, s
    missing: int = 0  # samples that gaps lack, by the usual step
    lost: float = 0  # time that gaps lack, s
    bursts: list[Burst] = field(default_factory=list)  # in order
    tilt: TiltStatistics | None = None  # of the whole; None without an attitude
    headings: Headings | None = None  # of the whole
    spectra: Spectra | None = None  # of `SPECTRAL`
    traces: Traces = NOTHING  # values over time
    moments: Moments = field(default_factory=Moments)  # of the traced channels
    flags: dict[str, FlagRuns] = field(default_factory=dict)  # those that occur

    def has(self, name: str) -> bool:
        """Whether a channel has a value."""
        return bool(self.moments.count[TRACED.index(name)])


@dataclass(kw_only=True, eq=False)
class Gatherer:
    """Gathers, as `plumbob.estimate` follows a recording: `begin` once, `take` with each part."""

    burst: float = BURST  # length of a burst, s
    limit: float = LIMIT  # an inclination above it counts as large, rad
    most: int = WHOLE  # up to so many samples every one is kept
    window: tuple[float, float] = (-math.inf, math.inf)  # samples in it count, s
    waves: WaveSettings | None = None  # how waves are computed, where the body floats
    _held: list[Rows] = field(default_factory=list, init=False)  # rows of the burst that is not over
    _spectra: list[Spectra] = field(default_factory=list, init=False)
    _attitude: bool = field(default=False, init=False)
    _scale_sd: float | None = field(default=None, init=False)  # of the vertical acceleration, by the calibration
    _is_north: bool = field(default=False, init=False)  # whether headings count from North
    _number: int = field(default=0, init=False)
    _last: tuple[float, float] | None = field(default=None, init=False)  # time and heading of the last sample

    def begin(self, samples: ImuData | AttitudeTrack) -> None:
        """Be ready for this recording: its times are looked at."""
        t, (begin, end) = samples.t, self.window
        low, high = np.searchsorted(t, begin), np.searchsorted(t, end, side="right")
        if high <= low:
            raise ShapeError(
                f"no sample lies between {begin:g} and {end:g} s; the recording has {t[0]:g} to {t[-1]:g} s."
            )
        triads = samples.triads if isinstance(samples, ImuData) else ()
        inside, starts, size = t[low:high], [0], int(high - low)
        if size > 64 * 4096:  # the usual step is that of places all over a long recording
            size, starts = 4096, np.linspace(0, size - 4096, 64).astype(np.int64).tolist()
        steps = np.concatenate([np.diff(to_ns(inside[start : start + size])) for start in starts])
        step = usual_step(steps) / 1e9 if steps.size else 1.0
        begin, end = float(inside[0]), float(inside[-1])
        self._gathered = Gathered(begin, end, end - begin, step, triads, self.burst)
        length = end - begin + step
        self._count = max(1, round(length / self.burst))  # a rest of less than half a burst is the last one's
        self._segment = segment_length(min(self.burst, length))
        self._tracing = Tracing(TRACED, int(high - low), most=self.most, circular=("roll", "heading"))

    def take(self, imu: ImuData | None, track: AttitudeTrack | None) -> None:
        """Take samples and their attitudes, of the same times where there are both."""
        part, g = channel_rows(imu, track), self._gathered
        part = part[(part["t"] >= self.window[0]) & (part["t"] <= self.window[1])]
        if not part.size:
            return
        self._attitude |= track is not None
        if self.waves is not None and self._scale_sd is None and imu is not None and track is not None:
            self._scale_sd, self._is_north = vertical_scale_sd(track, imu.meta.left[0]), track.north is not North.FREE
        t, traced, words = part["t"], part["traced"], part["words"]
        heading = traced[:, TRACED.index("heading")]
        since, before = (t[0] - g.step, heading[0]) if self._last is None else self._last
        turn = (np.diff(heading, prepend=before) + np.pi) % (2.0 * np.pi) - np.pi
        part["rate"] = turn / np.diff(t, prepend=since)
        if self._last is None:
            part["rate"][0] = np.nan  # the first sample has none before it
        self._events(t, words)
        self._last = (float(t[-1]), float(heading[-1]))
        self._tracing.add(t, traced, (words & np.uint32(flags.GAP)) != 0)
        g.moments.add(traced)
        g.samples += t.size
        place = np.minimum(np.floor((t - g.begin) / self.burst).astype(np.int64), self._count - 1)
        for number in np.unique(place).tolist():
            if self._held and number != self._number:
                self._close()
            self._number = number
            self._held.append(part[place == number])

    def done(self) -> Gathered:
        """What was gathered."""
        self._close()
        g = self._gathered
        for runs in g.flags.values():
            runs.thin(g.duration / (_RUNS / 2))
        g.flags = {name: g.flags[name] for name, _ in flags.MEANING.values() if name in g.flags}
        g.traces = self._tracing.done()
        if self._attitude:
            g.spectra = spectra = Spectra.joined(self._spectra)
            tilts = [burst.tilt for burst in g.bursts]
            g.tilt = TiltStatistics(
                TiltMotion.joined([tilt.roll for tilt in tilts], peak_period(spectra, 0)),
                TiltMotion.joined([tilt.pitch for tilt in tilts], peak_period(spectra, 1)),
                Inclination.joined([tilt.inclination for tilt in tilts]),
            )
            headings = [burst.headings for burst in g.bursts]
            counts = np.sum([part.counts for part in headings], axis=0)
            g.headings = Headings(counts, sum(part.cosine for part in headings), sum(part.sine for part in headings))
        return g

    def _events(self, t: Floats, words: NDArray[np.uint32]) -> None:
        """Flags over time, and gaps."""
        g = self._gathered
        for row in np.flatnonzero(words & np.uint32(flags.GAP)).tolist():
            before = float(t[row - 1]) if row else None if self._last is None else self._last[0]
            if before is not None:
                end = float(t[row])
                g.gaps.append((before, end))
                g.missing += max(0, round((end - before) / g.step) - 1)
                g.lost += end - before - g.step
        raised = int(np.bitwise_or.reduce(words))
        for bit, (name, _) in flags.MEANING.items():
            if not raised & bit:
                continue
            runs = g.flags.setdefault(name, FlagRuns())
            for start, stop in check.runs((words & np.uint32(bit)) != 0):
                begin, end = float(t[start]), float(t[stop]) if stop < t.size else float(t[-1]) + g.step
                runs.samples += stop - start
                if runs.stretches and begin <= runs.stretches[-1][1] + 0.5 * g.step:  # it goes on from the part before
                    begin, _ = runs.stretches.pop()
                runs.stretches.append((begin, end))
            if len(runs.stretches) > 4 * _RUNS:
                runs.thin(g.duration / (_RUNS / 2))

    def _close(self) -> None:
        """Judge the burst that is over."""
        part, self._held, g = np.concatenate(self._held), [], self._gathered
        begin = g.begin + self._number * self.burst
        end = g.end + g.step if self._number == self._count - 1 else begin + self.burst
        t, traced, enu = part["t"], part["traced"], part["enu"]
        vertical = enu[:, 2]
        roll, pitch, heading, tilt = traced[:, : TRACED.index("tilt") + 1].T
        spectral = np.stack((roll, pitch, part["rate"], vertical), axis=1)
        spectra = welch(t, spectral, step=g.step, segment=self._segment, turns=(0, 1))
        self._spectra.append(spectra)
        motions = [TiltMotion.of(t, angle, peak_period(spectra, i)) for i, angle in enumerate((roll, pitch))]
        stats = TiltStatistics(motions[0], motions[1], Inclination.of(t, tilt, self.limit))
        columns = {name: AXES[name] for name in g.triads}
        columns |= {"temp": ("temp",)} if g.has("temp") else {}
        columns |= {"attitude": ("roll", "pitch")} if self._attitude else {}
        verdicts = {
            name: quality.verdict(
                name, t, traced[:, [TRACED.index(channel) for channel in names]], part["words"], (begin, end),
                vertical if name == "acc" else None,
            )
            for name, names in columns.items()
        }  # fmt: skip
        waves = None
        if self.waves is not None and self._attitude:
            claimed = traced[:, TRACED.index("heading_sd")]
            heading_sd = float(np.nanmean(claimed)) if np.isfinite(claimed).any() else 0.0
            waves = sea_state(
                t, enu, step=g.step, segment=self._segment, settings=self.waves, scale_sd=self._scale_sd or 0.0,
                heading_sd=heading_sd if self._is_north else math.nan,
            )  # fmt: skip
        g.bursts.append(Burst(begin, end, part.size, stats, Headings.of(heading), verdicts, waves))


def channel_rows(imu: ImuData | None, track: AttitudeTrack | None) -> Rows:
    """All channels of samples and attitudes (N,); NaN where there is none, and for the rate of the heading."""
    source: Any = track if imu is None else imu
    rows = np.zeros(len(source), _ROW)
    rows["t"], traced, words = source.t, rows["traced"], rows["words"]
    traced[:] = rows["rate"][:] = np.nan
    rows["enu"][:] = np.nan
    if imu is not None:
        words |= imu.flags
        for name in imu.triads:
            start = TRACED.index(AXES[name][0])
            traced[:, start : start + 3] = imu.usable(name)
        if imu.temp_c is not None:
            traced[:, TRACED.index("temp")] = imu.temp_c
    if track is not None:
        words |= 0 if track.flags is None else track.flags
        _, pitch, roll = euler_zyx_from_quat(track.q_nb).T
        tilt = np.arccos(np.clip(np.cos(roll) * np.cos(pitch), -1.0, 1.0))
        channels = {"roll": roll, "pitch": pitch, "heading": heading_of(track.q_nb, track.frame), "tilt": tilt}
        if track.cov_b is not None:
            sd = euler_sd(track.q_nb, track.cov_b).T
            channels |= dict(zip(("heading_sd", "pitch_sd", "roll_sd"), sd, strict=True))
        if track.bias_b is not None:
            channels |= {f"bias_{axis}": track.bias_b[:, i] for i, axis in enumerate("xyz")}
        for name, values in channels.items():
            traced[:, TRACED.index(name)] = values
        if imu is not None and "acc" in imu.triads:
            east, north, up = track.frame.east, track.frame.north, track.frame.up
            rows["enu"] = quat_rotate(track.q_nb, imu.usable("acc")) @ np.stack((east, north, up), axis=1)
            rows["enu"][:, 2] -= G0
    return rows


def vertical_scale_sd(track: AttitudeTrack, half: Half) -> float:
    """Standard deviation of the vertical acceleration's scale, as the body first stood.

    `half` is the upper half of the covariance of what the calibration leaves of the accelerometer.
    """
    up = np.asarray(track.frame.up)
    sensitivity = error_sensitivity(dcm_from_quat(track.q_nb[:1]), up[np.newaxis])
    sensitivity[:, :, :3] = 0.0  # an offset is none of the waves'
    return math.sqrt(float(up @ residual_covariance(sensitivity, half)[0] @ up))
