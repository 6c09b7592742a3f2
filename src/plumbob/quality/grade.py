"""Grade of a recording with its reasons: how much a user can do with it, before anything is estimated.

The grade is 100 less the points that each criterion loses, and never below 0. A criterion loses nothing up to its first
limit, all its points from its second limit on, and between them in proportion to the logarithm of what was measured:
a fault that grows never raises the grade. Limits are those of `plumbob.quality.quality` [CDIPWaves] where that has
them; the others are this project's, and each rule says so. Criteria are cut such that one fault costs one of them.

Everything is found block by block, so that a recording that stays in its file is not read into memory.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from operator import itemgetter
from typing import Any, Final
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from plumbob.core import check, flags
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.findings import Finding, as_findings, as_json, info
from plumbob.core.time import GAP_FACTOR, Timing, timing
from plumbob.core.units import dps
from plumbob.data import AttitudeTrack, ImuData
from plumbob.data.imu import BLOCK, TRIAD_FLAGS, median, norms
from plumbob.data.plausibility import ALL_AXES, NOT_KNOWN, STUCK_SAMPLES, bursts, doubts, statistics, stuck_runs
from plumbob.data.recording import EARTH_FIELD, STUCK_FOR, Recording
from plumbob.quality import quality
from plumbob.quality.diagnosis import Declared, Examination
from plumbob.rotations import North, quat_angle

WORDS: Final = (("GOOD", 80.0), ("FAIR", 60.0), ("POOR", 0.0))
"""The words of calibration certificates, and the least grade of each."""

RATE: Final = (50.0, 5.0)
"""Samples a second: hands, vehicles and waves move below 20 Hz, and nothing is followed with a few samples a second."""
JITTER: Final = (0.05, 0.5)
"""Standard deviation of the steps, in steps; at half a step the order of samples is in doubt."""
LOST: Final = (1e-3, 0.1)  # Share of lost rows and values; the second is QARTOD's 90 % of good samples
IN_GAPS: Final = (1e-3, 0.1)  # Share of the time that lies in gaps; likewise
GRAVITY: Final = (0.03, 0.2)
"""Departure of the specific force at rest from 9.81 m/s², relative. Uncalibrated parts are off by up to 0.3 m/s²."""
MOVING: Final = (2.0, 5.0)
"""Factor between the usual specific force and 9.81 m/s² where nothing rests: a runner's phone shows up to 1.7; g for
m/s² is a factor of 9.8."""
OFF_FIELD: Final = (1.0, 2.0)
"""Factor by which the magnetic field is outside of the Earth's: a hard iron of its own size doubles it."""
COARSE: Final = (0.2, 0.8)
"""Share of samples that repeat the one before to the last bit: values held, or a step coarser than the noise."""
REST: Final = (2.0, 0.25)
"""Rest at the start, s: two seconds average the noise of a gyroscope to less than its bias."""
BEGIN: Final = 5.0
"""A rest that begins later than this is not one at the start, s."""
GAIN: Final = (0.01, 0.1)
"""Departure of the rates from the turning of gravity and field, relative, less three deviations: one in a hundred turns
a quarter turn into one that is off by a degree."""
FASTEST: Final = float(dps(4000.0))
"""No MEMS gyroscope in use measures more than 4000 °/s: an attitude that turns faster has jumped, rad/s."""


@dataclass(frozen=True, slots=True)
class Criterion:
    """One reason of a grade."""

    name: str  # its name
    points: float  # what it can cost at most
    lost: float  # what it costs here
    findings: tuple[Finding, ...]  # what was measured
    # numbers of its rule: when it costs nothing, and when everything
    limits: Mapping[str, Any] = field(default_factory=dict)
    value: float | None = None  # the number that the rule judges; None where it is not one number

    @property
    def measured(self) -> str:
        """What was measured, in words."""
        return "; ".join(map(str, self.findings))

    @property
    def rule(self) -> str:
        """When it costs nothing, and when everything, in words, and where that comes from."""
        return str(Finding(f"criterion.rule_{self.name}", "info", self.limits))

    @property
    def advice(self) -> str:
        """What to do, in words; empty where nothing is lost."""
        return str(Finding(f"criterion.advice_{self.name}", "info", self.limits)) if self.lost else ""

    def reason(self, mark: str, lang: str = "en") -> str:
        """What was measured and what to do, in words of a language with a mark between."""
        advised = (Finding(f"criterion.advice_{self.name}", "info", self.limits),) if self.lost else ()
        return mark.join(finding.sentence(lang) for finding in (*self.findings, *advised))

    def to_dict(self) -> dict[str, Any]:
        """All of it, as JSON can hold it."""
        names = ("name", "points", "lost", "measured", "rule", "advice", "value")
        return {name: getattr(self, name) for name in names} | {"findings": as_json(self.findings)}


