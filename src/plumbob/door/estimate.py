"""From a recording to an attitude, with what a reader should know of both: `plumbob run`, and `plumbob.estimate`."""

import math
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from plumbob.core import __version__, check, flags
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.errors import CalibrationError, ClockError, ParameterError, ShapeError
from plumbob.core.files import as_list
from plumbob.core.findings import Finding, as_json, info, lasting, warning, warnings
from plumbob.core.series import Series
from plumbob.core.text import counted
from plumbob.core.time import timing
from plumbob.core.units import Quantity, given, to_deg
from plumbob.data import AttitudeTrack, ImuData, calibration_told
from plumbob.data.earth_field import located, unlike
from plumbob.data.plausibility import upside_down
from plumbob.data.recording import Recording, findings, unsaved
from plumbob.door.reading import read, with_load
from plumbob.files import write
from plumbob.files.parquet import write_parquet
from plumbob.filters import SMOOTHER, Filter, offline
from plumbob.filters.settling import error_sensitivity, residual_covariance
from plumbob.rotations import Frame, North, dcm_from_quat, euler_zyx_from_quat, quat_rotate
from plumbob.rotations.frames import claimed_sd, counted_from, heading_zero

if TYPE_CHECKING:
    from plumbob.data.cards import CalibrationCard, NoiseCard
    from plumbob.filters.smoother import Smoother

Note = Callable[[str], None]
Progress = Callable[[int, int], None]

_OFTEN = 0.05  # share of samples behind a gap above which the declared unit of time is in doubt


class Follower(Protocol):
    """What looks at samples and attitudes while they are estimated."""

    def begin(self, samples: ImuData) -> None:
        """Be ready for these samples, as the filter is given them."""

    def take(self, imu: ImuData, track: AttitudeTrack) -> None:
        """Take consecutive samples and their attitudes."""


