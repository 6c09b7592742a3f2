"""From a capture to a calibration card: `plumbob calibrate`, in Python and on the command line."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from plumbob.calibration.calibration import Calibrated, Capture, capture, card_of
from plumbob.core import check
from plumbob.core.constants import G0
from plumbob.core.errors import CalibrationError, DecodeError, FrameError, ParameterError, unknown_name
from plumbob.core.findings import warnings
from plumbob.core.units import Quantity, dps, g, given, numbers
from plumbob.data import TRIADS, AttitudeTrack, ImuData
from plumbob.data.cards import CalibrationCard
from plumbob.data.earth_field import earth_field_at, parse_place
from plumbob.data.recording import Recording
from plumbob.door.reading import read, with_load
from plumbob.rotations import Frame

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from plumbob.calibration.calibrate_gyro import Plateau
    from plumbob.calibration.counts import CountsCalibration
    from plumbob.calibration.fit import Fitted, Mounted

Note = Callable[[str], None]
Value = float | str | None


def calibrate(
    recording: Capture | str | Path | Recording | ImuData,
    kind: str,
    *,
    calibration: CalibrationCard | str | Path | None = None,
    device: str | None = None,
    start: Value = None,
    stop: Value = None,
    profile: str | Path | None = None,
    note: Note | None = None,
    **options: Any,
) -> Calibrated:
    """Calibrate a unit from a capture.

    Parameters
    ----------
    recording : path, Recording, ImuData or Capture
        What was recorded for it, uncalibrated.
    kind : {"hand", "mag", "accel", "gyro", "ferraris", "table", "temperature", "currents", "mount"}
        What is calibrated.
    calibration : CalibrationCard or path, optional
        The card so far: applied to the other triads, and completed.
    device : str, optional
        The unit, where the recording does not name it.
    start, stop : float or str, optional
        Part of the recording: s, or text with a unit.
    profile : path, optional
        What the columns of a text file mean.
    note : callable, optional
        Called with each note on the way.
    **options
        Of the kind; see `kind_options`. Numbers are SI, or text with a unit.
    gravity, latitude, height : float or str, optional
        Of accel and hand: gravity at the place, m/s2; or its latitude, rad, with its height above the sea, m. The
        standard one sets the scale, too, and moves no horizon. Of table: a latitude takes the Earth's rate out.
    strength : float or str, optional
        Of mag and hand: strength of the field at the place, µT, as ``"48.5 uT"``.
    place : str, optional
        Of mag and hand: where the capture was taken, ``LAT,LON[,HEIGHT]``; takes the field of the World Magnetic Model.
    shape : str
        Of accel: "six" or "axes" give bias and scale, from pairs of faces or any poses, "ellipsoid" misalignment too.
        Of mag: model of the distortion, "sphere", "axes", "ellipsoid", or "level" for a unit that cannot tilt. "auto"
        tests which is needed.
    moving : bool
        Of accel: turned slowly without rests, beside a gyroscope.
    with_ : {"auto", "none", "acc", "gyr"}
        Of mag: sensors that help.
    in_use : bool
        Of mag: a long record of a unit at work, which nobody turned for it: hard and soft iron by the gyroscope.
    tilt : float or str, optional
        Of mag: inclination up to which headings count, rad; by default 45°.
    method : {"auto", "rest", "hand", "stops", "ferraris"}
        Of gyro: how; "auto" says which.
    preset : {"trackball"}, optional
        Of gyro: bias at rest with a paper's coefficients, not measured ones.
    parts : path, optional
        Of gyro by Ferraris: where the parts of a session lie, ``part,from_s,to_s``.
    angle : float or str, optional
        Of gyro: of each turn, rad: by default 90° from stop to stop, 360° in a Ferraris session.
    turns : str, optional
        Of gyro by stops: axis and angle of each turn, as ``"x 90deg, x -90deg"``.
    angle_sd : float or str, optional
        Of gyro by stops: how exactly a turn ends, standard deviation, rad; by default 0.5°.
    rates : str or sequence of float, optional
        Of table: its rates, rad/s, as '50,100,200 deg/s'; plateaus are found.
    plan : path, optional
        Of table: plateaus, ``from_s,to_s,rate_x_dps,… [,acc_x_g,…]``.
    model : {"auto", "12", "21"}
        Of table: 21 parameters have g-sensitivity.
    triad : {"gyr", "acc", "mag"}
        Of temperature: which; accelerometer and magnetometer complete their part of the card.
    current : sequence of str
        Of currents: further columns of a text file, throttle, current or speed, whose field is found and taken off; of
        `ImuData` its load, of which these are the names.
    mounting : float or str
        Of table: tilt of the unit on it, rad.
    frame : Frame or str, optional
        Of mount: body axes, z down in NED, z up in ENU and NWU; needed for poses.
    level, raised : (float, float), optional
        Of mount: when the body was level, by default the first rest, and when its nose was raised, by default the rest
        that leans most.
    level_only : bool
        Of mount: roll and pitch only; heading of the mounting taken as zero.
    reference, estimate : path, optional
        Of mount: attitude of the body, and that of the unit, instead of poses.

    Returns
    -------
    Calibrated

    Raises
    ------
    CaptureRefusedError
        If the capture cannot calibrate it; its reasons say what was missing and what to do.
    CalibrationError
        If the recording is calibrated already, lacks a triad, or belongs to another unit than the card.
    ParameterError
        If the kind or an option is not known, or two options say the same.
    DecodeError
        If a file cannot be read.
    """
    how = KINDS[check.one_of("kind", kind, tuple(KINDS))]
    names = kind_options(kind)
    if unknown := [name for name in options if name not in names]:
        raise unknown_name("option", unknown[0], names, of=kind)
    if "triad" in options:
        how = how._replace(triads=(check.one_of("triad", options["triad"], TRIADS),))
    base = None if calibration is None else CalibrationCard.of(calibration)
    if isinstance(recording, Capture):
        opened = recording
    else:
        loads = tuple(options.get("current", ()))
        span, described = as_span(start, stop), None if profile is None else Path(profile)
        opened = _opened(recording, how, base, device, span, described, loads)
    say = note or (lambda line: None)
    for finding in () if opened is recording else opened.found:
        say(str(finding))
    fits, mounted = how.find(opened, say, **options)
    return Calibrated(card_of(opened, fits, mounted=mounted), fits, opened)


def read_capture(
    path: str | Path,
    *,
    triads: tuple[str, ...],
    if_present: tuple[str, ...] = (),
    profile: Path | None = None,
    span: tuple[float, float] | None = None,
    device: str | None = None,
    base: CalibrationCard | None = None,
    load: Sequence[str] = (),
) -> Capture:
    """Read a capture; arguments and errors as of `plumbob.calibration.calibration.capture`, and of a file.

    `load` names further columns that are the load of `kind` currents.
    """
    recording = read(path, profile=profile).of_unit(None)
    if recording.imu is None:
        raise CalibrationError(f"{path} holds an attitude but no sensor data, so there is nothing to calibrate.")
    imu = with_load(recording.imu, Path(path), load, profile) if load else recording.imu
    captured = capture(imu, triads=triads, if_present=if_present, span=span, device=device, base=base)
    # That it is uncalibrated is what a capture is for.
    findings = tuple(finding for finding in warnings(recording.notes) if finding.code != "samples.uncalibrated")
    return replace(captured, found=findings)


def require_card_place(
    out: Path | None, device: str, made: Collection[str], base: CalibrationCard | None, *, force: bool
) -> None:
    """Refuse to write a card over that of another unit, one that has more, or a part over another without --force."""
    if out is None or not out.is_file():
        return
    try:
        there = CalibrationCard.load(out)
    except DecodeError:
        return
    if there.device != device:
        raise ParameterError(f"{out} is the card of '{there.device}', not of '{device}'; name another file.")
    if lost := [name for name in there.parts if name not in {*made, *(base.parts if base else ())}]:
        raise ParameterError(
            f"{out} has {' and '.join(lost)}, which this would lose; complete it with --calibration {out}, or name "
            "another file."
        )
    if not force and (again := [name for name in there.parts if name in made]):
        raise ParameterError(f"{out} has {' and '.join(again)} already. Name another file, or replace it with --force.")


def kind_options(kind: str) -> tuple[str, ...]:
    """Options that a kind takes beside those of every kind."""
    return tuple(signature(KINDS[kind].find).parameters)[2:]


def as_span(start: Value, stop: Value) -> tuple[float, float] | None:
    """Part of a recording, s, from its start or to its end where one is not given; None for the whole."""
    first, last = given("start", start, Quantity.TIME), given("stop", stop, Quantity.TIME)
    if first is None and last is None:
        return None
    return 0.0 if first is None else first, float("inf") if last is None else last


def _opened(
    recording: str | Path | Recording | ImuData,
    how: "Kind",
    base: CalibrationCard | None,
    device: str | None,
    span: tuple[float, float] | None,
    profile: Path | None,
    load: Sequence[str],
) -> Capture:
    how_read: dict[str, Any] = {
        "triads": how.triads, "if_present": how.if_present, "span": span, "device": device, "base": base
    }  # fmt: skip
    if not isinstance(recording, Recording | ImuData):
        return read_capture(check.path("recording", recording), profile=profile, load=load, **how_read)
    imu = recording.of_unit(None).imu if isinstance(recording, Recording) else recording
    if imu is None:
        raise CalibrationError("the recording holds an attitude but no sensor data, so there is nothing to calibrate.")
    return capture(imu, **how_read)


Found = tuple["Mapping[str, Fitted]", "Mounted | None"]


def _mag(
    opened: Capture,
    say: Note,
    *,
    with_: str = "auto",
    shape: str = "auto",
    strength: Value = None,
    place: str | None = None,
    tilt: Value = None,
    in_use: bool = False,
    force: bool = False,
) -> Found:
    from plumbob.calibration.calibrate_mag import calibrate_mag
    from plumbob.calibration.predicted import TILT_RANGE

    if shape == "level" and tilt is not None:
        raise ParameterError("shape level calibrates headings of a level unit, so tilt has no effect. Leave one out.")
    tilt_range = given("tilt", tilt, Quantity.ANGLE)
    field, dip, remarks = _field(opened, say, strength, place)
    fit = calibrate_mag(
        opened.imu,
        with_=with_,
        shape=shape,
        strength=field,
        dip=dip,
        tilt_range=TILT_RANGE if tilt_range is None else tilt_range,
        acc_calibrated=opened.calibrated("acc"),
        gyr_calibrated=opened.calibrated("gyr"),
        in_use=in_use,
        force=force,
    )
    return {"mag": replace(fit, remarks=(*fit.remarks, *remarks))}, None


def _accel(
    opened: Capture,
    _say: Note,
    *,
    shape: str = "auto",
    moving: bool = False,
    gravity: Value = None,
    latitude: Value = None,
    height: Value = None,
) -> Found:
    from plumbob.calibration.acc import calibrate_accel

    at = chosen_gravity(gravity=gravity, latitude=latitude, height=height)
    return {"acc": calibrate_accel(opened.imu, shape=shape, gravity=at, moving=moving)}, None


def _gyro(
    opened: Capture,
    _say: Note,
    *,
    method: str = "auto",
    preset: str | None = None,
    angle: Value = None,
    turns: str | None = None,
    angle_sd: Value = None,
) -> Found:
    from plumbob.calibration import calibrate_gyro as gyro

    if preset is not None:
        check.one_of("preset", preset, ("trackball",))
        return {"gyr": gyro.fit_gyro(opened, "trackball")}, None
    check.one_of("method", method, ("auto", "rest", "hand", "stops"))
    options = stop_options(angle=angle, turns=turns, angle_sd=angle_sd)
    if options and method != "stops":
        raise ParameterError(f"{next(iter(options))} belongs to method stops or ferraris; name that, or leave it out.")
    return {"gyr": gyro.fit_gyro(opened, method, **options)}, None


def stop_options(*, angle: Value = None, turns: str | None = None, angle_sd: Value = None) -> dict[str, Any]:
    """Arguments of turns from stop to stop, as of kind gyro, those that are given, in SI: of the fit and its guide."""
    sizes = {"angle": given("angle", angle, Quantity.ANGLE), "angle_sd": given("angle_sd", angle_sd, Quantity.ANGLE)}
    options: dict[str, Any] = {name: size for name, size in sizes.items() if size is not None}
    if wrong := [name for name, size in options.items() if not size > 0.0]:
        raise ParameterError(f"{wrong[0]} must be above 0; which way a turn went is said by turns.")
    if turns is not None:
        if "angle" in options:
            raise ParameterError("angle and turns both say how far it was turned. Give one of them.")
        options["turns"] = [_turn(item) for item in turns.split(",")]
    return options


def _turn(text: str) -> tuple[int, float]:
    """Axis, 0 to 2, and signed angle, rad, of a turn as ``"x -90deg"``."""
    axis, _, size = text.strip().partition(" ")
    angle = given("turns", size, Quantity.ANGLE) if size and axis in ("x", "y", "z") else None
    if not angle:
        raise ParameterError(
            f"turns are an axis and an angle each, as 'x 90deg, x -90deg', but one is {text.strip()!r}."
        )
    return "xyz".index(axis), angle


def _ferraris(
    opened: Capture,
    _say: Note,
    *,
    parts: Mapping[str, slice] | str | Path | None = None,
    labels: Sequence[str] | None = None,
    angle: Value = None,
) -> Found:
    from plumbob.calibration.calibrate_gyro import ferraris_session
    from plumbob.calibration.gyr.ferraris import parts_of_labels, parts_of_times
    from plumbob.files.text import read_spans

    if isinstance(parts, str | Path):
        parts = parts_of_times(opened.imu.t, read_spans(Path(parts)))
    elif labels is not None:
        parts = parts_of_labels(list(labels))
    turned = given("angle", "360 deg" if angle is None else angle, Quantity.ANGLE)
    assert turned is not None
    return ferraris_session(opened, parts, angle=turned), None


def _hand(
    opened: Capture,
    say: Note,
    *,
    gravity: Value = None,
    latitude: Value = None,
    height: Value = None,
    strength: Value = None,
    place: str | None = None,
    force: bool = False,
) -> Found:
    from plumbob.calibration.calibrate_gyro import calibrate_by_hand
    from plumbob.data import TITLES

    at = chosen_gravity(gravity=gravity, latitude=latitude, height=height, place=place)
    lacking = [title for name, title in TITLES.items() if name not in opened.imu.triads]
    if lacking:
        say(f"the recording has no {' and no '.join(lacking)}, which {'are' if lacking[1:] else 'is'} left out")
    field, dip, remarks = _field(opened, say, strength, place)
    fits = calibrate_by_hand(opened, gravity=at, strength=field, dip=dip, force=force)
    if (mag := fits.get("mag")) is not None:
        fits = {**fits, "mag": replace(mag, remarks=(*mag.remarks, *remarks))}
    return fits, None


def _table(
    opened: Capture,
    _say: Note,
    *,
    rates: str | Sequence[float] | None = None,
    plan: str | Path | None = None,
    model: str = "auto",
    mounting: Value = "0.1 deg",
    latitude: Value = None,
) -> Found:
    from plumbob.calibration.calibrate_gyro import calibrate_table, found_plateaus

    if (rates is None) == (plan is None):
        raise ParameterError("A rate table needs its rates or a plan of its plateaus. Give one of the two.")
    planned: list[Plateau]
    remarks: list[str]
    speeds = numbers("rates", rates, Quantity.RATE) if isinstance(rates, str) else rates or ()
    planned, remarks = (read_plan(Path(plan)), []) if plan is not None else found_plateaus(opened.imu, speeds)
    tilt = given("mounting", mounting, Quantity.ANGLE) or 0.0
    fitted = calibrate_table(
        opened, planned, model=model, mounting=tilt, latitude=given("latitude", latitude, Quantity.ANGLE)
    )
    return {"gyr": replace(fitted, remarks=(*fitted.remarks, *remarks))}, None


def read_plan(path: Path) -> "list[Plateau]":
    """Plateaus of a plan: a CSV file with from_s, to_s, rate_x_dps, rate_y_dps, rate_z_dps, and perhaps acc_x_g, …."""
    import numpy as np

    from plumbob.calibration.calibrate_gyro import Plateau
    from plumbob.files.text import read_rows

    rates, forces = (tuple(name.format(axis) for axis in "xyz") for name in ("rate_{}_dps", "acc_{}_g"))
    plateaus = []
    for row in read_rows(path, ("from_s", "to_s", *rates), forces):
        force = g(np.array([row[name] for name in forces])) if forces[0] in row else None
        plateaus.append(Plateau(row["from_s"], row["to_s"], dps(np.array([row[name] for name in rates])), force))
    return plateaus


def _temperature(opened: Capture, _say: Note, *, triad: str = "gyr") -> Found:
    from plumbob.calibration.calibrate_gyro import drift_over_temperature, fit_gyro

    if triad == "gyr":
        return {"gyr": fit_gyro(opened, "temperature")}, None
    return {triad: drift_over_temperature(opened, triad)}, None


def _currents(opened: Capture, _say: Note, *, current: Sequence[str] = ()) -> Found:
    import numpy as np

    from plumbob.calibration.mag.currents import fit_currents
    from plumbob.data.cards import TriadCalibration

    imu = opened.imu
    if imu.load is None:
        raise ParameterError("name the columns that say how large the currents are, as current=['throttle'].")
    part = None if opened.base is None else opened.base.mag
    base = part or TriadCalibration(matrix=np.eye(3), bias=np.zeros(3), unit_in="uT", unit_out="uT")
    names = tuple(current) or tuple(f"load {k}" for k in range(1, imu.load.shape[1] + 1))
    fitted = fit_currents(imu.t, imu.usable("mag"), imu.load, imu.gyr, base, names)
    return {"mag": replace(fitted, remarks=(*base.remarks, *fitted.remarks))}, None


def _mount(
    opened: Capture,
    _say: Note,
    *,
    frame: Frame | str | None = None,
    level: tuple[float, float] | None = None,
    raised: tuple[float, float] | None = None,
    level_only: bool = False,
    estimate: str | Path | Recording | None = None,
    reference: str | Path | Recording | None = None,
) -> Found:
    from plumbob.calibration.mount import mount_by_poses, mount_by_reference

    if (reference is None) != (estimate is None):
        raise ParameterError("reference and estimate belong together: attitudes of the body and of the unit.")
    if estimate is not None and reference is not None:
        if level or raised or level_only or frame:
            raise ParameterError("a reference needs no poses: leave out level, raised, level_only and frame.")
        return {}, mount_by_reference(read_track(estimate), read_track(reference))
    if frame is None:
        raise FrameError(f"the body's axes depend on the navigation frame. Give one of {', '.join(Frame)}.")
    mounted = mount_by_poses(opened, frame=Frame.parse(frame), level=level, raised=raised, level_only=level_only)
    return {}, mounted


class Kind(NamedTuple):
    """What is calibrated: triads that a capture must have, those that it may have, and how it is done."""

    triads: tuple[str, ...]
    if_present: tuple[str, ...]
    find: Callable[..., Found]


KINDS: Final[Mapping[str, Kind]] = {
    "hand": Kind(("acc",), ("gyr", "mag"), _hand),
    "mag": Kind(("mag",), (), _mag),
    "accel": Kind(("acc",), (), _accel),
    "gyro": Kind(("gyr",), (), _gyro),
    "ferraris": Kind(("acc", "gyr"), (), _ferraris),
    "table": Kind(("gyr",), (), _table),
    "temperature": Kind(("gyr",), (), _temperature),
    "currents": Kind(("mag",), (), _currents),
    "mount": Kind((), (), _mount),
}


def chosen_gravity(
    *, gravity: Value = None, latitude: Value = None, height: Value = None, place: str | None = None
) -> float:
    """Gravity, m/s²: its value, else that of the latitude, else that of the place, else the standard one.

    ParameterError if two of them say it, or there is a height without a latitude.
    """
    from plumbob.calibration.acc import normal_gravity

    if latitude is None and height is not None:
        raise ParameterError("height needs latitude: both together give gravity. Give both.")
    if gravity is not None and latitude is not None:
        raise ParameterError("gravity and latitude both give gravity. Give one of them.")
    if latitude is not None and place is not None:
        raise ParameterError("latitude and place both give the place of the capture. Give one of them.")
    if (value := given("gravity", gravity, Quantity.ACCELERATION)) is not None:
        return value
    if (north := given("latitude", latitude, Quantity.ANGLE)) is not None:
        return normal_gravity(north, given("height", height, Quantity.LENGTH) or 0.0)
    if place is not None:
        north, _, above = parse_place(place)
        return normal_gravity(north, above)
    return G0


def _field(
    opened: Capture, say: Note, strength: Value, place: str | None
) -> tuple[float | None, float | None, tuple[str, ...]]:
    """Strength, µT, and dip, rad, of the field on the day of a capture, as far as they are known; and a remark.

    The remark keeps the declination in the card. No verb takes it from there: a unit is used elsewhere too.
    """
    if place is None:
        return given("strength", strength, Quantity.FIELD), None, ()
    if strength is not None:
        raise ParameterError("strength and place both give the field. Give one of them.")
    if not opened.dated:
        say(f"the recording has no date; the field is that of today, {opened.date}")
    field = earth_field_at(*parse_place(place), opened.date)
    say(f"field at the place: {field.description}")
    return field.strength, field.dip, (f"Field at the place of the capture: {field.description}.",)


def read_track(given: str | Path | Recording) -> AttitudeTrack:
    """Attitude of a recording or its file; DecodeError if it holds none."""
    track = given.track if isinstance(given, Recording) else read(given).track
    if track is None:
        raise DecodeError(f"{given} holds no attitude; make one with 'plumbob run --out'.")
    return track


def calibrate_counts(
    source: "str | Path | ArrayLike", sensor: str = "mag", *, strength: Value = None, scale: Value = None
) -> "CountsCalibration":
    """Calibrate bare triples in counts: without time, unit or rate, in many attitudes.

    Parameters
    ----------
    source : path or array_like (N, 3)
        Readings; or a text file of them, three numbers a line or with others beside, as MotionCal's ``Raw:`` lines have
        accelerometer, gyroscope and magnetometer.
    sensor : {"mag", "acc"}
        Of which sensor. Of an accelerometer one averaged row for each pose at rest will do, or slow tumbling.
    strength : float or str, optional
        Of a magnetometer: strength of the field at the place, µT, to which the matrix then leads.
    scale : float or str, optional
        What one count is, µT or m/s2, as ``"0.15 uT"`` or ``"0.061 mg"``: for programs that take offsets in a unit.

    Returns
    -------
    CountsCalibration
        Bias in counts and the matrix; ``true = matrix @ (raw − bias)``. Its `lines` are what to paste.

    Raises
    ------
    CaptureRefusedError
        If the attitudes do not determine it, with the reasons.
    DecodeError
        If the file holds no such triples, or several could be meant.
    ShapeError
        If there is no such sensor, or readings are not finite triples.
    """
    import numpy as np

    from plumbob.calibration.counts import fit_counts

    if isinstance(source, str | Path):
        from plumbob.files.draft import read_triples

        source = read_triples(source, sensor)
    return fit_counts(
        np.asarray(source, dtype=np.float64),
        sensor,
        strength=given("strength", strength, Quantity.FIELD),
        scale=given("scale", scale, Quantity.FIELD if sensor == "mag" else Quantity.ACCELERATION, positive=True),
    )
