"""Every figure of the buoy paper, with its bars [Yu2018]."""

from collections.abc import Iterator, Mapping
from typing import Final, NamedTuple

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.units import from_si, to_deg, to_dps
from plumbob.filters import mahony
from plumbob.papers.buoy.bench import KEPT, CalibratedUnit, Device, Sailed, Slid
from plumbob.papers.buoy.modules import WIDE_STEP, ModuleStatistics, Refused
from plumbob.papers.buoy.static_test import ANGLES, StaticTest
from plumbob.papers.buoy.trials import SETTLE, STROKES, bound
from plumbob.papers.description import BUOY
from plumbob.papers.outcome import Outcome

FIRST: Final = STROKES[0]
"""The set of strokes that the bars of the gate are about."""
KPS: Final = (0.1, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5)
"""Gains of the scan, 1/s."""
SCANNED: Final = ((3.0, 0.8), (1.5, 0.6))
"""Its strokes, m/s and s."""


class Results(NamedTuple):
    """All that the run found.

    Attributes
    ----------
    unit : CalibratedUnit
        The unit that goes through bytes.
    device : Device
        Its own program.
    static : (StaticTest, StaticTest)
        Beside the DCM260B, with the paper's card and the best one.
    slid : mapping of (float, float) to Slid
        By strokes.
    sailed : Sailed
        At sea.
    rings : mapping of str to ModuleStatistics
        Static test of many modules, by row.
    refused : mapping of str to Refused
        Captures that calibrate nothing.
    slides : mapping of (float, float) to mapping of str to ndarray (seeds, 2)
        Largest roll and pitch, deg, of many units, by strokes and contender.
    sea : mapping of str to ndarray (seeds, 3)
        Rms of roll, pitch and yaw, deg, of several units, by contender.
    scan : mapping of (float, float) to ndarray (gains, 2, 2)
        Largest roll and pitch, deg, by strokes and Kp, without the gate and with it.
    strongest : float
        Largest roll of any stroke to 3 m/s with Kp 0.5 and without the gate, deg.
    misprints : mapping of str to tuple of float
        What printed forms give.
    modules : int
        How many were turned on the table.
    """

    unit: CalibratedUnit
    device: Device
    static: tuple[StaticTest, StaticTest]
    slid: Mapping[tuple[float, float], Slid]
    sailed: Sailed
    rings: Mapping[str, ModuleStatistics]
    refused: Mapping[str, Refused]
    slides: Mapping[tuple[float, float], Mapping[str, Floats]]
    sea: Mapping[str, Floats]
    scan: Mapping[tuple[float, float], Floats]
    strongest: float
    misprints: Mapping[str, tuple[float, ...]]
    modules: int


def outcomes(found: Results) -> list[Outcome]:
    """Every figure, in the order of the paper."""
    parts = (_design, _boot, _events, _capture, _static, _modules, _slide, _sea)
    return [
        *(row for part in parts for row in part(found)),
        _claim(found),
        *(BUOY.row(f"literal.{key}", faithful=form[0]) for key, form in found.misprints.items()),
    ]


def sea_rms(sailed: Sailed, name: str) -> Floats:
    """Rms of roll, pitch and yaw, deg, (3,), once a minute has passed."""
    errors = sailed.errors[name][sailed.t >= SETTLE]
    return np.asarray(np.sqrt(np.mean(errors**2, axis=0))[::-1])


def _design(results: Results) -> Iterator[Outcome]:
    """Constants that the paper states, as the filter and the simulated parts have them."""
    params = mahony.Params()
    assert params.gate is not None
    for key, value in (("kp", params.kp), ("ki", params.ki), ("gate", params.gate / G0)):
        yield BUOY.row(key, faithful=value)
    yield BUOY.row("mag.step", faithful=float(from_si(WIDE_STEP, "mgauss")))


def _boot(results: Results) -> Iterator[Outcome]:
    """The start of the slide: what is removed of the rates, what it would do, and the first attitude."""
    slid, gyr = results.slid[FIRST], results.unit.paper.gyr
    assert gyr is not None
    bias = float(to_dps(np.abs(gyr.bias).max()))
    yield BUOY.row("boot.bias", faithful=bias)
    tilt = float(np.abs(slid.errors[KEPT][:, 1:]).max())
    yield BUOY.row("boot.kept", faithful=tilt)
    first = (float(np.abs(slid.errors[name][0, 1:]).max()) for name in ("gate 0.08 g", "mekf"))
    faithful, best = first
    yield BUOY.row("boot.first", faithful=faithful, best=best)


def _events(results: Results) -> Iterator[Outcome]:
    device = results.device
    for task, rate in device.rates.items():
        yield BUOY.row(f"rate.{task}", faithful=rate)
    yield BUOY.row("events.missed", faithful=float(sum(device.missed.values())))
    yield BUOY.row("events.idle", faithful=100.0 * device.idle)
    yield BUOY.row("log.same", faithful=100.0 * device.same)
    yield BUOY.row("log.years", faithful=device.years)
    for axis in ("roll", "pitch"):
        yield BUOY.row(f"device.{axis}", faithful=getattr(device, axis))


