"""Grade of a recording with its reasons: how much a user can do with it, before anything is estimated.

The grade is 100 less the points that each criterion loses, and never below 0. A criterion loses nothing up to its first
limit, all its points from its second limit on, and between them in proportion to the logarithm of what was measured:
a fault that grows never raises the grade. Limits are those of `plumbob.quality.quality` [CDIPWaves] where that has
them; the others are this project's, and each criterion says so. Criteria are cut such that one fault costs one of them.

Everything is found block by block, so that a recording that stays in its file is not read into memory.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core import check, flags
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.findings import Finding
from plumbob.core.text import counted
from plumbob.core.time import GAP_FACTOR, is_gap, to_ns
from plumbob.core.units import dps
from plumbob.data import AttitudeTrack, ImuData
from plumbob.data.imu import BLOCK, TITLES, TRIAD_FLAGS, median, norms
from plumbob.data.plausibility import ALL_AXES, DOUBTS, NOT_KNOWN, bursts, doubts, statistics
from plumbob.data.recording import EARTH_FIELD, STUCK_FOR, STUCK_SAMPLES, Recording
from plumbob.quality import quality
from plumbob.quality.diagnosis import Declared, Examination
from plumbob.rotations import North, quat_angle

WORDS: Final = (("GOOD", 80.0), ("FAIR", 60.0), ("POOR", 0.0))
"""The words of calibration certificates, and the least grade of each."""

OURS: Final = "a rule of this project"
QARTOD: Final = "QARTOD, as CDIP applies it"

RATE: Final = (50.0, 5.0)
"""Samples a second: hands, vehicles and waves move below 20 Hz, and nothing is followed with a few samples a second."""
JITTER: Final = (0.05, 0.5)
"""Standard deviation of the steps, in steps; at half a step the order of samples is in doubt."""
LOST: Final = (1e-3, 0.1)
"""Share of lost rows and values; the second is QARTOD's 90 % of good samples."""
IN_GAPS: Final = (1e-3, 0.1)
"""Share of the time that lies in gaps; likewise."""
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
EXAMINED: Final = 20_000
"""Samples in which conventions are looked at: some minutes, those of a recording that turn most."""
TINY: Final = 0.02
"""A step shorter than this many usual ones repeats a time stamp."""
FASTEST: Final = float(dps(4000.0))
"""No MEMS gyroscope in use measures more than 4000 °/s: an attitude that turns faster has jumped, rad/s."""


@dataclass(frozen=True, slots=True)
class Criterion:
    """One reason of a grade.

    Attributes
    ----------
    name : str
        Its name.
    points : float
        What it can cost at most.
    lost : float
        What it costs here.
    measured : str
        What was measured, with its unit.
    rule : str
        When it costs nothing, and when everything.
    source : str
        Where the rule comes from.
    advice : str
        What to do; empty where nothing is lost.
    value : float or None
        The number that the rule judges; None where it is not one number.
    """

    name: str
    points: float
    lost: float
    measured: str
    rule: str
    source: str = OURS
    advice: str = ""
    value: float | None = None


@dataclass(frozen=True)
class Grade:
    """How much a recording is worth, with the reasons.

    Attributes
    ----------
    criteria : tuple of Criterion
        All that apply; of several units those of the worst.
    units : mapping of str to Grade
        The grade of each of several units.
    """

    criteria: tuple[Criterion, ...]
    units: Mapping[str, "Grade"] = field(default_factory=dict)

    @property
    def points(self) -> float:
        """From 0 to 100, rounded to a tenth."""
        return round(max(0.0, 100.0 - sum(criterion.lost for criterion in self.criteria)), 1)

    @property
    def word(self) -> str:
        """Word of `WORDS`."""
        return grade_word(self.points)

    def __getitem__(self, name: str) -> Criterion:
        """Criterion of a name."""
        return next(criterion for criterion in self.criteria if criterion.name == name)

    def summary(self) -> dict[str, Any]:
        """All of it, as JSON can hold it."""
        fields: dict[str, Any] = {"points": self.points, "word": self.word}
        fields["criteria"] = [asdict(criterion) for criterion in self.criteria]
        return fields | ({"units": {name: unit.summary() for name, unit in self.units.items()}} if self.units else {})


