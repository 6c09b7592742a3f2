"""plumbob repair: a complete recording of everything that is whole in a damaged one."""

import argparse
from pathlib import Path

from plumbob.cli import common
from plumbob.cli.verify import DAMAGED, PATH_HELP, print_verdict


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb."""
    p = verbs.add_parser(
        "repair",
        help="write the undamaged rows of an MCAP recording to a new, complete file",
        description="Write every whole row of a damaged or unfinished MCAP recording to one new, complete file.",
        epilog=common.more(
            "plumbob repair sea.mcap --out whole.mcap",
            "recordings.md",
            "exit codes: 0 nothing was lost, 3 repaired, but rows are lost, 1 it cannot be read or written\n",
        ),
    )
    p.add_argument("files", type=Path, nargs="+", metavar="FILE", help=PATH_HELP)
    p.add_argument("--out", type=Path, metavar="FILE", required=True, help="file to write")
    common.add_force(p)
    common.add_json(p)
    p.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.files.mcap import repair

    common.check_outputs(args, args.out, inputs=args.files)
    verdict = repair(args.files[0] if len(args.files) == 1 else args.files, args.out, overwrite=args.force)
    if args.json:
        common.print_json(verdict.as_dict() | {"out": str(args.out), "lossy": verdict.lossy})
    else:
        print_verdict(verdict)
        print(f"written      {args.out}, with every whole row")
    return DAMAGED if verdict.lossy else 0
