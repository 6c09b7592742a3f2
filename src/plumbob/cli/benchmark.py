"""plumbob benchmark: filters on many recordings, seeds of a scenario or faults; calibrations; decoders under damage."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from plumbob.cli import common
from plumbob.cli.sim import add_scenario_options, scenario_settings

if TYPE_CHECKING:
    from plumbob.benchmark import Case
    from plumbob.pipeline import Stage
    from plumbob.sensors.format import Format


class Result(Protocol):
    """What a benchmark gives."""

    def as_dict(self) -> dict[str, Any]: ...

    def text(self) -> str: ...


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb and what can be benchmarked."""
    p = verbs.add_parser(
        "benchmark",
        help="filters on recordings, on many seeds of a scenario, or under faults; calibrations; decoders",
        description="Measure filters on many recordings with references, on many seeds of a simulated scenario, or "
        "under faults of their input; calibrations of many simulated units; and decoders on damaged streams.",
    )
    kinds = p.add_subparsers(dest="kind", metavar="KIND", required=True)
    _add_accuracy(kinds)
    _add_scenario(kinds)
    _add_faults(kinds)
    _add_channel(kinds)
    _add_calibration(kinds)
    _add_rooms(kinds)
    _add_decoders(kinds)


def _add_accuracy(kinds: common.Adder) -> None:
    p = kinds.add_parser(
        "accuracy",
        help="errors on every recording of a folder, and their mean",
        description="Run filters, with one parameter set for all trials, on every recording of a folder that carries a "
        "reference, and print the errors per trial and their mean. Other libraries can run on the same recordings.",
    )
    p.add_argument("folder", type=Path, help="folder of recordings, such as BROAD trials")
    _add_filters(p)
    _add_peers(p, "; ahrs takes a second for 5000 samples")
    common.add_noise(p)
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
    p.add_argument(
        "--noise", metavar="JSON|own", help="noise card for filters that take one; own: of the simulated unit"
    )
    _add_seeds(p)
    p.add_argument("--settle", default="0", metavar="S", help="leave out so much at the start, as 60s (default 0)")
    p.add_argument("--limit", metavar="A", help="tell in how many seeds roll and pitch stay within this, as 1deg")
    common.add_json(p)
    p.set_defaults(run=run_scenario)


def _add_faults(kinds: common.Adder) -> None:
    p = kinds.add_parser(
        "faults",
        help="damaged samples, time stamps, starts and arguments, beside other libraries",
        description="Damage a simulated stream in many ways, feed it to filters and to other libraries sample by "
        "sample, and print what each makes of it beside its own clean run.",
    )
    _add_filters(p, required=False)
    _add_peers(p)
    p.add_argument("--cases", default="", metavar="A,B", help="cases or groups, F1 to F9 (default all)")
    p.add_argument("--list", action="store_true", help="list the cases with what they inject")
    common.add_json(p)
    p.set_defaults(run=run_faults)


def _add_channel(kinds: common.Adder) -> None:
    p = kinds.add_parser(
        "channel",
        help="the trackball paper's filter of a gyroscope channel, at rest and on a turntable",
        description="Repeat the trackball paper's tests of its rate filter on simulated data, beside a moving average "
        "and a filter with two states, and print noise, lag, angle, and what long averaging shows.",
    )
    _add_seeds(p)
    common.add_json(p)
    p.set_defaults(run=run_channel)


def _add_calibration(kinds: common.Adder) -> None:
    p = kinds.add_parser(
        "calibration",
        help="calibrations of many simulated units: errors, predictions, refusals",
        description="Calibrate many simulated units from captures of many kinds, turn them on the tilted table of the "
        "buoy paper, offer captures that must be refused, and print what is reached beside what it should be.",
    )
    p.add_argument(
        "--sections",
        default="",
        metavar="A,B",
        help="some of static, refusals, mag, accel, table, temperature (default all)",
    )
    _add_seeds(p, default=200)
    common.add_json(p)
    p.set_defaults(run=run_calibration)


