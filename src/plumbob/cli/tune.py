"""plumbob tune: parameters of a filter fitted to recordings with references, cross-validated."""

import argparse
from pathlib import Path

from plumbob.cli import common

UNPROVEN = 3
"""Exit code where no gain on held-out recordings is shown."""


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb."""
    p = verbs.add_parser(
        "tune",
        help="fit parameters of a filter to recordings with references, cross-validated",
        description="Fit parameters of a filter to recordings that carry a reference, and measure by cross-validation "
        "what they are worth on recordings that they were not fitted to. The defaults of the program stay as they are. "
        "Exit code 3: no gain on held-out recordings is shown, or there is nothing to hold out; the parameter file is "
        "then not written, unless --unproven is given.",
        epilog=common.more("plumbob tune trials --filter mahony --params kp,ki --out mahony.toml", "tune.md"),
    )
    p.add_argument("places", nargs="+", type=Path, metavar="FOLDER|FILE", help="folders of recordings, or recordings")
    p.add_argument("--filter", required=True, metavar="F", help="see 'plumbob filters'")
    p.add_argument(
        "--params", metavar="A,B", help="what to seek: names, or name=LOW..HIGH with units (default: the main ones)"
    )
    p.add_argument("--fixed", metavar="P", help=f"parameters that keep a value: {common.PARAMS_HELP}")
    p.add_argument("--metric", default="total", metavar="M", help="total, heading or inclination RMSE (default total)")
    p.add_argument(
        "--group-by", default="recording", metavar="G", help="held out together: recording, folder or device"
    )
    p.add_argument("--folds", type=int, metavar="K", help="number of folds (default: each group is one)")
    p.add_argument("--budget", type=int, default=60, metavar="N", help="evaluations for each search (default 60)")
    p.add_argument("--seed", type=int, default=1, metavar="N", help="of the search (default 1)")
    p.add_argument("--align", default="", metavar="A,B", help="remove heading, mounting or time offsets first")
    p.add_argument("--settle", default="0", metavar="S", help="leave out so much at the start, as 10s (default 0)")
    p.add_argument("--jobs", type=int, default=2, metavar="N", help="threads (default 2)")
    common.add_frame(p, "navigation frame where a recording names none")
    p.add_argument("--out", type=Path, metavar="TOML", help="parameter file to write, for 'plumbob run --params'")
    p.add_argument("--unproven", action="store_true", help="write the file even where no gain is shown")
    common.add_page(p)
    common.add_force(p)
    common.add_json(p)
    p.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.cli.eval import alignments
    from plumbob.core.errors import ParameterError
    from plumbob.fleet.experiments.tuning import tune

    if args.out is not None and args.out.suffix.lower() != ".toml":
        raise ParameterError(f"--out needs a name that ends in .toml, but got {args.out}.")
    common.check_pages(args, args.out, inputs=args.places)
    (stage,) = common.stages(args.filter, args.fixed)
    with common.progress_bars() as done:
        tuning = tune(
            args.places,
            stage.filter,
            params=None if args.params is None else args.params.split(","),
            fixed=stage.params,
            metric=args.metric,
            group_by=args.group_by,
            folds=args.folds,
            budget=args.budget,
            seed=args.seed,
            frame=common.frame_arg(args),
            align=alignments(args.align),
            settle=args.settle,
            jobs=args.jobs,
            progress=lambda so_far, total: done("tuning", so_far, total),
        )
    common.print_json(tuning.as_dict()) if args.json else print(tuning.text())
    if args.out is not None and (tuning.proven or args.unproven):
        tuning.write(args.out, unproven=args.unproven, overwrite=args.force)
        if not args.json:
            print(f"{'parameters':12} {args.out}")
    elif args.out is not None:
        common.note(f"{args.out} is not written: no gain is shown; --unproven writes it all the same")
    common.write_pages(args, tuning.report())
    return 0 if tuning.proven else UNPROVEN