def grade_word(points: float) -> str:
    """Word of `WORDS` for a number of points."""
    return next(word for word, least in WORDS if points >= least)


def grade_of(recording: Recording, *, judged: bool = False, examined: bool = False) -> Grade:
    """Grade of what a recording holds: of its samples, or of its attitude where it has none; options of `grade`."""
    if recording.array is not None:
        return grade_units(recording.array.units, recording.notes, examined=examined)
    if recording.imu is not None:
        return grade(recording.imu, recording.notes, judged=judged, examined=examined)
    assert recording.track is not None
    return grade_track(recording.track)


def grade(imu: ImuData, notes: Sequence[Finding] = (), *, judged: bool = False, examined: bool = False) -> Grade:
    """Grade the samples of one unit.

    Parameters
    ----------
    imu : ImuData
        The samples.
    notes : sequence of Finding
        What the reading of the file found; those about gaps that only the host's clock shows count.
    judged : bool
        Whether the notes hold the doubts about units and signs already, as those of a file that has been read do.
    examined : bool
        Whether axes, units, signs and delays are examined as `plumbob.doctor` does, which takes a second.
    """
    steps = _Steps.measure(bursts(imu.t), np.diff(imu.t_ns))
    repeated = {name: statistics(imu, name).repeats for name in imu.triads}
    made = (
        _sensors(imu.triads),
        _rate(steps),
        _jitter(steps),
        _gaps(steps),
        _loss(repeated, steps, notes),
        _clipping(imu),
        _stuck(imu, repeated),
        _resolution(imu, repeated),
        _plausible(imu, still := _rest(imu), _doubts(imu, notes if judged else None), examined),
        _calibration(imu.meta.calibration),
        _static(imu, still),
        _clock(imu, steps, notes),
    )
    return Grade(tuple(criterion for criterion in made if criterion is not None))


def grade_units(units: Mapping[str, ImuData], notes: Sequence[Finding] = (), *, examined: bool = False) -> Grade:
    """Grade of several units: that of the worst."""
    each = {name: grade(imu, notes, examined=examined) for name, imu in units.items()}
    worst = min(each.values(), key=lambda unit: 100.0 - sum(reason.lost for reason in unit.criteria))
    return Grade(worst.criteria, each)


def grade_track(track: AttitudeTrack) -> Grade:
    """Grade an attitude without samples by its times, and by how much of it is known and can be."""
    steps = _Steps.measure(bursts(track.t), np.diff(to_ns(track.t)))
    unknown = float(np.mean(~track.known))
    open_ = np.zeros(len(track), dtype=np.bool_) if track.flags is None else track.flags & flags.NOT_CONVERGED != 0
    turn = quat_angle(track.q_nb[:-1], track.q_nb[1:]) / np.maximum(np.diff(track.t), 1e-9)
    jumps = float(np.mean(turn[np.isfinite(turn)] > FASTEST)) if np.isfinite(turn).any() else 0.0
    unsettled = float(np.mean(open_))
    free = track.north is North.FREE
    return Grade((
        _rate(steps), _jitter(steps), _gaps(steps),
        _judged("loss", 25.0, unknown, LOST, f"{_percent(unknown)} of the attitudes are not known",
                "share of attitudes that are not known", QARTOD, "leave those times out of a comparison",
                show=_percent),
        _judged("converged", 20.0, unsettled, (0.05, 0.9),
                f"{_percent(unsettled)} of the attitudes come before the filter had converged",
                "share of attitudes that are flagged not-converged", OURS,
                "start from a known attitude (--init) or from a rest", show=_percent),
        _judged("jumps", 25.0, jumps, quality.SHARE, f"{_percent(jumps)} of the steps turn faster than 4000 °/s",
                "share of steps that turn faster than any gyroscope measures", QARTOD,
                "check the order and the signs of the quaternion", show=_percent),
        Criterion("heading", 10.0, 10.0 if free else 0.0, f"heading from {track.north}",
                  "no points where the heading counts from a free zero", OURS,
                  "use a magnetometer, or align the heading before comparing" if free else ""),
        Criterion("uncertainty", 5.0, 0.0 if track.cov_b is not None else 5.0,
                  "a covariance" if track.cov_b is not None else "no covariance",
                  "no points where the attitude says nothing about its uncertainty", OURS,
                  "" if track.cov_b is not None else "estimate with mekf or the smoother, which state one"),
    ))  # fmt: skip


