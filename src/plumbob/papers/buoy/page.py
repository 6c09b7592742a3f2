"""The buoy paper's page [Yu2018]: parts in the order of the paper."""

import math
from collections.abc import Mapping
from typing import Final

import numpy as np

from plumbob.core.units import from_si, to_deg, to_dps
from plumbob.papers.buoy import bench, figures, trials
from plumbob.papers.buoy.as_printed import KI, KP, loop
from plumbob.papers.buoy.bench import PERIODS
from plumbob.papers.buoy.figures import ANGLE, signed
from plumbob.papers.buoy.modules import STEP, WIDE_STEP
from plumbob.papers.buoy.outcomes import FIRST, KPS, SCANNED, Results, sea_rms
from plumbob.papers.buoy.static_test import ANGLES
from plumbob.papers.description import BUOY
from plumbob.quality.quality import FAIL, MEANING
from plumbob.quality.tilt import tilt_statistics
from plumbob.reporting.content import Figure, Table
from plumbob.reporting.report import Report
from plumbob.reporting.style import Both
from plumbob.rotations import euler_zyx_from_quat


def page(found: Results, seed: int) -> Report:
    """The page of a run."""
    parts = [_system(found), _events(found), _calibration(found), _static(found), _slide(found), _sea(found)]
    modules, units, seas = found.modules, len(found.slides[FIRST]["mekf"]), len(found.sea["mekf"])
    links = [(BUOY.text("report_of_the_sea"), f"buoy/{bench.REPORT}")] if found.sailed.page else []
    return BUOY.part(
        "page",
        seed=seed,
        device=found.unit.best.device,
        modules=modules,
        units=units,
        seas=seas,
        kp=KP,
        ki=KI,
        parts=[*parts, _misprinted(found)],
        links=links,
    )


def _system(results: Results) -> Report:
    same, slid = results.sailed.equal, results.slid[FIRST]
    gyr = results.unit.paper.gyr
    assert gyr is not None
    bias = ", ".join(signed(v, 1) for v in to_dps(gyr.bias))
    tilt = float(np.abs(slid.errors[bench.KEPT][:, 1:]).max())
    yaw, pitch, roll = (signed(v, 2) for v in slid.errors["gate 0.08 g"][0])
    return BUOY.part(
        "system",
        bias=bias,
        tilt=tilt,
        roll=roll,
        pitch=pitch,
        yaw=yaw,
        lines=results.sailed.lines,
        same="the same attitude to the bit" if same else "ANOTHER attitude",
        same_zh="与实时结果逐位一致" if same else "与实时结果不一致",
        tables=[BUOY.table("stages_of_the")],
        scenes=[figures.model(results.sailed.live, results.sailed.truth)],
    )


def _events(results: Results) -> Report:
    device = results.device
    names = BUOY.texts("events")
    rows = [
        [
            name,
            f"{PERIODS[task]}",
            f"{device.rates[task]:.2f}",
            f"{device.missed[task]}",
            f"{1e3 * device.latest[task]:.2f}",
            f"{device.waiting[task]}",
        ]
        for task, name in names.items()
    ]
    return BUOY.part(
        "events",
        device=device,
        idle=100 * device.idle,
        same="the same bits" if device.same else "OTHER bits",
        same_zh="逐位一致" if device.same else "不一致",
        tables=[BUOY.table("emulated_program_on", rows)],
        figures=[figures.fig4(device.calls, 0.16)],
    )


def _calibration(results: Results) -> Report:
    unit, card = results.unit, results.unit.paper.mag
    assert card is not None
    sizes = (np.linalg.norm(mag, axis=1) for mag in (unit.mag, (unit.mag - card.bias) @ card.matrix.T))
    spread = [100.0 * float(np.std(size) / np.mean(size)) for size in sizes]
    return BUOY.part(
        "calibration",
        regions=unit.regions,
        spread=spread[0],
        spread_2=spread[1],
        tables=[_ring_table(results), _refused_table(results)],
        figures=[figures.fig5(unit.mag_counts, unit.step)],
    )


