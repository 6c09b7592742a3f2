"""plumbob emulate: a rig that speaks its real bytes."""

import argparse
import sys
from contextlib import ExitStack
from pathlib import Path

from plumbob.cli import common
from plumbob.core.text import counted


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb."""
    p = verbs.add_parser(
        "emulate",
        help="emulate a rig: its bytes over a pseudo-terminal, a socket or into a file",
        description="Emulate a paper's rig, or any frame described in TOML, driven by the simulator. Prints the port's "
        "name first, and starts when somebody opens it.",
        epilog=common.more("plumbob emulate buoy --link buoy-port --duration 60s --truth truth.parquet", "acquire.md"),
    )
    p.add_argument("what", nargs="?", metavar="RIG", help="a rig, or a format: see --list and 'plumbob devices'")
    p.add_argument("--list", action="store_true", help="list rigs and kinds of faults, and stop")
    _add_content(p)
    _add_port(p)
    _add_faults(p)
    p.set_defaults(run=run)


def _add_content(p: argparse.ArgumentParser) -> None:
    p.add_argument("--scenario", metavar="NAME", help="motion of the body (default: the rig's own)")
    p.add_argument("--set", default="", metavar="P", help="name=value,... with units: parameters of --scenario")
    p.add_argument("--sensors", metavar="A+B", help="parts of what measures (default: a rig's own; ideal of a format)")
    p.add_argument("--reference", metavar="A", help="part of a rig's reference, as ideal (default: the rig's own)")
    p.add_argument("--unit", choices=("random", "calibrated"), default="random", help="default random, as off the line")
    p.add_argument(
        "--noise",
        action="append",
        default=[],
        metavar="[UNIT=]JSON",
        help="noise card whose N, B and K the units take instead of their own, or one unit by its prefix; repeatable",
    )
    p.add_argument("--temp", metavar="T", help="temperature, as 40degC (default 25 degC)")
    common.add_warm_up(p)
    p.add_argument("--high-pass", metavar="HZ", help="first-order high-pass behind the gyroscopes, as 0.5Hz")
    p.add_argument("--mount-error", metavar="A", help="sd of how references (units, without one) really sit, as 0.5deg")
    common.add_frame(p, "navigation frame of a format's truth, and its body's axes (a rig has its own; default NED)")
    common.add_option(p)
    p.add_argument("--seed", type=int, default=0, metavar="N", help="seed of everything random (default 0)")
    p.add_argument("--clock-error", metavar="E", help="error of the device's clock, as 0.004%%; positive: fast")
    p.add_argument("--rate", metavar="HZ", help="frames per second, as 100Hz (default: the format's)")
    p.add_argument("--duration", metavar="S", help="duration, as 60s (default: the scenario's)")
    p.add_argument("--truth", type=Path, metavar="FILE", help="recording of samples and truth; calibration card beside")
    common.add_calibration(p, "card that the processor of rig buoy_attitude corrects its samples with")
    p.add_argument("--flash-log", type=Path, metavar="FILE", help="image of that rig's Flash log, as it is at the end")


def _add_port(p: argparse.ArgumentParser) -> None:
    where = p.add_mutually_exclusive_group()
    where.add_argument("--link", type=Path, metavar="PATH", help="symbolic link that leads to the pseudo-terminal")
    where.add_argument(
        "--tcp", metavar="HOST:PORT", help="listen there; :PORT is for this machine alone, port 0 a free one"
    )
    where.add_argument("--udp", metavar="HOST:PORT", help="send there, a frame in a datagram")
    where.add_argument(
        "--write", metavar="FILE", help="write the bytes alone to a file, or '-' for a pipe, as fast as possible"
    )
    p.add_argument("--speed", metavar="K", help="times real time, or max (default 1; max with --write)")
    common.add_force(p)


def _add_faults(p: argparse.ArgumentParser) -> None:
    p.add_argument("--faults", metavar="F", help="kind=share,... of the frames, as flip=2%%,unplug=0.001")
    p.add_argument("--fault-log", type=Path, metavar="FILE", help="one JSON line for each fault once it has happened")


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.core.errors import ParameterError
    from plumbob.live.emulated import emulate, outputs
    from plumbob.live.transports.transport import Stop

    if args.list:
        _print_list()
        return 0
    if args.what is None:
        raise ParameterError("emulate needs a RIG or a format; 'plumbob emulate --list' shows what there is.")
    write = sys.stdout.buffer if args.write == "-" else args.write
    noise = _noise(args.noise)
    cards = noise.values() if isinstance(noise, dict) else (noise,)
    files = outputs(args.what, args.truth, write, args.fault_log, args.flash_log)
    common.check_outputs(args, *files, inputs=(*cards, args.calibration))
    stop = Stop()
    with ExitStack() as stack:

        def opened(name: str) -> None:
            # A line may end at any time; a file that is cut looks like one that is not, so that a signal removes it.
            if not args.write:
                stack.enter_context(common.stopped_by_signals(stop))
                print(name, flush=True)

        names = ("scenario", "sensors", "reference", "unit", "warm_up", "high_pass", "mount_error", "frame", "seed",
                 "clock_error", "rate", "duration", "truth", "calibration", "flash_log", "link", "tcp", "udp", "speed",
                 "fault_log")  # fmt: skip
        served = emulate(
            args.what,
            **{name: value for name in names if (value := getattr(args, name)) is not None},
            noise=noise,
            temp_c=args.temp,
            set=dict(common.pairs(args.set)),
            options=common.chosen_options(args),
            faults=dict(common.pairs(args.faults)),
            write=write,
            overwrite=args.force,
            stop=stop,
            opened=opened,
            note=common.note,
        )
    counts = ", ".join(f"{number} {word}" for word, number in served.facts().items())
    late = f"; latest by {served.latest_ns / 1e6:.1f} ms" if served.latest_ns else ""
    common.note(f"{counted(served.frames, 'frame')}: {counts}{late}")
    return 0


def _noise(words: list[str]) -> "Path | dict[str, Path] | None":
    """Noise cards that the options name: one for all units, or by prefix; a path may hold an equals sign, too."""
    from plumbob.core.errors import ParameterError

    named = {word.partition("=")[0]: Path(word.partition("=")[2]) for word in words if _is_named(word)}
    if len(named) == len(words):
        return named or None
    if len(words) > 1:
        raise ParameterError("give --noise one card for all units, or UNIT=CARD once for each unit that has one.")
    return Path(words[0])


def _is_named(word: str) -> bool:
    prefix, equals, _ = word.partition("=")
    return bool(equals) and prefix.isidentifier()


def _print_list() -> None:
    from plumbob.live.rigs.faults import KINDS
    from plumbob.live.rigs.plan import PLANS

    print("rigs")
    for name, plan in PLANS.items():
        print(f"    {name:10} {plan.title}; {plan.rate:g} Hz")
    print("faults, each a share of the frames")
    for kind, meaning in KINDS.items():
        print(f"    {kind:10} {meaning}")
