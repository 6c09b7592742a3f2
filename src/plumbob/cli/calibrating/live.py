"""Guided captures of `plumbob calibrate`: live from a line, and over a recording."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plumbob.cli import common
from plumbob.cli import session as lines
from plumbob.cli.calibrating import room

if TYPE_CHECKING:
    from plumbob.calib.guide.guide import Guide, Progress
    from plumbob.cards import CalibrationCard
    from plumbob.data import ImuData
    from plumbob.link import Event
    from plumbob.pipeline.calibration import Capture
    from plumbob.pipeline.session import Session


def add_options(p: argparse.ArgumentParser) -> None:
    """Options of kinds that have a guide."""
    p.add_argument("--guide", action="store_true", help="tell how the capture went, and what it lacks")
    live = p.add_argument_group("live", "calibrate while the unit is moved, with directions what to do next")
    live.add_argument(
        "--live", action="store_true", help="INPUT is a session file (TOML); or give --port, --from, --iio"
    )
    lines.add_line(live)
    live.add_argument("--raw", type=Path, metavar="MCAP", help="recording of the capture, raw bytes and samples")


def live_capture(args: argparse.Namespace, triads: tuple[str, ...], base: "CalibrationCard | None") -> "Capture":
    """Guided capture from a line; what would spoil its end is refused before it begins."""
    from plumbob.errors import CalibrationError
    from plumbob.pipeline.calibration import capture, unit_of

    _require_end(args)
    session = _session(args)
    card = base or session.card
    unit = unit_of(session.meta.device, args.device, card)
    room.require_room(args, unit, triads, card)
    _require_triads(session, triads)
    imu = _run(args, session)
    if imu is None:
        raise CalibrationError("nothing came over the line, so there is nothing to calibrate; see 'plumbob record'.")
    return capture(imu, triads=triads, device=args.device, base=card)


def require_recording(args: argparse.Namespace) -> None:
    """Refuse what names no recording, or a line beside it."""
    from plumbob.errors import ParameterError

    if args.file is None:
        raise ParameterError(f"name the recording of the capture, or a line: 'plumbob calibrate {args.kind} --live'.")
    given = [f"--{name}" for name in ("port", "rate", "iio", "format", "raw") if getattr(args, name) is not None]
    if given:
        raise ParameterError(f"{given[0]} belongs to a line; add --live, or leave it out for a recording.")


def tell(args: argparse.Namespace, imu: "ImuData") -> None:
    """Say how the capture of a recording went."""
    from plumbob.pipeline.guided import GUIDES, guided

    guide = GUIDES[args.guided]()
    progress = guided(guide, imu)
    args.told = _told(guide, progress)
    if not args.json:
        print("\n".join(_lines(guide, progress)))


def _run(args: argparse.Namespace, session: "Session") -> "ImuData | None":
    """Samples of the line until the guide or somebody says stop; None where there are none."""
    from plumbob import _jit
    from plumbob.cli.calibrating.board import Board
    from plumbob.cli.line import Status
    from plumbob.pipeline.guided import GUIDES, GuideSink, warm_up
    from plumbob.pipeline.keep import Keeper
    from plumbob.pipeline.line import Line
    from plumbob.pipeline.runner import run_line
    from plumbob.pipeline.sinks import Collected, Sink
    from plumbob.pipeline.sources import open_source

    line, guide, collected = Line(session), GUIDES[args.guided](), Collected()
    if _jit.is_cold("accumulate"):
        common.note(_jit.compiling("the guide"))
    line.warm_up()
    warm_up()
    board, status = Board(f"calibrate {args.kind}", guide), Status(line, quiet=True)
    keeper = None if session.record is None else Keeper(session, session.record)
    source = open_source(session.source)
    common.note("waiting for samples; the capture ends when it is good, or by Ctrl-C with what there is")
    with common.stopped_by_signals() as stop:
        sinks: list[Sink] = [collected, GuideSink(guide, stop, board.show), _Notes(board, status)]
        run_line(line, source, sinks=sinks, keeper=keeper, stop=stop, each=status.look)
    board.erase()
    args.told = _told(guide, guide.progress())
    return collected.imu(calibrated=False)


class _Notes:
    """Notes of a line, out of the way of a board."""

    def __init__(self, board: Any, status: Any) -> None:
        self._board, self._status = board, status

    def on_part(self, part: Any) -> None:
        """Leave it to the guide."""

    def on_event(self, event: "Event") -> None:
        """Say it."""
        self._board.erase()
        self._status.on_event(event)

    def close(self) -> None:
        """Nothing is held open."""


def _require_end(args: argparse.Namespace) -> None:
    """Refuse options with which the card of a whole capture could not be made or written."""
    from plumbob.errors import ParameterError

    if args.profile or args.stop:
        raise ParameterError(
            "--profile and --to belong to recordings; a live capture ends when it is good, or by Ctrl-C."
        )
    if args.out is None or not args.out.parent.is_dir():
        raise ParameterError(f"--live needs --out, a card to write in a folder that exists, but it is {args.out}.")


def _require_triads(session: "Session", triads: tuple[str, ...]) -> None:
    """Refuse a line that has not what is calibrated."""
    from plumbob.errors import CalibrationError

    fields = session.form.message(session.message).fields
    parts = [f.triad.rpartition(".") for f in fields if f.triad]
    known = {triad for unit, _, triad in parts if unit == session.unit}
    if missing := [name for name in triads if name not in known]:
        raise CalibrationError(f"the line has no {', '.join(missing)}, only {', '.join(sorted(known))}.")


def _session(args: argparse.Namespace) -> "Session":
    """Session of the capture: nothing is estimated, and recorded only where that is asked for.

    A unit that is called like its format was not named, and a card needs a name.
    """
    from dataclasses import replace

    from plumbob.data import ImuMeta
    from plumbob.pipeline.session import RecordSpec

    named = {"imu": {"device": args.device}} if args.device and args.file is None else {}
    session = lines.session_of(args, args.file, args.start, named)
    record = None if args.raw is None else replace(session.record or RecordSpec(""), path=str(args.raw))
    device = session.meta.device
    if device == session.form.name:
        device = args.device or ImuMeta().device
    return replace(session, meta=replace(session.meta, device=device), stage=None, record=record)


def _told(guide: "Guide", progress: "Progress") -> dict[str, Any]:
    from plumbob.calib.regions import NAMES

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
    from plumbob.calib.regions import names_of
    from plumbob.cli.calibrating.board import map_lines

    lines = [f"{moment.t:7.1f} s  {moment.text}" for moment in guide.timeline]
    lines.append(f"{progress.elapsed:7.1f} s  end of the capture")
    if progress.filled is not None:
        lines += ["", *map_lines(progress), "", f"missing      {names_of(progress.missing) or 'nothing'}"]
    if not progress.done:
        lines.append(f"what to add  {progress.next_step}")
    return [*lines, ""]
