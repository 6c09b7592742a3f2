"""plumbob run: from a recording to an attitude."""

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plumbob.cli import common
from plumbob.core.text import counted

if TYPE_CHECKING:
    from plumbob.data import AttitudeTrack, ImuData
    from plumbob.filters.offline import Stage


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb."""
    p = verbs.add_parser(
        "run",
        help="estimate the attitude of a recording with one filter",
        description="Estimate the attitude at every sample of a recording with one filter, and write it as a track.",
        epilog=common.more("plumbob run sea.parquet --filter mekf --out track.parquet", "choose-a-filter.md"),
    )
    p.add_argument("file", type=Path, help="recording: .mcap, .parquet, .csv, .txt, BROAD .hdf5 or .mat")
    p.add_argument("--filter", required=True, metavar="NAME", help="see 'plumbob filters'")
    p.add_argument("--params", metavar="P", help=common.PARAMS_HELP)
    common.add_frame(p, "navigation frame of the result; needed where the recording names none")
    common.add_init(p)
    common.add_place(p)
    common.add_profile(p)
    common.add_calibration(p)
    common.add_noise(p)
    p.add_argument("--out", type=Path, metavar="FILE", help="where to write the track (.parquet or .csv)")
    common.add_force(p)
    common.add_json(p)
    p.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from dataclasses import replace

    from plumbob import files
    from plumbob.core.errors import ParameterError, ShapeError
    from plumbob.data.plausibility import upside_down
    from plumbob.filters.offline import bias_beyond, estimate, filter_of, navigation_frame
    from plumbob.session.reading import read_any

    chosen = common.stages(args.filter, args.params)
    if len(chosen) != 1:
        raise ParameterError("run takes one filter; to compare several use 'plumbob benchmark accuracy'.")
    inputs = (args.file, args.profile, args.calibration, args.noise)
    common.check_outputs(args, *common.with_profile(args.out), inputs=inputs)
    stage = replace(common.given_noise(chosen, args.noise)[0], init=args.init)
    recording = read_any(args.file, profile=args.profile)
    if recording.imu is None:
        raise ShapeError(f"{args.file} holds an attitude but no sensor data, so there is nothing to estimate from.")
    frame = navigation_frame(recording.imu, common.frame_of(args), where=str(args.file))
    imu, beyond = _calibrated(_placed(args, recording.imu, stage), args.calibration)
    doubt = files.inferred_in(recording.notes)
    found = files.found_in(recording.notes) if args.calibration is None else (*doubt, *files.findings(imu))
    if beyond is not None:
        found = (*found, f"temperature: {beyond}")
    common.note(*(f"{args.file.name}: {line}" for line in (*found, *upside_down(imu, frame))))
    common.warn_of_compiling([stage.filter])
    with common.progress(f"{stage.name}", len(imu)) as advance:
        track = estimate(imu, stage, frame=frame, reference=recording.track, progress=advance)
    _warn_of_restarts(imu, track)
    filter_ = filter_of(stage, frame, imu.meta)
    if (contradiction := bias_beyond(filter_, track)) is not None:
        common.note(contradiction)
    if args.out:
        notes = (f"estimated from {args.file.name} by {track.source}", *doubt)
        files.write(args.out, track, notes=notes, overwrite=args.force)
    report = _report(args, imu, track) | {"filter": filter_.describe(), "bias_beyond": contradiction}
    report["declination_deg"] = common.declination_deg(filter_, track)
    report |= {"temperature_beyond": beyond, "noise_card": _noise(stage), "claimed_sd_deg": _claimed(track)}
    if recording.track is not None:
        report["errors"] = _errors(track, recording.track)
    common.print_json(report) if args.json else _print(report)
    return 0


def _placed(args: argparse.Namespace, imu: "ImuData", stage: "Stage") -> "ImuData":
    """Samples with the declination of --place, and a note of the field there."""
    from plumbob.core.errors import ParameterError
    from plumbob.data.earth_field import located

    if args.place is None:
        if args.date is not None:
            raise ParameterError("--date needs --place. Give both.")
        return imu
    if "declination" in stage.params:
        raise ParameterError("--place and the parameter declination both give the declination. Give one of them.")
    imu, field = located(imu, args.place, date=args.date)
    common.note(f"field at the place: {field.told}")
    return imu


def _calibrated(imu: "ImuData", path: Path | None) -> "tuple[ImuData, str | None]":
    """Samples with the card of a file applied, and how far beyond its temperatures they are."""
    if path is None:
        return imu, None
    from plumbob.data.calibrated import apply_card, temperature_beyond
    from plumbob.data.cards import CalibrationCard

    card = CalibrationCard.load(path)
    imu = apply_card(card, imu)
    return imu, temperature_beyond(card, imu)


def _warn_of_restarts(imu: "ImuData", track: "AttitudeTrack") -> None:
    """A filter that starts anew all the time is no filter: most often time is in another unit than declared."""
    import numpy as np

    from plumbob.core import flags
    from plumbob.core.time import timing

    share = float(np.mean((np.asarray(track.flags) & flags.GAP) != 0))
    if share > 0.05:
        step = 1.0 / timing(imu.t).rate
        common.note(
            f"{100.0 * share:.0f} % of the samples come after a gap, and a filter restarts after a gap longer than "
            f"max_gap; the median step is {step:.4g} s. Check the unit of time, and max_gap."
        )


def _noise(stage: "Stage") -> str | None:
    return f"{stage.noise.device} ({stage.noise.source})" if stage.noise else None


def _claimed(track: "AttitudeTrack") -> dict[str, float | None] | None:
    """Standard deviations that the filter claims for its last attitude; none for a heading that is free."""
    if track.cov_b is None:
        return None
    from plumbob.core.units import to_deg
    from plumbob.evaluation import claimed_sd
    from plumbob.rotations import North

    tilt, heading = (float(sd[0]) for sd in claimed_sd(track.q_nb[-1:], track.cov_b[-1:]))
    known = {"inclination": tilt, "heading": float("nan") if track.north is North.FREE else heading}
    return {name: to_deg(sd) if math.isfinite(sd) else None for name, sd in known.items()}


def _report(args: argparse.Namespace, imu: "ImuData", track: "AttitudeTrack") -> dict[str, Any]:
    import numpy as np

    from plumbob.core import flags
    from plumbob.core.units import to_deg
    from plumbob.rotations import euler_zyx_from_quat, quat_rotate

    last = track.q_nb[-1]
    yaw, pitch, roll = to_deg(euler_zyx_from_quat(last))
    forward = quat_rotate(last, [1.0, 0.0, 0.0])
    heading = to_deg(float(np.arctan2(forward @ track.frame.east, forward @ track.frame.north))) % 360.0
    return {
        "file": str(args.file),
        "out": str(args.out) if args.out else None,
        "frame": str(track.frame),
        "north": str(track.north),
        "calibration": imu.meta.calibration,
        "samples": len(track),
        "duration_s": float(track.t[-1] - track.t[0]),
        "last_attitude_deg": {"heading": heading, "yaw": float(yaw), "pitch": float(pitch), "roll": float(roll)},
        "flags": flags.counts(np.asarray(track.flags)),
    }


def _errors(track: "AttitudeTrack", reference: "AttitudeTrack") -> dict[str, Any]:
    """Errors against the reference that the recording carries; a word where they cannot be compared."""
    from plumbob.core.errors import PlumbobError
    from plumbob.evaluation import evaluate

    try:
        summary = evaluate(track, reference).summary()
    except PlumbobError as error:
        return {"not_compared": str(error)}
    keys = ("total_rmse_deg", "heading_rmse_deg", "inclination_rmse_deg")
    return {key: summary[key] for key in keys} | {"not_scored": summary["not_scored"]}


def _print(report: dict[str, Any]) -> None:
    from plumbob.data import calibration_told

    last = report["last_attitude_deg"]
    print(f"{report['file']}: {counted(report['samples'], 'sample')}, {report['duration_s']:.3f} s")
    print(f"filter       {report['filter']}")
    print(f"frame        {report['frame']}, heading from {common.heading_of(report)}")
    print(f"calibration  {calibration_told(report['calibration'])}")
    if report["noise_card"]:
        print(f"noise card   {report['noise_card']}")
    print(f"at the end   yaw {last['yaw']:.3f}°, pitch {last['pitch']:.3f}°, roll {last['roll']:.3f}°")
    print(f"heading      {last['heading']:.3f}° clockwise from {common.zero_of(report['north'])}, of the body's x axis")
    if report["claimed_sd_deg"]:
        claims = report["claimed_sd_deg"].items()
        told = ", ".join(f"{name} {'unknown' if sd is None else f'{sd:.3f}°'}" for name, sd in claims)
        print(f"claimed      {told} (standard deviations at the end)")
    for name, count in report["flags"].items():
        print(f"flag         {name}: {counted(count, 'sample')} ({100.0 * count / report['samples']:.2f} %)")
    for name, value in report.get("errors", {}).items():
        if value is not None and name != "not_scored":
            shown = value if isinstance(value, str) else f"{value:.3f}°"
            print(f"error        {name.removesuffix('_deg').replace('_', ' ')}: {shown}")
    for name, why in report.get("errors", {}).get("not_scored", {}).items():
        print(f"not scored   {name}: {why}")
    if report["out"]:
        print(f"written      {report['out']}")
