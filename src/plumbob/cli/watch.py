"""plumbob watch: a line or a recording as text that fills a terminal."""

import argparse

from plumbob.cli import common
from plumbob.cli.view import LOSSY, add_shown, view_args


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb."""
    p = verbs.add_parser(
        "watch",
        help="show a live line, or play a recording, as text that fills a terminal",
        description="Show a live line as it runs, or play a recording, in a terminal, as over ssh. Keys: q ends, r "
        "starts and stops a recording, m marks, the space bar pauses what is played, t lets angles count from now.",
        epilog=common.more("plumbob watch --emulate buoy", "view.md"),
    )
    add_shown(p)
    p.add_argument("--lang", choices=("en", "zh"), default="en", help="language of the labels (default en)")
    p.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.core.errors import DecodeError
    from plumbob.live.transports.transport import Stop
    from plumbob.viewer.terminal import watch

    stop = Stop()
    with common.stopped_by_signals(stop):
        result = watch(args.what, lang=args.lang, stop=stop, **view_args(args))
    print(result.text())
    if result.nothing is not None:
        raise DecodeError(result.nothing)
    return LOSSY if result.lossy else 0