@dataclass(frozen=True, eq=False, repr=False)
class Estimated(Series):
    """An estimated attitude, and what belongs to it.

    `attitude` is the file that has it where one was written, or the last one alone where it was not to be kept; `imu`
    what the filter was given, after the card; `filter` is in its first state; `inferred` what the reader had to, for
    the notes of a file.
    """

    attitude: AttitudeTrack | Path
    outline: "Outline"
    imu: ImuData
    filter: "Filter | Smoother"
    name: str
    notes: tuple[Finding, ...]
    reference: AttitudeTrack | None = None
    noise_card: str | None = None
    inferred: tuple[Finding, ...] = ()
    applied: "CalibrationCard | None" = None

    @property
    def track(self) -> AttitudeTrack:
        """The attitude at every sample; read each time that it is asked for, where it was written as it came."""
        if isinstance(self.attitude, AttitudeTrack):
            return self.attitude
        track = read(self.attitude).track
        assert track is not None
        return track

    def facts(self) -> Mapping[str, str]:
        """Recording, filter, length, and the attitude at the end."""
        last = self.summary()["last_attitude_deg"]
        return {
            "recording": self.name,
            "filter": self.filter.name,
            "samples": str(self.outline.samples),
            "at the end": ", ".join(f"{name} {last[name]:.2f}°" for name in ("yaw", "pitch", "roll")),
        }

    @property
    def filter_words(self) -> str:
        """What ran, in words: what differs from the defaults."""
        facts = self.filter.facts()
        name = facts["name"] if facts["params"] == "defaults" else f"{facts['name']} ({facts['params']})"
        if isinstance(self.filter, Filter):
            return f"{name}: each attitude from the samples before it"
        lag = self.filter.params.lag
        if lag == 0.0:
            return f"{name}: the past smoothed now and then, and a filter on from there; nothing later is used"
        if lag is not None:
            return f"{name}: smoothed with a lag of {lag:g} s"
        return f"{name}: smoothed over the whole recording; --causal gives what a live system would have known"

    def columns(self) -> Mapping[str, NDArray[Any]]:
        """Of the track."""
        return self.track.columns()

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write the track, with where it comes from; errors as of `plumbob.write`."""
        write(path, _noted(self.name, self.inferred, self.track), overwrite=overwrite)

    def acceleration(
        self, *, gravity: float = G0, noise: "NoiseCard | str | Path | None" = None
    ) -> "EarthAcceleration":
        """Acceleration without gravity at every sample, by `earth_acceleration`; errors as of that."""
        return earth_acceleration(self.imu, self.track, gravity=gravity, noise=noise)

    def card(self) -> "CalibrationCard":
        """Card of the unit with the bias, scale and misalignment of its gyroscope that were found in use.

        It is the card that was applied, with a new part for the gyroscope and its covariance, or a first one.
        """
        return _card_in_use(self)

    def summary(self) -> dict[str, Any]:
        """All numbers, as JSON can hold them; angles in degrees."""
        outline, claimed = self.outline, None
        track = outline.last
        forward = quat_rotate(track.q_nb[-1], [1.0, 0.0, 0.0])
        heading = float(to_deg(float(np.arctan2(forward @ track.frame.east, forward @ track.frame.north)))) % 360.0
        angles = to_deg(euler_zyx_from_quat(track.q_nb[-1])).tolist()
        if track.cov_b is not None:  # none for a heading that is free
            sds = [float(sd[0]) for sd in claimed_sd(track.q_nb[-1:], track.cov_b[-1:])]
            is_claimed = {"inclination": math.isfinite(sds[0])}
            is_claimed["heading"] = math.isfinite(sds[1]) and track.north is not North.FREE
            claimed = {
                name: float(to_deg(sd)) if is_claimed[name] else None for name, sd in zip(is_claimed, sds, strict=True)
            }
        return {
            "frame": str(track.frame),
            "north": str(track.north),
            "calibration": self.imu.meta.calibration,
            "samples": outline.samples,
            "duration_s": outline.duration,
            "last_attitude_deg": {"heading": heading, **dict(zip(("yaw", "pitch", "roll"), angles, strict=True))},
            "flags": {name: outline.flags[name] for _, (name, _) in flags.MEANING.items() if name in outline.flags},
            "filter": self.filter.describe(),
            "declination_deg": offline.declination_deg(self.filter, track),
            "notes": as_json(self.notes),
            "noise_card": self.noise_card,
            "claimed_sd_deg": claimed,
        }

    def text(self) -> str:
        """What a reader wants to know first, a line each."""
        report = self.summary()
        last, north = report["last_attitude_deg"], report["north"]
        lines = [
            f"filter       {self.filter_words}",
            f"frame        {report['frame']}, heading from {counted_from(north, report['declination_deg'])}",
            f"calibration  {calibration_told(report['calibration'])}",
        ]
        if self.noise_card:
            lines.append(f"noise card   {self.noise_card}")
        lines.append(f"at the end   yaw {last['yaw']:.3f}°, pitch {last['pitch']:.3f}°, roll {last['roll']:.3f}°")
        lines.append(f"heading      {last['heading']:.3f}° clockwise from {heading_zero(north)}, of the body's x axis")
        if claims := report["claimed_sd_deg"]:
            said = ", ".join(f"{name} {'unknown' if sd is None else f'{sd:.3f}°'}" for name, sd in claims.items())
            lines.append(f"claimed      {said} (standard deviations at the end)")
        for name, count in report["flags"].items():
            lines.append(f"flag         {name}: {counted(count, 'sample')} ({100.0 * count / report['samples']:.2f} %)")
        return "\n".join(lines)


_DIRECTIONS: Final = {"E": "east", "N": "north", "U": "up", "D": "down", "W": "west"}  # letters of a frame's name


class EarthSeries(Series):
    """Mixin of what has values along the axes of a navigation frame, which can be written as a table."""

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write the columns as ``.csv`` or ``.parquet``; errors as of `plumbob.files.arrow.write_table`."""
        from plumbob.files.arrow import write_table

        write_table(Path(path), self.columns(), overwrite=overwrite)


