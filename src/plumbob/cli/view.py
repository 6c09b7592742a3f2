"""plumbob view: a line or a recording on a page that this machine serves."""

import argparse
import os
import sys
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any

from plumbob.cli import common

LOSSY = 3


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb."""
    p = verbs.add_parser(
        "view",
        help="show a live line, or play a recording, on a page in a browser",
        description="Show a live line as it runs, or play a recording, on a page that this machine serves to itself: "
        "attitude, charts, what each sensor says, how the line does. The page's address holds a token. End it with "
        "Ctrl-C or SIGTERM; a recording that is being made ends whole.",
        epilog=common.more(
            "plumbob view --emulate buoy",
            "view.md",
            "exit codes: 0 ended as asked, 1 an error that the message explains, such as no sample at all, "
            "3 rows of a recording are lost\n",
        ),
    )
    add_shown(p)
    p.add_argument("--host", default="127.0.0.1", metavar="ADDRESS", help="where to listen (default: this machine)")
    p.add_argument("--http-port", type=int, default=8770, metavar="N", help="its port (8770); 0 takes a free one")
    p.add_argument("--control", action="store_true", help="let the page record, mark, seek; 'plumbob control', too")
    p.add_argument("--clients", type=int, metavar="N", help="pages at most")
    p.add_argument(
        "--allow-origin", action="append", default=[], metavar="ORIGIN", help="let a page from there connect, too"
    )
    common.add_send(p)
    p.add_argument("--no-open", action="store_true", help="do not open a browser")
    common.add_json(p)
    p.set_defaults(run=run)


def add_shown(p: argparse.ArgumentParser) -> None:
    """Options of what is shown."""
    p.add_argument("what", nargs="?", type=Path, help="session file (.toml), recording, or serial port")
    p.add_argument("--emulate", metavar="RIG", help="start a rig of 'plumbob emulate --list', and show it")
    common.add_line(p, all_units="; all: decode all, and estimate the first")
    p.add_argument("--device", metavar="ID", help="name of this unit, to which its calibration card belongs")
    common.add_estimate(p)
    common.add_place(p)
    common.add_profile(p)
    p.add_argument("--also", default="", metavar="A,B", help="further estimators beside it, as mahony,vqf")
    p.add_argument("--chain", type=Path, metavar="TOML", help="chain whose segments carry the units: a stick figure")
    p.add_argument("--folder", type=Path, default=Path(), metavar="DIR", help="where recordings go (default: here)")
    p.add_argument("--duration", metavar="TIME", help="stop after this time, such as 10s or 0.5h")


def view_args(args: argparse.Namespace) -> dict[str, Any]:
    """What the options of `add_shown` say, as `plumbob.view` takes it."""
    line = {**common.line_args(args), **common.estimate_args(args)}
    line |= {name: getattr(args, name) for name in ("device", "place", "date", "profile")}
    also = [name.strip() for name in args.also.split(",") if name.strip()]
    return {"emulate": args.emulate, "also": also, "chain": args.chain, "folder": args.folder,
            "duration": args.duration, **line}  # fmt: skip


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.core.errors import DecodeError
    from plumbob.live.transports.transport import Stop
    from plumbob.viewer.view import view

    stop, status = Stop(), common.Status(quiet=args.json)
    with closing(status), ExitStack() as stack:

        def opened(url: str) -> None:
            print(url, file=sys.stderr if args.json else sys.stdout, flush=True)
            if args.host not in ("127.0.0.1", "::1", "localhost"):
                status.note(f"the view is open to other machines at {args.host}; the token is all that protects it")

        stack.enter_context(common.stopped_by_signals(stop))
        result = view(
            args.what,
            host=args.host,
            http_port=args.http_port,
            control=args.control,
            clients=args.clients,
            allow_origin=args.allow_origin,
            open_browser=not args.no_open and has_display(),
            send=args.send,
            stop=stop,
            note=status.note,
            opened=opened,
            **view_args(args),
        )
    common.print_json(result.summary()) if args.json else print(result.text())
    if result.nothing is not None:
        raise DecodeError(result.nothing)
    return LOSSY if result.lossy else 0


def has_display() -> bool:
    """Whether there is a screen that a browser could open on."""
    if sys.platform in ("win32", "darwin"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
