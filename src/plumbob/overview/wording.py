"""Sentences of a page: what a reader must know of a recording, and what the words of the page mean."""

from collections.abc import Sequence
from typing import Final

from plumbob.data import UNCALIBRATED
from plumbob.overview.report_entry import Subject
from plumbob.quality import quality
from plumbob.quality.tilt import DEAD
from plumbob.rotations import North

BARE: Final = f"Calibration: {UNCALIBRATED}. All numbers of this page are of uncalibrated values."
"""What is said loudly where no card was applied."""


def remarks(subject: Subject) -> list[str]:
    """What a reader must know of a recording, a sentence each."""
    g, lines = subject.gathered, []
    if not subject.calibrated:
        lines.append(BARE)
    if g.traces.each > 1:
        lines.append(
            f"plots: each pair of points is the smallest and the largest of {g.traces.each} samples; statistics, "
            "spectra and flags are of all samples"
        )
    lines += [line for line in subject.remarks if not line.startswith("calibration: ")]
    if g.tilt is not None:
        for name, motion in (("roll", g.tilt.roll), ("pitch", g.tilt.pitch)):
            if motion.wrapped:
                lines.append(f"{name} went through ±180°, so that its mean, its deviation and its waves are left out")
    if subject.north is North.FREE:
        lines.append("headings count from an arbitrary zero, so that the rose shows directions against it")
    if g.spectra is not None and g.spectra.interpolated:
        lines.append(
            f"spectra: the samples of {g.spectra.interpolated} segments are not even in time and were interpolated, "
            "which damps high frequencies"
        )
    return lines


def definitions(subjects: Sequence[Subject]) -> tuple[str, ...]:
    """What the words of the page mean."""
    first = subjects[0].gathered
    spectra = next((subject.gathered.spectra for subject in subjects if subject.gathered.spectra is not None), None)
    welch = (
        ""
        if spectra is None
        else f"Segments of {spectra.length * spectra.step:.4g} s at {1.0 / spectra.step:.6g} Hz, resolution "
        f"{spectra.resolution:.3g} Hz; "
    )
    flagged = ", ".join(f"{flag} {word}" for flag, word in quality.MEANING.items())
    return (
        "Roll, pitch and yaw are ZYX Euler angles from the navigation frame to the body; heading is that of the body's "
        "x axis, clockwise from North; inclination is the angle between the body's vertical axis and the vertical. std "
        "is the standard deviation about the mean, rms that about zero. The band about a line is ± 1 standard "
        "deviation as the filter claims it; where it claims none, there is not a band.",
        "Waves of roll and pitch lie between zero up-crossings about the mean of their burst; the angle must have been "
        f"{DEAD:g} std below and above it on the two sides. A double amplitude is the highest less the lowest value "
        "of a wave; the significant one is the mean of the highest third (for a narrow-banded Gaussian process 4.00 "
        "std; Longuet-Higgins 1952, J. Mar. Res. 11, 245–266). Tz is the mean time between up-crossings, Tp the period "
        f"of the spectrum's peak. A burst lasts {first.burst:g} s, the last one up to half as much more; statistics of "
        "the whole are of all samples and of the waves of all bursts.",
        f"Spectra: Welch's method (1967, doi:10.1109/TAU.1967.1161901). {welch}Hann window, half overlapping, mean "
        "removed, one-sided, none across a gap or from burst to burst; from the 100th frequency on, values shown are "
        "means of bands of 1/60 decade.",
        "Heading statistics are circular: the mean is the direction of the mean vector, the spread √(−2 ln R) with its "
        "length R, the resultant (Mardia and Jupp 2000, doi:10.1002/9780470316979).",
        f"Quality flags are in the words of QARTOD: {flagged}; each is the worst of its tests. Tests and recommended "
        "thresholds follow its table for the time series of waves (cdip.ucsd.edu); thresholds that it leaves to the "
        "user are those of the table above.",
    )