@dataclass(frozen=True, eq=False, repr=False)
class EarthAcceleration(EarthSeries):
    """Acceleration of an accelerometer over the Earth, without gravity.

    `acc_n` (N, 3), m/s², along the axes of `frame`: in ENU positive towards east, north and up; NaN where the attitude
    or the specific force is not known. `sd_n`: its standard deviations, None where the filter claims no covariance.
    `gravity`: what was taken off, m/s².
    """

    t: Floats
    acc_n: Floats
    sd_n: Floats | None
    frame: Frame
    gravity: float

    def facts(self) -> Mapping[str, str]:
        """How many samples there are, their axes, and the gravity that was taken off."""
        return {"samples": str(len(self.t)), "frame": str(self.frame), "gravity": f"{self.gravity:g} m/s²"}

    def columns(self) -> Mapping[str, NDArray[Any]]:
        """Times, accelerations by the directions in which they are positive, and their standard deviations."""
        names = [f"acc_{_DIRECTIONS[letter]}" for letter in str(self.frame)]
        columns = {"t [s]": self.t} | {f"{name} [m/s2]": self.acc_n[:, i] for i, name in enumerate(names)}
        if self.sd_n is not None:
            columns |= {f"{name}_sd [m/s2]": self.sd_n[:, i] for i, name in enumerate(names)}
        return columns

    def displacement(self, *, low: float | str = "0.05 Hz", high: float | str = "1 Hz") -> "EarthDisplacement":
        """Way about its mean in these frequencies, of what floats: heave, and the level ways with the waves.

        NaN beside holes, and for half of the longest period at both ends, where what came before is not known.
        """
        from plumbob.quality.waves import displacement

        first, last = given("low", low, Quantity.FREQUENCY), given("high", high, Quantity.FREQUENCY)
        if first is None or last is None or not 0.0 < first < last:
            raise ParameterError(
                f"a way needs frequencies from a low one above 0 to a higher one, not {low} to {high}."
            )
        return EarthDisplacement(
            self.t, displacement(self.t, self.acc_n, step=1.0 / timing(self.t).rate, low=first, high=last), self.frame
        )


@dataclass(frozen=True, eq=False, repr=False)
class EarthDisplacement(EarthSeries):
    """Way `way_n` (N, 3), m, at times `t` (N,), s, along the axes of `frame`; NaN where it is not known."""

    t: Floats
    way_n: Floats
    frame: Frame

    def facts(self) -> Mapping[str, str]:
        """How many samples are known, and the axes."""
        return {"samples": str(np.count_nonzero(np.isfinite(self.way_n[:, 2]))), "frame": str(self.frame)}

    def columns(self) -> Mapping[str, NDArray[Any]]:
        """Times, and ways by the directions in which they are positive."""
        names = [f"way_{_DIRECTIONS[letter]} [m]" for letter in str(self.frame)]
        return {"t [s]": self.t} | dict(zip(names, self.way_n.T, strict=True))


def earth_acceleration(
    imu: ImuData, track: AttitudeTrack, *, gravity: float = G0, noise: "NoiseCard | str | Path | None" = None
) -> EarthAcceleration:
    """Acceleration without gravity in the axes of the navigation frame: C_nb f_b less the reaction to gravity.

    It is that of the accelerometer over the Earth, not of another point of the body. What the Earth's turning adds to a
    body that moves (0.00015 m/s² for each m/s) is left in.

    The standard deviation has the attitude's covariance, by which the specific force is turned; what the calibration
    leaves of the accelerometer, as if it were independent of that: at rest an offset tilts the attitude and cancels, so
    that it is too large rather than too small; and, with a noise card, white noise of a sample and bias instability. It
    has no error of `gravity`: the standard value is wrong by up to 0.03 m/s², along the vertical alone.

    Parameters
    ----------
    imu : ImuData
        Samples with an accelerometer.
    track : AttitudeTrack
        Attitude at their times.
    gravity : float
        Gravity at the place, m/s²; `plumbob.calibration.acc.normal_gravity` gives that of a latitude.
    noise : NoiseCard or path, optional
        Noise of the unit.

    Raises
    ------
    ShapeError
        If there is no accelerometer.
    ClockError
        If samples and attitude have different times.
    """
    if imu.acc is None:
        raise ShapeError("the recording has no accelerometer, from which to compute an acceleration. Record acc.")
    if not np.array_equal(imu.t, track.t):
        raise ClockError("samples and attitude have different times. Estimate the attitude from these samples.")
    card, acc = given_noise(noise), imu.usable("acc")
    c_nb = dcm_from_quat(track.q_nb)
    force_n = (c_nb @ acc[..., np.newaxis])[..., 0]
    acc_n, sd_n = force_n - gravity * np.asarray(track.frame.up), None
    if track.cov_b is not None:
        turned = np.cross(acc[:, np.newaxis, :], c_nb)  # δa = −C_nb [f_b]× δθ, row by row
        cov = turned @ track.cov_b @ np.swapaxes(turned, 1, 2)
        cov += residual_covariance(error_sensitivity(c_nb, force_n), imu.meta.left[0])
        if card is not None and card.acc is not None:
            var = card.acc.n_rpsd**2 * timing(imu.t).rate + card.acc.b**2
            cov += (c_nb * var) @ np.swapaxes(c_nb, 1, 2)
        sd_n = np.sqrt(np.diagonal(cov, axis1=1, axis2=2))
    return EarthAcceleration(imu.t, acc_n, sd_n, track.frame, gravity)


