"""plumbob record: from a live line to a recording, with the attitude as it comes."""

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING

from plumbob.cli import common
from plumbob.cli import line as told
from plumbob.cli import session as lines

if TYPE_CHECKING:
    from plumbob.session.session import Session


LOSSY = 3


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb."""
    p = verbs.add_parser(
        "record",
        help="record a live line, and estimate its attitude as it comes",
        description="Read a live line as a session file says, or as the options say, keep its raw bytes and what they "
        "mean in an MCAP recording, and estimate the attitude. End it with Ctrl-C or SIGTERM. For a recorder that "
        "nobody attends, see 'Unattended' in docs/sessions.md.",
        epilog=common.more(
            "plumbob record --port /dev/ttyUSB0 --format buoy --device buoy-7 --out sea.mcap",
            "record-at-sea.md",
            "exit codes: 0 ended as asked, 1 an error that the message explains, such as no sample at all, "
            "3 rows of the recording are lost or its text is cut short, as on a full disk\n",
        ),
    )
    p.add_argument("session", type=Path, nargs="?", help="session file (TOML); or give --port, --from or --iio")
    p.add_argument("--from", dest="capture", metavar="FILE", help="raw bytes in a file, as a logger keeps them")
    lines.add_line(p)
    p.add_argument("--device", metavar="ID", help="name of this unit, to which its calibration card belongs")
    told.add_estimate(p)
    common.add_place(p)
    p.add_argument("--out", metavar="MCAP", help="recording to write; {utc} in its name is the time of the start")
    p.add_argument(
        "--next-part",
        action="store_true",
        help="where the recording exists, as after a crash, go on with its next part instead of refusing",
    )
    p.add_argument("--text", metavar="TXT", help="text file that gets a line of attitude now and then; {utc} as above")
    p.add_argument("--duration", metavar="TIME", help="stop after this time, such as 10s or 0.5h")
    common.add_json(p)
    p.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.core.errors import DecodeError
    from plumbob.core.units import Quantity, parse
    from plumbob.session.recording_sink import Keeper, named_at
    from plumbob.session.runner import run_line
    from plumbob.session.sinks import Sink, TextSink
    from plumbob.session.sources import open_source
    from plumbob.session.stream import Line

    session = named_at(session_of(args), time.time_ns())
    duration = None if args.duration is None else parse(args.duration, Quantity.TIME)
    line = Line(session)
    common.note_unassigned(session.form, session.form.message(session.message))
    if session.stage is not None:
        common.warn_of_compiling([session.stage.filter])
    line.warm_up()
    keeper = None if session.record is None else Keeper(session, session.record)
    status = told.Status(line, quiet=args.json)
    sinks: list[Sink] = [status]
    if session.output.text:
        sinks.append(TextSink(session.output.text, session.output.every))
    source = open_source(session.source)
    with common.stopped_by_signals() as stop:  # so that the recording ends whole
        run_line(line, source, sinks=sinks, keeper=keeper, duration=duration, stop=stop, each=status.look)
    report = told.report_of(session, line, status)
    if keeper is not None and session.record is not None:
        recorder = keeper.recorder
        report["recording"] = {
            "path": str(recorder.path),
            "rows": recorder.written,
            "acknowledged": recorder.acknowledged,
            "dropped": recorder.dropped,
        }
    kept = report.get("recording")
    if args.json:
        common.print_json(report)
    else:
        told.print_report(report, told.attitude_of(status.last))
        print(
            f"recorded     {kept['path']}: {kept['acknowledged']} of {kept['rows']} rows on disk"
            if kept
            else "recorded     NOTHING: neither --out nor [record] names a file"
        )
    if not status.samples:
        raise DecodeError(told.nothing_of(line))
    failed = keeper is not None and bool(keeper.failures)
    return LOSSY if failed or (kept and kept["acknowledged"] < kept["rows"]) else 0


def session_of(args: argparse.Namespace) -> "Session":
    """Session from the file, or from the options; --out and --text go before what the file says."""
    from dataclasses import replace

    from plumbob.core.errors import ParameterError
    from plumbob.session.session import RecordSpec

    imu = {key: value for key in ("device", "frame", "place", "date") if (value := getattr(args, key))}
    tables = told.estimate_tables(args) | ({"imu": imu} if imu else {})
    session = lines.session_of(args, args.session, args.capture, tables)
    if args.out:
        spec = session.record or RecordSpec(args.out)
        session = replace(session, record=replace(spec, path=args.out))
    if args.next_part:
        if session.record is None:
            raise ParameterError("--next-part belongs to a recording; name one with --out.")
        session = replace(session, record=replace(session.record, next_part=True))
    if args.text:
        session = replace(session, output=replace(session.output, text=args.text))
    return session
