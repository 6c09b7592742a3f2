"""What single verbs do besides calling their function: what they refuse first, and how they print."""

import argparse
import sys
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, closing, nullcontext
from dataclasses import replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from plumbob.cli import common
from plumbob.cli.engine import Call, Verb, show
from plumbob.core.errors import DecodeError, ParameterError, PlumbobError
from plumbob.core.signals import stopped_by_signals
from plumbob.core.text import counted
from plumbob.core.units import Quantity, given, parse, span
from plumbob.reporting.catalogue import Listed

if TYPE_CHECKING:
    from plumbob.protocols.decode import Counts, Frames
    from plumbob.protocols.format import Format

__all__ = ["show"]

_MANY: Final = 50  # recordings of which progress is told in lines, where there is no terminal


def profile(args: argparse.Namespace, verb: Verb, call: Call) -> int:
    """Where no file is named, write the one that all verbs find; with --accept, exit 1 while questions are open."""
    from plumbob.core.files import profile_beside
    from plumbob.core.text import listed
    from plumbob.files.draft import answer
    from plumbob.live.listen import is_line

    path = Path(args.path[0])
    out = getattr(args, "out", None) or profile_beside(Path(path.name.strip("-") or "lines") if is_line(path) else path)
    draft = call(out=out, answers=dict(map(answer, getattr(args, "answers", []))))
    is_open = bool(hasattr(args, "accept") and draft.questions)
    way = "with --set KEY=VALUE" if is_open else "in an editor"
    head = f"{'not written' if is_open else out}: {counted(len(draft.questions), 'question')} to answer {way}"
    lines = [head, *listed(f"{key}: {why}" for key, why in draft.questions)]
    values = {"profile": None if is_open else str(out), **draft.summary()}
    show(args, verb, draft, shown=Listed("\n".join(lines), values))
    return 1 if is_open else 0


def report(args: argparse.Namespace, verb: Verb, call: Call) -> int:
    """Write the page before the text, because who reads that may go away; or draw one figure, and say where it is."""
    out = getattr(args, "out", None)
    if args.figure:
        from plumbob.reporting.overview import plot

        if out is None or len(args.files) > 1:
            raise ParameterError("--figure draws one recording; name the picture with --out.")
        print(f"figure       {call(plot, file=args.files[0], what=args.figure)}")
        return 0
    if out is not None:
        common.require_ending("--out", out, common.ENDINGS["html"])
    return show(args, verb, call())


def record(args: argparse.Namespace, verb: Verb, call: Call) -> int:
    """Show how it goes, and end whole by a signal."""
    from plumbob.live.runner import StatusLine
    from plumbob.live.transports.transport import Stop

    status, stop = StatusLine(quiet=args.json), Stop()
    with closing(status), ExitStack() as stack:
        result = call(
            stop=stop, note=status.note, progress=status.show,
            opened=lambda: stack.enter_context(stopped_by_signals(stop)),  # so that the recording ends whole
        )  # fmt: skip
    return recorded(args, verb, result)


def recorded(args: argparse.Namespace, verb: Verb, result: Any) -> int:
    """Print what came over a line; nothing is an error."""
    show(args, verb, result)
    if result.nothing is not None:
        raise DecodeError(result.nothing)
    return 3 if result.lossy else 0


def batch(args: argparse.Namespace, verb: Verb, call: Call) -> int:
    """A bar on a terminal; elsewhere, of many recordings, a line for each tenth of them."""
    with common.progress_bars() as bars:

        def over(done: int, total: int | None) -> None:
            lines = total and total >= _MANY and not sys.stderr.isatty()
            if bars is not None and not lines:
                bars("recordings", done, total or done)
            if lines and total and 10 * done // total > 10 * (done - 1) // total:
                common.note(f"{done} of {total} recordings")

        return show(args, verb, call(progress=over))


def emulate(args: argparse.Namespace, verb: Verb, call: Call) -> int:
    """Print the port's name first; a line may end at any time, but a file that is cut is removed."""
    from plumbob.live.emulated import noise_cards, outputs
    from plumbob.live.transports.transport import Stop

    given = {name: getattr(args, name, None) for name in ("truth", "write", "fault_log", "flash_log", "calibration")}
    write = sys.stdout.buffer if given["write"] == "-" else given["write"]
    noise = noise_cards(getattr(args, "noise", []))
    cards = noise.values() if isinstance(noise, dict) else (noise,)
    files = outputs(args.what, given["truth"], write, given["fault_log"], given["flash_log"])
    calibration = None if given["calibration"] is None else Path(given["calibration"])
    common.check_outputs(args, *files, inputs=(*cards, calibration))
    stop = Stop()
    with ExitStack() as stack:

        def opened(name: str) -> None:
            if write is None:
                stack.enter_context(stopped_by_signals(stop))
                print(name, flush=True)

        served = call(noise=noise, write=write, stop=stop, opened=opened)
    counts = ", ".join(f"{number} {word}" for word, number in served.facts().items())
    late = f"; latest by {served.latest_ns / 1e6:.1f} ms" if served.latest_ns else ""
    common.note(f"{counted(served.frames, 'frame')}: {counts}{late}")
    return 0