@dataclass(frozen=True)
class Grade:
    """How much a recording is worth, with the reasons."""

    criteria: tuple[Criterion, ...]  # all that apply; of several units those of the worst
    units: Mapping[str, "Grade"] = field(default_factory=dict)  # the grade of each of several units

    @property
    def points(self) -> float:
        """From 0 to 100, rounded to a tenth."""
        return round(max(0.0, 100.0 - sum(criterion.lost for criterion in self.criteria)), 1)

    @property
    def word(self) -> str:
        """Word of `WORDS`."""
        return next(word for word, least in WORDS if self.points >= least)

    @property
    def line(self) -> str:
        """Points, word, and what costs points, the dearest first."""
        costs = sorted((it for it in self.criteria if it.lost), key=lambda it: -it.lost)
        reasons = ", ".join(f"{it.name} −{it.lost:.3g}" for it in costs)
        return f"{self.points:g} of 100, {self.word}{reasons and ': '}{reasons}"

    def __getitem__(self, name: str) -> Criterion:
        """Criterion of a name."""
        return next(criterion for criterion in self.criteria if criterion.name == name)

    def summary(self) -> dict[str, Any]:
        """All of it, as JSON can hold it."""
        fields: dict[str, Any] = {"points": self.points, "word": self.word}
        fields["criteria"] = [criterion.to_dict() for criterion in self.criteria]
        return fields | ({"units": {name: unit.summary() for name, unit in self.units.items()}} if self.units else {})


def grade_of(recording: Recording) -> Grade:
    """Grade of what a recording holds: of its samples, of several units the worst, or of its attitude alone."""
    if recording.array is not None:
        each = {name: grade(imu, recording.notes) for name, imu in recording.array.units.items()}
        worst = min(each.values(), key=lambda unit: 100.0 - sum(reason.lost for reason in unit.criteria))
        return Grade(worst.criteria, each)
    if recording.imu is not None:
        return grade(recording.imu, recording.notes)
    assert recording.track is not None
    return grade_track(recording.track)


def grade(imu: ImuData, notes: Sequence[Finding] = ()) -> Grade:
    """Grade the samples of one unit; axes, units, signs and delays are examined as `plumbob.doctor` does.

    Parameters
    ----------
    imu : ImuData
        The samples.
    notes : sequence of Finding
        What the reading of the file found; those about gaps that only the host's clock shows count.
    """
    times, pauses = _times(sample_times(imu), imu.t)
    repeated, card = {name: statistics(imu, name).repeats for name in imu.triads}, imu.meta.calibration
    costs = {"gyr": 20.0, "acc": 15.0, "mag": 5.0}
    absent = tuple(name for name in costs if name not in imu.triads)
    sensors = info("criterion.sensors_absent", names=absent) if absent else info("criterion.sensors")
    only_mag = {"only_mag" if absent == ("mag",) else "others": "yes"}
    made = (
        Criterion("sensors", 20.0, min(20.0, sum(costs[name] for name in absent)), (sensors,), costs | only_mag),
        *_timing(times),
        *_losses(imu, repeated, times, notes),
        *_repetition(imu, repeated),
        _plausible(imu, still := _rest(imu)),
        Criterion("calibration", 10.0, 0.0 if card else 10.0,
                  (info("criterion.card", card=card) if card else info("criterion.no_card"),)),
        None if still is None else _judged(
            "rest", 5.0, still.first, REST, info("criterion.rest", percent=100.0 * still.share, first=still.first),
            begin=BEGIN,
        ),
        _clock(imu, times, pauses, notes),
    )  # fmt: skip
    return Grade(tuple(filter(None, made)))