def _judged(
    name: str, points: float, value: float, limits: tuple[float, float], measured: str, what: str, source: str,
    advice: str, show: Callable[[float], str] = "{:g}".format,
) -> Criterion:  # fmt: skip
    """Criterion that loses in proportion to the logarithm of a value between two limits, rising or falling."""
    lost = round(points * _share(value, limits), 2)
    over = limits[1] > limits[0]
    rule = f"{what}: all points {'up to' if over else 'from'} {show(limits[0])}"
    rule += f"{'' if over else ' on'}, none {'from' if over else 'down to'} {show(limits[1])}{' on' if over else ''}"
    return Criterion(name, points, lost, measured, rule, source, advice if lost else "", value)


def _share(value: float, limits: tuple[float, float]) -> float:
    """Share of the points that is lost, 0 to 1."""
    good, bad = limits
    if not math.isfinite(value):
        return 1.0
    if value <= 0.0:
        return 1.0 if bad < good else 0.0
    return min(1.0, max(0.0, math.log(value / good) / math.log(bad / good)))


def _percent(share: float) -> str:
    return f"{100.0 * share:.3g} %"


@dataclass(frozen=True)
class _Steps:
    """What the steps of a time line say.

    How many there are, the usual one and the sum, s; by how much those that are gaps are longer than usual, s; how many
    repeat a stamp; their standard deviation about whole numbers of the usual one, in steps; the share of the rows that
    are missing one to four at a time; and how they come in bursts.
    """

    count: int
    usual: float = math.nan
    total: float = 0.0
    holes: Floats = field(default_factory=lambda: np.empty(0))
    tiny: int = 0
    jitter: float = 0.0
    lost: float = 0.0
    bursts: Finding | None = None

    @classmethod
    def measure(cls, bursts: Finding | None, dt_ns: NDArray[np.int64]) -> "_Steps":
        """Measure steps (N,), ns, that come in bursts as is said. A day of them leaves little room for copies."""
        if not dt_ns.size:
            return cls(0)
        gaps, dt = is_gap(dt_ns), dt_ns / 1e9
        del dt_ns
        middle = float(np.median(dt))
        near = (dt >= 0.5 * middle) & (dt <= 1.5 * middle)
        # the median step may be one of two that alternate: the usual one is the mean of those about it
        usual = float(np.mean(dt, where=near)) if near.any() else middle
        tiny = dt < TINY * usual
        steps = cls(dt.size, usual, float(dt.sum()), dt[gaps] - usual, int(np.count_nonzero(tiny)), bursts=bursts)
        if bursts:
            return steps
        jitter, lost = _uneven(dt, usual, gaps, tiny)
        return replace(steps, jitter=jitter, lost=lost)


def _uneven(dt: Floats, usual: float, gaps: NDArray[np.bool_], tiny: NDArray[np.bool_]) -> tuple[float, float]:
    """`jitter` and `lost` of steps that do not come in bursts; the steps (N,), s, are used up."""
    count = dt.size - int(np.count_nonzero(gaps))
    late = float(np.sum(dt, where=~gaps)) / usual - count
    multiples = np.rint(np.divide(dt, usual, out=dt))
    np.maximum(multiples, 1.0, out=multiples)
    steady = ~(gaps | tiny)
    skipped = float(np.sum(multiples, where=steady)) - np.count_nonzero(steady)
    np.subtract(dt, multiples, out=dt)
    del multiples
    jitter = float(np.std(dt, where=steady)) if steady.any() else 0.0
    missing = max(0.0, min(skipped, late - 3.0 * jitter * math.sqrt(count)))  # by which jitter moves the mean step
    return jitter, missing / (missing + count + 1.0)


