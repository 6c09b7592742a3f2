"""Is this a static record that a noise analysis can be made of? Findings in words, and the longest still stretch.

Samples come in blocks, so that a record need not fit in memory; a check keeps a few numbers for each second.

Disturbed seconds of a long record are skipped: a step that somebody takes, or a door, spoils a second of hours, and
what is left is as good as before. But an Allan deviation and a spectrum need even samples, so each gap is filled with
its neighbours: those before it, mirrored, for its first half, and those after it for its second, on a straight line
between the two levels. So it has the noise of its surroundings at all but the longest times, and shows nothing of its
own.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.findings import Finding, warning
from plumbob.core.units import Quantity, deg, dps
from plumbob.data.plausibility import clipped
from plumbob.noise import artefacts

# Averages over 1 to 100 of them, two decades of time, are known to 20 %; through a shorter curve any line can be laid.
# [Riley2008]: 13 degrees of freedom of white noise
FEWEST_SAMPLES: Final = 1000

FEWEST_LEVELS: Final = 5
TURNING: Final = dps(10.0)  # departure of an average over 1 s from the median, rad/s; no warm-up drifts as much
TILTING: Final = deg(3.0)  # the same of the specific force's direction, rad: 50 mg of drift
LENGTHENING: Final = 0.05  # the same for the length of the specific force, as a part of it
ABOUT_G: Final = (0.8, 1.2)  # specific force of an uncalibrated accelerometer at rest, in g
# Noise on two neighbouring levels has a standard deviation of half their step at most; more must change.
TWO_LEVELS: Final = 0.6

_EXCERPT: Final = 1 << 16
_STRICT: Final = 0.7
_INERTIAL: Final = (Quantity.RATE, Quantity.ACCELERATION)  # of sensors whose motion is the unit's
_WITHOUT_MOTION: Final = ("not_finite", "constant", "one_way", "interleaved", "held", "coarse", "not_at_rest")
MARGIN: Final = 1.0  # what is skipped before and after a disturbance too, s
MOST: Final = 0.05  # share that may be skipped because it was found; more is no static record
MOST_ASKED: Final = 0.2  # share that may be skipped because it was asked for
LONGEST: Final = 60.0  # longest part that may be skipped because it was found, s: somebody at work, not a step
_LEVEL: Final = 10  # seconds whose mean is a level
_JUMP: Final = 6.0  # standard deviations of what the record does by itself in the same time
_FEWEST: Final = 20  # of such changes that are known


@dataclass(frozen=True, slots=True)
class Remark:
    """One thing to know about a record: its channel, or the names of those that it concerns, and the finding."""

    channel: str
    finding: Finding

    @property
    def kind(self) -> str:
        """What it is: the code without its family, as ``"one_way"``."""
        return self.finding.code.partition(".")[2]

    @property
    def refuses(self) -> bool:
        """Whether an analysis of the channel would mislead."""
        return self.finding.severity == "error"

    def concerns(self, channel: str) -> bool:
        """Whether it is about a channel, alone or with others; a name may hold a comma."""
        return channel == self.channel or channel in self.channel.split(", ")

    def __str__(self) -> str:
        """Sentence with the channel."""
        return f"{self.channel}: {self.finding}"


@dataclass(frozen=True)
class StaticReport:
    """What was found in a record."""

    findings: tuple[Remark, ...]  # errors and warnings
    steps: Mapping[str, float]  # step of the values of each channel, in their unit; 0 where none was found
    moving: tuple[tuple[float, float], ...]  # when something moved or was stuck, s, in order
    still: tuple[float, float] | None  # longest stretch without, s, if it has enough samples
    # times, s, that an analysis of a channel leaves out, with their margins
    skipped: Mapping[str, tuple[tuple[float, float], ...]] = field(default_factory=dict)

    @property
    def errors(self) -> tuple[Remark, ...]:
        """Findings for which an analysis would mislead."""
        return tuple(finding for finding in self.findings if finding.refuses)

    @property
    def warnings(self) -> tuple[Remark, ...]:
        """Findings that a reader must know."""
        return tuple(finding for finding in self.findings if not finding.refuses)

    def refused(self, *channels: str) -> bool:
        """Whether an analysis of any of the channels would mislead."""
        return any(finding.concerns(channel) for finding in self.errors for channel in channels)


class StaticCheck:
    """Looks at channels of one rate, block by block; `triad` says whether they are x, y and z of one sensor."""

    def __init__(
        self,
        names: Sequence[str],
        dt: float,
        *,
        quantity: Quantity = Quantity.RATIO,
        triad: bool = False,
        start: float = 0.0,
    ) -> None:
        if not 0.0 < dt < math.inf:
            raise ParameterError(f"dt must be a positive time in s, but it is {dt}.")
        self.names, self.dt, self.start = tuple(names), dt, start
        self.quantity, self.triad = quantity, triad
        self.count = 0
        columns = len(self.names)
        self._bad = [(-1, 0)] * columns
        self._numbers, self._since = (0, 0), 0
        self._low, self._high = np.full(columns, np.inf), np.full(columns, -np.inf)
        self._still = [artefacts.Stillness(dt) for _ in self.names]
        self._spikes = [artefacts.Spikes() for _ in self.names]
        self._runs = [artefacts.ChannelWatch() for _ in self.names]
        self._excerpt: list[Floats] = []
        self._grain: list[tuple[float, float]] | None = None
        self._second = max(1, round(1.0 / dt))
        self._rest = np.empty((0, columns))
        self._means: list[Floats] = []

    @property
    def stop(self) -> float:
        """Time after the last sample, s."""
        return self.start + self.count * self.dt

    def add(self, block: ArrayLike) -> None:
        """Take the next samples (n, k); or (n,) of a single channel."""
        samples = check.floats("block", block)
        samples = samples[:, np.newaxis] if samples.ndim == 1 else samples
        if samples.ndim != 2 or samples.shape[1] != len(self.names):
            raise ShapeError(f"block must have shape (n, {len(self.names)}), but its shape is {samples.shape}.")
        for column, values in enumerate(np.ascontiguousarray(samples.T)):
            finite = np.isfinite(values)
            if not finite.all():  # the channel is refused for it, whatever else it holds
                first, count = self._bad[column]
                here = self.count + int(np.argmin(finite))
                self._bad[column] = (here if first < 0 else first, count + int(np.count_nonzero(~finite)))
            elif values.size:
                self._low[column] = min(self._low[column], values.min())
                self._high[column] = max(self._high[column], values.max())
                for watch in (self._spikes[column], self._runs[column], self._still[column]):
                    watch.add(values)
        for place in np.flatnonzero(~np.isfinite(samples).all(axis=1)).tolist():
            self._numbers = max(self._numbers, (self._since, self.count + place), key=np.ptp)
            self._since = self.count + place + 1
        if self.count < _EXCERPT:
            self._excerpt.append(samples[: _EXCERPT - self.count])
            self._grain = None
        self.count += len(samples)
        seconds = np.concatenate((self._rest, samples))
        stop = len(seconds) // self._second * self._second
        self._means.append(seconds[:stop].reshape(-1, self._second, len(self.names)).mean(axis=1))
        self._rest = seconds[stop:]

    @property
    def _sound(self) -> list[int]:
        """Columns of numbers that change up and down."""
        changing = [c for c, (_, bad) in enumerate(self._bad) if not bad and self._high[c] > self._low[c]]
        return [c for c in changing if self._runs[c].one_way is None]

    def moving(self, start: float, stop: float, *, limit: float = 1.0) -> artefacts.Parts:
        """When something moved between two times, s, by what is quiet between them; a `limit` below 1 is stricter."""
        first, end = round((start - self.start) / self.dt), round((stop - self.start) / self.dt)
        parts = artefacts.Parts()
        for column in self._sound:
            step, sd = self.grains()[column]
            parts += self._still[column].moving(first, end, step if sd < step else 0.0, limit=limit)
        begin, size = -(-first // self._second), self._second
        means = np.concatenate(self._means)[begin : end // size]
        # where parts are known the rest is judged again: an average of a motion is not a measure of rest
        if parts or not len(means) or len(self._sound) < len(self.names):
            return self._times(parts)
        middle, off = np.median(means, axis=0), np.zeros(len(means), dtype=np.bool_)  # no averages of a sensor at rest
        usual = float(np.linalg.norm(middle))
        if self.quantity is Quantity.RATE:
            off |= (np.abs(means - middle) > TURNING).any(axis=1)
        elif self.quantity is Quantity.ACCELERATION and self.triad and ABOUT_G[0] * G0 <= usual <= ABOUT_G[1] * G0:
            angle = np.arctan2(np.linalg.norm(np.cross(means, middle), axis=1), means @ middle)
            off |= (angle > TILTING) | (np.abs(np.linalg.norm(means, axis=1) / usual - 1.0) > LENGTHENING)
        return self._times([(i * size, (i + 1) * size) for i in (begin + np.flatnonzero(off)).tolist()])

    def moves(self, known: artefacts.Parts) -> artefacts.Parts:
        """When something moved outside of the known parts, s; with margins, if it is short enough to be skipped."""
        gaps = artefacts.between(known, self.start, self.stop)
        parts = [part for gap in gaps for part in self.moving(*gap)]
        wide = widened(parts, self.start, self.stop)
        if not parts or self.too_much(wide):
            return artefacts.joined(parts)
        while not self.too_much(wide):
            gaps = artefacts.between(known + wide, self.start, self.stop)  # of too few samples, nothing is reported
            judged = [gap for gap in gaps if (gap[1] - gap[0]) / self.dt >= FEWEST_SAMPLES]
            more = [part for gap in judged for part in self.moving(*gap, limit=_STRICT)]
            if not more:
                break
            wide = widened(wide + more, self.start, self.stop)
        return wide

    def skip_parts(self, skip: Sequence[tuple[float, float]]) -> artefacts.Parts:
        """Times to skip, s, as far as the record has them."""
        for a, b in skip:
            if not a < b:
                raise ParameterError(f"a time to skip must end after it begins, but it is {a:g} s to {b:g} s.")
        parts = artefacts.joined(
            [(max(a, self.start), min(b, self.stop)) for a, b in skip if a < self.stop and b > self.start]
        )
        total = sum(b - a for a, b in parts)
        if total > MOST_ASKED * (self.stop - self.start):
            raise ParameterError(
                f"{total:.4g} s of {self.stop - self.start:.4g} s would be skipped, but at most "
                f"{100 * MOST_ASKED:g} % can be. Choose one stretch with --from and --to instead."
            )
        return parts

    @property
    def means(self) -> Floats:
        """Average of each second of the channels of numbers that change up and down."""
        return np.concatenate(self._means)[:, self._sound]

    def too_much(self, parts: artefacts.Parts) -> bool:
        """Whether parts that were found, s, are too long to be skipped."""
        lengths = [b - a for a, b in parts]
        return max(lengths, default=0.0) > LONGEST or sum(lengths) > MOST * (self.stop - self.start)

    def stuck(self) -> artefacts.Parts:
        """When a channel repeated one value for longer than its noise can, s."""
        parts = artefacts.Parts()
        for column in self._sound:
            scatter = _local_sds(self.excerpt()[:, column])
            lively = scatter[scatter > 0.0]
            if not (
                lively.size and np.median(lively) < TWO_LEVELS * self.grains()[column][0]
            ):  # its noise rests by itself
                parts += self._runs[column].stuck()
        return self._times(parts)

    def _times(self, parts: artefacts.Parts) -> artefacts.Parts:
        return artefacts.joined([(float(self.start + a * self.dt), float(self.start + b * self.dt)) for a, b in parts])

    def excerpt(self) -> Floats:
        """First samples of the record (n, k)."""
        return np.concatenate(self._excerpt) if self._excerpt else np.empty((0, len(self.names)))

    def grains(self) -> list[tuple[float, float]]:
        """Step and short-term scatter of each channel, within short windows, which drift does not reach."""
        if self._grain is None:
            columns = np.ascontiguousarray(self.excerpt().T)
            sound = self._sound
            self._grain = [
                (artefacts.find_step(c), float(np.median(_local_sds(c)))) if i in sound else (0.0, 0.0)
                for i, c in enumerate(columns)
            ]
        return self._grain

    def findings(self) -> list[Remark]:
        """Everything but motion."""
        if self.count < FEWEST_SAMPLES:
            return [_remark("rest.short", ", ".join(self.names), count=self.count, least=FEWEST_SAMPLES)]
        findings = [finding for column, name in enumerate(self.names) for finding in self._of_channel(column, name)]
        if self.triad and self.quantity is Quantity.ACCELERATION and len(self._sound) == len(self.names):
            means = np.concatenate(self._means)
            usual = float(np.linalg.norm(np.median(means, axis=0))) if len(means) else G0
            if not ABOUT_G[0] * G0 <= usual <= ABOUT_G[1] * G0:
                findings.append(_remark("rest.not_at_rest", ", ".join(self.names), size=usual / G0))
        return findings

    def _text(self, value: float, digits: int = 3) -> str:
        """Value with its unit."""
        unit = "" if self.quantity is Quantity.RATIO else f" {self.quantity}"
        return f"{value:.{digits}g}{unit}"

    def _of_channel(self, column: int, name: str) -> list[Remark]:
        first, bad = self._bad[column]
        if bad:
            (part,) = self._times([max(self._numbers, (self._since, self.count), key=np.ptp)])
            first_tenth, last_tenth = _tenths(part)
            enough = (last_tenth - first_tenth) / self.dt >= FEWEST_SAMPLES - 0.5
            stretch, none = (_options(part), None) if enough else (None, True)
            return [
                _remark("rest.not_finite", name, first=first, bad=bad, count=self.count, stretch=stretch, none=none)
            ]
        if not self._high[column] > self._low[column]:
            return [_remark("rest.constant", name, count=self.count, value=self._text(self._low[column], 9))]
        if (way := self._runs[column].one_way) is not None:
            return [_remark("rest.one_way", name, **{way: True})]
        values = self.excerpt()[:, column]
        if (times := artefacts.interleaved(values)) > 1:
            return [_remark("rest.interleaved", name, times=times)]
        return [*self._artefacts(column, name, values)]

    def _artefacts(self, column: int, name: str, values: Floats) -> Iterator[Remark]:
        """What the first samples of a channel that changes show of a converter, of its range, of spikes and shaking."""
        if (times := artefacts.hold_length(values)) > 1:
            yield _remark("rest.held", name, times=times, rate=1.0 / (self.dt * times))
        step, sd = self.grains()[column]
        levels = np.unique(values).size
        if step > 0.0 and (levels < FEWEST_LEVELS or sd < 0.5 * step):
            scatter = self._text(sd)
            yield _remark("rest.coarse", name, refuses=False, levels=levels, step=self._text(step, 6), scatter=scatter)
        if piles := [] if sd < step else clipped({"": values}).get(""):
            (times, value), *other = [(pile.size, self._text(pile.value, 6)) for pile in piles]
            more = dict(zip(("other_times", "other"), *other, strict=True)) if other else {}
            yield _remark("rest.clipped", name, times=times, value=value, count=values.size, **more)
        if places := self._spikes[column].places(3.0 * step):
            first, others = tuple(places[:5]), len(places) > 5 or None
            yield _remark("rest.spikes", name, refuses=False, count=len(places), places=first, more=others)
        wave = artefacts.shaking(values, self.dt)
        if wave is not None and wave.amplitude >= step:  # less is as the stairs of a quantised ramp
            rule = np.arange(values.size)
            power = float(np.var(values - np.polyval(np.polyfit(rule, values, 1), rule)))
            most = wave.amplitude**2 / 2.0 > 0.5 * power
            shape = {"most" if most else "hump": True, "frequency": wave.frequency}
            yield _remark("rest.periodic", name, refuses=most, amplitude=self._text(wave.amplitude), **shape)


def judge(*checks: StaticCheck, skip: Sequence[tuple[float, float]] = ()) -> StaticReport:
    """Report on all sensors of one unit, each by itself, but a unit that moved has moved all of them.

    Short disturbances of a long record are skipped and reported, and what lies in `skip`, s; what moved for longer, or
    left the sensor at another level, refuses it. The still stretch passes by its own measure, and a stricter one:
    beside a rough motion a gentle one seems quiet, so what is left is judged again until nothing is found in it.
    """
    findings = {sensor: sensor.findings() for sensor in checks}
    steps = {name: step for s in checks for name, (step, _) in zip(s.names, s.grains(), strict=True)}
    enough = [sensor for sensor in checks if sensor.count >= FEWEST_SAMPLES]
    requested = {sensor: sensor.skip_parts(skip) for sensor in enough}
    stuck = {sensor: sensor.stuck() for sensor in enough}  # beside which noise would seem a motion
    moving = {sensor: parts or sensor.moves(requested[sensor]) for sensor, parts in stuck.items()}
    together = artefacts.joined([part for parts in moving.values() for part in parts])
    skipped: dict[str, tuple[tuple[float, float], ...]] = {}
    for sensor, parts in moving.items():
        excluded = artefacts.joined(parts + requested[sensor])
        lasts = bool(parts) and (bool(stuck[sensor]) or sensor.too_much(parts))
        level = None
        if parts and not lasts:  # when a part ends, s, after which the level may be another
            inner = [(a, b) for a, b in parts if a > sensor.start and b < sensor.stop]
            level = jumped(sensor.means, inner, sensor.start)
        refused = lasts or level is not None
        if parts:  # of which everything else is a consequence
            kind = "rest.stuck" if stuck[sensor] else "rest.moving"
            finding = _disturbed(sensor, parts, kind, level) if refused else _left_out(sensor, excluded)
            others = [f for f in findings[sensor] if f.kind in _WITHOUT_MOTION and (f.refuses or not stuck[sensor])]
            findings[sensor] = [*others, finding]
        elif excluded:
            findings[sensor].append(_left_out(sensor, excluded))
        if excluded and not refused:
            skipped |= dict.fromkeys(sensor.names, tuple(excluded))
    still = _longest_still(enough, together) if enough else None
    mover = next((s for s in enough if s.quantity in _INERTIAL and any(f.kind == "moving" for f in findings[s])), None)
    for sensor in checks:
        if mover is not None and sensor is not mover and not any(f.refuses for f in findings[sensor]):
            about = _disturbed(mover, moving[mover], "rest.moving", None).finding
            unit = replace(about, values={**about.values, "unit": True})
            findings[sensor].append(Remark(", ".join(sensor.names), unit))
    return StaticReport(tuple(f for group in findings.values() for f in group), steps, tuple(together), still, skipped)


def _left_out(sensor: StaticCheck, parts: artefacts.Parts) -> Remark:
    """Finding that lists what is skipped."""
    listed = tuple(f"{a:.6g} to {b:.6g} s" for a, b in parts[:5])
    share = 100.0 * (1.0 - sum(b - a for a, b in parts) / (sensor.stop - sensor.start))
    values: dict[str, Any] = {"parts": listed, "more": len(parts) > 5 or None, "count": len(parts), "share": share}
    return _remark("rest.disturbed", ", ".join(sensor.names), refuses=False, **values)


def _longest_still(checks: Sequence[StaticCheck], motions: artefacts.Parts) -> tuple[float, float] | None:
    """Longest stretch outside the known motions, a second away from any, in which nothing else moved."""
    span = max(float(sensor.start) for sensor in checks), min(float(sensor.stop) for sensor in checks)
    while True:
        stretch = max(
            artefacts.between([(a - MARGIN, b + MARGIN) for a, b in motions], *span), key=np.ptp, default=(span[0],) * 2
        )
        if any((stretch[1] - stretch[0]) / sensor.dt < FEWEST_SAMPLES - 0.5 for sensor in checks):
            return None
        more = [part for sensor in checks for part in sensor.moving(*stretch, limit=_STRICT)] if motions else []
        if not more:
            return stretch
        motions = motions + more


def _disturbed(sensor: StaticCheck, parts: artefacts.Parts, kind: str, level: float | None) -> Remark:
    still = _longest_still([sensor], parts)
    begin, end = parts[0]
    values: dict[str, Any] = {"begin": begin, "end": end, "more": len(parts) - 1 or None, "level": level}
    values |= {"none": True} if still is None else {"still": _options(still)}
    return _remark(kind, ", ".join(sensor.names), **values)


def _remark(kind: str, channel: str, *, refuses: bool = True, **values: Any) -> Remark:
    finding = warning(kind, **{name: value for name, value in values.items() if value is not None})
    return Remark(channel, replace(finding, severity="error") if refuses else finding)


def _options(part: tuple[float, float]) -> str:
    """Part of the time as options that choose it."""
    start, stop = _tenths(part)
    return f"--from {start:.12g}s --to {stop:.12g}s"


def _tenths(part: tuple[float, float]) -> tuple[float, float]:
    """Tenths of a second inside which a part lies."""
    return math.ceil(10.0 * part[0] - 1e-6) / 10.0, math.floor(10.0 * part[1] + 1e-6) / 10.0


def _local_sds(values: Floats, size: int = 64) -> Floats:
    stop = values.size // size * size
    return values[:stop].reshape(-1, size).std(axis=1) if stop else np.array([values.std()])


def widened(parts: artefacts.Parts, start: float, stop: float) -> artefacts.Parts:
    """Parts with their margins, s, inside of a record from `start` to `stop`; those that then meet are one."""
    return artefacts.joined([(max(start, a - MARGIN), min(stop, b + MARGIN)) for a, b in parts])


def jumped(means: Floats, parts: artefacts.Parts, start: float) -> float | None:
    """When, s, a part ends after which the level is another; None where the record drifts as much by itself.

    By the average of each second of the record, (n, k), and the parts that are skipped, s.
    """
    seconds = [(math.floor(a - start), math.ceil(b - start)) for a, b in parts]
    disturbed = np.zeros((len(means), 1))
    for first, end in seconds:
        disturbed[first:end] = 1.0
    levels = artefacts.window_sums(means, _LEVEL) / _LEVEL
    for begin, late in artefacts.joined(
        [(a, b + _LEVEL) for a, b in seconds]
    ):  # those that share a level are judged together
        before, end = int(begin) - _LEVEL, int(late) - _LEVEL
        if before < 0 or end >= len(levels):
            continue
        apart = end - before
        quiet = artefacts.window_sums(disturbed, apart + _LEVEL)[:, 0] == 0.0
        changes = (levels[apart:] - levels[:-apart])[quiet]
        if len(changes) < _FEWEST:
            return start + end
        usual = np.median(changes, axis=0)
        sd = 1.4826 * np.median(np.abs(changes - usual), axis=0)  # of a normal distribution
        if (np.abs(levels[end] - levels[before] - usual) > _JUMP * sd).any():
            return start + end
    return None


def bridged(samples: Floats, dt: float, start: float, parts: artefacts.Parts) -> Floats:
    """Samples (N, k), every `dt` s from `start` on, with their neighbours in place of the parts.

    A part at an end of the record is cut off.
    """
    filled = samples.copy()
    begin, stop = 0, len(filled)
    for a, b in parts:
        first, end = max(0, round((a - start) / dt)), min(len(filled), round((b - start) / dt))
        if first <= begin:
            begin = end
        elif end >= len(filled):
            stop = first
        else:
            filled[first:end] = _filling(filled[begin:first], filled[end:], end - first)
    return filled[begin:stop]


def _filling(before: Floats, after: Floats, count: int) -> Floats:
    """Rows (count, k) between two stretches: each mirrored for its half, on a line between their levels."""
    reach = max(1, min(count, len(before), len(after)))
    tail, head = before[-reach:], after[:reach]
    low, high = tail.mean(axis=0), head.mean(axis=0)
    place = (np.arange(count) + 0.5) / count
    half = count // 2
    noise = np.empty((count, before.shape[1]))
    noise[:half] = (tail - low)[::-1][np.arange(half) % reach]
    noise[half:] = (head - high)[np.arange(count - half)[::-1] % reach]
    return np.asarray(noise + low + place[:, np.newaxis] * (high - low))
