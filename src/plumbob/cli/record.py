"""plumbob record: from a live line to a recording, with the attitude as it comes."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from plumbob.cli import common
from plumbob.cli import line as told

if TYPE_CHECKING:
    from plumbob.pipeline.session import Session


LOSSY = 3


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb."""
    p = verbs.add_parser(
        "record",
        help="record a live line, and estimate its attitude as it comes",
        description="Read a live line as a session file says, or as the options say, keep its raw bytes and what they "
        "mean in an MCAP recording, and estimate the attitude. End it with Ctrl-C. Exit code 3 "
        "where rows of the recording are lost, as on a full disk.",
    )
    p.add_argument("session", type=Path, nargs="?", help="session file (TOML); or give --port, --from or --iio")
    p.add_argument("--port", metavar="DEV", help="serial line, such as /dev/ttyUSB0")
    p.add_argument("--from", dest="capture", metavar="FILE", help="raw bytes in a file, as a logger keeps them")
    p.add_argument(
        "--rate", metavar="HZ", help="frames per second of --from, where its format has neither clock nor rate"
    )
    p.add_argument("--iio", metavar="DEV", help="buffer of an IIO device (Linux), by its name or number")
    p.add_argument("--baud", type=int, default=115200, help="its speed (115200)")
    p.add_argument("--format", metavar="NAME|TOML", help="known device, see 'plumbob devices', or a format file")
    p.add_argument("--device", metavar="ID", help="name of this very unit, to which its calibration card belongs")
    told.add_estimate(p)
    p.add_argument("--out", type=Path, metavar="MCAP", help="recording to write")
    p.add_argument("--text", type=Path, metavar="TXT", help="text file that gets a line of attitude now and then")
    p.add_argument("--duration", metavar="TIME", help="stop after this time, such as 10s or 0.5h")
    common.add_json(p)
    p.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.pipeline.keep import Keeper
    from plumbob.pipeline.line import Line
    from plumbob.pipeline.runner import run_line
    from plumbob.pipeline.sinks import Sink, TextSink
    from plumbob.pipeline.sources import open_source
    from plumbob.units import Quantity, parse

    session = session_of(args)
    duration = None if args.duration is None else parse(args.duration, Quantity.TIME)
    line = Line(session)
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
            "path": session.record.path,
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
    return LOSSY if kept and kept["acknowledged"] < kept["rows"] else 0


def session_of(args: argparse.Namespace) -> "Session":
    """Session from the file, or from the options; --out and --text go before what the file says."""
    from dataclasses import replace

    from plumbob.errors import ParameterError
    from plumbob.pipeline.session import RecordSpec
    from plumbob.pipeline.session_toml import load_session

    if [args.session, args.port, args.capture, args.iio].count(None) != 3:
        raise ParameterError("give either a session file, or --port or --from with --format, or --iio.")
    if args.session is not None:
        if args.filter or args.format or args.calibration or args.device:
            raise ParameterError("the session file says format, device, calibration and filter; leave the options out.")
        session = load_session(args.session)
    else:
        session = _session_of_options(args)
    if args.out:
        spec = session.record or RecordSpec(str(args.out))
        session = replace(session, record=replace(spec, path=str(args.out)))
    if args.text:
        session = replace(session, output=replace(session.output, text=str(args.text)))
    return session


def _session_of_options(args: argparse.Namespace) -> "Session":
    from plumbob.errors import ParameterError
    from plumbob.forms import text_of
    from plumbob.pipeline.session_toml import parse_session, plain_session

    if args.iio is not None and args.format:
        raise ParameterError("--iio takes no --format: the kernel says what the bytes mean.")
    if args.iio is None and args.format is None:
        raise ParameterError(
            "--port and --from need --format: what the bytes mean is not guessed; see 'plumbob devices'."
        )
    imu = {key: value for key, value in (("device", args.device), ("frame", args.frame)) if value}
    tables = told.estimate_tables(args) | ({"imu": imu} if imu else {})
    text = plain_session(form=args.format, source=_source_of_options(args), **tables)
    name = Path(args.port or args.capture or args.iio).name
    return parse_session(text, lambda file: text_of(Path(file)), name=name)


def _source_of_options(args: argparse.Namespace) -> dict[str, str | int]:
    if args.iio is not None:
        return {"kind": "iio", "device": int(args.iio) if args.iio.isdecimal() else args.iio}
    if args.capture is not None:
        return {"kind": "file", "path": args.capture} | ({"rate": args.rate} if args.rate else {})
    return {"kind": "serial", "port": args.port, "baud": args.baud}