def _sensors(triads: Sequence[str]) -> Criterion:
    costs = {"gyr": 20.0, "acc": 15.0, "mag": 5.0}
    absent = [name for name in costs if name not in triads]
    lost = min(20.0, sum(costs[name] for name in absent))
    missing = ", ".join(TITLES[name] for name in absent)
    return Criterion(
        "sensors", 20.0, lost, f"no {missing}" if absent else "gyroscope, accelerometer, magnetometer",
        "a missing gyroscope costs 20 points, accelerometer 15, magnetometer 5, all together 20", OURS,
        "without a magnetometer the heading counts from a free zero" if absent == ["mag"]
        else "attitude needs a gyroscope and an accelerometer" if absent else "",
    )  # fmt: skip


def _rate(steps: _Steps) -> Criterion:
    rate = 1.0 / steps.usual if steps.count else math.nan
    return _judged("rate", 10.0, rate, RATE, f"{rate:.5g} Hz" if steps.count else "one sample", "samples a second",
                   OURS, "sample faster where the body moves faster than a wave", "{:g} Hz".format)  # fmt: skip


def _jitter(steps: _Steps) -> Criterion:
    jitter = steps.jitter
    return _judged(
        "jitter", 10.0, jitter, JITTER, f"{_percent(jitter)} of a step"
        + (f", {1e6 * jitter * steps.usual:.3g} µs" if steps.count else ""),
        "standard deviation of the steps between gaps, over the usual step", OURS,
        "stamp on the device, by its own clock or a counter (docs/time.md)", _percent,
    )  # fmt: skip


def _gaps(steps: _Steps) -> Criterion:
    holes = steps.holes
    longest = float(holes.max(initial=0.0))
    share = float(holes.sum() / steps.total) if holes.size else 0.0
    lost = 10.0 * (_share(longest, quality.HOLE) + _share(share, IN_GAPS))
    measured = (
        f"{counted(holes.size, 'gap')}, longest {longest:.3g} s, {_percent(share)} of the time"
        if holes.size
        else "no gap"
    )
    return Criterion(
        "gaps", 20.0, round(lost, 2), measured,
        f"10 points by the longest, from {quality.HOLE[0]:g} s to {quality.HOLE[1]:g} s, and 10 by the share of the "
        f"time, from {_percent(IN_GAPS[0])} to {_percent(IN_GAPS[1])}", QARTOD,
        "look at the line: power, cable, buffer; estimate each part by itself" if lost else "", longest,
    )  # fmt: skip


def _loss(repeated: Mapping[str, NDArray[np.uint8]], steps: _Steps, notes: Sequence[Finding]) -> Criterion:
    shares = {"rows": steps.lost, "bytes": _junk(notes)}
    shares |= {name: _absent(axes != NOT_KNOWN, each=name != "mag") for name, axes in repeated.items()}
    worst = max(shares, key=lambda name: shares[name])
    measured = ", ".join(f"{_percent(share)} of {name}" for name, share in shares.items() if share)
    return _judged(
        "loss", 20.0, shares[worst], LOST, measured or "none", "largest share of rows or values that are missing",
        QARTOD + " (90 % of good samples)", "send a counter, and check line, buffer and sensor bus", _percent,
    )  # fmt: skip


def _junk(notes: Sequence[Finding]) -> float:
    """Share of the bytes of a stream that belong to no frame, as who decoded them says."""
    counts = [note.values for note in notes if note.code == "source.decoded"]
    return int(str(counts[0]["junk"])) / max(1, int(str(counts[0]["bytes"]))) if counts else 0.0


