"""From a static record to the figures of a data sheet: `plumbob allan`, in Python and on the command line.

The analysis goes channel by channel, in memory or in one pass over a larger file.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any, Final, Literal

import numpy as np

from plumbob.core import __version__
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.result import Reported
from plumbob.data.cards import NoiseCard
from plumbob.noise.analysis import Averages, analyse, analyse_averages, with_curve
from plumbob.noise.compare import DeviationComparison, compare
from plumbob.noise.curve import Curve, curves, make_curve
from plumbob.noise.factors import Averager, Factors, every_adev, log_factors, longest_factor, stream_factors
from plumbob.noise.findings import Analysis, Deviation, numbers
from plumbob.noise.static import StaticReport, bridged
from plumbob.noise.static_record import Channels, StaticRecord
from plumbob.noise.stream import AllanStream

IN_MEMORY: Final = 1 << 24  # bytes of a file of bare numbers up to which it is read whole
# S; every one that the record allows; or evenly spaced in their logarithm.
Taus = Sequence[float] | Literal["all"] | None

_Done = Callable[[int, int], None]

_WORKERS = 2
_ROUNDED = 0.01  # of an averaging time: more is another one


def characterise(
    record: StaticRecord, report: StaticReport, *, taus: Taus = None, progress: _Done | None = None
) -> list[Analysis]:
    """Analyse every channel of a record, those of sensors that the report refuses left out.

    What it skips is bridged by its neighbours, and its warnings stand in the notes. `taus` are those of the curve; the
    coefficients are found on log-spaced ones all the same. `progress` is given what is done, and of how much.
    """
    analyses: list[Analysis] = []
    for group in _sound(record, report):
        if isinstance(group.source, np.ndarray) or record.size <= IN_MEMORY or taus == "all":
            for analysis in _in_memory(group, report, taus):
                analyses.append(analysis)
                if progress is not None:
                    progress(len(analyses), sum(len(each.names) for each in record.groups))
        elif group.names[0] in report.skipped:
            warning = next(f for f in report.warnings if f.kind == "disturbed" and f.concerns(group.names[0]))
            raise ShapeError(
                f"{record.path} is analysed as it is read, so nothing can be skipped: {warning} Choose a still "
                "stretch with --from and --to."
            )
        else:
            analyses += _streamed(group, record.size, taus, progress)
    return [
        replace(
            a,
            step=report.steps.get(a.name, 0.0),
            notes=(*(warning.finding for warning in report.warnings if warning.concerns(a.name)), *a.notes),
        )
        for a in analyses
    ]


def deviations(record: StaticRecord, report: StaticReport, kind: str, *, taus: Taus = None) -> list[Deviation]:
    """Only the deviation of each channel, of any kind in `plumbob.noise.KINDS`; otherwise as `characterise`."""
    channels: list[Deviation] = []
    for group in _sound(record, report):
        samples = _samples(group, report)
        n = None if taus is None else _factors(taus, group.dt, samples.shape[0], kind)
        of = curves(samples, group.dt, n, kind=kind)
        channels += [Deviation(name, group.quantity, curve) for name, curve in zip(group.names, of, strict=True)]
    return channels


def changes(
    before: tuple[StaticRecord, StaticReport], after: tuple[StaticRecord, StaticReport], *, taus: Taus = None
) -> dict[str, DeviationComparison]:
    """What has changed from one record to another, channel by channel, of those that both have at one rate."""
    old, new = _sound(*before), _sound(*after)
    alone = sum(len(x.names) for x in old) == sum(len(y.names) for y in new) == 1  # whatever the files are called
    compared: dict[str, DeviationComparison] = {}
    for x, y in product(old, new):
        channels = product(enumerate(x.names), enumerate(y.names))
        pairs = [(i, j) for (i, first), (j, second) in channels if alone or first == second]
        if not pairs or abs(x.dt / y.dt - 1.0) > _ROUNDED or x.quantity is not y.quantity:
            continue
        a, b = _samples(x, before[1]), _samples(y, after[1])
        n = None if taus is None else _factors(taus, x.dt, min(len(a), len(b)))
        compared |= {y.names[j]: compare(a[:, i], b[:, j], x.dt, n=n) for i, j in pairs}
    return compared


def _sound(record: StaticRecord, report: StaticReport) -> list[Channels]:
    """Sensors that the report does not refuse; an error where it refuses all."""
    sound = [group for group in record.groups if not report.refused(*group.names)]
    if report.errors and not sound:
        more = f" ({len(report.errors) - 1} more)" if len(report.errors) > 1 else ""
        raise ShapeError(f"not a static record: {report.errors[0]}{more}")
    return sound


def _samples(group: Channels, report: StaticReport) -> Floats:
    """Samples of a sensor, with their neighbours in place of what is skipped."""
    parts = report.skipped.get(group.names[0], ())
    return bridged(group.read(), group.dt, group.start, list(parts)) if parts else group.read()


def _in_memory(group: Channels, report: StaticReport, taus: Taus) -> Iterable[Analysis]:
    samples = _samples(group, report)

    def analyse_column(channel: int) -> Analysis:
        column = np.ascontiguousarray(samples[:, channel])
        analysis = analyse(column, group.dt, name=group.names[channel], quantity=group.quantity)
        return analysis if taus is None else with_curve(analysis, _curve_at_taus(column, group.dt, taus))

    with ThreadPoolExecutor(_WORKERS) as pool:
        yield from pool.map(analyse_column, range(samples.shape[1]))


def _curve_at_taus(samples: Floats, dt: float, taus: Sequence[float] | Literal["all"]) -> Curve:
    if taus == "all":
        dev = every_adev(samples)
        return make_curve(dev, np.arange(1, dev.size + 1), samples.size, dt)
    return curves(samples[:, np.newaxis], dt, _factors(taus, dt, samples.size))[0]


def _streamed(group: Channels, size: int, taus: Taus, progress: _Done | None) -> list[Analysis]:
    grid = log_factors(size)  # a number is a byte or more
    n = None if taus is None else stream_factors(_factors(taus, group.dt, size))
    allan = AllanStream(grid if n is None else np.union1d(grid, n), channels=len(group.names))
    averager = Averager(len(group.names))
    for block in group.blocks(None if progress is None else lambda done: progress(done, size)):
        allan.feed(block)
        averager.feed(block)
    stats, values = allan.result(), averager.values()
    channel_curves = [make_curve(dev, stats.n, stats.count, group.dt) for dev in stats.dev.T]
    analyses = [
        analyse_averages(
            Averages(np.ascontiguousarray(values[:, i]), averager.averaged),
            channel_curves[i],
            mean=float(stats.mean[i]),
            sd=float(stats.sd[i]),
            name=name,
            quantity=group.quantity,
        )
        for i, name in enumerate(group.names)
    ]
    if n is None:
        return analyses
    if n[-1] > stats.n[-1]:
        raise _too_long(float(n[-1] * group.dt), group.dt, stats.count)
    return [replace(a, curve=a.curve.only(n)) for a in analyses]  # whose intervals the model has given


def _factors(taus: Sequence[float] | Literal["all"], dt: float, count: int, kind: str = "oadev") -> Factors:
    """Averaging factors of averaging times, refusing those that are no multiple of the sampling time."""
    longest = longest_factor(kind, count)
    if taus == "all":
        return np.arange(1, longest + 1)
    times = np.asarray(taus, dtype=np.float64)
    n = np.rint(times / dt)
    for tau, factor in zip(times.tolist(), n.tolist(), strict=True):
        if not factor >= 1.0 or abs(factor * dt / tau - 1.0) > _ROUNDED:
            nearest = max(factor, 1.0) * dt
            raise ParameterError(
                f"τ = {tau:g} s is not a multiple of the sampling time {dt:.6g} s; the nearest is {nearest:.6g} s."
            )
        if factor > longest:
            raise _too_long(tau, dt, count, kind)
    return np.unique(n).astype(np.int64)


def _too_long(tau: float, dt: float, count: int, kind: str = "oadev") -> ParameterError:
    return ParameterError(
        f"τ = {tau:g} s is too long: for {kind}, a record of {count * dt:.6g} s has "
        f"{longest_factor(kind, count) * dt:.6g} s at most."
    )


@dataclass(frozen=True, eq=False, repr=False)
class Noise(Reported):
    """Noise of a unit, found from a static record; or of several records beside each other.

    Attributes
    ----------
    record : StaticRecord
        What was analysed.
    static : StaticReport
        Whether it was static, and what was left out of it.
    analyses : tuple of Analysis
        One for each channel.
    calibration : str or None
        Device of the calibration card that was applied first.
    label : str
        What the record is called beside others.
    beside : tuple of Noise
        The others; this is the first, with which they are compared.
    changes : mapping of str to DeviationComparison
        Of one that stands beside another: from that to this, by the channel's name.
    """

    record: StaticRecord
    static: StaticReport
    analyses: tuple[Analysis, ...]
    calibration: str | None = None
    label: str = ""
    beside: tuple["Noise", ...] = ()
    changes: Mapping[str, DeviationComparison] = field(default_factory=dict)

    @property
    def all(self) -> tuple["Noise", ...]:
        """The record itself, and those beside it."""
        return (self, *self.beside)

    def facts(self) -> Mapping[str, str]:
        """Record, length and channels."""
        if self.beside:
            return {each.label: ", ".join(each._alone().facts().values()) for each in self.all}
        length = {a.name: a.curve.count * a.curve.dt for a in self.analyses}
        return {
            "record": self.record.path.name,
            "length": f"{max(length.values(), default=0.0):.0f} s",
            "channels": ", ".join(a.name for a in self.analyses),
        }

    def card(self, device: str | None = None, source: str | None = None) -> NoiseCard:
        """Noise card of the unit, for the simulator and the filters; errors as of `NoiseCard`, and of several units."""
        from plumbob.noise.card import noise_card

        device = device or self.record.device or self.record.path.stem
        return noise_card(self._alone("a card").analyses, device=device, source=source or self.source)

    def lines(self, form: str) -> str:
        """What another program takes: "kalibr", "vins", "orbslam", "liosam", "kfgins" or "ros"; with definitions."""
        from plumbob.noise.card import lines

        return lines(self._alone(form).analyses, form, source=self.source)

    def _alone(self, what: str = "") -> "Noise":
        if what and self.beside:
            raise ParameterError(f"{what} is for one unit, but there are {len(self.all)} records. Give one of them.")
        return replace(self, beside=())

    @property
    def source(self) -> str:
        """Where the figures come from."""
        return f"Allan analysis of {self.named}, plumbob {__version__}"

    @property
    def named(self) -> str:
        """Name of the record, and the card that was applied."""
        return self.record.path.name + ("" if self.calibration is None else f", calibrated with {self.calibration}")

    def summary(self) -> dict[str, Any]:
        """All figures with their units, as JSON can hold them; of several records by their labels."""
        if self.beside:
            return {each.label: each._alone().summary() for each in self.all}
        more = {"changes": {name: change.summary() for name, change in self.changes.items()}} if self.changes else {}
        return {"file": str(self.record.path), "calibration": self.calibration, **numbers(self.analyses), **more}
