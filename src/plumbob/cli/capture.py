"""What the kinds of `plumbob calibrate` share: options, the capture, live or of a recording, and what is printed."""

import argparse
import sys
from collections.abc import Collection
from typing import TYPE_CHECKING, Any

from plumbob.cli import common

if TYPE_CHECKING:
    from plumbob.calibration.calibration import Capture
    from plumbob.calibration.fit import CaptureRefusedError
    from plumbob.data import ImuData
    from plumbob.data.cards import CalibrationCard
    from plumbob.door.calibrate import Kind
    from plumbob.live.session import Session


def completes(args: argparse.Namespace) -> bool:
    """Whether the card so far is the card to write: then it is completed, and nothing of it is lost."""
    from plumbob.core.files import is_same_file

    both = args.out is not None and args.calibration is not None
    return both and is_same_file(args.out, args.calibration)


def require_room(args: argparse.Namespace, device: str, made: Collection[str], base: "CalibrationCard | None") -> None:
    """Refuse to write a card over that of another unit, one that has more, or a part over another without --force."""
    from plumbob.core.errors import DecodeError, ParameterError
    from plumbob.data.cards import CalibrationCard

    out = args.out
    if out is None or not out.is_file():
        return
    try:
        there = CalibrationCard.load(out)
    except DecodeError:
        return
    if there.device != device:
        raise ParameterError(f"{out} is the card of '{there.device}', not of '{device}'; name another file.")
    base_parts = base.parts if base else ()
    if lost := [name for name in there.parts if name not in {*made, *base_parts}]:
        raise ParameterError(
            f"{out} has {' and '.join(lost)}, which this would lose; complete it with --calibration {out}, or name "
            "another file."
        )
    if not args.force and (again := [name for name in there.parts if name in made]):
        raise ParameterError(f"{out} has {' and '.join(again)} already. Name another file, or replace it with --force.")


def live_capture(args: argparse.Namespace, triads: tuple[str, ...], base: "CalibrationCard | None") -> "Capture":
    """Guided capture from a line; what would spoil its end is refused before it begins."""
    from plumbob.calibration.calibration import capture, unit_of
    from plumbob.core.errors import CalibrationError

    _require_end(args)
    session = _session(args)
    card = base or session.card
    unit = unit_of(session.meta.device, args.device, card)
    require_room(args, unit, triads, card)
    _require_triads(session, triads)
    imu = _run(args, session)
    if imu is None:
        raise CalibrationError(
            "no sample arrived over the line, so there is nothing to calibrate. See 'plumbob record'."
        )
    return capture(imu, triads=triads, device=args.device, base=card)


def require_recording(args: argparse.Namespace) -> None:
    """Refuse what names no recording, or a line beside it."""
    from plumbob.core.errors import ParameterError

    if args.file is None:
        raise ParameterError(f"name the recording of the capture, or a line: 'plumbob calibrate {args.kind} --live'.")
    given = [f"--{name}" for name in ("port", "rate", "iio", "format", "raw") if getattr(args, name) is not None]
    if given:
        raise ParameterError(f"{given[0]} belongs to a line; add --live, or leave it out for a recording.")


def _run(args: argparse.Namespace, session: "Session") -> "ImuData | None":
    """Samples of the line until the guide or somebody says stop; None where there are none."""
    from plumbob.live.guide.board import Board, guide_summary
    from plumbob.live.guide.guides import GUIDES, GuideSink
    from plumbob.live.runner import run_stream
    from plumbob.live.sinks import Collected, RecordingSink, Sink
    from plumbob.live.sources import open_source
    from plumbob.live.stream import Stream
    from plumbob.live.transports.transport import Stop
    from plumbob.live.watch import Watch

    stream, guide, collected = Stream(session), GUIDES[args.guided](), Collected()
    board, stop = Board(f"calibrate {args.kind}", guide), Stop()

    def note(text: str) -> None:
        board.erase()
        common.note(text)

    watch = Watch(stream, note)
    recording_sink = None if session.record is None else RecordingSink(session, session.record)
    source = open_source(session.source)
    common.note("waiting for samples; the capture ends when it is good, or by Ctrl-C with what there is")
    with common.stopped_by_signals(stop):
        sinks: list[Sink] = [collected, GuideSink(guide, stop, board.show), watch]
        run_stream(stream, source, sinks=sinks, recording=recording_sink, stop=stop, each=watch.look)
    board.erase()
    args.told = guide_summary(guide, guide.progress())
    return collected.imu(calibrated=False)


