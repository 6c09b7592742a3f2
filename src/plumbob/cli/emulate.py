"""plumbob emulate: a rig that speaks its real bytes."""

import argparse
import json
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plumbob.cli import common
from plumbob.core.text import counted
from plumbob.core.units import Quantity, parse

if TYPE_CHECKING:
    from plumbob.acquisition.transport import Stop
    from plumbob.protocols.format import Format
    from plumbob.simulation.rigs.faults import Fault
    from plumbob.simulation.rigs.plan import Plan
    from plumbob.simulation.rigs.rig import Rig
    from plumbob.simulation.rigs.serving import Port, Served


LOOPBACK = "127.0.0.1"
"""Where no host is named: to be heard by other machines is asked for, as 0.0.0.0."""


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
    p.add_argument("--sensors", default="ideal", metavar="A+B", help="parts of a format's units (default ideal)")
    p.add_argument("--module", choices=("drawn", "calibrated"), default="drawn", help="default drawn, as off the line")
    common.add_frame(p, "navigation frame of a format's truth, and its body's axes (a rig has its own; default NED)")
    common.add_option(p)
    p.add_argument("--seed", type=int, default=0, metavar="N", help="seed of everything random (default 0)")
    p.add_argument("--clock-error", metavar="E", help="error of the device's clock, as 0.004%%; positive: fast")
    p.add_argument("--rate", metavar="HZ", help="frames per second, as 100Hz (default: the format's)")
    p.add_argument("--duration", metavar="S", help="duration, as 60s (default: the scenario's)")
    p.add_argument("--truth", type=Path, metavar="FILE", help="recording of samples and truth; calibration card beside")


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
    from plumbob.acquisition.transport import Stop
    from plumbob.core.errors import ParameterError
    from plumbob.simulation.rigs.rig import make_rig
    from plumbob.simulation.rigs.serving import serve

    if args.list:
        _print_list()
        return 0
    if args.what is None:
        raise ParameterError("emulate needs a RIG or a format; 'plumbob emulate --list' shows what there is.")
    speed, faults = _speed(args), _faults(args.faults)
    duration = None if args.duration is None else parse(args.duration, Quantity.TIME)
    clock_error = parse(args.clock_error or "0", Quantity.RATIO)
    form, plan = _plan(args)
    common.check_outputs(args, *_outputs(args, plan))
    rig = make_rig(
        plan,
        form,
        seed=args.seed,
        duration=duration,
        module=args.module,
        clock_error=clock_error,
        faults=faults,
    )
    if args.truth:  # before the port is named, so that who waits for it finds the truth and the card
        _write_truth(args.truth, rig, overwrite=args.force)
    with ExitStack() as stack:
        # A line may end at any time; a file that is cut looks like one that is not, so that a signal removes it.
        stop = Stop() if args.write else stack.enter_context(common.stopped_by_signals())
        port = stack.enter_context(_port(args, stop))
        if speed != 1.0 and not (args.write or args.udp):
            common.note('this line does not keep real time: record it with --time count, or time = "count" in [source]')
        log = stack.enter_context(_fault_log(args.fault_log))
        served = serve(rig, port, speed=speed, stop=stop, on_fault=log)
    _tell(served, len(rig))
    return 0


def _plan(args: argparse.Namespace) -> "tuple[Format, Plan]":
    from dataclasses import replace

    from plumbob.core.errors import ParameterError
    from plumbob.protocols.find import find_format
    from plumbob.rotations import Frame
    from plumbob.simulation import scenario
    from plumbob.simulation.rigs.plan import PLANS, plan_for

    form = find_format(args.what).bind(common.options_of(args))
    rate = None if args.rate is None else parse(args.rate, Quantity.FREQUENCY)
    if args.set and args.scenario is None:
        raise ParameterError("--set gives parameters of a scenario; name it with --scenario.")
    motion = None if args.scenario is None else scenario(args.scenario, **dict(common.pairs(args.set)))
    if plan := PLANS.get(form.name if not args.what.endswith(".toml") else ""):
        if args.sensors != "ideal" or args.frame:
            raise ParameterError(f"rig {plan.name} has its own sensors and frame; leave --sensors and --frame out.")
        if motion:
            plan = replace(plan, scenario=motion, duration=motion.duration)
        return form, replace(plan, rate=rate or plan.rate)
    if motion is None:
        raise ParameterError(f"say what moves {form.name}: --scenario buoy, or another of 'plumbob sim --list'.")
    frame = common.frame_of(args) or Frame.NED
    return form, plan_for(form, motion, sensors=args.sensors, frame=frame, rate=rate)