@dataclass(slots=True)
class Outline:
    """What is known of a track whose parts have come by: its length, its end, and its flags."""

    samples: int = 0  # number of samples
    begin: float = 0.0  # time of the first, s
    duration: float = 0.0  # from the first sample to the last, s
    last: AttitudeTrack = field(init=False)  # the last sample
    flags: Counter[str] = field(default_factory=Counter)  # how many samples carry each flag, by name

    def gather(
        self, parts: Iterable[AttitudeTrack], imu: ImuData, progress: Progress | None, follow: Follower | None
    ) -> Iterator[AttitudeTrack]:
        """The parts as they come, each shown with its samples to who follows; `progress` gets samples done, and all."""
        again = imu
        if progress is not None:
            progress(0, len(imu))
        if follow is not None:
            follow.begin(imu)
            again = imu.each(lambda part: part)  # a reader of its own: the filter's goes on from where that is
        for part in parts:
            if follow is not None:
                follow.take(again[self.samples : self.samples + len(part)], part)
            self.begin = self.begin if self.samples else float(part.t[0])
            self.samples += len(part)
            self.last, self.duration = part.end, float(part.t[-1]) - self.begin
            self.flags.update(flags.counts(np.asarray(part.flags)))
            if progress is not None:
                progress(self.samples, len(imu))
            yield part
            del part  # the next one may need its room