def _require_end(args: argparse.Namespace) -> None:
    """Refuse options with which the card of a whole capture could not be made or written."""
    from plumbob.core.errors import ParameterError

    if args.profile or args.stop:
        raise ParameterError(
            "--profile and --to belong to recordings; a live capture ends when it is good, or by Ctrl-C."
        )
    if args.out is None or not args.out.parent.is_dir():
        raise ParameterError(f"--live needs --out, a card to write in a folder that exists, but it is {args.out}.")


def _require_triads(session: "Session", triads: tuple[str, ...]) -> None:
    """Refuse a line that has not what is calibrated."""
    from plumbob.core.errors import CalibrationError

    fields = session.form.message(session.message).fields
    parts = [f.triad.rpartition(".") for f in fields if f.triad]
    present = {triad for unit, _, triad in parts if unit == session.unit}
    if missing := [name for name in triads if name not in present]:
        raise CalibrationError(f"the line has no {', '.join(missing)}, only {', '.join(sorted(present))}.")


def _session(args: argparse.Namespace) -> "Session":
    """Session of the capture: nothing is estimated, and recorded only where that is asked for.

    A unit that is called like its format was not named, and a card needs a name.
    """
    from dataclasses import replace

    from plumbob.data import ImuMeta
    from plumbob.live.session import RecordSpec
    from plumbob.live.session_toml import capture_session

    named = args.device if args.file is None else None
    names = ("port", "rate", "time", "iio", "baud", "format", "unit")
    line = {name: value for name in names if (value := getattr(args, name, None)) is not None}
    session = capture_session(args.file, capture=args.start, device=named, **line)
    record = None if args.raw is None else replace(session.record or RecordSpec(""), path=str(args.raw))
    device = session.meta.device
    if device == session.form.name:
        device = args.device or ImuMeta().device
    return replace(session, meta=replace(session.meta, device=device), stage=None, record=record)


def find(args: argparse.Namespace, kind: str, **converted: Any) -> int:
    """Calibrate what the options name, from a file or live; print what was found, and write the card."""
    from plumbob.data.cards import CalibrationCard
    from plumbob.door.calibrate import KINDS, calibrate, kind_options

    how, names = KINDS[kind], kind_options(kind)
    common.check_pages(args, None if completes(args) else args.out, inputs=args.inputs)
    base = None if args.calibration is None else CalibrationCard.load(args.calibration)
    captured = live_capture(args, how.triads, base) if args.live else _capture(args, how, base)
    options = {name: value for name, value in {"force": args.force, **args.given}.items() if name in names}
    calibrated = calibrate(captured, kind, note=common.note, **options | converted)
    if args.out is not None:
        calibrated.save(args.out, overwrite=args.force or completes(args))
    if args.json:
        written = {"out": args.out and str(args.out), "html": args.html and str(args.html)}
        common.print_json(_read(args) | written | calibrated.summary())
    else:
        print(calibrated.text())
        print(f"card         {args.out}" if args.out else "card         NOT WRITTEN: name a file with --out")
    common.write_pages(args, calibrated.report(recording=args.file.name if args.file else "live"))
    return 0


def _capture(args: argparse.Namespace, how: "Kind", base: "CalibrationCard | None") -> "Capture":
    """Capture that the options name, for the triads that are calibrated, some of them only where it has them."""
    from plumbob.door.calibrate import as_span, read_capture

    if args.guided:
        require_recording(args)
    captured = read_capture(
        args.file,
        triads=how.triads,
        if_present=how.if_present,
        profile=args.profile,
        span=as_span(args.start, args.stop),
        device=args.device,
        base=base,
    )
    common.note(*(f"{args.file.name}: {line}" for line in captured.found))
    made = {*how.triads, *(name for name in how.if_present if name in captured.imu.triads)} or {"mount"}
    require_room(args, captured.device, made, base)
    if args.guided and args.guide:
        from plumbob.live.guide.board import guide_summary, guide_text
        from plumbob.live.guide.guides import GUIDES, guided

        guide = GUIDES[args.guided]()
        progress = guided(guide, captured.imu)
        args.told = guide_summary(guide, progress)
        if not args.json:
            print(guide_text(guide, progress))
    return captured


def refused(args: argparse.Namespace, why: "CaptureRefusedError") -> int:
    """Print the reasons, as text on standard error or as JSON; nothing is written."""
    from plumbob.calibration.report import refusal_numbers, refusal_text
    from plumbob.core.text import visible

    if args.json:
        common.print_json(_read(args) | {"out": None, "html": None} | refusal_numbers(why))
    else:
        reasons = visible(refusal_text(why), keep="\n")
        print(f"plumbob calibrate {args.kind}: {reasons}", file=sys.stderr)
    return 1


def _read(args: argparse.Namespace) -> dict[str, Any]:
    """What was read, and what a guide told about it."""
    return {"file": args.file and str(args.file), **getattr(args, "told", {})}
