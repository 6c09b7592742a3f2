"""What verbs on a live line share: the options that name it, and the session that they mean."""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from plumbob.session.session import Session


def add_line(p: argparse._ActionsContainer) -> None:
    """Options of a line, besides its session file and ``--from``."""
    p.add_argument("--port", metavar="DEV", help="serial line, such as /dev/ttyUSB0")
    p.add_argument(
        "--rate",
        metavar="HZ",
        help="frames per second of --port or --from, where the format has neither clock nor rate",
    )
    p.add_argument(
        "--time",
        choices=("host", "count"),
        help="of --port; count: by the frames alone, for a line that loses nothing, such as one faster than real time",
    )
    p.add_argument("--iio", metavar="DEV", help="buffer of an IIO device (Linux), by its name or number")
    p.add_argument("--baud", type=int, default=115200, help="its speed (115200)")
    p.add_argument("--format", metavar="NAME|TOML", help="known device, see 'plumbob devices', or a format file")
    p.add_argument(
        "--unit", metavar="NAME|N", help="which unit, where a frame has several, as the six of the rig 'arm'"
    )


def session_of(
    args: argparse.Namespace, file: Path | None, capture: str | None, tables: Mapping[str, Mapping[str, Any]]
) -> "Session":
    """Session of a file, or of the options of a line.

    Parameters
    ----------
    args : Namespace
        Options of `add_line`.
    file : Path or None
        Session file.
    capture : str or None
        Raw bytes in a file, as ``--from`` names them.
    tables : mapping
        What the options say besides the line, by table of a session file.

    Raises
    ------
    PlumbobError
        If not exactly one line is named, the options do not fit it, or the file cannot be read.
    """
    from plumbob.core.errors import ParameterError
    from plumbob.core.files import text_of
    from plumbob.session.session_toml import load_session, parse_session, plain_session

    if [file, args.port, capture, args.iio].count(None) != 3:
        raise ParameterError("give either a session file, or --port or --from with --format, or --iio.")
    if args.unit:
        tables = {**tables, "format": {"unit": args.unit}}
    if file is not None:
        if args.format or tables:
            raise ParameterError(
                "the session file says format, unit, device, frame, calibration and filter; leave the options out."
            )
        return load_session(file)
    if args.iio is not None and (args.format or args.unit):
        raise ParameterError("--iio takes no --format and no --unit: the kernel says what the bytes mean.")
    if args.iio is None and args.format is None:
        raise ParameterError(
            "--port and --from need --format: what the bytes mean is not guessed; see 'plumbob devices'."
        )
    text = plain_session(form=args.format, source=_source(args, capture), **tables)
    return parse_session(text, lambda name: text_of(Path(name)), name=Path(args.port or capture or args.iio).name)


def _source(args: argparse.Namespace, capture: str | None) -> dict[str, str | int]:
    if args.iio is not None:
        return {"kind": "iio", "device": int(args.iio) if args.iio.isdecimal() else args.iio}
    rate = {"rate": args.rate} if args.rate else {}
    if capture is not None:
        return {"kind": "file", "path": capture, **rate}
    time = {"time": args.time} if args.time else {}
    return {"kind": "serial", "port": args.port, "baud": args.baud, **rate, **time}
