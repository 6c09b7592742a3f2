"""plumbob benchmark: filters on many recordings, or on many seeds of a scenario."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Protocol

from plumbob.cli import common
from plumbob.cli.sim import add_scenario_options, scenario_settings
from plumbob.core.text import counted

if TYPE_CHECKING:
    from plumbob.filters.offline import Stage


class Result(Protocol):
    """What a benchmark gives."""

    def as_dict(self) -> dict[str, Any]: ...

    def text(self) -> str: ...


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb and what can be benchmarked."""
    p = verbs.add_parser(
        "benchmark",
        help="compare filters on many recordings, or on many seeds of a scenario",
        description="Measure filters on many recordings with references, or on many seeds of a simulated scenario.",
        epilog=common.more("plumbob benchmark accuracy trials --filters mahony,vqf", "choose-a-filter.md"),
    )
    kinds = p.add_subparsers(dest="kind", metavar="KIND", required=True)
    _add_accuracy(kinds)
    _add_scenario(kinds)


def _add_accuracy(kinds: common.Adder) -> None:
    p = kinds.add_parser(
        "accuracy",
        help="errors on every recording of some folders, and their means",
        description="Run filters and the smoother, with one parameter set for all trials, on every recording that "
        "carries a reference, and print the errors per trial, their means, and how far claimed uncertainties hold. "
        "Other libraries can run on the same recordings, and all recordings can be made harder first.",
        epilog=common.more(
            "plumbob benchmark accuracy trials --filters smoother --peers vqf --against smoother --gaps 5x1s",
            "accuracy.md",
        ),
    )
    p.add_argument("places", nargs="+", type=Path, metavar="FOLDER", help="folders of recordings, or recordings")
    add_filters(p)
    add_peers(p, "; ahrs takes a second for 5000 samples")
    common.add_noise(p)
    p.add_argument("--against", metavar="NAME", help="compare the others with this one, trial by trial")
    p.add_argument("--align", default="", metavar="A,B", help="remove heading, mounting or time offsets first")
    p.add_argument("--between", metavar="S,S", help="judge only this time after the first sample, as 0s,10s")
    p.add_argument(
        "--calibrated", action="store_true", help="recordings without a card come from calibrated units: claims say so"
    )
    common.add_frame(p, "navigation frame where a recording names none")
    common.add_json(p)
    harder = p.add_argument_group("changes to every recording, before anything runs")
    for name, (metavar, help_) in CHANGES.items():
        option, flag = f"--{name.replace('_', '-')}", {"action": "store_const", "const": ""}
        harder.add_argument(option, help=help_, **({"metavar": metavar} if metavar else flag))
    harder.add_argument("--seed", type=int, default=1, metavar="N", help="of gaps and missing rows (default 1)")
    p.set_defaults(run=run_accuracy)


CHANGES: Final = {
    "start": ("S", "begin this long after the motion begins, as 20s"),
    "wrong_field": (
        "F:S-S", "add a field in the reference's frame for a time, as 15,-10,20uT:0s-20s; ...@motion counts from the "
        "begin of the motion; several with ;",
    ),
    "hard_iron": ("F", "add a field in body axes, as 5,0,0uT"),
    "scale": ("R", "make rates too large, as 1%%"),
    "bias": ("R", "add a rate, on all axes or each, as 6dps or 2,-2,2dps"),
    "no_mag": ("", "leave out the magnetometer"),
    "gaps": ("NxS", "remove the samples of N stretches in motion, as 5x1s"),
    "rate": ("HZ", "means of whole blocks, as 47.6Hz"),
    "asynchronous": ("", "rates, specific forces and fields in different rows"),
    "missing": ("R", "rows without values, as 5%%"),
}  # fmt: skip
"""By name, as `plumbob.fleet.experiments.variants.changed` knows them: letter of the value, help."""


def _add_scenario(kinds: common.Adder) -> None:
    p = kinds.add_parser(
        "scenario",
        help="errors per axis over many seeds of a simulated scenario",
        description="Simulate a scenario with many seeds, run filters on each, and print the errors per axis.",
        epilog=common.more(
            "plumbob benchmark scenario buoy --frame NED --filters mahony,mekf --seeds 20", "choose-a-filter.md"
        ),
    )
    add_scenario_options(p)
    add_filters(p)
    p.add_argument(
        "--noise", metavar="JSON|own", help="noise card for filters that take one; own: of the simulated unit"
    )
    add_seeds(p)
    p.add_argument("--settle", default="0", metavar="S", help="leave out so much at the start, as 60s (default 0)")
    p.add_argument(
        "--limit", metavar="A", help="limit of roll and pitch error, as 1deg: print in how many seeds it holds"
    )
    common.add_json(p)
    p.set_defaults(run=run_scenario)