def grade_track(track: AttitudeTrack) -> Grade:
    """Grade an attitude without samples by its times, and by how much of it is known and can be."""
    times, _ = _times(timing(track.t), track.t)
    unknown = float(np.mean(~track.known))
    open_ = np.zeros(len(track), dtype=np.bool_) if track.flags is None else track.flags & flags.NOT_CONVERGED != 0
    turn = quat_angle(track.q_nb[:-1], track.q_nb[1:]) / np.maximum(np.diff(track.t), 1e-9)
    jumps = float(np.mean(turn[np.isfinite(turn)] > FASTEST)) if np.isfinite(turn).any() else 0.0
    unsettled = float(np.mean(open_))
    free, bare = track.north is North.FREE, track.cov_b is None
    return Grade((
        *_timing(times),
        _judged("loss", 25.0, unknown, LOST, info("criterion.known", percent=100.0 * unknown), attitudes="yes"),
        _judged("converged", 20.0, unsettled, (0.05, 0.9), info("criterion.converged", percent=100.0 * unsettled)),
        _judged("jumps", 25.0, jumps, quality.SHARE, info("criterion.jumps", percent=100.0 * jumps)),
        Criterion("heading", 10.0, 10.0 * free, (info("criterion.heading", north=track.north),)),
        Criterion("uncertainty", 5.0, 5.0 * bare,
                  (info("criterion.no_covariance") if bare else info("criterion.covariance"),)),
    ))  # fmt: skip


def _judged(
    name: str, points: float, value: float, limits: tuple[float, float], *findings: Finding, **more: object
) -> Criterion:
    """Criterion that loses in proportion to the logarithm of a value between two limits, rising or falling."""
    good, bad = limits
    numbers = {"good": good, "bad": bad, "good_percent": 100.0 * good, "bad_percent": 100.0 * bad}
    return Criterion(name, points, round(points * _share(value, limits), 2), findings, numbers | more, value)


def _share(value: float, limits: tuple[float, float]) -> float:
    """Share of the points that is lost, 0 to 1."""
    good, bad = limits
    if not math.isfinite(value):
        return 1.0
    if value <= 0.0:
        return 1.0 if bad < good else 0.0
    return min(1.0, max(0.0, math.log(value / good) / math.log(bad / good)))


_TIMES: Final[WeakKeyDictionary[ImuData, Timing]] = WeakKeyDictionary()


def sample_times(imu: ImuData) -> Timing:
    """What the time stamps of a recording say, measured once."""
    if imu not in _TIMES:
        _TIMES[imu] = timing(imu.t)
    return _TIMES[imu]


def _times(said: Timing, t: Floats) -> tuple[Timing, Finding | None]:
    """What is graded of time stamps: where rows come in bursts, that alone."""
    pauses = bursts(t)
    return said if pauses is None else replace(said, wander=0.0, lost=0.0), pauses


def _timing(said: Timing) -> tuple[Criterion, Criterion, Criterion]:
    """Rate, jitter and gaps."""
    jitter = said.wander
    rate, jitter_us = said.rate, 1e6 * jitter / said.rate if said.samples > 1 else None
    longest, share = (said.longest - 1.0 / rate, said.in_gaps / said.duration) if said.gaps else (0.0, 0.0)
    lost = 10.0 * (_share(longest, quality.HOLE) + _share(share, IN_GAPS))
    gaps = info("criterion.gaps", count=said.gaps, longest=longest, percent=100.0 * share)
    gaps = gaps if said.gaps else info("criterion.no_gap")
    percent = {"good_percent": 100.0 * IN_GAPS[0], "bad_percent": 100.0 * IN_GAPS[1]}
    return (
        _judged("rate", 10.0, rate, RATE,
                info("criterion.rate", rate=rate) if said.samples > 1 else info("criterion.one_sample")),
        _judged("jitter", 10.0, jitter, JITTER,
                info("criterion.jitter", percent=100.0 * jitter, jitter_us=jitter_us)),
        replace(_judged("gaps", 20.0, longest, quality.HOLE, gaps, **percent), lost=round(lost, 2)),
    )  # fmt: skip


