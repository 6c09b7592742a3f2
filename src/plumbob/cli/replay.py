"""plumbob replay: send a recording through the line again, with its own session or another."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from plumbob.cli import common
from plumbob.cli import line as told
from plumbob.core.text import counted

if TYPE_CHECKING:
    from plumbob.acquisition.transport import Event
    from plumbob.files.mcap import Log
    from plumbob.session.session import Session
    from plumbob.session.sinks import Sink

DIFFERENT = 3


class _Past(told.Status):
    """What is told of a run, without its events: they were told when they happened."""

    def on_event(self, event: "Event") -> None:
        """Leave it to the recording."""


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb."""
    p = verbs.add_parser(
        "replay",
        help="process a recorded line again, with its own filter or another",
        description="Send the raw bytes of a recording through the same line again: with the session that it holds, or "
        "with another session, filter, calibration or noise. With --check, compare with the attitude that was "
        "estimated live, bit for bit; exit code 3 where they differ.",
        epilog=common.more("plumbob replay sea.mcap --filter vqf --out vqf.parquet", "recordings.md"),
    )
    p.add_argument("recording", type=Path, help="recording made by 'plumbob record' (.mcap)")
    p.add_argument("--session", type=Path, metavar="TOML", help="session to use instead of the recording's own")
    told.add_estimate(p)
    p.add_argument(
        "--unit", metavar="NAME|N", help="another unit of the same frames, as one of the six of the rig 'arm'"
    )
    p.add_argument("--out", type=Path, metavar="FILE", help="where to write the track (.parquet, .csv or .tum)")
    common.add_force(p)
    p.add_argument("--speed", type=float, metavar="K", help="K times as fast as it was; without it, as fast as it goes")
    p.add_argument("--check", action="store_true", help="compare with the live attitude that the recording holds")
    common.add_json(p)
    p.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from dataclasses import asdict

    from plumbob.core.errors import ParameterError
    from plumbob.files import Recording, inferred
    from plumbob.session.recorded import export
    from plumbob.session.replay import Check, open_recording
    from plumbob.session.runner import run_line
    from plumbob.session.sinks import Tracks
    from plumbob.session.sources import ReplaySource
    from plumbob.session.stream import Line

    if args.speed is not None and not args.speed > 0.0:
        raise ParameterError(f"--speed must be above 0, but it is {args.speed:g}.")
    inputs = (args.recording, args.session, args.calibration, args.noise)
    common.check_outputs(args, *common.with_profile(args.out), inputs=inputs)
    log, session = open_recording(args.recording)
    session = _changed(args, log, session)
    if session.stage is not None:
        common.warn_of_compiling([session.stage.filter])
    line, kept = Line(session), Tracks()
    status = _Past(line, quiet=True)
    check = Check(log) if args.check else None
    sinks: list[Sink | None] = [status, kept if args.out else None, check]
    run_line(line, ReplaySource(log, args.speed), sinks=[sink for sink in sinks if sink])
    for topic, count in log.missing.items():
        common.note(f"{args.recording.name}: {counted(count, 'row')} of {topic} missing")
    for damage in log.damage:
        common.note(f"{args.recording.name}: {damage}")
    report = told.report_of(session, line, status)
    track = kept.track()
    if args.out:
        if track is None:
            raise ParameterError("nothing was estimated, so there is no track to write; name a filter with --filter.")
        doubt = inferred(line.time_report())
        notes = (f"replayed from {args.recording.name} by {track.source}", *doubt)
        export(args.out, Recording(track=track, name=args.out.stem, notes=notes), overwrite=args.force)
    same = check.comparison if check else None
    if same is not None:
        report["check"] = {**asdict(same), "equal": same.equal}
    if args.json:
        common.print_json(report)
    else:
        told.print_report(report, told.attitude_of(status.last))
        if same is not None:
            verdict = "EQUAL to the bit" if same.equal else "NOT equal"
            print(f"check        {verdict}: {counted(same.compared, 'attitude')} compared, {same.different} different, "
                  f"{same.only_live} only live, {same.only_replayed} only replayed")  # fmt: skip
        if args.out:
            print(f"written      {args.out}")
    return 0 if same is None or same.equal else DIFFERENT


def _day(log: "Log") -> str | None:
    """Day of the first row, ISO 8601; None where it is not known."""
    from plumbob.data.earth_field import day_of

    info, first = log.first_info, next(iter(log), None)
    return None if info is None or first is None else day_of(info.epoch_offset_ns + first.t_ns)


def _changed(args: argparse.Namespace, log: "Log", session: "Session") -> "Session":
    """The recording's session, or what the options make of it."""
    from dataclasses import replace

    from plumbob.core.errors import FrameError, ParameterError
    from plumbob.data.cards import CalibrationCard
    from plumbob.session.session_toml import load_session, of_unit

    if args.session is not None:
        session = load_session(args.session, date=_day(log))
    if args.unit is not None:
        session = of_unit(session, args.unit)
    if args.calibration is not None:
        card = CalibrationCard.load(args.calibration)
        if card.device != session.meta.device:
            raise ParameterError(f"the card is for '{card.device}', but the recording is of '{session.meta.device}'.")
        session = replace(session, card=card)
    if args.filter is None:
        if args.params or args.noise or args.init:
            raise ParameterError("--params, --noise and --init belong to a filter; name one with --filter.")
        return session
    frame = common.frame_of(args) or session.frame
    if frame is None:
        raise FrameError("the recording's session names no frame. Give --frame ENU, NED or NWU.")
    chosen = common.given_noise(common.stages(args.filter, args.params), args.noise)
    if len(chosen) != 1:
        raise ParameterError("replay takes one filter; run it again for another.")
    if args.init == "truth" and session.reference is None:
        raise ParameterError("--init truth takes the reference of the recording's session, which names none.")
    return replace(
        session, stage=replace(chosen[0], init=args.init), frame=frame, meta=replace(session.meta, frame=frame)
    )
