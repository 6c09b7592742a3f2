"""plumbob calibrate: from a capture, recorded or live, to a calibration card, or to the reason why there is none."""

import argparse
import sys
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plumbob.cli import common
from plumbob.cli.engine import Call, Verb, show
from plumbob.cli.verbs import OF_LINES
from plumbob.core.errors import CalibrationError, DecodeError, ParameterError
from plumbob.core.files import is_same_file
from plumbob.core.text import visible

if TYPE_CHECKING:
    from plumbob.calibration.calibration import Capture
    from plumbob.data.cards import CalibrationCard
    from plumbob.door.calibrate import Kind
    from plumbob.live.session import Session


def calibrate(args: argparse.Namespace, verb: Verb, call: Call) -> int:
    """Do it; a refusal is a result, with its reasons, as text on standard error or as JSON, and writes nothing."""
    from plumbob.calibration.fit import CaptureRefusedError

    args.file = Path(args.recording) if hasattr(args, "recording") else None
    if getattr(args, "counts", False):
        from plumbob.door.calibrate import calibrate_counts

        sensor = "acc" if args.kind == "accel" else args.kind
        return show(args, verb._replace(pages=None), calibrate_counts(args.file, sensor))
    about: dict[str, Any] = {"file": args.file and str(args.file), "out": args.out, "html": args.html}
    try:
        return _find(args, verb, about)
    except CaptureRefusedError as why:
        from plumbob.reporting.calibration import refusal_text

        if args.json:
            common.print_json(about | {"out": None, "html": None} | why.summary())
        else:
            reasons = visible(refusal_text(why), keep="\n")
            print(f"plumbob calibrate {args.kind}: {reasons}", file=sys.stderr)
        return 1


def _find(args: argparse.Namespace, verb: Verb, about: dict[str, Any]) -> int:
    """Calibrate what the options name, print what was found, and write the card; what was read goes into `about`."""
    from plumbob.data.cards import CalibrationCard
    from plumbob.door import calibrate as door

    option = vars(args).get
    kind, live, method = args.kind, option("live", False), option("method", "auto")
    if kind == "gyro":
        if live and method not in ("auto", "rest"):
            raise ParameterError(f"--live guides a rest only; record for --method {method}, and give the recording.")
        idle = [name for name in ("parts", "part-column", "angle") if option(name.replace("-", "_")) is not None]
        if idle and method != "ferraris":
            raise ParameterError(f"--{idle[0]} belongs to --method ferraris; name that, or leave it out.")
        kind = "ferraris" if method == "ferraris" else kind
    path, out = option("calibration"), args.out and Path(args.out)
    completes = out is not None and path is not None and is_same_file(out, Path(path))
    common.check_outputs(args, *common.pages(args), None if completes else out, inputs=args.inputs)
    base = None if path is None else CalibrationCard.load(Path(path))
    captured = (_live if live else _recorded)(args, out, door.KINDS[kind], base, about)
    options = {"force": args.force, **args.given}
    if option("part_column"):
        from plumbob.files.text import read_labels

        options["labels"] = read_labels(args.file, args.part_column, option("profile") and Path(args.profile))
    options = {name: value for name, value in options.items() if name in door.kind_options(kind)}
    calibrated = door.calibrate(captured, kind, note=common.note, **options)
    if out is not None:
        calibrated.save(out, overwrite=args.force or completes)
    text = f"{calibrated.text()}\ncard         {out or 'NOT WRITTEN: name a file with --out'}"
    return show(args, verb, calibrated, shown=common.Listed(text, about | calibrated.summary()))


def _require_room(
    out: Path | None, device: str, made: Collection[str], base: "CalibrationCard | None", *, force: bool
) -> None:
    """Refuse to write a card over that of another unit, one that has more, or a part over another without --force."""
    from plumbob.data.cards import CalibrationCard

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


