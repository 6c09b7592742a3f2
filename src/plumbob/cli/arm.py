"""plumbob arm: sources of several units, poses, and what the kinds print."""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plumbob.cli import common
from plumbob.core.errors import ParameterError
from plumbob.core.files import write_text
from plumbob.core.units import Quantity, parse, to_deg

if TYPE_CHECKING:
    from plumbob.arm.program import Program
    from plumbob.cli.engine import Verb
    from plumbob.data.array import ImuArray
    from plumbob.data.chain import Chain

Call = Callable[..., Any]


def _read(args: argparse.Namespace, call: Call) -> "ImuArray":
    """Units of the sources, which are files or UNIT=FILE."""
    from plumbob.door.reading import read_array

    pairs = [source.partition("=") for source in args.array]
    if not any(equals for _, equals, _ in pairs):
        array: ImuArray = call(read_array, sources=args.array)
        return array
    if not all(equals for _, equals, _ in pairs):
        raise ParameterError("either every SOURCE has the form UNIT=FILE or none has; name all units.")
    return read_array({name: path for name, _, path in pairs}, note=common.note)


def _angles(texts: list[str], chain: "Chain") -> list[float]:
    """Angles with units, or zero for all of them."""
    if texts in ([], ["zero"]):
        return [0.0] * len(chain.angles)
    return [parse(text, Quantity.ANGLE) for text in texts]


def align(args: argparse.Namespace, verb: "Verb", call: Call) -> int:
    """Find mountings and axes, and write the card."""
    from plumbob.arm import ArmCard, opened_chain

    ArmCard.require_place(Path(args.out))
    chain = opened_chain(args.chain)
    if isinstance(chain, ArmCard):
        raise ParameterError(f"{args.chain} is a card already; align takes the chain that it was made of.")
    poses = []
    for text in getattr(args, "poses", []):
        start, comma, rest = text.partition(",")
        end, *angles = rest.split(",")
        if not comma or not end:
            raise ParameterError(f"--pose takes FROM,TO and angles, as 0s,2s, but got {text!r}.")
        poses.append((parse(start, Quantity.TIME), parse(end, Quantity.TIME), _angles(angles, chain)))
    card = call(chain=chain, array=_read(args, call), poses=poses)
    card.save(Path(args.out), overwrite=args.force)
    if args.json:
        common.print_json({"file": args.out, **card.summary()})
        return 0
    print(card.table())
    print(f"card         {args.out}")
    return 0


def run(args: argparse.Namespace, verb: "Verb", call: Call) -> int:
    """Estimate joint angles."""
    from plumbob.arm import ArmCard, opened_chain

    chain = opened_chain(args.chain)
    geometry = chain.chain if isinstance(chain, ArmCard) else chain
    pose = {"pose": _angles(args.pose.split(","), geometry)} if hasattr(args, "pose") else {}
    motion = call(chain=chain, array=_read(args, call), **pose)
    if args.out is not None:
        motion.save(Path(args.out), overwrite=args.force)
    if args.json:
        common.print_json({"out": args.out, **motion.summary()})
    else:
        for name, value in motion.facts().items():
            print(f"{name:20} {value}")
        for name, last, sd in motion.at_end():
            print(f"{name:20} {to_deg(last):8.2f}° ± {to_deg(sd):.2f}° at the end")
        common.note(*motion.notes)
        if args.out is not None:
            print(f"{'file':20} {args.out}")
    if verb.pages is not None and (args.html or args.plot):
        common.write_pages(args, verb.pages(motion, args))
    return 0