def _capture(results: Results) -> Iterator[Outcome]:
    yield BUOY.row("regions", faithful=float(results.unit.regions))
    yield BUOY.row("fewest", faithful=float(_fewest(results.unit.mag)))
    for key, refused in results.refused.items():
        yield BUOY.row(f"refused.{key}", faithful=100.0 * refused.failed, best=100.0 * refused.rightly)


def _fewest(mag: Floats) -> int:
    """Least count of readings with which the matrix of equation (12) has rank six."""
    x, y, z = (mag / np.abs(mag).max()).T
    rows = np.column_stack((-y * y, -z * z, 2.0 * x, 2.0 * y, 2.0 * z, np.ones_like(x)))  # [Yu2018] (12)
    return next(n for n in range(1, len(rows) + 1) if np.linalg.matrix_rank(rows[:n]) == rows.shape[1])


def _static(results: Results) -> Iterator[Outcome]:
    paper, best = results.static
    for name in ANGLES:
        before, after, ours = (to_deg(e.stats[name].max_abs) for e in (paper.before, paper.after, best.after))
        yield BUOY.row(f"static.before.{name}", faithful=before)
        yield BUOY.row(f"static.after.{name}", faithful=after, best=ours)


def _modules(results: Results) -> Iterator[Outcome]:
    rings = results.rings
    for capture in ("pitch", "roll", "faces"):
        yield BUOY.row(f"modules.yaw.{capture}", faithful=rings[capture].yaw95, best=rings[f"{capture}, chosen"].yaw95)
    yield BUOY.row("modules.level", faithful=rings["faces"].level95, best=rings["faces, chosen"].level95)
    yield BUOY.row("modules.all5", faithful=100.0 * rings["faces"].all5, best=100.0 * rings["faces, chosen"].all5)
    yield BUOY.row("modules.iron", faithful=rings["c 0.1"].yaw95, best=rings["c 0.1, general"].yaw95)
    yield BUOY.row("modules.alone", faithful=rings["magnetometer alone"].yaw95)


def _slide(results: Results) -> Iterator[Outcome]:
    first, slid = results.slides[FIRST], results.slid[FIRST]
    for column, axis in enumerate(("roll", "pitch")):
        open_, shut, new = (first[name][:, column] for name in ("no gate", "gate 0.08 g", "mekf"))
        yield BUOY.row(f"slide.open.{axis}", faithful=float(np.median(open_)))
        yield BUOY.row(f"slide.gated.{axis}", faithful=float(shut.max()), best=float(new.max()))
        yield BUOY.row(f"slide.reduction.{axis}", faithful=float(np.median(100.0 * (1.0 - shut / open_))))
        largest = {name: slid.largest(name)[column] for name in ("no gate", "gate 0.08 g", "mekf")}
        yield BUOY.row(
            f"slide.unit.{axis}", faithful=largest["gate 0.08 g"], best=largest["mekf"], largest=largest["no gate"]
        )
    for speed, stroke in STROKES:
        each = results.slides[speed, stroke]
        yield BUOY.row(
            f"slide.new.{speed:g}-{stroke:g}", faithful=float(each["gate 0.08 g"].max()), best=float(each["mekf"].max())
        )
    yield BUOY.row("slide.bound", faithful=results.strongest, bound=bound(3.0))


def _sea(results: Results) -> Iterator[Outcome]:
    for column, axis in enumerate(("roll", "pitch", "yaw")):
        faithful, best = (float(np.median(results.sea[name][:, column])) for name in ("gate 0.08 g", "mekf"))
        yield BUOY.row(f"sea.{axis}", faithful=faithful, best=best)
        rms = [float(sea_rms(results.sailed, name)[column]) for name in ("gate 0.08 g", "mekf")]
        yield BUOY.row(f"sea.unit.{axis}", faithful=rms[0], best=rms[1])
    yield BUOY.row("sea.output", best=float(results.sailed.lines / results.sailed.t[-1]))
    yield BUOY.row("sea.replay", best=100.0 * results.sailed.equal)


def _claim(results: Results) -> Outcome:
    """The largest error of any angle of the unit through bytes, at rest and sliding with the gate, and at sea."""
    worst = []
    for static, name in zip(results.static, ("gate 0.08 g", "mekf"), strict=True):
        at_rest = [to_deg(static.after.stats[angle].max_abs) for angle in ANGLES]
        moving = [float(np.abs(slid.errors[name]).max()) for slid in results.slid.values()]
        sailed = float(np.abs(results.sailed.errors[name][results.sailed.t >= SETTLE]).max())
        worst.append(max(*at_rest, *moving, sailed))
    return BUOY.row("claim", faithful=worst[0], best=worst[1])
