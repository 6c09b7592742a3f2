"""plumbob calibrate: from a capture, recorded or live, to a calibration card, or to the reason why there is none."""

import argparse
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plumbob.cli import common
from plumbob.cli.engine import Call, Verb, show
from plumbob.cli.verbs import OF_LINES
from plumbob.core.errors import ParameterError
from plumbob.core.files import is_same_file
from plumbob.core.signals import stopped_by_signals
from plumbob.core.text import visible
from plumbob.reporting.catalogue import Listed

if TYPE_CHECKING:
    from plumbob.calibration.calibration import Capture
    from plumbob.data.cards import CalibrationCard
    from plumbob.door.calibrate import Kind
    from plumbob.live.guide.guide import Guide


def calibrate(args: argparse.Namespace, verb: Verb, call: Call) -> int:
    """Do it; a refusal is a result, with its reasons, as text on standard error or as JSON, and writes nothing."""
    from plumbob.calibration.fit import CaptureRefusedError

    args.file = Path(args.recording) if hasattr(args, "recording") else None
    about: dict[str, Any] = {"file": args.file and str(args.file), "out": args.out, "html": args.html}
    try:
        return (_find_counts if getattr(args, "counts", False) else _find)(args, verb, about)
    except CaptureRefusedError as why:
        from plumbob.reporting.calibration import refusal_text

        if args.json:
            common.print_json(about | {"out": None, "html": None} | why.summary())
        else:
            reasons = visible(refusal_text(why), keep="\n")
            print(f"plumbob calibrate {args.kind}: {reasons}", file=sys.stderr)
        return 1


def _find_counts(args: argparse.Namespace, verb: Verb, _about: dict[str, Any]) -> int:
    """Calibrate bare triples, and print what was found or what to paste."""
    from plumbob.door.calibrate import calibrate_counts

    if args.file is None:
        raise ParameterError(f"name the file of the triples: 'plumbob calibrate {args.kind} raw.txt --counts'.")
    sensor = "acc" if args.kind == "accel" else args.kind
    corrected = calibrate_counts(args.file, sensor, strength=vars(args).get("strength"), scale=args.scale)
    if vars(args)["as"] is None:
        return show(args, verb._replace(pages=None), corrected)
    print(corrected.lines(vars(args)["as"]))
    return 0


def _find(args: argparse.Namespace, verb: Verb, about: dict[str, Any]) -> int:
    """Calibrate what the options name, print what was found, and write the card; what was read goes into `about`."""
    from plumbob.data.cards import CalibrationCard
    from plumbob.door import calibrate as door

    option = vars(args).get
    kind, live, method = args.kind, option("live", False), option("method", "auto")
    if kind == "gyro":
        if live and method not in ("auto", "rest", "stops"):
            raise ParameterError(f"--live guides a rest or stops; for --method {method} give a recording.")
        idle = [name for name in ("parts", "part-column") if option(name.replace("-", "_")) is not None]
        if idle and method != "ferraris":
            raise ParameterError(f"--{idle[0]} belongs to --method ferraris; name that, or leave it out.")
        kind = "ferraris" if method == "ferraris" else kind
    path, out = option("calibration"), args.out and Path(args.out)
    completes = out is not None and path is not None and is_same_file(out, Path(path))
    common.check_outputs(args, *args.pages, None if completes else out, inputs=args.inputs)
    base = None if path is None else CalibrationCard.load(Path(path))
    how = door.KINDS[kind]
    how = how._replace(triads=(args.triad,)) if option("triad") else how
    captured = (_live if live else _recorded)(args, out, how, base, about)
    options = {"force": args.force, **args.given}
    if option("part_column"):
        from plumbob.files.text import read_labels

        options["labels"] = read_labels(args.file, args.part_column, option("profile") and Path(args.profile))
    options = {name: value for name, value in options.items() if name in door.kind_options(kind)}
    calibrated = door.calibrate(captured, kind, note=common.note, **options)
    if out is not None:
        calibrated.save(out, overwrite=args.force or completes)
    text = f"{calibrated.text()}\ncard         {out or 'NOT WRITTEN: name a file with --out'}"
    return show(args, verb, calibrated, shown=Listed(text, about | calibrated.summary()))


def _recorded(
    args: argparse.Namespace, out: Path | None, how: "Kind", base: "CalibrationCard | None", about: dict[str, Any]
) -> "Capture":
    """Capture of a recording, for the triads that are calibrated, some of them only where it has them."""
    from plumbob.door.calibrate import as_span, read_capture, require_card_place

    option = vars(args).get
    if args.file is None:
        raise ParameterError(f"name the recording of the capture, or a line: 'plumbob calibrate {args.kind} --live'.")
    captured = read_capture(
        args.file, triads=how.triads, if_present=how.if_present, device=option("device"), base=base,
        profile=option("profile") and Path(args.profile), span=as_span(option("start"), option("stop")),
        load=args.given.get("current", ()),
    )  # fmt: skip
    common.note(*(f"{args.file.name}: {line}" for line in captured.found))
    made = {*how.triads, *(name for name in how.if_present if name in captured.imu.triads)} or {"mount"}
    require_card_place(out, captured.device, made, base, force=args.force)
    if option("guide"):
        from plumbob.live.guide.board import guide_summary, guide_text
        from plumbob.live.guide.guide import guided

        guide = _guide(args)
        progress = guided(guide, captured.imu)
        about |= guide_summary(guide, progress)
        if not args.json:
            print(guide_text(guide, progress))
    return captured


def _guide(args: argparse.Namespace) -> "Guide":
    """Guide of what is calibrated, by the options of the command line."""
    from plumbob.door.calibrate import stop_options
    from plumbob.live.guide.guide import GUIDES

    if vars(args).get("method") != "stops":
        return GUIDES[args.kind]()
    options = {name: args.given.get(name) for name in ("angle", "turns", "angle_sd")}
    return GUIDES["stops"](**stop_options(**options))


def _live(
    args: argparse.Namespace, out: Path | None, how: "Kind", base: "CalibrationCard | None", about: dict[str, Any]
) -> "Capture":
    """Guided capture from a line, until the guide or somebody says stop; what would spoil its end is refused before."""
    from plumbob.calibration.calibration import unit_of
    from plumbob.door.calibrate import require_card_place
    from plumbob.live.guide.board import bare_session, guided_capture
    from plumbob.live.transports.transport import Stop

    if out is None or not out.parent.is_dir():
        raise ParameterError(f"--live needs --out, a card to write in a folder that exists, but it is {out}.")
    device, line = args.given.get("device"), {name: args.given[name] for name in OF_LINES if name in args.given}
    session = bare_session(args.file, args.given.get("start"), device, args.raw, **line)
    card = base or session.card
    require_card_place(out, unit_of(session.meta.device, device, card), how.triads, card, force=args.force)
    stop = Stop()
    with ExitStack() as stack:
        captured, summary = guided_capture(
            session, _guide(args), how.triads, device=device, base=base, stop=stop, note=common.note,
            opened=lambda: stack.enter_context(stopped_by_signals(stop)),
        )  # fmt: skip
    about |= summary
    return captured


def tested(args: argparse.Namespace, verb: Verb, call: Call) -> int:
    """Print the errors of all rests, and where they come from."""
    result = call()
    names = {name: Path(getattr(args, name, args.recording)).name for name in ("recording", "reference", "calibration")}
    names["reference"] += f": {result.before.reference.source}"
    page = result.report(facts=[*names.items()])
    shown = Listed(page.text(), {"file": args.recording, **result.summary()})
    return show(args, verb._replace(pages=lambda *_: page), result, shown=shown)