def export(
    angles: str | Path,
    *,
    out: Sequence[Path],
    chain: str | Path | None = None,
    rate: float | str = "100 Hz",
    smooth: float | str = "0.2 s",
    still: float | str = "1 deg",
    dwell: float | str = "0.3 s",
    unit: str = "rad",
    as_is: bool = False,
    overwrite: bool = False,
) -> "tuple[Program, Chain | None]":
    """Make a program of recorded joint angles.

    Stops are kept, the rest is smoothed and slowed where the chain's limits ask for it, and sampled at the rate of a
    controller.

    Parameters
    ----------
    angles : path
        Table of angles: .csv or .parquet.
    out : sequence of path
        Files to write, by suffix.
    chain : path, optional
        The chain, whose limits are kept.
    rate : float or str
        Samples per second.
    smooth : float or str
        What is shorter is smoothed away.
    still : float or str
        Greatest motion at a stop.
    dwell : float or str
        Least duration of a stop.
    unit : {"rad", "deg"}
        Of a .csv file.
    as_is : bool
        Write the angles as they are: no smoothing, no limits.
    overwrite : bool
        Whether files that lie there may be replaced.
    """
    from plumbob import arm
    from plumbob.data.chain_toml import load_chain

    paths = [Path(path) for path in out]
    _require_suffixes(paths)
    models = [path for path in paths if path.suffix.lower() == ".urdf"]
    if chain is None and models:
        raise ParameterError("a model needs the chain; name its file with --chain.")
    geometry = None if chain is None else load_chain(Path(chain))
    program = (
        arm.Program.load(angles)
        if as_is
        else arm.taught(arm.JointTrack.load(angles), geometry, rate=rate, smooth=smooth, still=still, dwell=dwell)
    )
    for path in paths:
        if path in models and geometry is not None:
            write_text(path, arm.urdf_text(geometry), overwrite=overwrite)
        else:
            in_unit = unit if path.suffix.lower() == ".csv" else "rad"
            arm.export(program, path, unit=in_unit, overwrite=overwrite)
    return program, geometry


def exported(args: argparse.Namespace, verb: "Verb", call: Call) -> int:
    """Write the program, and say what became of the angles."""
    if not hasattr(args, "chain") and (args.html or args.plot):
        raise ParameterError("a page needs the chain; name its file with --chain.")
    program, chain = call()
    _print_program(args, program, chain)
    if chain is not None and (args.html or args.plot):
        from plumbob.arm import JointTrack, arm_report

        common.write_pages(args, arm_report(chain, JointTrack.load(args.angles), program=program))
    return 0


def _require_suffixes(paths: list[Path]) -> None:
    """Refuse what cannot be written before anything is."""
    from plumbob.arm.exported import SUFFIXES

    for path in paths:
        if path.suffix.lower() not in (*SUFFIXES, ".urdf"):
            raise ParameterError(f"--out takes names that end in {', '.join((*SUFFIXES, '.urdf'))}, but got {path}.")


def _print_program(args: argparse.Namespace, program: "Program", chain: "Chain | None") -> None:
    used = {} if chain is None else dict(program.used(chain))
    away = {name: (to_deg(error.rms), to_deg(error.max)) for name, error in (program.deviations or {}).items()}
    if args.json:
        stops = [{"at_s": stop.start, "for_s": stop.end - stop.start, "recorded_s": stop.recorded,
                  "angles_rad": list(stop.angles)} for stop in program.stops]  # fmt: skip
        common.print_json({
            "files": args.out, "angles": list(program.names), "samples": len(program),
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


def replay(args: argparse.Namespace, verb: "Verb", call: Call) -> int:
    """Move a model by a program."""
    from plumbob.arm import JointTrack
    from plumbob.arm.angles import write_table

    model = Path(args.model)
    if model.suffix.lower() not in (".toml", ".urdf"):
        raise ParameterError(f"a model is a chain (.toml) or a URDF (.urdf), but it is {args.model}.")
    if hasattr(args, "hand") and model.suffix.lower() == ".toml":
        raise ParameterError("--hand names a link of a URDF; a chain says itself where its hand is. Leave it out.")
    truth = None if args.truth is None else JointTrack.load(Path(args.truth))
    if truth is not None and truth.hand is None:
        raise ParameterError(f"{args.truth} has no place of the hand; it needs hand_x [m], hand_y [m] and hand_z [m].")
    done = call()
    error = None if truth is None or truth.hand is None else done.against(truth.t, truth.hand)
    if args.out is not None:
        write_table(Path(args.out), done.columns(), source=f"{model.name} moved", overwrite=args.force)
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