_RING_ROWS: Final[Mapping[str, Both]] = BUOY.texts("ring_rows")


def _ring_table(results: Results) -> Table:
    rows = []
    for name, title in _RING_ROWS.items():
        fit = results.rings[name]
        shares = [f"{100 * share:.0f}" for share in (fit.within, fit.yaw5, fit.all5, fit.failed)]
        rows.append([title, f"{fit.before:.1f}", f"{fit.yaw:.2f}", f"{fit.yaw95:.2f}", f"{fit.level95:.2f}", *shares])
    title = BUOY.text("static_test_of_random", modules=results.modules)
    return BUOY.table("ring", rows, title=title)


def _refused_table(results: Results) -> Table:
    names = BUOY.texts("captures")
    rows = []
    for key, name in names.items():
        refused = results.refused[key]
        yaw = f"{refused.yaw:.0f}" if math.isfinite(refused.yaw) else "-"
        rows.append([name, f"{100 * refused.rightly:.0f}", f"{100 * refused.failed:.0f}", yaw])
    return BUOY.table("captures_that_calibrate", rows)


def _static(results: Results) -> Report:
    paper, best = results.static
    rows = []
    for name in ANGLES:
        cells = []
        for kind in ("max_abs", "rmse"):
            three = (getattr(e.stats[name], kind) for e in (paper.before, paper.after, best.after))
            cells += [f"{to_deg(value):.2f}" for value in three]
        rows.append([ANGLE[name], *cells])
    return BUOY.part("static", tables=[BUOY.table("errors_of_the", rows)], figures=[figures.fig7(paper, best)])


_CONTENDERS: Final[Mapping[str, Both]] = BUOY.texts("contenders")


def _strokes(pair: tuple[float, float]) -> str:
    return f"{pair[0]:g} m/s, {pair[1]:g} s"


def _slide(results: Results) -> Report:
    sets = list(results.slides)
    head = ("", *(_strokes(pair) for pair in sets))
    many = [
        [
            _CONTENDERS[name],
            *(" / ".join(f"{v:.2f}" for v in np.median(results.slides[pair][name], axis=0)) for pair in sets),
        ]
        for name in trials.SLIDE
    ]
    worst = [
        [_CONTENDERS[name], *(" / ".join(f"{v:.2f}" for v in results.slides[pair][name].max(axis=0)) for pair in sets)]
        for name in trials.SLIDE
    ]
    single = [
        [name, *(" / ".join(f"{v:.2f}" for v in results.slid[pair].largest(key)) for pair in sets)]
        for key, name in _CONTENDERS.items()
    ]
    units = len(results.slides[FIRST]["mekf"])
    tables = [
        BUOY.table("largest_roll_pitch", many, units=units, head=head),
        BUOY.table("same_worst_of", worst, units=units, head=head),
        BUOY.table("unit_through_bytes", single, head=head),
        _gain_table(results),
    ]
    pi = loop()
    return BUOY.part(
        "slide",
        kp=KP,
        bound=trials.bound(3.0),
        strongest=results.strongest,
        poles=signed(pi.poles[0], 3),
        pi_poles=signed(pi.poles[1], 4),
        damping=pi.damping,
        peak=5 * pi.peak,
        tables=tables,
        figures=[figures.fig8(results.slid[FIRST]), _gain_figure(results)],
    )


def _gain_table(results: Results) -> Table:
    head = ["Kp [1/s]"]
    for pair in SCANNED:
        head += [BUOY.text("no_gate", pair=_strokes(pair)), BUOY.text("gate_0_08_g_2")]
    rows = []
    for k, kp in enumerate(KPS):
        cells = [" / ".join(f"{v:.1f}" for v in results.scan[pair][k, :, gate]) for pair in SCANNED for gate in (0, 1)]
        rows.append([f"{kp:g}", *cells])
    return BUOY.table("largest_roll_pitch_by", rows, head=head)