def _losses(
    imu: ImuData, repeated: Mapping[str, NDArray[np.uint8]], times: Timing, notes: Sequence[Finding]
) -> Iterator[Criterion]:
    """What is lost, and what is clipped, by its shares."""
    counts = [note.values for note in notes if note.code == "source.decoded"]  # bytes, and those of no frame
    junk = int(str(counts[0]["junk"])) / max(1, int(str(counts[0]["bytes"]))) if counts else 0.0
    lost, clipped, words = {"rows": times.lost, "bytes": junk}, {}, imu.flags
    for name, axes in repeated.items():  # the share of time without a value for longer than from one to the next
        present = axes != NOT_KNOWN
        lost[name] = 0.0 if present.all() else 1.0
        if present.any() and not present.all():
            rows = np.diff(np.flatnonzero(present), prepend=-1, append=present.size)
            usual = float(np.median(rows))  # in rows, which gaps do not lengthen
            # a magnetometer of three quarters of the rate has none in each fourth row, which is no loss
            every_row = name != "mag" and usual == 1.0
            holes = rows[rows > (1.0 if every_row else GAP_FACTOR * usual)] - usual
            lost[name] = float(holes.sum() / present.size)
        at_ends = np.count_nonzero(words & np.uint32(TRIAD_FLAGS[name][1])) or statistics(imu, name).piled
        clipped[name] = float(at_ends) / len(imu)
    names = tuple(name for name in imu.triads if imu.meta.full_scale(name) is None and not clipped[name])
    no_range = [info("criterion.no_range", names=names)] if names else []
    for name, shares, limits, also, more in (
        ("loss", lost, LOST, [], {"samples": "yes"}), ("clipping", clipped, quality.SHARE, no_range, {}),
    ):  # fmt: skip
        some = [info("criterion.share", of=of, percent=100.0 * share) for of, share in shares.items() if share]
        yield _judged(name, 20.0, max(shares.values()), limits, *(some or [info("criterion.no_share")]), *also, **more)


def _repetition(imu: ImuData, repeated: Mapping[str, NDArray[np.uint8]]) -> Iterator[Criterion]:
    """How long values are stuck, and what share of the others repeat the one before."""
    longest, where, shares = 0.0, info("criterion.not_stuck"), {}
    for name, bits in repeated.items():
        repeats = bits[bits != NOT_KNOWN]
        if np.count_nonzero(repeats != ALL_AXES) < 2:  # it never changes: a simulation without noise, at rest
            continue
        again = {"": repeats == ALL_AXES} | {axis: repeats & (1 << i) != 0 for i, axis in enumerate("xyz")}
        stretches = [(axes, start, stop) for axes, marks in again.items() for start, stop in stuck_runs(marks)]
        t = imu.t[bits != NOT_KNOWN] if stretches else np.empty(0)
        for axes, start, stop in stretches:
            lasting, own_bit = float(t[stop - 1] - t[start]), 1 << "xyz".index(axes)
            # the others change nearly always while one does not: a coarse step at rest holds all of them
            alone = not axes or np.mean((repeats[start + 1 : stop] | own_bit) != ALL_AXES) > 0.8
            if lasting > longest and alone:
                longest = lasting
                where = info("criterion.stuck", sensor=name, axis=axes, seconds=lasting, start=float(t[start]))
            if not axes:
                again[""][start:stop] = False
        if name != "mag":  # which is often held from its slower rate
            shares[name] = float(np.mean(again[""]))
    yield _judged("stuck", 30.0, longest, (STUCK_FOR, quality.FLAT[1]), where, samples=STUCK_SAMPLES)
    if shares:
        worst = max(shares, key=shares.__getitem__)
        finding = info("criterion.resolution", percent=100.0 * shares[worst], sensor=worst)
        yield _judged("resolution", 10.0, shares[worst], COARSE, finding)


@dataclass(frozen=True)
class _Still:
    """Rest: share of the time, length of the rest at the start, s, and the median specific force at rest, m/s²."""

    share: float
    first: float
    force: float


