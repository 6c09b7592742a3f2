"""plumbob benchmark: filters on many recordings, or on many seeds of a scenario."""

import argparse
from pathlib import Path

from plumbob.cli import common
from plumbob.cli.sim import add_scenario_options, scenario_settings


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb and what can be benchmarked."""
    p = verbs.add_parser(
        "benchmark",
        help="filters on a folder of recordings, or on many seeds of a scenario",
        description="Measure filters on many recordings with references, or on many seeds of a simulated scenario.",
    )
    kinds = p.add_subparsers(dest="kind", metavar="KIND", required=True)
    _add_accuracy(kinds)
    _add_scenario(kinds)


def _add_accuracy(kinds: common.Adder) -> None:
    p = kinds.add_parser(
        "accuracy",
        help="errors on every recording of a folder, and their mean",
        description="Run filters, with one parameter set for all trials, on every recording of a folder that carries a "
        "reference, and print the errors per trial and their mean.",
    )
    p.add_argument("folder", type=Path, help="folder of recordings, such as BROAD trials")
    _add_filters(p)
    p.add_argument("--align", default="", metavar="A,B", help="remove heading, mounting or time offsets first")
    common.add_frame(p, "navigation frame where a recording names none")
    common.add_json(p)
    p.set_defaults(run=run_accuracy)


def _add_scenario(kinds: common.Adder) -> None:
    p = kinds.add_parser(
        "scenario",
        help="errors per axis over many seeds of a simulated scenario",
        description="Simulate a scenario with many seeds, run filters on each, and print the errors per axis.",
    )
    add_scenario_options(p)
    _add_filters(p)
    p.add_argument("--seeds", type=int, default=20, metavar="N", help="number of seeds, from 0 (default 20)")
    p.add_argument("--settle", default="0", metavar="S", help="leave out so much at the start, as 60s (default 0)")
    common.add_json(p)
    p.set_defaults(run=run_scenario)


def _add_filters(p: argparse.ArgumentParser) -> None:
    p.add_argument("--filters", required=True, metavar="A,B", help="see 'plumbob filters'")
    p.add_argument("--params", metavar="P", help=f"{common.PARAMS_HELP}; with several filters write filter.name=value")


def run_accuracy(args: argparse.Namespace) -> int:
    """Do it on recordings."""
    from plumbob.benchmark import measure_accuracy, trials_in
    from plumbob.cli.eval import alignments

    files, chosen = trials_in(args.folder), common.stages(args.filters, args.params)
    common.warn_of_compiling([stage.filter for stage in chosen])
    with common.progress(f"{len(files)} recordings", len(files)) as advance:
        result = measure_accuracy(
            files, chosen, frame=common.frame_of(args), align=alignments(args.align), progress=advance
        )
    common.print_json(result.as_dict()) if args.json else print(result.text())
    return 0


def run_scenario(args: argparse.Namespace) -> int:
    """Do it on a scenario."""
    from plumbob.benchmark import measure_scenario
    from plumbob.errors import ParameterError
    from plumbob.units import Quantity, parse

    if args.seeds < 1:
        raise ParameterError(f"--seeds must be at least 1, but it is {args.seeds}.")
    chosen = common.stages(args.filters, args.params)
    frame, settings = scenario_settings(args)
    common.warn_of_compiling([stage.filter for stage in chosen])
    with common.progress(f"{args.seeds} seeds", args.seeds) as advance:
        result = measure_scenario(
            args.scenario,
            chosen,
            frame=frame,
            sensors=args.sensors,
            module=args.module,
            seeds=range(args.seeds),
            settings=settings,
            settle=parse(args.settle, Quantity.TIME),
            progress=advance,
        )
    common.print_json(result.as_dict()) if args.json else print(result.text())
    return 0