def _gain_figure(results: Results) -> Figure:
    scans = {
        BUOY.text("no_gate", pair=_strokes(pair)): (results.scan[pair][:, 0, 0], results.scan[pair][:, 0, 1])
        for pair in SCANNED
    }
    return figures.gains(KPS, scans)


_SEA: Final[Mapping[str, Both]] = BUOY.texts("sea")


def _sea(results: Results) -> Report:
    rows = []
    for key, name in _SEA.items():
        many = np.median(results.sea[key], axis=0) if key in results.sea else np.full(3, np.nan)
        cells = [*many, *sea_rms(results.sailed, key)]
        rows.append([name, *("-" if math.isnan(v) else f"{v:.3f}" for v in cells)])
    seas = len(results.sea["mekf"])
    axes = [ANGLE[name] for name in ("roll", "pitch", "yaw")]
    head = (
        "",
        *(BUOY.text("seas", seas=seas, axis=axis) for axis in axes),
        *(BUOY.text("bytes", axis=axis) for axis in axes),
    )
    return BUOY.part(
        "sea",
        tables=[BUOY.table("rms_error_in", rows, head=head), _tilt_table(results), _quality_table(results)],
        figures=[figures.waves(results.sailed)],
    )


def _misprinted(results: Results) -> Report:
    step, wide_step = (from_si(value, "mgauss") for value in (STEP, WIDE_STEP))
    table = BUOY.table("misprints", forms=results.misprints, step=step, wide_step=wide_step)
    return BUOY.part("misprinted", tables=[table])


def _tilt_table(results: Results) -> Table:
    """Statistics of tilt by the report, whose filter is the smoother, beside the true ones."""
    truth = results.sailed.truth
    _, pitch, roll = euler_zyx_from_quat(truth.q_nb).T
    true = tilt_statistics(truth.t, roll, pitch)
    ours = results.sailed.overview.subjects[0].gathered.tilt
    assert ours is not None
    rows = []
    for name in ("roll", "pitch"):
        for who, tilt in ((BUOY.text("report"), getattr(ours, name)), (BUOY.text("truth"), getattr(true, name))):
            label = BUOY.text("angle_by", name=name, who=who, angle_name=ANGLE[name])
            angles = [f"{to_deg(v):.2f}" for v in (tilt.sd, tilt.significant, tilt.largest)]
            rows.append([label, *angles, f"{tilt.tz:.2f}", f"{tilt.tp:.2f}", f"{tilt.waves}"])
    return BUOY.table("tilt_statistics_of", rows)


def _quality_table(results: Results) -> Table:
    """Quality flags by burst, and why where one is not a pass."""
    channels = BUOY.texts("channels")
    words = {1: "通过", 2: "未评估", 3: "可疑", FAIL: "不合格", 9: "缺失"}
    tests = {"gap": "缺样", "percent good": "有效率"}
    rows = []
    for burst in results.sailed.overview.subjects[0].gathered.bursts:
        cells = []
        for channel in channels:
            qc = burst.verdicts[channel]
            why = f": {qc.why}" if qc.why else ""
            zh = f"：{tests.get(qc.why, qc.why)}" if qc.why else ""
            cells.append(
                BUOY.text("flag_and_why", flag=qc.flag, qc_flag=MEANING[qc.flag], why=why, flag_2=words[qc.flag], zh=zh)
            )
        tilt = burst.tilt.inclination
        rows.append([f"{burst.begin:.0f} s", *cells, f"{to_deg(tilt.mean):.1f}", f"{to_deg(tilt.greatest):.1f}"])
    head = (BUOY.text("burst"), *channels.values(), BUOY.text("tilt_mean"), BUOY.text("greatest"))
    return BUOY.table("quality_flags_by", rows, head=head)