def _absent(present: NDArray[np.bool_], *, each: bool) -> float:
    """Share of the time in which a triad has no value for longer than it usually takes from one to the next.

    `each` says that every row should have one: a magnetometer of three quarters of the rate has none in each fourth
    row, which is no loss.
    """
    if present.all() or not present.any():
        return 0.0 if present.all() else 1.0
    rows = np.diff(np.flatnonzero(present), prepend=-1, append=present.size)
    usual = float(np.median(rows))  # in rows, which gaps do not lengthen
    holes = rows[rows > (1.0 if each and usual == 1.0 else GAP_FACTOR * usual)] - usual
    return float(holes.sum() / present.size)


def _clipping(imu: ImuData) -> Criterion:
    words = imu.flags
    bits = {"gyr": flags.GYR_CLIPPED, "acc": flags.ACC_CLIPPED, "mag": flags.MAG_CLIPPED}
    shares = {name: float(np.count_nonzero(words & np.uint32(bits[name]))) / len(imu) for name in imu.triads}
    open_ = [name for name in imu.triads if imu.meta.full_scale(name) is None and not shares[name]]
    measured = ", ".join(f"{_percent(share)} of {name}" for name, share in shares.items() if share) or "none seen"
    return _judged(
        "clipping", 20.0, max(shares.values()), quality.SHARE,
        measured + (f"; range of {', '.join(open_)} not declared" if open_ else ""),
        "share of samples at the end of the range", QARTOD, "choose a larger range, or damp shocks", _percent,
    )  # fmt: skip


def _stuck(imu: ImuData, repeated: Mapping[str, NDArray[np.uint8]]) -> Criterion:
    longest, where = 0.0, "none"
    for name, bits in repeated.items():
        repeats = bits[bits != NOT_KNOWN]
        if np.count_nonzero(repeats != ALL_AXES) < 2:  # it never changes: a simulation without noise, at rest
            continue
        held = [
            (axes, start, stop)
            for axes, marks in _repeating(repeats)
            for start, stop in check.runs(marks)
            if stop - start >= STUCK_SAMPLES - 1
        ]
        t = imu.t[bits != NOT_KNOWN] if held else np.empty(0)
        for axes, start, stop in held:
            lasting = float(t[stop - 1] - t[max(start - 1, 0)])
            if lasting > longest and _others(repeats, axes, start, stop):
                longest, where = (
                    lasting,
                    f"{name} {axes or 'all axes'} for {lasting:.4g} s from t = {t[start]:.4g} s",
                )
    return _judged(
        "stuck", 30.0, longest, (STUCK_FOR, quality.FLAT[1]), where,
        f"longest time in which a sensor, or an axis while the others move, repeats to the last bit in {STUCK_SAMPLES} "
        "samples or more", QARTOD + " (flat line)", "replace the sensor or check its bus; leave that time out",
        "{:g} s".format,
    )  # fmt: skip


def _repeating(repeats: NDArray[np.uint8]) -> Iterable[tuple[str, NDArray[np.bool_]]]:
    yield "", np.asarray(repeats == ALL_AXES)
    for i, axis in enumerate("xyz"):
        yield axis, np.asarray(repeats & (1 << i) != 0)


def _others(repeats: NDArray[np.uint8], axes: str, start: int, stop: int) -> bool:
    """Whether the other axes change nearly always while one does not: a coarse step at rest holds all of them."""
    if not axes:
        return True
    own_bit = 1 << "xyz".index(axes)
    return float(np.mean((repeats[start:stop] | own_bit) != ALL_AXES)) > 0.8