def _rest(imu: ImuData) -> _Still | None:
    """Where the unit was at rest, as captures for a calibration are judged, from the moments of blocks."""
    from plumbob.quality import static_periods as rests

    t = imu.t
    if "acc" not in imu.triads or t.size < 3 * rests.FEWEST:
        return None
    step = 1.0 / sample_times(imu).rate
    size = max(rests.FEWEST, round(rests.BLOCK / step))
    if t.size // size < 3:
        return None
    names = [name for name in ("acc", "gyr") if name in imu.triads]
    blocks: dict[str, list[rests.BlockMoments]] = {name: [] for name in names}
    for part in imu.only(*names).chunks(size * max(1, BLOCK // size)):
        for name in names:
            blocks[name].append(rests.BlockMoments.measured(part.usable(name), len(part) // size, size))
    moments = {name: rests.BlockMoments(*map(np.concatenate, zip(*of, strict=True))) for name, of in blocks.items()}
    quiet = rests.at_rest(moments["acc"], moments.get("gyr"), size)
    long = [(a, b) for a, b in check.runs(quiet) if (b - a) * size * step >= REST[1]]
    at_start = [t[min(b * size, t.size) - 1] - t[a * size] for a, b in long if t[a * size] - t[0] <= BEGIN]
    of_rest = np.concatenate([np.arange(a, b) for a, b in long]) if long else np.zeros(0, dtype=int)
    force = norms(moments["acc"].mean[of_rest])
    return _Still(
        of_rest.size / quiet.size, float(max(at_start, default=0.0)), median(force) if force.size else math.nan
    )


def _plausible(imu: ImuData, still: _Still | None) -> Criterion:
    """What contradicts the declared units, the worst first, which alone costs."""
    sizes = () if imu.meta.unit_check else imu.unit_doubts()  # else the reading has refused it
    doubted = [*as_findings("doubts", sizes), *(it for it in doubts(imu) if it.code != "samples.bursts")]
    # how far gravity, field and temperature are from what is usual on the Earth
    tests: list[tuple[float, Finding]] = []
    if "acc" in imu.triads and still is not None and math.isfinite(still.force):
        off = _share(abs(still.force / G0 - 1.0), GRAVITY)
        tests.append((off, info("criterion.force_at_rest", force=still.force)))
    elif "acc" in imu.triads:
        typical = statistics(imu, "acc").norm
        off = max(typical / G0, G0 / typical) if typical > 0.0 else math.inf
        tests.append((_share(off, MOVING), info("criterion.force_in_motion", force=typical)))
    if "mag" in imu.triads:
        typical, (low, high) = statistics(imu, "mag").norm, EARTH_FIELD
        off = max(low / typical if typical > 0.0 else math.inf, typical / high)
        tests.append((0.5 * _share(off, OFF_FIELD), info("criterion.field", field=typical)))
    temp = imu.temp_c  # asked for once: it may lie in a file
    if temp is not None and np.isfinite(temp).any():
        low, high = float(np.nanmin(temp)), float(np.nanmax(temp))
        beyond = low < quality.CELSIUS[0] or high > quality.CELSIUS[1]
        tests.append((0.25 * beyond, info("criterion.temperature", low=low, high=high)))
    tests += [(1.0, doubt) for doubt in doubted]
    turns = "gyr" in imu.triads and len(imu.triads) > 1
    # what is wrong by how gravity and field turn beside the rates, as the doctor says it
    for it in Examination(imu, "", Declared(None), None).diagnosis().findings if turns else ():
        factor, share = it.finding.values.get("factor"), float(it.wrong)
        if not it.wrong and it.finding.code in ("doctor.unit", "doctor.factor_perhaps") and isinstance(factor, float):
            share = _share(abs(math.log(factor)) - 3.0 * float(str(it.finding.values["sd"])), GAIN)
        if share > 0.0:
            tests.append((share, it.finding.on(f"{it.sensor} {it.question}")))
    lost = max((share for share, _ in tests), default=0.0)
    worst_first = sorted(tests, key=itemgetter(0), reverse=True)
    findings = tuple(dict.fromkeys(it for share, it in worst_first if share > 0.0 or not lost))
    limits = {
        "rest_good_percent": 100.0 * GRAVITY[0], "rest_bad_percent": 100.0 * GRAVITY[1], "moving_good": MOVING[0],
        "moving_bad": MOVING[1], "low": EARTH_FIELD[0], "high": EARTH_FIELD[1], "field_bad": OFF_FIELD[1],
        "coldest": quality.CELSIUS[0], "warmest": quality.CELSIUS[1],
        "gain_good_percent": 100.0 * GAIN[0], "gain_bad_percent": 100.0 * GAIN[1],
    }  # fmt: skip
    findings = findings or (info("criterion.nothing_to_judge"),)
    return Criterion("plausibility", 40.0, round(40.0 * lost, 2), findings, limits)


def _clock(imu: ImuData, times: Timing, pauses: Finding | None, notes: Sequence[Finding]) -> Criterion:
    faults = int(np.count_nonzero(imu.flags & np.uint32(flags.TIME_FAULT))) + times.repeated
    share = 0.0 if pauses else faults / len(imu)
    said = [info("criterion.time_faults", percent=100.0 * share)] if share else []
    lost = 15.0 * _share(share, quality.SHARE)
    if pauses:
        said, lost = [pauses], 15.0
    for code, finding in (
        ("reading.inferred", info("criterion.gaps_by_host")), ("reading.clock", info("criterion.clock_fitted")),
    ):  # fmt: skip
        if any(note.code.startswith(code) for note in notes):
            said.append(finding)
            lost += 5.0
    limits = {"good_percent": 100.0 * quality.SHARE[0], "bad_percent": 100.0 * quality.SHARE[1]}
    findings = tuple(said) or (info("criterion.even"),)
    return Criterion("clock", 15.0, round(min(15.0, lost), 2), findings, limits, share)
