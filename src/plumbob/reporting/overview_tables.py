"""Tables and sentences about recordings: degrees, seconds and per cent, with the unit in every head."""

import math
from collections.abc import Sequence
from operator import attrgetter
from typing import Final

from plumbob.core import flags
from plumbob.core.findings import Finding, Note, info
from plumbob.core.text import number
from plumbob.core.units import to_deg
from plumbob.data import UNCALIBRATED
from plumbob.overview.report_entry import Subject
from plumbob.overview.streaming_stats import AXES, MOTION_NAMES, SHOWN_SCALE, TILT_NAMES, TRACED, UNITS, Burst, Gathered
from plumbob.quality import quality
from plumbob.quality.tilt import DEAD, Headings, TiltStatistics
from plumbob.reporting.content import Both, Table
from plumbob.rotations import North

NARROW: Final = 0.7  # spread of headings, rad, up to which they are drawn about their mean
_WAVES: Final = tuple(
    f"{axis} {kind}" for axis in ("roll", "pitch") for kind in ("std [°]", "significant [°]", "Tz [s]")
)
_ORDER: Final = (  # of the tables, those for every reader first
    "motion", "inclination", "headings", "wave table", "sensors", "gaps", "burst table", "grade", "quality",
    "thresholds", "sectors",
)  # fmt: skip


def tables(subject: Subject) -> dict[str, Table]:
    """Tables of one recording by the names of `_ORDER`."""
    g, grade = subject.gathered, subject.grade
    made = _bursts(subject) | ({} if g.tilt is None or g.headings is None else _attitude(g.tilt, g.headings))
    rows: list[tuple[str | Both, ...]] = []
    m, names = g.moments, [(name, axis) for name in g.triads for axis in AXES[name]]
    for triad, channel in [*names, ("temp", "temp")] if g.has("temp") else names:
        i, scale = TRACED.index(channel), SHOWN_SCALE[channel]
        values = (m.mean[i], m.sd[i], m.least[i], m.greatest[i]) if m.count[i] > 0 else (math.nan,) * 4
        label = channel.replace("_", " ") if triad != "temp" else "temperature"
        rows.append((f"{label} [{UNITS[triad]}]", *(number(float(v) * scale, 4) for v in values), str(int(m.count[i]))))
    if rows:
        made["sensors"] = Table("Sensors", ("", "mean", "std", "least", "greatest", "samples"), rows)
    meaning, longest = dict(flags.MEANING.values()), max((end - begin for begin, end in g.gaps), default=0.0)
    steps = f"longest step {longest:.6g} s, {g.missing} samples missing by the usual step of {1e3 * g.step:.6g} ms"
    rows = [("time in gaps", str(len(g.gaps)), percent(g.lost / max(g.duration, g.step)), steps if g.gaps else "–")]
    rows += [
        (name, str(runs.samples), percent(runs.samples / g.samples), meaning[name]) for name, runs in g.flags.items()
    ]
    made["gaps"] = Table("Gaps and flags", ("", "count", "share [%]", "meaning"), rows, words=(3,))
    if grade is not None:  # what it lost points for, the dearest first
        rows = [
            (
                "rest at the start" if criterion.name == "rest" else criterion.name,
                f"{criterion.lost:.3g}",
                f"{criterion.points:g}",
                Both(criterion.reason("; "), criterion.reason("；", "zh")),
            )
            for criterion in sorted(grade.criteria, key=attrgetter("lost"), reverse=True)
            if criterion.lost
        ]
        head = ("criterion", "points lost", "at most", "reason")
        title = f"Grade: {grade.points:g} of 100, {grade.word}"
        made["grade"] = Table(title, head, rows or [("none", "0", "100", "")], words=(3,))
    return {name: made[name] for name in _ORDER if name in made}


