"""plumbob sim: a recording of which the truth is known."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plumbob.cli import common

if TYPE_CHECKING:
    from plumbob.rotations import Frame

WORLD = ("strength", "dip", "declination", "temp_c", "mag_rate", "jitter", "lost")
"""As `plumbob.simulation.simulation.WORLD`, which a help text shall not import."""

TEACH = "teach"
"""Program of a chain that is understood without --chain: the chain of that name does it."""


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb."""
    p = verbs.add_parser(
        "sim",
        help="simulate a recording with its truth",
        description="Simulate what sensors would record in a scenario, and the truth beside it in the same file. With "
        "a chain, simulate the units on its segments; true joint angles and the chain are written beside them.",
        epilog=common.more("plumbob sim buoy --frame NED --duration 60s --out sea.parquet", "start.md"),
    )
    add_scenario_options(p)
    p.add_argument("--chain", metavar="NAME|TOML", help="chain that a program moves (default, of teach: teach)")
    common.add_noise(p, "noise card whose N, B and K the sensors take instead of their own")
    common.add_warm_up(p)
    p.add_argument("--seed", type=int, default=0, metavar="N", help="seed of everything random (default 0)")
    p.add_argument("--out", type=Path, required=True, metavar="FILE", help="recording to write (.parquet or .csv)")
    p.add_argument("--card", type=Path, metavar="JSON", help="write the unit's calibration card too")
    p.add_argument("--noise-card", type=Path, metavar="JSON", help="write the unit's noise card too")
    common.add_force(p)
    p.set_defaults(run=run)


def add_scenario_options(p: argparse.ArgumentParser) -> None:
    """Options that say what to simulate."""
    p.add_argument("scenario", metavar="SCENARIO", help="see 'plumbob list scenarios'")
    common.add_frame(p, "navigation frame of the truth and of the body's axes; needed")
    p.add_argument("--sensors", default="ideal", metavar="A+B", help="parts, as mpu6000+hmc5983 (default ideal)")
    p.add_argument(
        "--unit",
        choices=("random", "calibrated"),
        help="a unit as it left the line, or after an ideal calibration; needed but for ideal sensors",
    )
    p.add_argument("--rate", metavar="HZ", help="sampling rate, as 100Hz; default: the scenario's")
    p.add_argument("--duration", metavar="S", help="duration, as 600s; default: the scenario's")
    p.add_argument(
        "--set",
        default="",
        metavar="P",
        help=f"name=value,... with units: the scenario's parameters, and {', '.join(WORLD)}",
    )


def scenario_settings(args: argparse.Namespace) -> "tuple[Frame, dict[str, Any]]":
    """Frame and keyword arguments of `plumbob.simulation.simulate` that the options name."""
    from plumbob.core.errors import FrameError, ParameterError
    from plumbob.rotations import Frame

    frame = common.frame_arg(args)
    if frame is None:
        raise FrameError(f"a simulation needs a navigation frame. Give --frame {', --frame '.join(Frame)}.")
    if args.unit is None and args.sensors != "ideal":
        raise ParameterError(f"say --unit random for {args.sensors} as it left the line, or --unit calibrated.")
    args.unit = args.unit or "calibrated"
    given = {key: value for key in ("rate", "duration") if (value := getattr(args, key)) is not None}
    return frame, dict(common.pairs(args.set)) | given


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob import files
    from plumbob.data import calibration_told
    from plumbob.data.recording import Recording
    from plumbob.simulation import simulate

    if args.chain is not None or args.scenario == TEACH:
        return _run_chain(args)
    common.check_outputs(args, *common.with_profile(args.out), args.card, args.noise_card, inputs=(args.noise,))
    frame, given = scenario_settings(args)
    choice = {"sensors": args.sensors, "unit": args.unit, "seed": args.seed, "noise": args.noise}
    result = simulate(args.scenario, frame=frame, warm_up=args.warm_up, **choice, **given)
    notes = (result.truth.source, *(() if args.noise is None else (f"noise {result.noise.source}",)))
    recording = Recording(imu=result.imu, track=result.truth, name=args.scenario, notes=notes)
    files.write(args.out, recording, overwrite=args.force)
    for path, card in ((args.card, result.calibration), (args.noise_card, result.noise)):
        if path:
            card.save(path, overwrite=args.force)
    print(f"{args.out}: {len(result.imu)} samples, {result.imu.t[-1]:.3f} s, {result.imu.meta.device}")
    print(f"truth        {result.truth.source}, frame {frame}, heading from true north")
    if args.noise is not None:
        print(f"noise        {result.noise.source}")
    print(f"calibration  {calibration_told(result.imu.meta.calibration)}")
    return 0


def _run_chain(args: argparse.Namespace) -> int:
    from plumbob import files
    from plumbob.data import calibration_told
    from plumbob.data.chain_toml import load_chain
    from plumbob.data.recording import Recording
    from plumbob.live.emulated import chain_files, unit_file, write_chain
    from plumbob.simulation import named_chain, simulate_chain

    file = Path(args.chain) if args.chain and args.chain.endswith(".toml") else None
    chain = named_chain(args.chain or TEACH) if file is None else load_chain(file)
    units = [segment.unit for segment in chain.segments if segment.unit]
    cards = {path: [unit_file(path, unit) for unit in units] for path in (args.card, args.noise_card) if path}
    outputs = (args.out, *chain_files(args.out), *(file for paths in cards.values() for file in paths))
    common.check_outputs(args, *outputs, inputs=(args.noise, file))
    frame, given = scenario_settings(args)
    world = {key: value for key in ("noise", "warm_up") if (value := getattr(args, key)) is not None}
    choice = {"sensors": args.sensors, "unit": args.unit, "seed": args.seed}
    made = simulate_chain(chain, args.scenario, frame=frame, **choice, **world, **given)
    label = f"simulated {made.program.name}, seed {args.seed}"
    recording = Recording(array=made.array, name=made.chain.name, notes=(label,))
    files.write(args.out, recording, overwrite=args.force)
    write_chain(args.out, made, overwrite=args.force)
    for path, paths in cards.items():
        for unit, file in zip(made.units.values(), paths, strict=True):
            (unit.calibration if path == args.card else unit.noise).save(file, overwrite=args.force)
    print(f"{args.out}: {len(made.array)} samples, {made.t[-1]:.3f} s, units {', '.join(units)}")
    print(f"truth        {label}, frame {frame}, in {', '.join(map(str, chain_files(args.out)))}")
    print(f"calibration  {calibration_told(next(iter(made.units.values())).imu.meta.calibration)}")
    return 0
