"""From a static record to the figures of a data sheet: `plumbob allan`, in Python and on the command line.

The analysis goes channel by channel, in memory or in one pass over a larger file.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

import numpy as np

from plumbob import noise
from plumbob.core import __version__
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.result import Reported
from plumbob.data.cards import NoiseCard
from plumbob.noise import Averager, ChannelComparison, Curve, compare, curves
from plumbob.noise.factors import Factors, kind_named
from plumbob.noise.static import StaticReport, bridged
from plumbob.noise.static_record import Channels, StaticRecord

IN_MEMORY: Final = 1 << 24  # bytes of a file of bare numbers up to which it is read whole
# S; every one that the record allows; or evenly spaced in their logarithm.
Taus = Sequence[float] | Literal["all"] | None

_Done = Callable[[int], None]

_WORKERS = 2
_ROUNDED = 0.01  # of an averaging time: more is another one


def characterise(
    record: StaticRecord, report: StaticReport, *, taus: Taus = None, progress: _Done | None = None
) -> list[noise.Analysis]:
    """Analyse every channel of a record, those of sensors that the report refuses left out.

    What it skips is bridged by its neighbours, and its warnings stand in the notes. `taus` are those of the curve; the
    coefficients are found on log-spaced ones all the same. `progress` is given the bytes that are done.
    """
    analyses: list[noise.Analysis] = []
    for group in _sound(record, report):
        if isinstance(group.source, np.ndarray) or record.size <= IN_MEMORY or taus == "all":
            analyses += _in_memory(group, report, taus)
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


def deviations(record: StaticRecord, report: StaticReport, kind: str, *, taus: Taus = None) -> list[noise.Deviation]:
    """Only the deviation of each channel, of any kind in `plumbob.noise.KINDS`; otherwise as `characterise`."""
    channels: list[noise.Deviation] = []
    for group in _sound(record, report):
        samples = _samples(group, report)
        n = None if taus is None else _factors(taus, group.dt, samples.shape[0], kind)
        of = curves(samples, group.dt, n, kind=kind)
        channels += [noise.Deviation(name, group.quantity, curve) for name, curve in zip(group.names, of, strict=True)]
    return channels


def comparisons(
    before: tuple[StaticRecord, StaticReport], after: tuple[StaticRecord, StaticReport], *, taus: Taus = None
) -> list[ChannelComparison]:
    """Compare the channels of two records, which must have the same ones and rates."""
    first, second = (_sound(record, report) for record, report in (before, after))
    compared = []
    alone = all([len(g.names) for g in groups] == [1] for groups in (first, second))  # whatever the files are called
    if not alone and [g.names for g in first] != [g.names for g in second]:
        raise ShapeError(
            f"before has {_channels(first)}, but after has {_channels(second)}; compare the same channels."
        )
    for old, new in zip(first, second, strict=True):
        if abs(old.dt / new.dt - 1.0) > _ROUNDED or old.quantity is not new.quantity:
            raise ShapeError(
                f"before is {old.quantity.name.lower()} at {1.0 / old.dt:.6g} Hz, but after is "
                f"{new.quantity.name.lower()} at {1.0 / new.dt:.6g} Hz; compare like with like."
            )
        x, y = _samples(old, before[1]), _samples(new, after[1])
        n = None if taus is None else _factors(taus, old.dt, min(x.shape[0], y.shape[0]))
        compared += [
            ChannelComparison(name, old.quantity, compare(x[:, i], y[:, i], old.dt, n=n))
            for i, name in enumerate(old.names)
        ]
    return compared


def _channels(groups: Sequence[Channels]) -> str:
    return ", ".join(name for group in groups for name in group.names) or "none"


def _sound(record: StaticRecord, report: StaticReport) -> list[Channels]:
    """Sensors that the report does not refuse; an error where it refuses all."""
    report.require(*(group.names for group in record.groups))
    return [group for group in record.groups if not report.refused(*group.names)]


def _samples(group: Channels, report: StaticReport) -> Floats:
    """Samples of a sensor, with their neighbours in place of what is skipped."""
    parts = report.skipped.get(group.names[0], ())
    return bridged(group.read(), group.dt, group.start, list(parts)) if parts else group.read()


def _in_memory(group: Channels, report: StaticReport, taus: Taus) -> Iterable[noise.Analysis]:
    samples = _samples(group, report)

    def analyse_column(channel: int) -> noise.Analysis:
        column = np.ascontiguousarray(samples[:, channel])
        analysis = noise.analyse(column, group.dt, name=group.names[channel], quantity=group.quantity)
        return analysis if taus is None else noise.with_curve(analysis, _curve_at_taus(column, group.dt, taus))

    with ThreadPoolExecutor(_WORKERS) as pool:
        return list(pool.map(analyse_column, range(samples.shape[1])))


def _curve_at_taus(samples: Floats, dt: float, taus: Sequence[float] | Literal["all"]) -> Curve:
    if taus == "all":
        dev = noise.every_adev(samples)
        return noise.make_curve(dev, np.arange(1, dev.size + 1), samples.size, dt)
    return curves(samples[:, np.newaxis], dt, _factors(taus, dt, samples.size))[0]


def _streamed(group: Channels, size: int, taus: Taus, progress: _Done | None) -> list[noise.Analysis]:
    grid = noise.log_factors(size)  # a number is a byte or more
    n = None if taus is None else noise.stream_factors(_factors(taus, group.dt, size))
    allan = noise.AllanStream(
        noise.stream_factors(grid if n is None else np.union1d(grid, n)), channels=len(group.names)
    )
    averager = Averager(len(group.names))
    for block in group.blocks(progress):
        allan.feed(block)
        averager.feed(block)
    stats, values = allan.result(), averager.values()
    channel_curves = [noise.make_curve(dev, stats.n, stats.count, group.dt) for dev in stats.dev.T]
    analyses = [
        noise.analyse_averages(
            noise.Averages(np.ascontiguousarray(values[:, i]), averager.averaged),
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
    longest = kind_named(kind).longest(count)
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
        f"{kind_named(kind).longest(count) * dt:.6g} s at most."
    )


@dataclass(frozen=True, eq=False, repr=False)
class Noise(Reported):
    """Noise of a unit, found from a static record.

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
    """

    record: StaticRecord
    static: StaticReport
    analyses: tuple[noise.Analysis, ...]
    calibration: str | None = None

    def facts(self) -> Mapping[str, str]:
        """Record, length and channels."""
        length = {a.name: a.curve.count * a.curve.dt for a in self.analyses}
        return {
            "record": self.record.path.name,
            "length": f"{max(length.values(), default=0.0):.0f} s",
            "channels": ", ".join(a.name for a in self.analyses),
        }

    def card(self, device: str | None = None, source: str | None = None) -> NoiseCard:
        """Noise card of the unit, for the simulator and the filters; errors as of `NoiseCard`."""
        from plumbob.noise.card import noise_card

        device = device or self.record.device or self.record.path.stem
        return noise_card(self.analyses, device=device, source=source or self.source)

    @property
    def source(self) -> str:
        """Where the figures come from."""
        return f"Allan analysis of {self.named}, plumbob {__version__}"

    @property
    def named(self) -> str:
        """Name of the record, and the card that was applied."""
        return self.record.path.name + ("" if self.calibration is None else f", calibrated with {self.calibration}")

    def summary(self) -> dict[str, Any]:
        """All figures with their units, as JSON can hold them."""
        from plumbob.noise.findings import numbers

        return {"file": str(self.record.path), "calibration": self.calibration, **numbers(self.analyses)}