def _attitude(tilt: TiltStatistics, hdg: Headings) -> dict[str, Table]:
    """Roll and pitch with their waves, the angle from the vertical, and headings by a circle and by 16 sectors."""
    motions = [
        (
            name,
            *(degrees(getattr(m, attribute)) for attribute in MOTION_NAMES.values()),
            seconds(m.tz),
            seconds(m.tp),
            str(m.waves) if m.samples else "-",
        )
        for name, m in (("roll", tilt.roll), ("pitch", tilt.pitch))
    ]
    t = tilt.inclination
    angles = (degrees(getattr(t, attribute)) for attribute in TILT_NAMES.values())
    inclined = ("inclination", *angles, seconds(t.greatest_at), degrees(t.limit), percent(t.share_beyond))
    heading = ("heading", degrees(hdg.mean), degrees(hdg.spread), number(hdg.resultant), str(hdg.samples))
    shares = [(f"{22.5 * k:g}°", percent(float(share))) for k, share in enumerate(hdg.sectors(16))]
    return {
        "motion": Table("Roll and pitch", ("", *(f"{name} [°]" for name in MOTION_NAMES), "Tz [s]", "Tp [s]", "waves"),
                        motions),
        "inclination": Table("Inclination from the vertical",
                             ("", *(f"{name} [°]" for name in TILT_NAMES), "at [s]", "limit [°]", "beyond [%]"),
                             [inclined]),
        "headings": Table("Heading", ("", "mean [°]", "spread [°]", "resultant", "samples"), [heading]),
        "sectors": Table("Share of time by heading", ("sector about", "share [%]"), shares, detail="heading"),
    }  # fmt: skip


def _bursts(subject: Subject) -> dict[str, Table]:
    """Tilt and heading of each burst, its quality flags with the tests that did not pass, and what the tests ask."""
    bursts = subject.gathered.bursts
    channels = [name for name in quality.CHANNELS if any(name in burst.verdicts for burst in bursts)]
    angles, verdicts = [], []
    for burst in bursts:
        begin, tilt, hdg = subject.utc(burst.begin) or f"{burst.begin:.6g} s", burst.tilt.inclination, burst.headings
        angles.append((
            begin, f"{burst.end - burst.begin:.6g}", *_waves(burst.tilt), degrees(tilt.mean), degrees(tilt.greatest),
            percent(tilt.share_beyond), degrees(hdg.mean), degrees(hdg.spread),
        ))  # fmt: skip
        judged = [burst.verdicts.get(name) for name in channels]
        cells = [v and ": ".join(filter(None, (f"{v.flag} {quality.MEANING[v.flag]}", v.why))) for v in judged]
        verdicts.append((begin, *(cell or "-" for cell in cells)))
    head = ("begin", "length [s]", *_WAVES, "tilt mean [°]", "tilt greatest [°]", "beyond [%]", "heading mean [°]",
            "heading spread [°]")  # fmt: skip
    made = {} if subject.gathered.tilt is None else {"burst table": Table("Bursts", head, angles, detail="bursts")}
    if any(burst.waves for burst in bursts):
        made["wave table"] = Table("Waves", _SEA, [_sea(subject, burst) for burst in bursts if burst.waves], words=(9,))
    if channels:
        made["quality"] = Table("Quality flags by burst", ("begin", *channels), verdicts, detail="quality")
        made["thresholds"] = Table("Tests and their thresholds", ("test", "looks at", "suspect (3)", "fail (4)"),
                                   quality.THRESHOLDS, words=(1,), detail="quality")  # fmt: skip
    return made


_SEA: Final = ("begin", "Hm0 [m]", "95 % band [m]", "Tp [s]", "Tm02 [s]", "Tm-10 [s]", "direction from [°]", "± [°]",
               "spread [°]", "flag")  # fmt: skip


def _sea(subject: Subject, burst: Burst) -> tuple[str, ...]:
    """Cells of `_SEA`."""
    sea = burst.waves
    assert sea is not None
    why = ", ".join(name for name, flag in sea.tests.items() if flag != quality.PASS)
    return (
        subject.utc(burst.begin) or f"{burst.begin:.6g} s", seconds(sea.hm0),
        f"{seconds(sea.hm0_low)} to {seconds(sea.hm0_high)}", seconds(sea.tp), seconds(sea.tm02), seconds(sea.tm_10),
        degrees(sea.direction), degrees(sea.direction_sd), degrees(sea.spread),
        f"{sea.flag} {quality.MEANING[sea.flag]}{f': {why}' if why else ''}",
    )  # fmt: skip