def _add_rooms(kinds: common.Adder) -> None:
    p = kinds.add_parser(
        "rooms",
        help="magnetometers that were turned in real rooms: calibrations beside a reference",
        description="Calibrate the magnetometer of every recording of a folder that carries a reference, by its own "
        "samples alone and with the help that is chosen without being told, and print the heading error that each "
        "calibration predicts beside that by the reference.",
    )
    p.add_argument("folder", type=Path, help="folder of recordings, such as BROAD trials")
    p.add_argument(
        "--window", metavar="S", help="calibrate windows of this length each, as 30s (default: whole recordings)"
    )
    common.add_json(p)
    p.set_defaults(run=run_rooms)


def _add_decoders(kinds: common.Adder) -> None:
    p = kinds.add_parser(
        "decoders",
        help="sensor formats: damaged streams, noise, mutated bytes",
        description="Damage streams of every format in seven ways, let its decoder hear random and mutated bytes, and "
        "print how many undamaged frames are lost and how many wrong ones believed.",
    )
    p.add_argument(
        "--formats", default="", metavar="A,B", help="names, or .toml files (default: all known, and a user's)"
    )
    p.add_argument("--frames", type=int, default=20_000, metavar="N", help="frames per stream (default 20000)")
    p.add_argument("--noise", type=int, default=100_000_000, metavar="N", help="random bytes each (default 100000000)")
    p.add_argument("--fuzz", type=int, default=10_000_000, metavar="N", help="mutated bytes each (default 10000000)")
    common.add_json(p)
    p.set_defaults(run=run_decoders)


def _add_filters(p: argparse.ArgumentParser, *, required: bool = True) -> None:
    p.add_argument("--filters", required=required, metavar="A,B", help="see 'plumbob filters'")
    p.add_argument("--params", metavar="P", help=f"{common.PARAMS_HELP}; with several filters write filter.name=value")


def _add_peers(p: argparse.ArgumentParser, more: str = "") -> None:
    help_ = f"vqf, imufusion, ahrs, all or none (default none){more}"
    p.add_argument("--peers", default="none", metavar="A,B", help=help_)


def _add_seeds(p: argparse.ArgumentParser, default: int = 20) -> None:
    help_ = f"number of seeds, from 0 (default {default})"
    p.add_argument("--seeds", type=int, default=default, metavar="N", help=help_)


def _seeds(args: argparse.Namespace) -> range:
    """Seeds that --seeds asks for."""
    _require_some("--seeds", args.seeds)
    return range(args.seeds)


def _require_some(option: str, count: int) -> None:
    from plumbob.errors import ParameterError

    if count < 1:
        raise ParameterError(f"{option} must be at least 1, but it is {count}.")


def _show(result: Result, args: argparse.Namespace) -> int:
    """Print what was measured, as --json asks."""
    common.print_json(result.as_dict()) if args.json else print(result.text())
    return 0


def run_accuracy(args: argparse.Namespace) -> int:
    """Do it on recordings."""
    from plumbob.benchmark import measure_accuracy, peer_runs, trials_in
    from plumbob.cli.eval import alignments

    files = trials_in(args.folder)
    chosen = common.given_noise(common.stages(args.filters, args.params), args.noise)
    others, absent = peer_runs(args.peers)
    common.warn_of_compiling([stage.filter for stage in chosen])
    runs = len(chosen) + len(others)
    with common.progress(f"{len(files)} files, {runs} runs each", len(files) * runs) as advance:
        result = measure_accuracy(
            files,
            chosen,
            peers=others,
            absent=absent,
            frame=common.frame_of(args),
            align=alignments(args.align),
            progress=advance,
        )
    return _show(result, args)


def run_rooms(args: argparse.Namespace) -> int:
    """Do it in rooms."""
    from plumbob.benchmark import trials_in
    from plumbob.benchmark.rooms import measure_rooms
    from plumbob.units import Quantity, parse

    files = trials_in(args.folder)
    window = None if args.window is None else parse(args.window, Quantity.TIME)
    with common.progress(f"{len(files)} files", len(files)) as advance:
        result = measure_rooms(files, window=window, progress=advance)
    return _show(result, args)