def replay(args: argparse.Namespace, verb: Verb, call: Call) -> int:
    """Hold in memory only what is written."""
    return show(args, verb, call(keep="track" if args.out else "nothing"))


def send(args: argparse.Namespace, verb: Verb, call: Call) -> int:
    """Standard output may hold the messages, and nothing else."""
    from plumbob.live.transports.transport import Stop

    stop = Stop()
    with stopped_by_signals(stop):
        result = call(stop=stop)
    if args.to != "-":
        return show(args, verb, result)
    print(result.text(), file=sys.stderr)
    return 0


def info(args: argparse.Namespace, verb: Verb, call: Call) -> int:
    """Compare with the grade that is asked for."""
    from plumbob.core import check

    least, word = getattr(args, "min_grade", None), getattr(args, "require", None)
    if least is not None and not 0.0 <= least <= 100.0:
        raise ParameterError(f"--min-grade must be a number from 0 to 100, but it is {least:g}.")
    if word is not None:
        check.one_of("--require", word, ("GOOD", "FAIR", "POOR"))
    facts, wanted = call(), word if least is None else least
    show(args, verb, facts)
    return 0 if wanted is None or facts.reaches(wanted) else 3


def convert(args: argparse.Namespace, verb: Verb, call: Call) -> int:
    """Refuse first what cannot be written, and say how much was."""
    from plumbob.live.recorded import LAYOUTS, require_writer

    new, layout = Path(args.path), getattr(args, "layout", None)
    require_writer(new, layout)
    inputs = [Path(path) for name in ("recording", "profile", "calibration") if (path := getattr(args, name, None))]
    is_folder = layout is not None and not LAYOUTS[layout].suffixes
    common.check_outputs(args, *(() if is_folder else common.with_profile(new)), inputs=inputs)
    written = call()
    units = "" if written.array is None else f" of each of {counted(len(written.array.names), 'unit')}"
    parts = [(f"samples{units}", written.imu or written.array), ("attitudes", written.track)]
    counts = ", ".join(f"{len(part)} {word}" for word, part in parts if part is not None)
    print(f"{new}: of {inputs[0].name}, {counts}")
    return 0


def verify(args: argparse.Namespace, verb: Verb, call: Call) -> int:
    """Say what helps a damaged recording, or write its whole rows."""
    from plumbob.files.mcap import repair

    if args.repair:
        verdict = call(repair, path=args.path, out=args.repair, overwrite=args.force)
        written = {"out": args.repair, "lossy": verdict.lossy}
        show(args, verb, verdict, f"written      {args.repair}, with every intact row", **written)
        return 3 if verdict.lossy else 0
    verdict = call()
    show(args, verb, verdict)
    if not verdict.whole and not verdict.open and verdict.recording is not None:
        common.note("--repair OUT writes what is whole to a new, complete file")
    return 0 if verdict.whole else 3


def text(args: argparse.Namespace, verb: Verb, call: Call) -> int:
    """Print text as it is."""
    print(call(), end="")
    return 0


def docs(args: argparse.Namespace, verb: Verb, call: Call) -> int:
    """Print a page, or open it."""
    import webbrowser

    from plumbob.core.resources import page_path

    if not args.open:
        return text(args, verb, call)
    page = page_path(getattr(args, "page", "start"))
    if not webbrowser.open(page.as_uri()):
        raise PlumbobError(f"No browser could be opened. The page is {page}.")
    print(f"opened       {page}")
    return 0


_OF_ATTITUDES: Final = ("frame", "init", "place", "date", "noise", "card", "report", "acceleration")  # not of rates


def run(args: argparse.Namespace, verb: Verb, call: Call) -> int:
    """Estimate the attitude, or filter the rates; write the card and the page."""
    from plumbob.filters.known import RATE_FILTERS, SMOOTHER

    name, args.recording = getattr(args, "filter", SMOOTHER), args.recording[0]
    errors, lines = dict[str, Any](), list[str]()
    if name in RATE_FILTERS:
        result = _rates(args, call)
    else:
        if args.drift or args.rest:
            raise ParameterError(f"--drift and --rest are for a filter of rates: --filter {', '.join(RATE_FILTERS)}.")
        if args.card and name != SMOOTHER:
            raise ParameterError(f"--card is for the smoother, but the filter is {name}. Leave one of them out.")
        gatherer = None
        if args.report:
            from plumbob.overview.streaming_stats import Gatherer

            gatherer = Gatherer()
        result = call(filter=name, follow=gatherer)
        if gatherer is not None:
            from plumbob.reporting.overview import of_estimate

            of_estimate(result, gatherer, args.recording).write_html(Path(args.report), overwrite=args.force)
        if result.reference is not None:
            from plumbob.door.evaluate import brief_errors, error_lines

            errors = brief_errors(result.track, result.reference)
            lines = error_lines(errors)
    numbers = {"file": args.recording, "out": getattr(args, "out", None), **result.summary()}
    head = f"{args.recording}: {counted(numbers['samples'], 'sample')}, {numbers['duration_s']:.3f} s"
    shown = Listed("\n".join([head, result.text(), *lines]), numbers | ({"errors": errors} if errors else {}))
    return show(args, verb, result, shown=shown)


