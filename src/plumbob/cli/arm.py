"""plumbob arm and array: sources of several units, poses, programs, and what the kinds print."""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plumbob.cli import common
from plumbob.cli.engine import Call, Verb, show
from plumbob.core import check
from plumbob.core.errors import ParameterError
from plumbob.core.files import write_text
from plumbob.core.units import Quantity, numbers, parse, to_deg
from plumbob.reporting.catalogue import Listed

if TYPE_CHECKING:
    from plumbob.data.array import ImuArray


def _read(args: argparse.Namespace, call: Call, note: Callable[[str], object] = common.note) -> "ImuArray":
    """Units of the sources, which are files or UNIT=FILE."""
    from plumbob.door.reading import read_array

    if named := _named(args.array):
        return read_array(named, note=note)
    units: ImuArray = call(read_array, sources=args.array, note=note)
    return units


def _named(sources: Sequence[str]) -> dict[str, str]:
    """Files by the names of their units, where the sources are UNIT=FILE; else empty."""
    pairs = [source.partition("=") for source in sources]
    if any(equals for _, equals, _ in pairs) and not all(equals for _, equals, _ in pairs):
        raise ParameterError("either every SOURCE has the form UNIT=FILE or none has; name all units.")
    return {name: path for name, equals, path in pairs if equals}


def array(args: argparse.Namespace, verb: Verb, call: Call) -> int:
    """Read the units, say what is found in them, and combine or compare them."""
    from plumbob.data.array import UnitMount

    notes: list[str] = []
    units = _read(args, call, notes.append)
    common.note(*notes)
    if not hasattr(args, "mounts") and all(
        replace(mount, noise=None) == UnitMount() for mount in units.mounts.values()
    ):
        common.note("no mount is known, so all units are taken to lie along the body's axes; see --mounts")
    return show(args, verb, call(array=units))


def align(args: argparse.Namespace, verb: Verb, call: Call) -> int:
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
        zero = angles in ([], ["zero"])
        held = [0.0] * len(chain.angles) if zero else numbers("--pose", ",".join(angles), Quantity.ANGLE)
        poses.append((parse(start, Quantity.TIME), parse(end, Quantity.TIME), held))
    card = call(chain=chain, array=_read(args, call), poses=poses)
    return show(args, verb, card, shown=Listed(card.table(), {"file": args.out, **card.summary()}))


def run(args: argparse.Namespace, verb: Verb, call: Call) -> int:
    """Estimate joint angles."""
    return _show_motion(args, verb, call(array=_read(args, call)))


def joints(args: argparse.Namespace, verb: Verb, call: Call) -> int:
    """Align units and estimate joint angles; files of a unit each have clocks of their own."""
    one_recording = len(args.array) == 1
    return _show_motion(args, verb, call(array=_named(args.array) or (args.array[0] if one_recording else args.array)))


def _show_motion(args: argparse.Namespace, verb: Verb, motion: Any) -> int:
    ends = {name: f"{to_deg(last):8.2f}° ± {to_deg(sd):.2f}° at the end" for name, last, sd in motion.at_end()}
    if not args.json:
        common.note(*map(str, motion.notes))
    lines = [f"{name:20} {value}" for name, value in (motion.facts() | ends).items()]
    return show(args, verb, motion, shown=Listed("\n".join(lines), {"out": args.out, **motion.summary()}))


def export(args: argparse.Namespace, verb: Verb, call: Call) -> int:
    """Write the program, or the angles as they are, and say what became of them."""
    from plumbob import arm
    from plumbob.arm.exported import SUFFIXES
    from plumbob.data.chain import load_chain

    paths = [Path(path) for path in args.out]
    for path in paths:
        if path.suffix.lower() not in (*SUFFIXES, ".urdf"):
            raise ParameterError(f"--out takes names that end in {', '.join((*SUFFIXES, '.urdf'))}, but got {path}.")
    unit, models = args.unit or "rad", [path for path in paths if path.suffix.lower() == ".urdf"]
    check.one_of("--unit", unit, ("rad", "deg"))
    chain = load_chain(Path(args.limits)) if hasattr(args, "limits") else None
    if chain is None and (models or args.html or args.plot):
        raise ParameterError("a model and a page need the chain; name its file with --chain.")
    track = arm.JointTrack.load(args.track)
    program = arm.Program.load(args.track) if args.as_is else call(track=track, limits=chain)
    for path in paths:
        if chain is not None and path in models:
            write_text(path, arm.urdf_text(chain), overwrite=args.force)
        else:
            in_unit = unit if path.suffix.lower() == ".csv" else "rad"
            arm.export(program, path, unit=in_unit, overwrite=args.force)
    text = "\n".join([program.text(chain), *(f"{'file':12} {path}" for path in args.out)])
    show(args, verb._replace(pages=None), Listed(text, {"files": args.out, **program.summary(chain)}))
    if not args.json:
        common.note(*map(str, program.notes))
    if chain is not None and (args.html or args.plot):
        from plumbob.reporting.arm import arm_report

        common.write_pages(args, arm_report(chain, track, program=program))
    return 0


def replay(args: argparse.Namespace, verb: Verb, call: Call) -> int:
    """Move a model by a program."""
    from plumbob.arm import JointTrack

    suffix = Path(args.model).suffix.lower()
    if suffix not in (".toml", ".urdf"):
        raise ParameterError(f"a model must be a chain (.toml) or a URDF (.urdf), but it is {args.model}.")
    if hasattr(args, "hand") and suffix == ".toml":
        raise ParameterError("--hand names a link of a URDF; a chain says itself where its hand is. Leave it out.")
    truth = None if args.truth is None else JointTrack.load(Path(args.truth))
    if truth is not None and truth.hand is None:
        raise ParameterError(f"{args.truth} has no position of the hand, which is hand_x [m], hand_y [m], hand_z [m].")
    done = call()
    lines = [f"{name:12} {value}" for name, value in done.facts().items()]
    numbers = {"samples": int(done.t.size), "duration_s": float(done.t[-1] - done.t[0]), "arm_m": done.length}
    if truth is not None and truth.hand is not None:
        error = done.against(truth.t, truth.hand)
        numbers |= {f"hand_{name}": value for name, value in error._asdict().items()}
        lines.append(
            f"{'hand error':12} rms {1e3 * error.rms:.2f} mm ({100.0 * error.rms_share:.2f} % of the arm), greatest "
            f"{1e3 * error.max:.2f} mm ({100.0 * error.max_share:.2f} %)"
        )
    return show(args, verb, done, shown=Listed("\n".join(lines), numbers))