def _speed(args: argparse.Namespace) -> float | None:
    from plumbob.core.errors import ParameterError

    text = args.speed or ("max" if args.write else "1")
    if text == "max":
        return None
    try:
        speed = float(text)
    except ValueError:
        speed = 0.0
    if not 0.0 < speed < float("inf"):
        raise ParameterError(f"--speed must be a number above 0, or max, but it is '{text}'.")
    return speed


def _faults(text: str | None) -> dict[str, float]:
    return {kind: parse(share, Quantity.RATIO) for kind, share in common.pairs(text)}


@contextmanager
def _port(args: argparse.Namespace, stop: "Stop") -> "Iterator[Port]":
    """Open the port, and say its name before anything else."""
    from plumbob.core.files import replacing
    from plumbob.simulation.rigs.serving import FilePort, TcpPort, UdpPort
    from plumbob.simulation.rigs.terminal import PtyPort

    with ExitStack() as stack:
        port: Port
        if args.write == "-":
            port = FilePort(sys.stdout.buffer, "-")
        elif args.write:
            temporary = stack.enter_context(replacing(Path(args.write), overwrite=args.force))
            port = FilePort(stack.enter_context(temporary.open("wb")), args.write)
        elif args.tcp:
            port = TcpPort(*_address(args.tcp))
        elif args.udp:
            port = UdpPort(*_address(args.udp))
        else:
            port = PtyPort(args.link, stop)
        stack.callback(port.close)
        if not args.write:
            print(port.name, flush=True)
        yield port


def _address(text: str) -> tuple[str, int]:
    from plumbob.core.errors import ParameterError

    host, colon, number = text.rpartition(":")
    if not colon or not number.isdecimal() or int(number) > 65535:
        raise ParameterError(f"an address is HOST:PORT, as 127.0.0.1:4000, but got '{text}'.")
    return host or LOOPBACK, int(number)


@contextmanager
def _fault_log(path: Path | None) -> "Iterator[Callable[[Fault], None]]":
    if path is None:
        yield lambda fault: None
        return
    with path.open("w", encoding="utf-8") as file:
        yield lambda fault: print(json.dumps(fault.told()), file=file, flush=True)


def _outputs(args: argparse.Namespace, plan: "Plan") -> "Iterator[Path | None]":
    """Files that the options name, and those beside them."""
    yield from (None if args.write in (None, "-") else Path(args.write), args.fault_log)
    for unit in plan.units if args.truth else ():
        own = _truth_of(args.truth, unit.prefix)
        yield from (*common.with_profile(own), own.with_suffix(".card.json"))


def _truth_of(path: Path, prefix: str) -> Path:
    """Where the truth of one of several units lies."""
    return path.with_stem(f"{path.stem}-{prefix}") if prefix else path


def _write_truth(path: Path, rig: "Rig", *, overwrite: bool) -> None:
    from plumbob import files

    for prefix, unit in rig.units.items():
        own = _truth_of(path, prefix)
        recording = files.Recording(imu=unit.imu, track=unit.truth, name=own.stem, notes=(unit.truth.source,))
        files.write(own, recording, overwrite=overwrite)
        unit.calibration.save(own.with_suffix(".card.json"), overwrite=overwrite)


def _tell(served: "Served", count: int) -> None:
    what: Mapping[str, Any] = {
        "sent": served.sent,
        "lost by faults": served.lost,
        "due while nobody listened": served.unheard,
    }
    told = ", ".join(f"{number} {word}" for word, number in what.items() if number or word == "sent")
    late = f"; latest by {served.latest_ns / 1e6:.1f} ms" if served.latest_ns else ""
    common.note(f"{counted(count, 'frame')}: {told}{late}")


def _print_list() -> None:
    from plumbob.simulation.rigs.faults import KINDS
    from plumbob.simulation.rigs.plan import PLANS

    print("rigs")
    for name, plan in PLANS.items():
        print(f"    {name:10} {plan.title}; {plan.rate:g} Hz")
    print("faults, each a share of the frames")
    for kind, meaning in KINDS.items():
        print(f"    {kind:10} {meaning}")