def estimate(
    recording: str | Path | Sequence[str | Path] | Recording | ImuData,
    filter: str | None = None,
    *,
    causal: bool = False,
    lag: float | str | None = None,
    params: Mapping[str, Any] | None = None,
    frame: Frame | str | None = None,
    init: str | None = None,
    calibration: "CalibrationCard | str | Path | None" = None,
    noise: "NoiseCard | str | Path | None" = None,
    place: str | None = None,
    date: str | None = None,
    profile: str | Path | None = None,
    unit: str | None = None,
    out: str | Path | None = None,
    overwrite: bool = False,
    follow: Follower | None = None,
    keep: bool = True,
    note: Note | None = None,
    progress: Progress | None = None,
) -> Estimated:
    """Estimate the attitude at every sample of a recording: smoothed, or with one filter.

    Parameters
    ----------
    recording : path, sequence of paths, Recording or ImuData
        Sensor data; a file of any format that `plumbob.read` takes, or files of one recording, with a sensor each.
    filter : str, optional
        Name of a causal filter, `plumbob.filter_names` lists them, or "smoother", which is the default: each attitude
        is then estimated from what came before and after it.
    causal : bool
        Estimate as on a stream by default: each attitude knows only what came before it, a lag of zero.
    lag : float or str, optional
        Smooth with a fixed lag, s: each attitude knows nothing that comes later than this after it. With a lag of
        zero it knows only what came before: the past is smoothed now and then, and a filter goes on from there.
    params : mapping, optional
        Its parameters: numbers in SI, or text with a unit, as ``{"gate": "0.08 g"}``.
    frame : Frame or str, optional
        Navigation frame of the result; by default that of the recording.
    init : str, optional
        What it starts from: "level", "ROLL,PITCH,HEADING" with units, or "truth", the reference's first attitude; by
        default its first samples. To the smoother the tilt is then known to a degree, unless the first seconds
        contradict it; the heading counts where no field gives one.
    calibration : CalibrationCard or path, optional
        Card of this unit, applied first, in place of that of a recorded line's session.
    noise : NoiseCard or path, optional
        Noise of this unit, for a filter that takes its parameters from it.
    place, date : str, optional
        Where and when it was recorded, ``LAT,LON[,HEIGHT]`` and ISO 8601: headings are then true.
    profile : path, optional
        What the columns of a text file mean.
    unit : str, optional
        Which of several units in the file, by name or number from 1.
    out : path, optional
        Where to write the track. A ``.parquet`` file is written while the attitude is estimated, and the samples of one
        without a reference are read meanwhile, so that neither is in memory as a whole.
    overwrite : bool
        Whether a file that lies there may be replaced.
    follow : Follower, optional
        What looks at samples and attitudes as they are estimated, part by part.
    keep : bool
        Whether the result holds the attitude at every sample; without it, and without `out`, neither the track nor the
        samples of a ``.parquet`` file are in memory as a whole.
    note : callable, optional
        Called with each note as soon as it is known; the result holds them too.
    progress : callable, optional
        Called with the number of samples done, and of all.

    Returns
    -------
    Estimated

    Raises
    ------
    ShapeError
        If the recording holds no sensor data.
    FrameError
        If neither `frame` nor the recording names a frame.
    ParameterError
        If the filter or a parameter is not known, two arguments say the same, or none of several units is named.
    CalibrationError
        If a card is for another unit, or the samples are calibrated already.
    DecodeError
        If a file cannot be read.
    """
    notes: list[Finding] = []
    written = None if out is None else check.path("out", out)
    native = written is not None and written.suffix.lower() == ".parquet"
    label, source, imu = opened_samples(recording, profile, unit, load=keep and not native, carded=calibration is None)
    named, settings = offline.lagged(filter, lag, params, causal=causal)
    stage = offline.Stage(named or SMOOTHER, dict(settings or {}), noise=given_noise(noise), init=init)
    frame = offline.navigation_frame(imu, None if frame is None else Frame.parse(frame), where=label)

    def say(*of: Finding, name: str = "") -> None:
        notes.extend(of)
        for finding in of if note is not None else ():
            note(f"{name}{finding}")  # type: ignore[misc]

    imu = imu if place is None and date is None else _placed(imu, place, date, stage, say)
    card = None if calibration is None else _card(calibration)
    imu, beyond = (imu, ()) if card is None else _calibrated(imu, card, recording, profile)
    doubt = warnings(lasting(source.notes))
    before = warnings(source.notes if card is None else (*lasting(source.notes), *findings(imu)))
    say(*before, *beyond, *upside_down(imu, frame), name=f"{source.name}: ")
    used, runs = offline.started(imu, stage, frame, source.track)
    made_by = offline.make_estimator(stage, frame, imu.meta) if isinstance(runs, Filter) else runs
    outline = Outline()
    parts = outline.gather(offline.track_parts(used, runs), used, progress, follow)
    if written is not None and native and source.track is None:
        attitude: AttitudeTrack | Path = written
        write_parquet(written, map(partial(_noted, source.name, doubt), parts), overwrite)  # a `for` would keep a part
    elif keep or written is not None:
        attitude = AttitudeTrack.joined(parts, len(used))
    else:
        deque(parts, maxlen=0)
        attitude = outline.last
    say(*(_restarts(imu, outline) if isinstance(made_by, Filter) else made_by.remarks))
    say(*offline.bias_beyond(made_by, outline.last))
    model = None if stage.noise is None else f"{stage.noise.device} ({stage.noise.source})"
    result = Estimated(attitude, outline, imu, made_by, source.name, tuple(notes), source.track, model, doubt, card)
    if written is not None and attitude is not written:
        result.save(written, overwrite=overwrite)
    return result


def _noted(name: str, inferred: Sequence[Finding], track: AttitudeTrack) -> Recording:
    return Recording(track=track, notes=(info("source.estimated", name=name, by=track.source), *inferred))


def opened_samples(
    given: str | Path | Sequence[str | Path] | Recording | ImuData,
    profile: str | Path | None,
    unit: str | None,
    *,
    load: bool,
    carded: bool = False,
) -> tuple[str, Recording, ImuData]:
    """What messages call it, the recording, and its samples, by its session's card if `carded`.

    ShapeError if it holds no sensor data.
    """
    if isinstance(given, ImuData):
        given = unsaved(given, "the samples")
    if isinstance(given, Recording):
        label, source = given.name, given.of_unit(unit)
    else:
        files = [check.path("recording", file) for file in as_list(given)]
        described = None if profile is None else Path(profile)
        path = files[0] if len(files) == 1 else files
        source = read(path, profile=described, whole=load, unit=unit, calibrated=carded).of_unit(None)
        label, source = str(files[0]), replace(source, name=files[0].name)
    if source.imu is None:
        raise ShapeError(f"{label} holds an attitude but no sensor data, so there is nothing to estimate from.")
    return label, source, source.imu


