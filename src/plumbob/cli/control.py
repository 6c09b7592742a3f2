"""plumbob control: what the buttons of the live page do, from a shell."""

import argparse

from plumbob.cli import common


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb."""
    p = verbs.add_parser(
        "control",
        help="ask a running view for something: record, stop, mark, tare, seek, calibrate",
        description="Ask a running view, which was started with --control, for what its buttons do.\n\n"
        "record [NAME], stop, mark TEXT, tare, untare, text [NAME], text-stop, add NAME, remove NAME; of a recording "
        "that is played: play, pause, seek SECONDS, speed FACTOR; calibrate KIND, calibrate-end, calibrate-cancel, "
        "allan-reset.",
        epilog=common.more("plumbob control 'http://127.0.0.1:8770/?token=...' mark 'lee of the pier'", "view.md"),
    )
    p.add_argument("url", help="address of the view with its token, as it printed it")
    p.add_argument("what", metavar="VERB", help="what to do")
    p.add_argument("argument", nargs="?", metavar="NAME|TEXT|VALUE", help="what it needs")
    common.add_json(p)
    p.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.viewer.control_client import control, verb_value

    answer = control(args.url, args.what, **verb_value(args.what, args.argument))
    common.print_json({"verb": args.what, "answer": answer}) if args.json else print(answer)
    return 0
