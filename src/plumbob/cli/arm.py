"""plumbob arm: a chain with a unit on each segment, from motion to joint angles and to a program for a robot."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from plumbob.cli import common

if TYPE_CHECKING:
    from plumbob.arm.program import Program
    from plumbob.data.array import ImuArray
    from plumbob.data.chain import Chain

KINDS: tuple[str, ...] = ("align", "run", "export", "replay")
"""What can be done with a chain: `add_` declares it."""
PAGE = "arm.md"


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb and what it does."""
    p = verbs.add_parser(
        "arm",
        help="joint angles of a chain, and programs taught with it",
        description="A chain of segments with a unit on each: find how the units sit, estimate the joint angles, make "
        "a program of them, and replay it on a model.",
        epilog=common.more("plumbob arm export angles.parquet --chain arm.toml --out program.yaml", PAGE),
    )
    kinds = p.add_subparsers(dest="kind", metavar="WHAT")
    for add in (add_align, add_run, add_export, add_replay):
        add(kinds)
    p.set_defaults(run=run, usage=p)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    if args.kind is None:
        args.usage.error(f"name WHAT to do: {', '.join(KINDS)}")
    code: int = args.do(args)
    return code


def _add_chain_and_sources(p: argparse.ArgumentParser, what: str) -> None:
    p.add_argument("chain", type=Path, metavar="CHAIN", help=what)
    p.add_argument(
        "sources", nargs="+", metavar="SOURCE",
        help="recording of all units, or one file for each: FILE, whose stem is the unit's name, or UNIT=FILE",
    )  # fmt: skip
    p.add_argument("--format", metavar="NAME|TOML", help="what raw bytes mean: a device, a rig or a .toml file")
    p.add_argument("--params", metavar="NAME=VALUE,...", help="of the chain filter, as mean_rate=off,bias_sd=0.1deg/s")


def _add_pose_sd(p: argparse.ArgumentParser) -> None:
    p.add_argument("--pose-sd", default="1 deg", metavar="ANGLE", help="how exactly a pose was held (1deg)")


def _files(args: argparse.Namespace) -> list[Path]:
    return [Path(source.partition("=")[2] or source) for source in args.sources]


def _read(args: argparse.Namespace) -> "ImuArray":
    from plumbob.core.errors import ParameterError
    from plumbob.door.reading import read_array

    named = ["=" in source for source in args.sources]
    if all(named):
        pairs = [source.partition("=") for source in args.sources]
        return read_array({name: path for name, _, path in pairs}, note=common.note)
    if any(named):
        raise ParameterError("either every SOURCE has the form UNIT=FILE or none has; name all units.")
    if len(args.sources) == 1:
        return read_array(args.sources[0], format=args.format, note=common.note)
    return read_array(args.sources, note=common.note)


def _angles(texts: list[str], chain: "Chain") -> list[float]:
    """Angles with units, or zero for all of them."""
    from plumbob.core.units import Quantity, parse

    if texts in ([], ["zero"]):
        return [0.0] * len(chain.angles)
    return [parse(text, Quantity.ANGLE) for text in texts]


def add_align(kinds: common.Adder) -> None:
    """Declare what finds mountings and axes."""
    p = kinds.add_parser(
        "align",
        help="find how the units sit on their segments, and where joints lie",
        description="Find mountings, lever arms and axes from a recording in which every joint moves. Joints whose "
        "place the chain does not say are found, too.",
        epilog=common.more("plumbob arm align arm.toml calibration.mcap --pose 0s,2s --out card.json", PAGE),
    )
    _add_chain_and_sources(p, "the chain, a TOML file or a URDF")
    p.add_argument(
        "--pose", action="append", default=[], metavar="FROM,TO[,ANGLE...]",
        help="when all angles were held at zero, or at these angles, as 0s,2s or 5s,7s,0deg,90deg",
    )  # fmt: skip
    _add_pose_sd(p)
    p.add_argument("--out", type=Path, required=True, metavar="JSON", help="card to write")
    common.add_force(p)
    common.add_json(p)
    p.set_defaults(do=do_align)


