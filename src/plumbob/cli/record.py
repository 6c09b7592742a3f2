"""plumbob record: from a live line to a recording, with the attitude as it comes."""

import argparse
from contextlib import ExitStack, closing
from pathlib import Path

from plumbob.cli import common

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
    common.add_line(p, all_units="; all: record all, and estimate the first")
    p.add_argument("--device", metavar="ID", help="name of this unit, to which its calibration card belongs")
    common.add_estimate(p)
    common.add_place(p)
    p.add_argument("--out", metavar="MCAP", help="recording to write; {utc} in its name is the time of the start")
    p.add_argument(
        "--next-part",
        action="store_true",
        help="where the recording exists, as after a crash, go on with its next part instead of refusing",
    )
    p.add_argument("--text", metavar="TXT", help="text file that gets a line of attitude now and then; {utc} as above")
    p.add_argument("--duration", metavar="TIME", help="stop after this time, such as 10s or 0.5h")
    common.add_send(p)
    common.add_json(p)
    p.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.core.errors import DecodeError
    from plumbob.live.record import record
    from plumbob.live.transports.transport import Stop

    status, stop = common.Status(quiet=args.json), Stop()
    with closing(status), ExitStack() as stack:
        result = record(
            args.session,
            capture=args.capture,
            **common.line_args(args),
            **common.estimate_args(args),
            device=args.device,
            place=args.place,
            date=args.date,
            out=args.out,
            next_part=args.next_part,
            text=args.text,
            duration=args.duration,
            send=args.send,
            stop=stop,
            opened=lambda: stack.enter_context(common.stopped_by_signals(stop)),  # so that the recording ends whole
            note=status.note,
            progress=status.show,
        )
    common.print_json(result.summary()) if args.json else print(result.text())
    if result.nothing is not None:
        raise DecodeError(result.nothing)
    return LOSSY if result.lossy else 0