def _rates(args: argparse.Namespace, call: Call) -> Any:
    """Filter the rates; the text of the result says its notes."""
    from plumbob.door.rates import filter_rates

    if beside := [f"--{name}" for name in _OF_ATTITUDES if getattr(args, name, None) is not None]:
        raise ParameterError(f"{', '.join(beside)}: {args.filter} gives no attitude. Leave it out.")
    rest = None if args.rest is None else span("--rest", args.rest)
    return call(filter_rates, drift=args.drift, rest=rest, note=None)


def view(args: argparse.Namespace, verb: Verb, call: Call) -> int:
    """Print the address, and serve until somebody says stop."""
    from plumbob.live.runner import StatusLine
    from plumbob.live.transports.transport import Stop
    from plumbob.viewer.view import has_display

    stop, status = Stop(), StatusLine(quiet=args.json)
    with closing(status), ExitStack() as stack:

        def opened(url: str) -> None:
            stack.enter_context(stopped_by_signals(stop))  # until then a signal ends the start, wherever it is
            if not url:  # of a terminal
                return
            print(url, file=sys.stderr if args.json else sys.stdout, flush=True)
            host = getattr(args, "host", "localhost")
            if host not in ("127.0.0.1", "::1", "localhost"):
                status.note(f"the view is open to other machines at {host}; the token is all that protects it")

        shown = not args.no_open and has_display()
        result = call(stop=stop, note=status.note, opened=opened, open_browser=shown)
    return recorded(args, verb, result)


def demo(args: argparse.Namespace, verb: Verb, call: Call) -> int:
    """Run the buoy's line."""
    from plumbob.cli.demo import FILES
    from plumbob.cli.demo import demo as run_line
    from plumbob.cli.main import main

    duration, out = parse(args.duration or "600s", Quantity.TIME), Path(getattr(args, "out", "demo-out"))
    common.check_outputs(args, *(out / name for name in FILES if out.is_dir()))  # from here on, they may be replaced
    with common.progress_bars() as bars:
        made = run_line(out, duration, (lambda _: None) if args.json else partial(print, flush=True), bars)
    numbers = {name: evaluation.summary() for name, evaluation in made.evaluations.items()}
    table = replace(made.report, facts=(), remarks=(), parts=()).text()
    places = f"certificate  {made.certificate.resolve()}\nreport       {made.page.resolve()}"
    values = {"report": str(made.page), "certificate": str(made.certificate), "filters": numbers}
    show(args, verb, made, shown=Listed(f"\n{table}\n\n{places}", values))
    if args.view and not args.json:
        from plumbob.viewer.view import has_display

        wait = "600s" if has_display() else "20s"
        print(f"live page    for {wait}, or until Ctrl-C; 'plumbob view --emulate buoy' shows it again", flush=True)
        words = ["view", "--emulate", "buoy", "--also", "mahony", "--control", "--http-port", "0", "--duration"]
        main([*words, wait, "--folder", str(out)])  # which says itself what it lacks
    return 0


def control(args: argparse.Namespace, verb: Verb, call: Call) -> int:
    """Print the answer."""
    answer = call()
    return show(args, verb, answer, shown=Listed(answer, {"verb": args.what, "answer": answer}))


