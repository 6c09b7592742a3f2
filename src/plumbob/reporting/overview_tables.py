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
from plumbob.overview.streaming_stats import AXES, MOTION_NAMES, SHOWN_SCALE, TILT_NAMES, TRACED, UNITS, Gathered
from plumbob.quality import quality
from plumbob.quality.grade import Grade
from plumbob.quality.tilt import DEAD, Headings, Inclination, TiltMotion, TiltStatistics
from plumbob.reporting.content import Both, Table
from plumbob.rotations import North

NARROW: Final = 0.7  # spread of headings, rad, up to which they are drawn about their mean
_WAVES: Final = ("std [°]", "significant [°]", "Tz [s]")


def tables(subject: Subject) -> list[Table]:
    """Tables of one recording, those for every reader first."""
    g = subject.gathered
    parts = []
    if g.tilt is not None and g.headings is not None:
        parts += [
            motion_table(g.tilt.roll, g.tilt.pitch),
            inclination_table(g.tilt.inclination),
            heading_table(g.headings),
        ]
    if g.triads or g.has("temp"):
        parts.append(sensor_table(g))
    parts.append(flag_table(g))
    if g.tilt is not None:
        parts.append(burst_table(subject))
    if subject.grade is not None:
        parts.append(grade_table(subject.grade))
    qualities = quality_table(subject)
    if qualities.rows:
        parts += [qualities, threshold_table()]
    if g.headings is not None:
        parts.append(sector_table(g.headings))
    return parts


def motion_table(roll: TiltMotion, pitch: TiltMotion) -> Table:
    """Statistics of roll and pitch, with their waves."""
    head = ("", *(f"{name} [°]" for name in MOTION_NAMES), "Tz [s]", "Tp [s]", "waves")
    rows = [
        (
            name,
            *(degrees(getattr(m, attribute)) for attribute in MOTION_NAMES.values()),
            seconds(m.tz),
            seconds(m.tp),
            str(m.waves) if m.samples else "-",
        )
        for name, m in (("roll", roll), ("pitch", pitch))
    ]
    return Table("Roll and pitch", head, rows)


def _waves(tilt: TiltStatistics) -> list[str]:
    """Cells of `_WAVES` of roll and of pitch."""
    return [text for m in (tilt.roll, tilt.pitch) for text in (degrees(m.sd), degrees(m.significant), seconds(m.tz))]


def inclination_table(tilt: Inclination) -> Table:
    """Angle from the vertical, and how long it was beyond the limit."""
    head = ("", *(f"{name} [°]" for name in TILT_NAMES), "at [s]", "limit [°]", "beyond [%]")
    angles = (degrees(getattr(tilt, attribute)) for attribute in TILT_NAMES.values())
    row = ("inclination", *angles, seconds(tilt.greatest_at), degrees(tilt.limit), percent(tilt.share_beyond))
    return Table("Inclination from the vertical", head, [row])


def heading_table(hdg: Headings) -> Table:
    """Circular mean and spread."""
    head = ("", "mean [°]", "spread [°]", "resultant", "samples")
    return Table("Heading", head, [("heading", degrees(hdg.mean), degrees(hdg.spread), number(hdg.resultant),
                                    str(hdg.samples))])  # fmt: skip


def sector_table(headings: Headings) -> Table:
    """Share of the samples in each of 16 sectors."""
    rows = [(f"{22.5 * k:g}°", percent(float(share))) for k, share in enumerate(headings.sectors(16))]
    return Table("Share of time by heading", ("sector about", "share [%]"), rows, detail="heading")


def sensor_table(g: Gathered) -> Table:
    """Mean, deviation and extremes of each axis."""
    rows = []
    names = [(name, axis) for name in g.triads for axis in AXES[name]] + ([("temp", "temp")] if g.has("temp") else [])
    for triad, channel in names:
        i, scale = TRACED.index(channel), SHOWN_SCALE[channel]
        m = g.moments
        has_samples = m.count[i] > 0
        values = (m.mean[i], m.sd[i], m.least[i], m.greatest[i]) if has_samples else (math.nan,) * 4
        label = channel.replace("_", " ") if triad != "temp" else "temperature"
        rows.append((f"{label} [{UNITS[triad]}]", *(number(float(v) * scale, 4) for v in values), str(int(m.count[i]))))
    return Table("Sensors", ("", "mean", "std", "least", "greatest", "samples"), rows)


def flag_table(g: Gathered) -> Table:
    """Gaps and flags with their counts."""
    meaning = dict(flags.MEANING.values())
    longest = max((end - begin for begin, end in g.gaps), default=0.0)
    steps = f"longest step {longest:.6g} s, {g.missing} samples missing by the usual step of {1e3 * g.step:.6g} ms"
    rows = [("time in gaps", str(len(g.gaps)), percent(g.lost / max(g.duration, g.step)), steps if g.gaps else "–")]
    rows += [
        (name, str(runs.samples), percent(runs.samples / g.samples), meaning[name]) for name, runs in g.flags.items()
    ]
    return Table("Gaps and flags", ("", "count", "share [%]", "meaning"), rows, words=(3,))


def burst_table(subject: Subject) -> Table:
    """Tilt and heading of each burst."""
    waves = [f"{name} {what}" for name in ("roll", "pitch") for what in _WAVES]
    head = ("begin", "length [s]", *waves, "tilt mean [°]", "tilt greatest [°]", "beyond [%]", "heading mean [°]",
            "heading spread [°]")  # fmt: skip
    rows = []
    for burst in subject.gathered.bursts:
        tilt = burst.tilt.inclination
        rows.append((
            subject.utc(burst.begin) or f"{burst.begin:.6g} s", f"{burst.end - burst.begin:.6g}", *_waves(burst.tilt),
            degrees(tilt.mean), degrees(tilt.greatest), percent(tilt.share_beyond), degrees(burst.headings.mean),
            degrees(burst.headings.spread),
        ))  # fmt: skip
    return Table("Bursts", head, rows, detail="bursts")


def grade_table(grade: Grade) -> Table:
    """Grade of a recording, and what it lost points for, the dearest first."""
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
    title = f"Grade: {grade.points:g} of 100, {grade.word}"
    return Table(
        title, ("criterion", "points lost", "at most", "reason"), rows or [("none", "0", "100", "")], words=(3,)
    )


def quality_table(subject: Subject) -> Table:
    """Quality flag of each burst and channel, with the tests that did not pass."""
    channels = [name for name in quality.CHANNELS if any(name in burst.verdicts for burst in subject.gathered.bursts)]
    rows = []
    for burst in subject.gathered.bursts if channels else ():
        verdicts = [burst.verdicts.get(name) for name in channels]
        words = [v and ": ".join(filter(None, (f"{v.flag} {quality.MEANING[v.flag]}", v.why))) for v in verdicts]
        rows.append((subject.utc(burst.begin) or f"{burst.begin:.6g} s", *(cell or "-" for cell in words)))
    return Table("Quality flags by burst", ("begin", *channels), rows, detail="quality")


def threshold_table() -> Table:
    """What the tests ask."""
    head = ("test", "looks at", "suspect (3)", "fail (4)")
    return Table("Tests and their thresholds", head, quality.thresholds(), words=(1,), detail="quality")


def comparison_table(subjects: Sequence[Subject]) -> Table:
    """Recordings beside each other."""
    waves = [f"{name} {what}" for name in ("roll", "pitch") for what in _WAVES]
    head = ("recording", "duration [s]", "rate [Hz]", "time in gaps [%]", *waves, "tilt greatest [°]",
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
