"""From a recording to an attitude: read, calibrate, estimate, in chunks, with progress."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from plumbob.data import AttitudeTrack, ImuData, ImuMeta
from plumbob.errors import DecodeError, FrameError, ShapeError
from plumbob.filters import Filter, Start, takes_noise
from plumbob.filters.start import TRUTH_WORD
from plumbob.rotations import Frame

if TYPE_CHECKING:
    from plumbob.cards import CalibrationCard, NoiseCard
    from plumbob.io import Recording

SUFFIX: Final = ".mcap"
"""Of recordings of a line."""

CHUNK = 1 << 16
"""Samples handed to a filter at a time; the result does not depend on it."""

Progress = Callable[[int], None]


@dataclass(frozen=True, slots=True)
class Stage:
    """One way to estimate: a filter, its parameters, and a label for tables.

    Attributes
    ----------
    filter : str
        Name of the filter.
    params : Mapping
        Its parameters; numbers in SI, text with its unit.
    label : str
        How results are called; the filter's name where empty.
    noise : NoiseCard or None
        Noise of the unit, for a filter that takes its parameters from it; `params` has the last word.
    init : str or None
        What it starts from: "level", "ROLL,PITCH,HEADING" with units, or "truth", the reference's first attitude;
        None: its first samples.
    """

    filter: str
    params: Mapping[str, Any]
    label: str = ""
    noise: "NoiseCard | None" = None
    init: str | None = None

    @property
    def name(self) -> str:
        """Label, or the filter's name."""
        return self.label or self.filter


def read_any(path: str | Path, *, profile: Path | None = None) -> "Recording":
    """Read a file of any format: a recording of a line too, of which the samples are decoded anew from their bytes.

    Raises
    ------
    PlumbobError
        As `plumbob.io.read`, or as `plumbob.pipeline.recorded.read_recorded`.
    """
    from plumbob import io

    file = Path(path)
    if file.suffix == SUFFIX:
        from plumbob.pipeline.recorded import read_recorded

        return read_recorded(file)
    known = [suffix for kind in io.FORMATS for suffix in kind.suffixes]
    if file.suffix.lower() not in known:
        listed = f"known are {', '.join([SUFFIX, *known])}; raw bytes are for 'plumbob record --from'"
        raise DecodeError(f"{file}: the suffix '{file.suffix}' is unknown; {listed}.")
    return io.read(file, profile=profile)


def with_noise(stages: Sequence[Stage], card: "NoiseCard") -> list[Stage]:
    """Stages with a noise card for each filter that takes one; for all where none does, so that the filter refuses it.

    Parameters
    ----------
    stages : sequence of Stage
        Filters with their parameters.
    card : NoiseCard
        Noise of the unit.
    """
    takers = [stage.filter for stage in stages if takes_noise(stage.filter)]
    return [replace(stage, noise=card) if stage.filter in takers or not takers else stage for stage in stages]


def navigation_frame(imu: ImuData, asked: Frame | None, *, where: str) -> Frame:
    """Frame that was asked for, or that the recording names; never a guess.

    Raises
    ------
    FrameError
        If neither says one.
    """
    frame = asked or imu.meta.frame
    if frame is None:
        raise FrameError(f"{where} does not name a navigation frame; say --frame {', --frame '.join(Frame)}.")
    return frame


def calibrated(imu: ImuData, card: "CalibrationCard | None", *, live: bool = False) -> ImuData:
    """Recording, or a part of a stream (`live`), with the card applied, or as it is where there is none."""
    if card is None:
        return imu
    from plumbob.calib.model import apply_card

    return apply_card(card, imu, live=live)


def filter_of(stage: Stage, frame: Frame, meta: ImuMeta | None = None, *, start: Start | None = None) -> Filter:
    """Filter of a stage for samples with this meta; `Filter` has the rule of its headings.

    Parameters
    ----------
    stage : Stage
        Filter, parameters, noise card and start.
    frame : Frame
        Navigation frame of the result.
    meta : ImuMeta, optional
        What is known about the samples.
    start : Start, optional
        The start, where the stage leaves it to the truth.
    """
    init = None if stage.init == TRUTH_WORD else stage.init
    return Filter(stage.filter, frame=frame, params=stage.params, noise=stage.noise, init=start or init, meta=meta)


def recalibrated(recording: "Recording", card: "CalibrationCard") -> "Recording":
    """Recording with the card applied to its samples, and what is then found in them in its notes.

    Parameters
    ----------
    recording : Recording
        Uncalibrated samples; an attitude that comes with them stays as it is.
    card : CalibrationCard
        Of this very unit.

    Raises
    ------
    ShapeError
        If it has no samples.
    CalibrationError
        As `plumbob.apply_card`.
    """
    from plumbob.calib.model import temperature_beyond
    from plumbob.io.findings import findings, provenance

    if recording.imu is None:
        raise ShapeError(f"{recording.name} holds an attitude but no samples that a calibration card could correct.")
    imu = calibrated(recording.imu, card)
    beyond = () if (told := temperature_beyond(card, imu)) is None else (f"temperature: {told}",)
    return replace(recording, imu=imu, notes=(*provenance(recording.notes), *findings(imu), *beyond))


def estimate(
    imu: ImuData,
    stage: Stage,
    *,
    frame: Frame,
    reference: AttitudeTrack | None = None,
    progress: Progress | None = None,
) -> AttitudeTrack:
    """Attitude at every sample of a recording, with its covariance where the filter claims one.

    Headings are true where the recording knows its declination, and magnetic where it does not; see `located`.

    Parameters
    ----------
    imu : ImuData
        Calibrated samples.
    stage : Stage
        Filter, parameters and noise card.
    frame : Frame
        Navigation frame of the result.
    reference : AttitudeTrack, optional
        What a stage with init "truth" starts from; the track then begins with the first sample whose attitude it knows.
    progress : callable, optional
        Called with the number of samples done since the last call.
    """
    start = None
    if stage.init == TRUTH_WORD:
        from plumbob.pipeline.starts import start_from

        imu, start = start_from(reference, imu, filter_of(stage, frame, imu.meta))
    filter_ = filter_of(stage, frame, imu.meta, start=start)
    parts = []
    for chunk in imu.chunks(CHUNK):
        parts.append(filter_.process(chunk, covariance=True, look=False))  # the findings have been told
        if progress:
            progress(len(chunk))
    return AttitudeTrack.joined(parts)