def given_noise(given: "NoiseCard | str | Path | None") -> "NoiseCard | None":
    """Noise card of what was given; None where nothing was."""
    if given is None:
        return None
    from plumbob.data.cards import NoiseCard

    return NoiseCard.of(given)


def _card(given: "CalibrationCard | str | Path") -> "CalibrationCard":
    from plumbob.data.cards import CalibrationCard

    return CalibrationCard.of(given)


def _calibrated(
    imu: ImuData, card: "CalibrationCard", source: Any, profile: Any
) -> tuple[ImuData, tuple[Finding, ...]]:
    """Samples with a card applied, which may ask for more columns of their file; how they leave its temperatures."""
    from plumbob.data.calibrated import apply_card, temperature_beyond

    if card.mag is not None and card.mag.loads and isinstance(source, str | Path):
        imu = with_load(imu, Path(source), card.mag.loads, profile)
    imu = imu.each(lambda part: apply_card(card, part))
    return imu, temperature_beyond(card, imu)


def _placed(
    imu: ImuData, place: str | None, date: str | None, stage: offline.Stage, say: Callable[..., None]
) -> ImuData:
    """Samples with the declination of their place, and a note of the field there."""
    if place is None:
        raise ParameterError("date needs place. Give both.")
    if "declination" in stage.params:
        raise ParameterError("place and the parameter declination both give the declination. Give one of them.")
    imu, field = located(imu, place, date=date)
    say(info("place.reference", field=field.description))
    if (doubt := unlike(imu, field)) is not None:
        say(doubt)
    return imu


IN_USE: Final = "in use, by the smoother"  # method of a calibration that a recording gave by the way


def _card_in_use(result: Estimated) -> "CalibrationCard":
    """Card with the gyroscope's part of a smoothed recording: `Estimated.card`."""
    from plumbob.data.cards import CalibrationCard, TriadCalibration

    learned = None if isinstance(result.filter, Filter) else result.filter.learned
    if learned is None:
        raise ParameterError(f"{result.filter.name} does not estimate scale and misalignment. Use the smoother.")
    card, meta = result.applied, result.imu.meta
    if card is None and meta.calibration is not None:
        raise CalibrationError(
            f"the samples have been calibrated already, with {meta.calibration}. Give the uncalibrated recording, and "
            "the card with calibration (--calibration)."
        )
    before = None if card is None else card.gyr
    dcm_bs = np.eye(3) if card is None or card.mount is None else dcm_from_quat(card.mount.q_bs)
    # rate = (I − M) gyr − b of calibrated rates, of the unit's own axes: one matrix and bias of the measured ones
    correction = dcm_bs.T @ (np.eye(3) - learned.matrix) @ dcm_bs
    matrix = correction if before is None else correction @ before.matrix
    change = np.linalg.inv(matrix)
    bias = change @ dcm_bs.T @ learned.bias
    first = np.eye(3) if before is None else before.matrix
    to_card = np.zeros((12, 12))
    to_card[:3, :3] = change @ dcm_bs.T
    to_card[3:, 3:] = -np.kron(dcm_bs.T, first.T @ dcm_bs.T)
    covariance = to_card @ learned.cov @ to_card.T
    part: dict[str, Any] = {
        "matrix": matrix,
        "bias": bias if before is None else before.bias + bias,
        "covariance": 0.5 * (covariance + covariance.T),
        "method": IN_USE,
        "date": datetime.now(UTC).date().isoformat(),
        "quality": None,
        "residual_rms": None,
        "remarks": (f"from {result.name}, {result.outline.duration:.0f} s",),
    }
    gyr = TriadCalibration(unit_in="rad/s", unit_out="rad/s", **part) if before is None else replace(before, **part)
    date = part["date"]
    if card is None:
        return CalibrationCard(meta.device, date, f"gyr: {IN_USE}", gyr=gyr, software=f"plumbob {__version__}")
    return replace(card, gyr=gyr, date=date, software=f"plumbob {__version__}")


def _restarts(imu: ImuData, outline: Outline) -> list[Finding]:
    """A filter that restarts all the time estimates nothing: most often time is in another unit than declared."""
    share = outline.flags[flags.MEANING[flags.GAP][0]] / outline.samples
    if share <= _OFTEN:
        return []
    return [warning("estimate.restarts", percent=100.0 * share, step=1.0 / timing(imu.t).rate)]