def add_filters(p: argparse.ArgumentParser, *, required: bool = True) -> None:
    p.add_argument("--filters", required=required, metavar="A,B", help="see 'plumbob list filters'")
    p.add_argument("--params", metavar="P", help=f"{common.PARAMS_HELP}; with several filters write filter.name=value")


def add_peers(p: argparse.ArgumentParser, more: str = "") -> None:
    help_ = f"vqf, imufusion, ahrs, single ones as vqf.offlineVQF, all or none (default none){more}"
    p.add_argument("--peers", default="none", metavar="A,B", help=help_)


def add_seeds(p: argparse.ArgumentParser, default: int = 20) -> None:
    help_ = f"number of seeds, from 0 (default {default})"
    p.add_argument("--seeds", type=int, default=default, metavar="N", help=help_)


def parse_seeds(args: argparse.Namespace) -> range:
    """Seeds that --seeds asks for."""
    require_some("--seeds", args.seeds)
    return range(args.seeds)


def require_some(option: str, count: int) -> None:
    from plumbob.core.errors import ParameterError

    if count < 1:
        raise ParameterError(f"{option} must be at least 1, but it is {count}.")


def show(result: Result, args: argparse.Namespace) -> int:
    """Print what was measured, as --json asks."""
    common.print_json(result.as_dict()) if args.json else print(result.text())
    return 0


def run_accuracy(args: argparse.Namespace) -> int:
    """Do it on recordings."""
    from plumbob.fleet.experiments.peers import peer_runs
    from plumbob.fleet.experiments.trials import measure_accuracy, trials_in

    files = trials_in(*args.places)
    changes = {name: value for name in CHANGES if (value := getattr(args, name)) is not None}
    chosen = common.given_noise(common.stages(args.filters, args.params), args.noise)
    others, absent = peer_runs(args.peers)
    runs = len(chosen) + len(others)
    with common.progress(f"{counted(len(files), 'file')}, {counted(runs, 'run')} each", len(files) * runs) as advance:
        result = measure_accuracy(
            files,
            chosen,
            peers=others,
            absent=absent,
            frame=common.frame_arg(args),
            align=common.alignments(args.align),
            changes=changes,
            seed=args.seed,
            between=_between(args.between),
            calibrated=args.calibrated,
            against=args.against,
            progress=advance,
        )
    return show(result, args)


def _between(text: str | None) -> tuple[float, float] | None:
    from plumbob.core.errors import ParameterError
    from plumbob.core.units import Quantity, parse

    if text is None:
        return None
    begin, comma, end = text.partition(",")
    if not comma:
        raise ParameterError(f"--between needs two times, as 0s,10s, but got '{text}'.")
    return parse(begin, Quantity.TIME), parse(end, Quantity.TIME)


def run_scenario(args: argparse.Namespace) -> int:
    """Do it on a scenario."""
    from plumbob.core.units import Quantity, parse
    from plumbob.fleet.experiments.scenario import measure_scenario

    seeds = parse_seeds(args)
    chosen, own_noise = _with_noise(common.stages(args.filters, args.params), args.noise)
    frame, settings = scenario_settings(args)
    with common.progress(counted(args.seeds, "seed"), args.seeds) as advance:
        result = measure_scenario(
            args.scenario,
            chosen,
            frame=frame,
            sensors=args.sensors,
            unit=args.unit,
            seeds=seeds,
            settings=settings,
            settle=parse(args.settle, Quantity.TIME),
            limit=None if args.limit is None else parse(args.limit, Quantity.ANGLE),
            own_noise=own_noise,
            progress=advance,
        )
    return show(result, args)


def _with_noise(chosen: "list[Stage]", noise: str | None) -> "tuple[list[Stage], bool]":
    """Filters with the noise card that --noise names, and whether each simulated unit's own is to be taken."""
    if noise != "own":
        return common.given_noise(chosen, None if noise is None else Path(noise)), False
    common.tell_noise(chosen)
    return chosen, True