def do_align(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.arm import ArmCard, align, opened_chain
    from plumbob.core.errors import ParameterError
    from plumbob.core.units import Quantity, parse

    common.check_outputs(args, args.out, inputs=(args.chain, *_files(args)))
    ArmCard.require_place(args.out)
    chain = opened_chain(args.chain)
    if isinstance(chain, ArmCard):
        raise ParameterError(f"{args.chain} is a card already; align takes the chain that it was made of.")
    poses = []
    for text in args.pose:
        start, comma, rest = text.partition(",")
        end, *angles = rest.split(",")
        if not comma or not end:
            raise ParameterError(f"--pose takes FROM,TO and angles, as 0s,2s, but got {text!r}.")
        poses.append((parse(start, Quantity.TIME), parse(end, Quantity.TIME), _angles(angles, chain)))
    card = align(
        chain,
        _read(args),
        poses=poses,
        pose_sd=parse(args.pose_sd, Quantity.ANGLE),
        params=dict(common.pairs(args.params)),
        note=common.note,
    )
    card.save(args.out, overwrite=args.force)
    if args.json:
        common.print_json({"file": str(args.out), **card.summary()})
        return 0
    print(card.table())
    print(f"card         {args.out}")
    return 0


def add_run(kinds: common.Adder) -> None:
    """Declare what estimates joint angles."""
    p = kinds.add_parser(
        "run",
        help="estimate joint angles and the hand's place",
        description="Estimate the joint angles of a chain from its units, with their standard deviations.",
        epilog=common.more("plumbob arm run card.json take.mcap --frame ENU --out angles.parquet", PAGE),
    )
    _add_chain_and_sources(
        p, "the card that 'plumbob arm align' made; or the chain, where units sit exactly as it says"
    )
    common.add_frame(p, "navigation frame of the result; by default that of the recording")
    p.add_argument("--causal", action="store_true", help="each angle from what came before it only")
    p.add_argument(
        "--pose", metavar="zero|ANGLE,...", help="angles at the first sample; a ball joint on a fixed base needs it"
    )
    _add_pose_sd(p)
    p.add_argument("--out", type=Path, metavar="FILE", help="table of angles: .csv or .parquet")
    common.add_page(p)
    common.add_force(p)
    common.add_json(p)
    p.set_defaults(do=do_run)


def do_run(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob import arm
    from plumbob.core.units import Quantity, parse, to_deg

    common.check_pages(args, args.out, inputs=(args.chain, *_files(args)))
    chain = arm.opened_chain(args.chain)
    array = _read(args)
    geometry = chain.chain if isinstance(chain, arm.ArmCard) else chain
    with common.progress_bars() as bars:
        motion = arm.run(
            chain,
            array,
            frame=args.frame,
            causal=args.causal,
            pose=None if args.pose is None else _angles(args.pose.split(","), geometry),
            pose_sd=parse(args.pose_sd, Quantity.ANGLE),
            params=dict(common.pairs(args.params)),
            progress=lambda done, total: bars("arm", done, total),
        )
    if args.out is not None:
        motion.save(args.out, overwrite=args.force)
    if args.json:
        common.print_json({"out": str(args.out) if args.out else None, **motion.summary()})
    else:
        for name, value in motion.facts().items():
            print(f"{name:20} {value}")
        for name, last, sd in motion.at_end():
            print(f"{name:20} {to_deg(last):8.2f}° ± {to_deg(sd):.2f}° at the end")
        common.note(*motion.notes)
        if args.out is not None:
            print(f"{'file':20} {args.out}")
    if args.html or args.plot:
        facts = [(name, value) for name, value in motion.facts().items() if name in ("frame", "method")]
        report = arm.arm_report(
            geometry, motion.joints, postures=motion.postures(), facts=facts, remarks=motion.notes, title=geometry.name
        )
        common.write_pages(args, report)
    return 0


EXPORT = """\
.csv and .parquet are tables of times and angles; .yaml and .json are a ROS trajectory_msgs/JointTrajectory; .mcap is
the same in CDR, with a sensor_msgs/JointState for each sample. A .urdf is the chain itself, as a model for ROS.
"""


def add_export(kinds: common.Adder) -> None:
    """Declare what makes a program of angles."""
    p = kinds.add_parser(
        "export",
        help="make a program of joint angles, and write it for a robot",
        description="Make a program of recorded joint angles: stops are kept, the rest is smoothed and slowed where "
        "the chain's limits ask for it, and sampled at the rate of a controller.",
        epilog=common.more(
            "plumbob arm export angles.parquet --chain arm.toml --rate 125Hz --out program.yaml", PAGE, EXPORT
        ),
    )
    p.add_argument("angles", type=Path, metavar="ANGLES", help="table of angles: .csv or .parquet")
    p.add_argument("--chain", type=Path, metavar="TOML", help="the chain, whose limits are kept")
    p.add_argument("--out", type=Path, nargs="+", required=True, metavar="FILE", help="files to write, by suffix")
    p.add_argument("--rate", default="100 Hz", metavar="HZ", help="samples per second (100Hz)")
    p.add_argument("--smooth", default="0.2 s", metavar="TIME", help="what is shorter is smoothed away (0.2s)")
    p.add_argument("--still", default="1 deg", metavar="ANGLE", help="greatest motion at a stop (1deg)")
    p.add_argument("--dwell", default="0.3 s", metavar="TIME", help="least duration of a stop (0.3s)")
    p.add_argument("--unit", choices=("rad", "deg"), default="rad", help="of a .csv file (rad)")
    p.add_argument("--as-is", action="store_true", help="write the angles as they are: no smoothing, no limits")
    common.add_page(p)
    common.add_force(p)
    common.add_json(p)
    p.set_defaults(do=do_export)


def do_export(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.arm import export
    from plumbob.core.errors import ParameterError
    from plumbob.core.files import write_text
    from plumbob.data.chain_toml import load_chain

    common.check_pages(args, *args.out, inputs=(args.angles, args.chain))
    _require_suffixes(args.out)
    models = [path for path in args.out if path.suffix.lower() == ".urdf"]
    if args.chain is None and (models or args.html or args.plot):
        raise ParameterError("a model and a page need the chain; name its file with --chain.")
    chain = None if args.chain is None else load_chain(args.chain)
    program = _program(args, chain)
    for path in args.out:
        if path in models and chain is not None:
            from plumbob.arm import urdf_text

            write_text(path, urdf_text(chain), overwrite=args.force)
        else:
            unit = args.unit if path.suffix.lower() == ".csv" else "rad"
            export(program, path, unit=unit, overwrite=args.force)
    _print_program(args, program, chain)
    if chain is not None and (args.html or args.plot):
        from plumbob.arm import JointTrack, arm_report

        common.write_pages(args, arm_report(chain, JointTrack.load(args.angles), program=program))
    return 0


def _require_suffixes(paths: list[Path]) -> None:
    """Refuse what cannot be written before anything is."""
    from plumbob.arm.exported import SUFFIXES
    from plumbob.core.errors import ParameterError

    for path in paths:
        if path.suffix.lower() not in (*SUFFIXES, ".urdf"):
            raise ParameterError(f"--out takes names that end in {', '.join((*SUFFIXES, '.urdf'))}, but got {path}.")


def _program(args: argparse.Namespace, chain: "Chain | None") -> "Program":
    from plumbob.arm import JointTrack, Program, taught

    if args.as_is:
        return Program.load(args.angles)
    return taught(
        JointTrack.load(args.angles), chain, rate=args.rate, smooth=args.smooth, still=args.still, dwell=args.dwell
    )


def _print_program(args: argparse.Namespace, program: "Program", chain: "Chain | None") -> None:
    from plumbob.core.units import to_deg

    used = {} if chain is None else dict(program.used(chain))
    away = {name: (to_deg(error.rms), to_deg(error.max)) for name, error in (program.deviations or {}).items()}
    if args.json:
        stops = [{"at_s": stop.start, "for_s": stop.end - stop.start, "recorded_s": stop.recorded,
                  "angles_rad": list(stop.angles)} for stop in program.stops]  # fmt: skip
        common.print_json({
            "files": [str(path) for path in args.out], "angles": list(program.names), "samples": len(program),
            "rate_hz": program.rate, "duration_s": float(program.t[-1]), "slowed": program.slowed, "stops": stops,
            "used": used, "notes": list(program.notes),
            "deviation_deg": {name: {"rms": rms, "max": most} for name, (rms, most) in away.items()},
        })  # fmt: skip
        return
    for name, value in program.facts().items():
        print(f"{name:12} {value}")
    if away:
        width = max(map(len, away))
        print("deviation    of the program from the recording, rms and greatest:")
        for name, (rms, most) in away.items():
            print(f"             {name:{width}} {rms:6.2f}° {most:6.2f}°")
    if used:
        print("limits       " + ", ".join(f"{name} {100.0 * share:.1f} %" for name, share in used.items() if share))
    common.note(*program.notes)
    for path in args.out:
        print(f"{'file':12} {path}")


def add_replay(kinds: common.Adder) -> None:
    """Declare what moves a model."""
    p = kinds.add_parser(
        "replay",
        help="move a model by a program, and compare the hand with truth",
        description="Move a model by a program: a chain (.toml) by its own kinematics, a URDF by those of another "
        "program. With the true path of the hand, the distance is printed, in metres and of the arm's length.",
        epilog=common.more("plumbob arm replay program.csv arm.urdf --truth hand.csv", PAGE),
    )
    p.add_argument("program", type=Path, metavar="PROGRAM", help="table of angles: .csv or .parquet")
    p.add_argument("model", type=Path, metavar="MODEL", help="chain (.toml) or URDF (.urdf)")
    p.add_argument("--truth", type=Path, metavar="FILE", help="table with the hand's place: hand_x [m] and so on")
    p.add_argument("--hand", default="", metavar="LINK", help="link of the URDF that is the hand; default: the last")
    p.add_argument("--out", type=Path, metavar="FILE", help="write the hand's place: .csv or .parquet")
    common.add_force(p)
    common.add_json(p)
    p.set_defaults(do=do_replay)


def do_replay(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.arm import JointTrack, Program, replay
    from plumbob.arm.angles import write_table
    from plumbob.core.errors import ParameterError

    common.check_outputs(args, args.out, inputs=(args.program, args.model, args.truth))
    if args.model.suffix.lower() not in (".toml", ".urdf"):
        raise ParameterError(f"a model is a chain (.toml) or a URDF (.urdf), but it is {args.model}.")
    if args.hand and args.model.suffix.lower() == ".toml":
        raise ParameterError("--hand names a link of a URDF; a chain says itself where its hand is. Leave it out.")
    truth = None if args.truth is None else JointTrack.load(args.truth)
    if truth is not None and truth.hand is None:
        raise ParameterError(f"{args.truth} has no place of the hand; it needs hand_x [m], hand_y [m] and hand_z [m].")
    done = replay(Program.load(args.program), args.model, hand=args.hand)
    error = None if truth is None or truth.hand is None else done.against(truth.t, truth.hand)
    if args.out is not None:
        write_table(args.out, done.columns(), source=f"{args.model.name} moved", overwrite=args.force)
    if args.json:
        numbers = {"samples": int(done.t.size), "duration_s": float(done.t[-1] - done.t[0]), "arm_m": done.length}
        common.print_json(numbers | ({} if error is None else {f"hand_{k}": v for k, v in error._asdict().items()}))
        return 0
    for name, value in done.facts().items():
        print(f"{name:12} {value}")
    if error is not None:
        print(
            f"{'hand error':12} rms {1e3 * error.rms:.2f} mm ({100.0 * error.rms_share:.2f} % of the arm), greatest "
            f"{1e3 * error.max:.2f} mm ({100.0 * error.max_share:.2f} %)"
        )
    if args.out is not None:
        print(f"{'file':12} {args.out}")
    return 0