def run_scenario(args: argparse.Namespace) -> int:
    """Do it on a scenario."""
    from plumbob.benchmark import measure_scenario
    from plumbob.units import Quantity, parse

    seeds = _seeds(args)
    chosen, own_noise = _with_noise(common.stages(args.filters, args.params), args.noise)
    frame, settings = scenario_settings(args)
    common.warn_of_compiling([stage.filter for stage in chosen])
    with common.progress(f"{args.seeds} seeds", args.seeds) as advance:
        result = measure_scenario(
            args.scenario,
            chosen,
            frame=frame,
            sensors=args.sensors,
            module=args.module,
            seeds=seeds,
            settings=settings,
            settle=parse(args.settle, Quantity.TIME),
            limit=None if args.limit is None else parse(args.limit, Quantity.ANGLE),
            own_noise=own_noise,
            progress=advance,
        )
    return _show(result, args)


def _with_noise(chosen: "list[Stage]", noise: str | None) -> "tuple[list[Stage], bool]":
    """Filters with the noise card that --noise names, and whether each simulated unit's own is to be taken."""
    if noise != "own":
        return common.given_noise(chosen, None if noise is None else Path(noise)), False
    common.tell_noise(chosen)
    return chosen, True


def run_faults(args: argparse.Namespace) -> int:
    """Do it under faults."""
    from plumbob.benchmark import ARGUMENTS, OurFilter, listing, measure_faults, peers
    from plumbob.errors import ParameterError

    if args.list:
        print(listing())
        return 0
    if args.filters is None:
        raise ParameterError("--filters is missing; 'plumbob filters' shows what there is, --list shows the cases.")
    chosen = common.stages(args.filters, args.params)
    cases, wanted = _cases(args.cases)
    others, absent = peers(args.peers)
    contenders = [*map(OurFilter, chosen), *others]
    common.warn_of_compiling([stage.filter for stage in chosen])
    with common.progress(f"{len(cases)} cases, {len(contenders)} contenders", len(cases) * len(contenders)) as advance:
        result = measure_faults(
            contenders, cases, arguments=ARGUMENTS in wanted or not wanted, absent=absent, progress=advance
        )
    return _show(result, args)


def _cases(names: str) -> "tuple[list[Case], list[str]]":
    """Cases that a comma list names, all where it is empty, and the names."""
    from plumbob.benchmark import CASES, choose

    wanted = [name.strip() for name in names.split(",") if name.strip()]
    return (choose(wanted) if wanted else list(CASES)), wanted


def run_channel(args: argparse.Namespace) -> int:
    """Do it on a gyroscope channel."""
    from plumbob.benchmark.channel import PARTS, measure_channel
    from plumbob.filters.channel import channel_names

    seeds = _seeds(args)
    common.warn_of_compiling([f"channel_{name}" for name in channel_names()])
    with common.progress(f"{args.seeds} seeds", PARTS * args.seeds) as advance:
        result = measure_channel(seeds, progress=advance)
    return _show(result, args)


def run_calibration(args: argparse.Namespace) -> int:
    """Do it on calibrations."""
    from plumbob.benchmark.calibration import PARTS, measure_calibration

    seeds = _seeds(args)
    names = [name.strip() for name in args.sections.split(",") if name.strip()]
    steps = sum(part.steps for name, part in PARTS.items() if name in names or not names)
    with common.progress(f"{args.seeds} units", steps) as advance:
        result = measure_calibration(seeds, names, progress=advance)
    return _show(result, args)


def run_decoders(args: argparse.Namespace) -> int:
    """Do it on decoders."""
    from plumbob.benchmark import measure_decoders

    for name in ("frames", "noise", "fuzz"):
        _require_some(f"--{name}", getattr(args, name))
    forms = _formats(args.formats)
    with common.progress(f"{len(forms)} formats", len(forms)) as advance:
        result = measure_decoders(forms, frames=args.frames, noise=args.noise, fuzzing=args.fuzz, progress=advance)
    return _show(result, args)


def _formats(names: str) -> "list[Format]":
    """Formats of a comma list; the whole catalogue and a user's own frame where it is empty."""
    from plumbob.benchmark import user_frame
    from plumbob.sensors import catalog
    from plumbob.sensors.format_toml import load_format

    wanted = [name.strip() for name in names.split(",") if name.strip()]
    if not wanted:
        return [*map(catalog.load, catalog.names()), user_frame()]
    return [load_format(name) if name.endswith(".toml") else catalog.load(name) for name in wanted]
