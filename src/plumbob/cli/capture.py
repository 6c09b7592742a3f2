"""What the kinds of `plumbob calibrate` share: options, the capture, live or of a recording, and what is printed."""

import argparse
import shutil
import sys
import textwrap
import time
from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TextIO

from plumbob.cli import common

if TYPE_CHECKING:
    from plumbob.calibration.calibration import Capture
    from plumbob.calibration.fit import CaptureRefusedError
    from plumbob.data import ImuData
    from plumbob.data.cards import CalibrationCard
    from plumbob.door.calibrate import Calibrated, Kind
    from plumbob.live.guide.guide import Guide, Progress
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


_EVERY: Final = 0.25
_SELDOM: Final = 5.0
_SEEN, _MISSING, _GOAL, _HERE = "■", "·", "○", "▣"
_LAYERS: Final = ("+z", "across z", "−z")
_ROWS: Final = ((1, -1), (1, 0), (1, 1)), ((0, -1), (0, 0), (0, 1)), ((-1, -1), (-1, 0), (-1, 1))


class Board:
    """Draws progress on standard error, over itself where that is a terminal.

    Elsewhere each event gets a line, and every 5 s what to do next.

    Parameters
    ----------
    title : str
        First line.
    guide : Guide
        Whose timeline is shown.
    out : file
        Where to draw.
    """

    def __init__(self, title: str, guide: "Guide", out: TextIO | None = None) -> None:
        self._title, self._guide, self._out = title, guide, out or sys.stderr
        self._told = self._lines = 0
        self._next = 0.0

    def show(self, progress: "Progress") -> None:
        """Show how it stands, a few times in a second, and what is new at once."""
        drawn = self._out.isatty()
        now = time.monotonic() if drawn else progress.elapsed
        new = self._guide.timeline[self._told :]
        if now < self._next and not new:
            return
        self.erase()
        self._told += len(new)
        for moment in new:
            self._tell(moment.t, moment.text)
        if drawn:
            self._out.write("\a" if new else "")  # who holds the unit does not look at the screen
            self._draw(progress)
        elif now >= self._next and not progress.done:
            self._tell(now, f"next: {progress.next_step}")
        if now >= self._next:
            self._next = now + (_EVERY if drawn else _SELDOM)
        self._out.flush()

    def erase(self) -> None:
        """Take away what was drawn, to write something else."""
        if self._lines:
            self._out.write(f"\033[{self._lines}F\033[J")
            self._lines = 0

    def _tell(self, t: float, text: str) -> None:
        self._out.write(f"{t:7.1f} s  {text}\n")

    def _draw(self, progress: "Progress") -> None:
        width = shutil.get_terminal_size().columns - 1
        lines = [
            row
            for line in board_lines(self._title, progress)
            for row in textwrap.wrap(line, width, subsequent_indent=" " * 9) or [""]
        ]
        self._out.write("\n".join(lines) + "\n")
        self._lines = len(lines)


def board_lines(title: str, progress: "Progress") -> list[str]:
    """Lines of a board."""
    lines = ["", f"{title}, {progress.elapsed:.0f} s; Ctrl-C ends it with what there is", ""]
    if progress.filled is not None:
        lines += [*map_lines(progress), ""]
    lines.append(f"now      {f'at rest for {progress.still_for:.1f} s' if progress.at_rest else 'moving'}")
    lines.append(f"next     {progress.next_step}")
    if progress.predicted:
        lines.append(f"so far   {progress.predicted}, {progress.grade or 'not usable'} as far as it goes")
    return [*lines, *(f"WARNING  {text}" for text in progress.warnings)]


def map_lines(progress: "Progress") -> list[str]:
    """Map of the 18 directions: +x upward and +y to the right, in the three layers of z."""
    cells = _cells(progress)
    layers = [[" ".join(cells.get((x, y, z), " ") for x, y in row) for row in _ROWS] for z in (1, 0, -1)]
    count = 0 if progress.filled is None else int(progress.filled.sum())
    notes = (f"{count} of 18 seen", f"{_SEEN} seen  {_MISSING} missing", f"{_HERE} here  {_GOAL} next")
    head = "    ".join(f"{name:^8}" for name in _LAYERS) + "    +x upward, +y to the right"
    return [head, *("    ".join(f"{row:^8}" for row in rows) + f"    {note}"
                    for *rows, note in zip(*layers, notes, strict=True))]  # fmt: skip


