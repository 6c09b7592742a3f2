"""What Plumbob promises, measured: filters under faults, calibrations, rooms, decoders.

Run: python -m benchmarks.harness faults|calibration|rooms|decoders [options]
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plumbob.cli import common
from plumbob.cli.main import Parser
from plumbob.cli.main import main as run
from plumbob.core.errors import ParameterError

if TYPE_CHECKING:
    from plumbob.protocols.format import Format

PROGRAM = "python -m benchmarks.harness"


def build_parser(_words: Sequence[str] = ()) -> argparse.ArgumentParser:
    """Parser of what can be measured."""
    parser = Parser(
        prog=PROGRAM,
        description="Measure filters under faults of their input, calibrations of many units, "
        "magnetometers in real rooms, and decoders on damaged streams.",
    )
    kinds = parser.add_subparsers(dest="verb", metavar="KIND", required=True)
    adds = {
        _add_faults: run_faults,
        _add_calibration: run_calibration,
        _add_rooms: run_rooms,
        _add_decoders: run_decoders,
    }
    for add, measure in adds.items():
        p = add(kinds)
        p.set_defaults(run=measure)
        p.add_argument("--json", action="store_true", help="print one JSON object instead of text")
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, and return the exit code."""
    return run(argv, build_parser, PROGRAM)


def _add_faults(kinds: Any) -> Any:
    p = kinds.add_parser(
        "faults",
        help="damaged samples, time stamps, starts and arguments, beside other libraries",
        description="Damage a simulated stream in many ways, feed it to filters and to other libraries sample by "
        "sample, and print what each makes of it beside its own clean run.",
    )
    p.add_argument("--filters", metavar="A,B", help="see 'plumbob list filters'")
    p.add_argument("--params", metavar="P", help=f"{common.PARAMS_HELP}; with several filters write filter.name=value")
    p.add_argument("--peers", default="none", metavar="A,B", help="vqf, imufusion, ahrs, single ones, all or none")
    p.add_argument("--battery", choices=("first", "second"), default="first", help="set of faults (default first)")
    p.add_argument("--cases", default="", metavar="A,B", help="cases or groups, F1 to F9 or S1 to S9 (default all)")
    p.add_argument("--list", action="store_true", help="list the cases with what they inject")
    return p


def _add_calibration(kinds: Any) -> Any:
    p = kinds.add_parser(
        "calibration",
        help="calibrations of many simulated units: errors, predictions",
        description="Calibrate many simulated units from captures of many kinds, turn them on the tilted table of the "
        "buoy paper, offer captures that must be refused, and print what is reached beside what it should be.",
    )
    p.add_argument("--sections", default="", metavar="A,B", help="some of mag, accel, table, temperature (default all)")
    p.add_argument("--seeds", type=int, default=200, metavar="N", help="number of seeds, from 0 (default 200)")
    return p


def _add_rooms(kinds: Any) -> Any:
    p = kinds.add_parser(
        "rooms",
        help="magnetometers that were turned in real rooms: calibrations beside a reference",
        description="Calibrate the magnetometer of every recording of a folder that carries a reference, by its own "
        "samples alone and with the help that is chosen without being told, and print the heading error that each "
        "calibration predicts beside that by the reference.",
    )
    p.add_argument("folder", type=Path, help="folder of recordings, such as BROAD trials")
    p.add_argument("--window", metavar="S", help="calibrate windows of this length, as 30s (default: whole recordings)")
    return p


def _add_decoders(kinds: Any) -> Any:
    p = kinds.add_parser(
        "decoders",
        help="sensor formats: damaged streams, noise, mutated bytes",
        description="Damage streams of every format in seven ways, let its decoder hear random and mutated bytes, and "
        "print how many undamaged frames are lost and how many wrong ones believed.",
    )
    p.add_argument("--formats", default="", metavar="A,B", help="names, or .toml files (default all, and a user's)")
    p.add_argument("--frames", type=int, default=20_000, metavar="N", help="frames per stream (default 20000)")
    p.add_argument("--noise", type=int, default=100_000_000, metavar="N", help="random bytes each (default 100000000)")
    p.add_argument("--fuzz", type=int, default=10_000_000, metavar="N", help="mutated bytes each (default 10000000)")
    return p