def _recorded(
    args: argparse.Namespace, out: Path | None, how: "Kind", base: "CalibrationCard | None", about: dict[str, Any]
) -> "Capture":
    """Capture of a recording, for the triads that are calibrated, some of them only where it has them."""
    from plumbob.door.calibrate import as_span, read_capture

    option = vars(args).get
    if args.file is None:
        raise ParameterError(f"name the recording of the capture, or a line: 'plumbob calibrate {args.kind} --live'.")
    captured = read_capture(
        args.file, triads=how.triads, if_present=how.if_present, device=option("device"), base=base,
        profile=option("profile") and Path(args.profile), span=as_span(option("start"), option("stop")),
    )  # fmt: skip
    common.note(*(f"{args.file.name}: {line}" for line in captured.found))
    made = {*how.triads, *(name for name in how.if_present if name in captured.imu.triads)} or {"mount"}
    _require_room(out, captured.device, made, base, force=args.force)
    if option("guide"):
        from plumbob.live.guide.board import guide_summary, guide_text
        from plumbob.live.guide.guides import GUIDES, guided

        guide = GUIDES[args.kind]()
        progress = guided(guide, captured.imu)
        about |= guide_summary(guide, progress)
        if not args.json:
            print(guide_text(guide, progress))
    return captured


def _live(
    args: argparse.Namespace, out: Path | None, how: "Kind", base: "CalibrationCard | None", about: dict[str, Any]
) -> "Capture":
    """Guided capture from a line, until the guide or somebody says stop; what would spoil its end is refused before."""
    from plumbob.calibration.calibration import capture, unit_of
    from plumbob.live.guide.board import Board, guide_summary
    from plumbob.live.guide.guides import GUIDES, GuideSink
    from plumbob.live.record import record
    from plumbob.live.sinks import Collected, Sink
    from plumbob.live.transports.transport import Stop

    if out is None or not out.parent.is_dir():
        raise ParameterError(f"--live needs --out, a card to write in a folder that exists, but it is {out}.")
    session, device = _session(args), args.given.get("device")
    card = base or session.card
    _require_room(out, unit_of(session.meta.device, device, card), how.triads, card, force=args.force)
    parts = [f.triad.rpartition(".") for f in session.form.message(session.message).fields if f.triad]
    present = {triad for unit, _, triad in parts if unit == session.unit}
    if missing := [name for name in how.triads if name not in present]:
        raise CalibrationError(f"the line has no {', '.join(missing)}, only {', '.join(sorted(present))}.")
    guide, collected, stop = GUIDES[args.kind](), Collected(), Stop()
    board = Board(f"calibrate {args.kind}", guide)

    def note(text: str) -> None:
        board.erase()
        common.note(text)

    sinks: list[Sink] = [collected, GuideSink(guide, stop, board.show)]
    common.note("waiting for samples; the capture ends when it is good, or by Ctrl-C with what there is")
    with common.stopped_by_signals(stop):
        record(session, sinks=sinks, stop=stop, note=note)
    board.erase()
    about |= guide_summary(guide, guide.progress())
    if (imu := collected.imu(calibrated=False)) is None:
        raise CalibrationError(
            "no sample arrived over the line, so there is nothing to calibrate. See 'plumbob record'."
        )
    return capture(imu, triads=how.triads, device=device, base=base)


def _session(args: argparse.Namespace) -> "Session":
    """Session of the capture: nothing is estimated, and recorded only where that is asked for.

    A unit that is called like its format was not named, and a card needs a name.
    """
    from plumbob.data import ImuMeta
    from plumbob.live.session import OutputSpec, RecordSpec
    from plumbob.live.session_toml import capture_session

    named = args.given.get("device")
    line = {name: args.given[name] for name in OF_LINES if name in args.given}
    device = named if args.file is None else None
    session = capture_session(args.file, capture=args.given.get("start"), device=device, **line)
    raw = None if args.raw is None else replace(session.record or RecordSpec(""), path=args.raw)
    device = session.meta.device
    if device == session.form.name:
        device = named or ImuMeta().device
    meta = replace(session.meta, device=device)
    return replace(session, meta=meta, stage=None, record=raw, output=OutputSpec(), send=())


def tested(args: argparse.Namespace, verb: Verb, call: Call) -> int:
    """Print the errors of all rests, and where they come from."""
    result = call()
    names = {name: Path(getattr(args, name, args.recording)).name for name in ("recording", "reference", "calibration")}
    names["reference"] += f": {result.before.reference.source}"
    page = result.report(facts=[*names.items()])
    shown = common.Listed(page.text(), {"file": args.recording, **result.summary()})
    return show(args, verb._replace(pages=lambda *_: page), result, shown=shown)