def allan(args: argparse.Namespace, verb: Verb, call: Call) -> int:
    """Print the noise, one deviation alone, or what another program takes."""
    from plumbob.core import check
    from plumbob.data.cards import NoiseCard
    from plumbob.door.allan import is_recording, open_static
    from plumbob.noise import KINDS
    from plumbob.noise.allan import deviations
    from plumbob.noise.card import forms
    from plumbob.reporting.noise import curves_report

    records = getattr(args, "records", [])
    if args.card is not None:
        NoiseCard.require_place(Path(args.card))
    named = [f"--{name}" for name in ("triads", "profile", "calibration") if hasattr(args, name)]
    for path in map(Path, records if named else ()):
        plain = path.is_file() and not is_recording(path, getattr(args, "profile", None), getattr(args, "kind", None))
        if plain and getattr(args, "calibration", [""])[0] != "none":
            raise ParameterError(f"{path} holds plain numbers, but {', '.join(named)} is for recordings. Leave it out.")
    if len(records) > 1 and (alone := [name for name in _OF_ONE if getattr(args, name, None)]):
        raise ParameterError(f"--{alone[0]} is for one record, but there are {len(records)}. Give one of them.")
    if args.deviation is not None:
        kind = check.one_of("--deviation", args.deviation, KINDS)
        how = {**dict.fromkeys(("records", "label", "taus")), **args.given, "note": common.note}
        (path,), _, taus = (how.pop(name) for name in ("records", "label", "taus"))
        how["calibration"] = how.get("calibration", [None])[0]
        record, static, card = open_static(path, **how)
        curves = deviations(record, static, kind, taus=taus)
        about = {"file": str(record.path), "calibration": card, "deviation": kind}
        shown = Listed(curves_report(curves).text(), about | {curve.name: curve.summary() for curve in curves})
        return show(args, verb._replace(pages=None), None, shown=shown)
    if form := getattr(args, "as", None):
        check.one_of("--as", form, tuple(forms()))
        print(call().lines(form), end="")
        return 0
    args.curve |= hasattr(args, "taus")
    return show(args, verb, call())


_OF_ONE: Final = ("card", "device", "methods", "deviation", "as")  # options of allan for one record
_READ: Final = 1 << 20
_HINT: Final = 1 << 18  # bytes of a file of which other formats are tried


def decode_bytes(args: argparse.Namespace, verb: Verb, call: Call) -> int:
    """Print the table, or write it, and say what was not decoded."""
    from plumbob.data import UNCALIBRATED
    from plumbob.files.decoded import TEXTS, DecodedTable
    from plumbob.protocols.decode import decode, prefix_by_unit
    from plumbob.protocols.format_toml import find_format, unassigned_told
    from plumbob.protocols.page import not_decoded, other_format

    form, out = find_format(args.format).bind(args.given.get("options", {})), args.out and Path(args.out)
    if spare := unassigned_told(form, form.message(args.message or "")):
        common.note(spare)
    common.check_outputs(args, *common.with_profile(out, TEXTS), inputs=(Path(args.data),))
    table = DecodedTable(form, args.message or "", given("--rate", args.rate, Quantity.FREQUENCY))

    def take(frames: "Mapping[str, Frames]", _: "Counts") -> None:
        table.add(frames)
        if out is None:
            sys.stdout.writelines(table.csv())
            sys.stdout.flush()

    pieces = _chunks(args.data)
    head = next(pieces, b"")
    pieces = chain([head], pieces)
    counts = decode(_in_order(args.data, pieces, form) if args.ring else pieces, form, each=take).counts
    if not counts.received:
        raise DecodeError(f"{args.data} is empty. Give a file of raw bytes.")
    hint = other_format(form, head[:_HINT]) if 2 * counts.framed < counts.received or form.framing.transfers else ""
    if not sum(counts.frames.values()):
        frame = f"a {'transfer' if form.framing.transfers else 'frame'} of {form.name}{counts.why_rejected()}"
        raise DecodeError(f"{args.data}: none of its {counted(counts.received, 'byte')} is {frame}.{hint}")
    if out is not None:
        table.write(out, counts, args.unit, overwrite=args.force)
        units = prefix_by_unit(form.message(table.message))
        if len(units) > 1 and args.unit is None:
            common.note(f"the file is read as unit {units[0]} of {', '.join(units)}; ask for another with --unit")
    common.note(*not_decoded(form, counts, table.message))
    if hint:
        common.note(f"this may not be {form.name} at all.{hint}")
    if table.skipped:
        rows = "; t [s] counts rows, so it is early by that many periods after each gap" if args.rate else ""
        common.note(f"the frame counter skips {table.skipped}: that many frames are missing, or it jumped{rows}")
    common.note(f"calibration {UNCALIBRATED}")
    return 0


def _chunks(name: str) -> Iterator[bytes]:
    """Pieces of a file, or of standard input."""
    with nullcontext(sys.stdin.buffer) if name == "-" else Path(name).open("rb") as file:
        read = getattr(file, "read1", file.read)  # what is there already, where it comes through a pipe
        yield from iter(lambda: read(_READ), b"")


def _in_order(name: str, pieces: Iterator[bytes], form: "Format") -> Iterator[bytes]:
    """Frames of a ring in the order of their counter; tells what else is there."""
    from plumbob.protocols.ring import read_ring

    try:
        ring = read_ring(b"".join(pieces), form)
    except DecodeError as error:
        raise DecodeError(f"{name}: {error}") from error
    common.note(
        f"{counted(ring.records, 'record')}, {ring.missing} missing between the first and the last; beside them "
        f"{ring.blank} blank bytes and {ring.torn} torn"
    )
    yield ring.stream