def run_faults(args: argparse.Namespace) -> int:
    """Do it under faults."""
    from benchmarks.harness import fault_cases, second_cases
    from benchmarks.harness.contender import contender_of
    from benchmarks.harness.faults import measure_faults
    from benchmarks.harness.peers import peers
    from benchmarks.harness.second import measure_second

    battery = second_cases if args.battery == "second" else fault_cases
    if args.list:
        print(fault_cases.listing(battery.CASES, battery.GROUPS))
        return 0
    if args.filters is None:
        raise ParameterError("--filters is missing; see 'plumbob list filters', and --list for the cases.")
    chosen = common.stages(args.filters, args.params)
    wanted = [name.strip() for name in args.cases.split(",") if name.strip()]
    others, absent = peers(args.peers)
    contenders = [*map(contender_of, chosen), *others]

    if args.battery == "second":
        second = fault_cases.choose(wanted or list(second_cases.GROUPS), second_cases.CASES, second_cases.GROUPS)
        return _show(args, len(second) * len(contenders), measure_second, contenders, second, absent=absent)
    groups = fault_cases.GROUPS
    first = fault_cases.choose(wanted or list(groups), fault_cases.CASES, groups)
    how = {"arguments": fault_cases.ARGUMENTS in wanted or not wanted, "absent": absent}
    return _show(args, len(first) * len(contenders), measure_faults, contenders, first, **how)


def run_calibration(args: argparse.Namespace) -> int:
    """Do it on calibrations."""
    from benchmarks.harness.calibration import PARTS, measure_calibration

    _require_some("--seeds", args.seeds)
    names = [name.strip() for name in args.sections.split(",") if name.strip()]
    steps = sum(part.steps for name, part in PARTS.items() if name in names or not names)
    return _show(args, steps, measure_calibration, range(args.seeds), names)


def run_rooms(args: argparse.Namespace) -> int:
    """Do it in rooms."""
    from benchmarks.harness.rooms import measure_rooms
    from plumbob.core.units import Quantity, parse
    from plumbob.fleet.experiments.trials import trials_in

    files = trials_in(args.folder)
    window = None if args.window is None else parse(args.window, Quantity.TIME)
    return _show(args, len(files), measure_rooms, files, window=window)


def run_decoders(args: argparse.Namespace) -> int:
    """Do it on decoders."""
    from benchmarks.harness.decoders import measure_decoders

    for name in ("frames", "noise", "fuzz"):
        _require_some(f"--{name}", getattr(args, name))
    forms = _formats(args.formats)
    return _show(args, len(forms), measure_decoders, forms, frames=args.frames, noise=args.noise, fuzzing=args.fuzz)


def _require_some(option: str, count: int) -> None:
    if count < 1:
        raise ParameterError(f"{option} must be at least 1, but it is {count}.")


def _show(args: argparse.Namespace, total: int, measure: Callable[..., Any], *given: Any, **how: Any) -> int:
    """Measure so many steps with a bar, and print what was measured, as --json asks."""
    done = 0
    with common.progress_bars() as bars:

        def advance(steps: int) -> None:
            nonlocal done
            done += steps
            if bars is not None:
                bars(args.verb, done, total)

        result = measure(*given, progress=advance, **how)
    common.print_json(result.summary()) if args.json else print(result.text())
    return 0


def _formats(names: str) -> "list[Format]":
    """Formats of a comma list; the whole catalogue and a user's own frame where it is empty."""
    from benchmarks.harness.decoder_streams import user_frame
    from plumbob.protocols.format_toml import device_names, find_format, load_format

    wanted = [name.strip() for name in names.split(",") if name.strip()]
    if not wanted:
        return [*map(find_format, device_names()), user_frame()]
    return [load_format(name) if name.endswith(".toml") else find_format(name) for name in wanted]


if __name__ == "__main__":
    sys.exit(main())