def _cells(progress: "Progress") -> dict[tuple[int, int, int], str]:
    from plumbob.calibration.predicted import REGIONS

    cells = {}
    for region, place in enumerate(REGIONS.tolist()):
        filled = progress.filled is not None and progress.filled[region]
        mark = _SEEN if filled else _MISSING
        mark = _GOAL if region == progress.goal else mark
        mark = _HERE if region == progress.direction else mark
        x, y, z = (round(1.2 * value) for value in place)
        cells[x, y, z] = mark
    return cells


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


def tell(args: argparse.Namespace, imu: "ImuData") -> None:
    """Say how the capture of a recording went."""
    from plumbob.live.guide.guides import GUIDES, guided

    guide = GUIDES[args.guided]()
    progress = guided(guide, imu)
    args.told = _guide_numbers(guide, progress)
    if not args.json:
        print("\n".join(_lines(guide, progress)))


def _run(args: argparse.Namespace, session: "Session") -> "ImuData | None":
    """Samples of the line until the guide or somebody says stop; None where there are none."""
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
    args.told = _guide_numbers(guide, guide.progress())
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


def _guide_numbers(guide: "Guide", progress: "Progress") -> dict[str, Any]:
    from plumbob.calibration.predicted import NAMES

    return {
        "guide": {
            "elapsed_s": progress.elapsed,
            "timeline": [{"t": moment.t, "text": moment.text} for moment in guide.timeline],
            "missing": None if progress.filled is None else [NAMES[i] for i in progress.missing],
            "next": progress.next_step,
            "predicted": progress.predicted,
            "grade": progress.grade,
            "warnings": list(progress.warnings),
            "done": progress.done,
        }
    }


def _lines(guide: "Guide", progress: "Progress") -> list[str]:
    from plumbob.calibration.predicted import region_names

    lines = [f"{moment.t:7.1f} s  {moment.text}" for moment in guide.timeline]
    lines.append(f"{progress.elapsed:7.1f} s  end of the capture")
    if progress.filled is not None:
        lines += ["", *map_lines(progress), "", f"missing      {region_names(progress.missing) or 'nothing'}"]
    if not progress.done:
        lines.append(f"what to add  {progress.next_step}")
    return [*lines, ""]


def find(args: argparse.Namespace, kind: str, inputs: tuple[Path | None, ...] = (), **converted: Any) -> int:
    """Calibrate what the options name, from a file or live, and finish; what else is read is among `inputs`."""
    from plumbob.door.calibrate import kind_options

    given = {name: value for name in kind_options(kind) if (value := getattr(args, name, None)) is not None}
    return _finish(args, _calibrated(args, kind, inputs, given | converted))


def _calibrated(
    args: argparse.Namespace, kind: str, inputs: tuple[Path | None, ...], options: dict[str, Any]
) -> "Calibrated":
    from plumbob.data.cards import CalibrationCard
    from plumbob.door.calibrate import KINDS, calibrate

    how = KINDS[kind]
    out = None if completes(args) else args.out
    common.check_pages(args, out, inputs=(args.file, args.profile, args.calibration, *inputs))
    base = None if args.calibration is None else CalibrationCard.load(args.calibration)
    if args.live:
        return calibrate(live_capture(args, how.triads, base), kind, note=common.note, **options)
    if args.guided:
        require_recording(args)
    return calibrate(_capture(args, how, base), kind, note=common.note, **options)


def _capture(args: argparse.Namespace, how: "Kind", base: "CalibrationCard | None") -> "Capture":
    """Capture that the options name, for the triads that are calibrated, some of them only where it has them."""
    from plumbob.door.calibrate import as_span, read_capture

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
        tell(args, captured.imu)
    return captured


def _finish(args: argparse.Namespace, calibrated: "Calibrated") -> int:
    """Print what was found, and write the card."""
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


def refused(args: argparse.Namespace, why: "CaptureRefusedError") -> int:
    """Print the reasons, as text on standard error or as JSON; nothing is written."""
    import sys

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