def _resolution(imu: ImuData, repeated: Mapping[str, NDArray[np.uint8]]) -> Criterion | None:
    shares = {}
    for name in (name for name in repeated if name != "mag"):  # which is often held from its slower rate
        repeats = repeated[name][repeated[name] != NOT_KNOWN]
        again = repeats == ALL_AXES
        for start, stop in check.runs(again):
            if stop - start >= STUCK_SAMPLES - 1:
                again[start:stop] = False
        if repeats.size and np.count_nonzero(repeats != ALL_AXES) >= 2:
            shares[name] = float(np.mean(again))
    if not shares:
        return None
    worst = max(shares, key=lambda name: shares[name])
    return _judged(
        "resolution", 10.0, shares[worst], COARSE, f"{_percent(shares[worst])} of {worst} repeat the sample before",
        "share of samples of gyroscope or accelerometer that repeat the one before to the last bit", OURS,
        "values are held or coarse: store each sample once, with all bits of the part", _percent,
    )  # fmt: skip


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
    step = median(np.diff(t))
    size = max(rests.FEWEST, round(rests.BLOCK / step))
    if t.size // size < 3:
        return None
    names = [name for name in ("acc", "gyr") if name in imu.triads]
    blocks: dict[str, list[tuple[Floats, Floats]]] = {name: [] for name in names}
    for part in imu.only(*names).chunks(size * max(1, BLOCK // size)):
        count = len(part) // size
        for name in names:
            values = part.usable(name)[: count * size].reshape(count, size, 3)
            blocks[name].append((values.mean(axis=1), values.std(axis=1, ddof=1)))
    moments = {name: rests.BlockMoments(*map(np.concatenate, zip(*of, strict=True))) for name, of in blocks.items()}
    quiet = rests.at_rest(moments["acc"], moments.get("gyr"), size)
    long = [(a, b) for a, b in check.runs(quiet) if (b - a) * size * step >= REST[1]]
    at_start = [t[min(b * size, t.size) - 1] - t[a * size] for a, b in long if t[a * size] - t[0] <= BEGIN]
    of_rest = np.concatenate([np.arange(a, b) for a, b in long]) if long else np.zeros(0, dtype=int)
    force = norms(moments["acc"].mean[of_rest])
    return _Still(
        of_rest.size / quiet.size, float(max(at_start, default=0.0)), median(force) if force.size else math.nan
    )


def _static(imu: ImuData, still: _Still | None) -> Criterion | None:
    if still is None:
        return None
    return _judged(
        "rest", 5.0, still.first, REST, f"at rest for {_percent(still.share)} of the time, "
        f"{still.first:.3g} s at the start",
        f"rest that begins in the first {BEGIN:g} s, for the bias of the gyroscope",
        OURS, "let the unit lie still for a few seconds before it moves", "{:g} s".format,
    )  # fmt: skip


def _plausible(imu: ImuData, still: _Still | None, doubted: Sequence[str], examined: bool) -> Criterion:
    """The worst of what contradicts the declared units: it costs once."""
    tests = [*_gravity(imu, still), *_field(imu), *_temperature(imu)]
    tests += [(1.0, doubt) for doubt in (*doubted, *(_contradicted(imu) if examined else ()))]
    lost, worst = max(tests, key=lambda test: test[0], default=(0.0, ""))
    others = "; ".join(dict.fromkeys(text for share, text in tests if share <= 0.0))
    low, high = EARTH_FIELD
    return Criterion(
        "plausibility", 40.0, round(40.0 * lost, 2), worst if lost else others or "nothing to judge",
        f"the worst of: |acc| at rest within {_percent(GRAVITY[0])} of 9.81 m/s², nothing from {_percent(GRAVITY[1])} "
        f"on, without a rest in a factor of {MOVING[0]:g}, nothing from {MOVING[1]:g} on; median |mag| in "
        f"{low:g} to {high:g} µT, half of the points lost at a factor of {OFF_FIELD[1]:g} outside; "
        f"temperature in {quality.CELSIUS[0]:g} to {quality.CELSIUS[1]:g} °C; no doubt about units and signs"
        f"{', axes and delays' if examined else ''}",
        "QARTOD (range); Alken 2021 (field); the rest " + OURS,
        "check units, axes and signs of the file ('plumbob doctor' says which), and calibrate" if lost else "",
    )  # fmt: skip


def _doubts(imu: ImuData, notes: Sequence[Finding] | None) -> list[str]:
    """Doubts about units and signs; without that about bursts, which is the clock's."""
    sizes = () if imu.meta.unit_check else imu.unit_doubts()  # else the reading has refused it
    others = doubts(imu) if notes is None else [note for note in notes if note.code in DOUBTS]
    return [*sizes, *(str(doubt) for doubt in others if doubt.code != "samples.bursts")]


def _contradicted(imu: ImuData) -> list[str]:
    """What is wrong by how gravity and field turn beside the rates, in the stretch that turns most."""
    if "gyr" not in imu.triads or len(imu.triads) < 2:
        return []
    most = max(imu.chunks(EXAMINED), key=lambda part: float(np.nansum(np.asarray(part.gyr) ** 2)))
    clipped = {name: (most.flags & np.uint32(TRIAD_FLAGS[name][1]) != 0)[:, np.newaxis] for name in most.triads}
    values: dict[str, Floats] = {name: np.where(at, np.nan, getattr(most, name)) for name, at in clipped.items()}
    unclipped = most.corrected(meta=most.meta, **values)
    findings = Examination(unclipped, "", Declared(None), None).diagnosis().findings
    return [f"{TITLES[it.sensor]}, {it.question}: {it.value} ({it.answer})" for it in findings if it.wrong]


def _gravity(imu: ImuData, still: _Still | None) -> Iterable[tuple[float, str]]:
    if "acc" not in imu.triads:
        return
    at_rest = still is not None and math.isfinite(still.force)
    typical = still.force if at_rest and still is not None else statistics(imu, "acc").norm
    text = f"|acc| {'at rest' if at_rest else 'in motion'} {typical:.4g} m/s²"
    if at_rest:
        yield _share(abs(typical / G0 - 1.0), GRAVITY), text
    else:
        yield _share(max(typical / G0, G0 / typical) if typical > 0.0 else math.inf, MOVING), text


def _field(imu: ImuData) -> Iterable[tuple[float, str]]:
    if "mag" not in imu.triads:
        return
    typical = statistics(imu, "mag").norm
    low, high = EARTH_FIELD
    off = max(low / typical if typical > 0.0 else math.inf, typical / high)
    yield 0.5 * _share(off, OFF_FIELD), f"|mag| {typical:.4g} µT"


def _temperature(imu: ImuData) -> Iterable[tuple[float, str]]:
    temp = imu.temp_c
    if temp is None or not np.isfinite(temp).any():
        return
    low, high = float(np.nanmin(temp)), float(np.nanmax(temp))
    beyond = low < quality.CELSIUS[0] or high > quality.CELSIUS[1]
    yield 0.25 * beyond, f"{low:.3g} to {high:.3g} °C"


def _calibration(card: str | None) -> Criterion:
    return Criterion(
        "calibration", 10.0, 0.0 if card else 10.0, card or "none",
        "no points without a calibration card", OURS,
        "" if card else "plumbob calibrate hand, and apply the card",
    )  # fmt: skip


def _clock(imu: ImuData, steps: _Steps, notes: Sequence[Finding]) -> Criterion:
    faults = int(np.count_nonzero(imu.flags & np.uint32(flags.TIME_FAULT))) + steps.tiny
    share = 0.0 if steps.bursts else faults / len(imu)
    said = [f"{_percent(share)} of the stamps repeat or go back"] if share else []
    lost = 15.0 * _share(share, quality.SHARE)
    if steps.bursts:
        said.append(str(steps.bursts))
        lost = 15.0
    for code, what in (
        ("reading.inferred", "gaps that only the host's delays show"),
        ("reading.clock", "a fitted clock"),
    ):
        if any(note.code.startswith(code) for note in notes):
            said.append(what)
            lost += 5.0
    return Criterion(
        "clock", 15.0, round(min(15.0, lost), 2), "; ".join(said) or "stamps increase evenly",
        f"share of stamps that repeat, from {_percent(quality.SHARE[0])} to {_percent(quality.SHARE[1])}; no points "
        "where they come in bursts; 5 less where gaps rest on the host's delays alone, or the clock is fitted", OURS,
        "send the device's clock or a counter, or declare the rate (docs/time.md)" if lost else "", share,
    )  # fmt: skip