def _waves(tilt: TiltStatistics) -> list[str]:
    """Cells of `_WAVES`."""
    return [text for m in (tilt.roll, tilt.pitch) for text in (degrees(m.sd), degrees(m.significant), seconds(m.tz))]


def comparison_table(subjects: Sequence[Subject]) -> Table:
    """Recordings beside each other."""
    head = ("recording", "duration [s]", "rate [Hz]", "time in gaps [%]", *_WAVES, "tilt greatest [°]",
            "heading mean [°]", "calibration", "grade")  # fmt: skip
    rows = []
    for subject in subjects:
        g, grade = subject.gathered, subject.grade
        tilt = ["-"] * 7 if g.tilt is None else [*_waves(g.tilt), degrees(g.tilt.inclination.greatest)]
        heading = "-" if g.headings is None else degrees(g.headings.mean)
        rows.append((
            subject.name, f"{g.duration:.6g}", f"{1.0 / g.step:.6g}", percent(g.lost / max(g.duration, g.step)), *tilt,
            heading, "yes" if subject.calibrated else "no", "-" if grade is None else f"{grade.points:g}",
        ))  # fmt: skip
    return Table("Recordings", head, rows)


def heading_circle(g: Gathered) -> tuple[float, float]:
    """Ends of the circle on which headings are drawn, degrees: where all are near one, it stands in the middle."""
    narrow = g.headings is not None and g.headings.samples > 0 and g.headings.spread < NARROW
    if not narrow:
        return 0.0, 360.0
    assert g.headings is not None
    middle = 10.0 * round(float(to_deg(g.headings.mean)) / 10.0)
    return (middle - 180.0, middle + 180.0) if abs(middle - 180.0) > 90.0 else (0.0, 360.0)


def degrees(angle: float) -> str:
    """Angle in degrees with two decimals; a dash where it is not known."""
    return f"{round(to_deg(angle), 2) + 0.0:.2f}" if math.isfinite(angle) else "-"  # without a sign of zero


def seconds(value: float) -> str:
    """Time with two decimals; a dash where it is not known."""
    return f"{value:.2f}" if math.isfinite(value) else "-"


def percent(share: float) -> str:
    """Share in per cent, with more decimals where it is small."""
    value = 100.0 * share
    if not math.isfinite(value):
        return "-"
    return f"{value:.2f}" if value >= 0.1 or value == 0.0 else f"{value:.1g}"


# What is said loudly where no card was applied.
BARE: Final = f"Calibration: {UNCALIBRATED}. All numbers of this page are of uncalibrated values."


def remarks(subject: Subject) -> list[Note]:
    """What a reader must know of a recording, a sentence each."""
    g, lines = subject.gathered, list[Note]()
    if not subject.calibrated:
        lines.append(BARE)
    if g.traces.each > 1:
        lines.append(info("page.envelope", samples=g.traces.each))
    lines += [finding for finding in subject.remarks if finding.code != "samples.uncalibrated"]
    if g.tilt is not None:
        wrapped = (g.tilt.roll, "page.roll_wrapped"), (g.tilt.pitch, "page.pitch_wrapped")
        lines += [info(code) for motion, code in wrapped if motion.wrapped]
    if subject.north is North.FREE:
        lines.append(info("page.free_north"))
    if g.spectra is not None and g.spectra.interpolated:
        lines.append(info("page.interpolated", segments=g.spectra.interpolated))
    return lines


def definitions(subjects: Sequence[Subject]) -> tuple[Finding, ...]:
    """What the words of the page mean."""
    first = subjects[0].gathered
    spectra = next((subject.gathered.spectra for subject in subjects if subject.gathered.spectra is not None), None)
    length, rate, resolution = None, None, None
    if spectra is not None:
        length, rate, resolution = spectra.length * spectra.step, 1.0 / spectra.step, float(spectra.frequency[0])
    return (
        info("page.angles"),
        info("page.waves", dead=DEAD, burst=first.burst),
        info("page.spectra", length=length, rate=rate, resolution=resolution),
        info("page.headings"),
        info("page.quality"),
    )
