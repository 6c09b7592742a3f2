"""What the kinds of `plumbob calibrate` share: their options, the capture, and what is printed and written."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plumbob.cli import common, live

if TYPE_CHECKING:
    from plumbob.calibration.calibrate import Calibrated, Kind
    from plumbob.calibration.calibration import Capture
    from plumbob.calibration.fit import CaptureRefusedError
    from plumbob.data.cards import CalibrationCard


def add_gravity(p: argparse.ArgumentParser) -> None:
    """Options that say what gravity is."""
    p.add_argument("--gravity", metavar="ACCELERATION", help="gravity at the place with its unit, m/s2")
    p.add_argument("--latitude", metavar="ANGLE", help="latitude of the place instead, as '52.5 deg'")
    p.add_argument("--height", metavar="LENGTH", help="height of the place above the sea, as '40 m'; with --latitude")


def add_field(p: argparse.ArgumentParser) -> None:
    """Options that say what the magnetic field is."""
    field = p.add_mutually_exclusive_group()
    field.add_argument("--strength", metavar="FIELD", help="strength of the field at the place with unit, as '48.5 uT'")
    field.add_argument(
        "--place",
        metavar="LAT,LON[,HEIGHT]",
        help="where the capture was taken, in degrees and metres: takes the field of the World Magnetic Model",
    )


def add_options(
    p: argparse.ArgumentParser, *, file: str = "recording of the capture", guide: str | None = None
) -> None:
    """Options that every kind has; a kind with a guide also those of a live capture."""
    p.add_argument("file", type=Path, nargs="?" if guide else None, metavar="INPUT", help=file)
    common.add_profile(p)
    raw = "; with --live: raw bytes in a file, as a logger keeps them" if guide else ""
    p.add_argument("--from", dest="start", metavar="TIME", help=f"leave out what comes before, such as 5s{raw}")
    p.add_argument("--to", dest="stop", metavar="TIME", help="leave out what comes after")
    p.add_argument("--device", metavar="ID", help="the unit, where the recording does not name it")
    common.add_calibration(p, "card so far: used for other triads, and kept")
    p.add_argument("--out", type=Path, metavar="JSON", help="card to write; that of --calibration is completed")
    common.add_page(p)
    common.add_force(p)
    common.add_json(p)
    p.set_defaults(told={}, live=False, guided=guide)
    if guide:
        live.add_options(p)


def calibrated(
    args: argparse.Namespace, kind: str, inputs: tuple[Path | None, ...] = (), **options: Any
) -> "Calibrated":
    """Calibrate what the options name, from a file or live; what else is read is among `inputs`."""
    from plumbob.calibration.calibrate import KINDS, calibrate
    from plumbob.data.cards import CalibrationCard

    how = KINDS[kind]
    out = None if live.completes(args) else args.out
    common.check_pages(args, out, inputs=(args.file, args.profile, args.calibration, *inputs))
    base = None if args.calibration is None else CalibrationCard.load(args.calibration)
    if args.live:
        return calibrate(live.live_capture(args, how.triads, base), kind, note=common.note, **options)
    if args.guided:
        live.require_recording(args)
    return calibrate(_capture(args, how, base), kind, note=common.note, **options)


def _capture(args: argparse.Namespace, how: "Kind", base: "CalibrationCard | None") -> "Capture":
    """Capture that the options name, for the triads that are calibrated, some of them only where it has them."""
    from plumbob.calibration.calibrate import span_of
    from plumbob.calibration.calibration import capture_of

    found = capture_of(
        args.file,
        triads=how.triads,
        if_present=how.if_present,
        profile=args.profile,
        span=span_of(args.start, args.stop),
        device=args.device,
        base=base,
    )
    common.note(*(f"{args.file.name}: {line}" for line in found.found))
    made = {*how.triads, *(name for name in how.if_present if name in found.imu.triads)} or {"mount"}
    live.require_room(args, found.device, made, base)
    if args.guided and args.guide:
        live.tell(args, found.imu)
    return found


def finish(args: argparse.Namespace, found: "Calibrated") -> int:
    """Print what was found, and write the card."""
    if args.out is not None:
        found.save(args.out, overwrite=args.force or live.completes(args))
    if args.json:
        written = {"out": args.out and str(args.out), "html": args.html and str(args.html)}
        common.print_json(_read(args) | written | found.summary())
    else:
        print(found.text())
        print(f"card         {args.out}" if args.out else "card         NOT WRITTEN: name a file with --out")
    common.write_pages(args, found.report(recording=args.file.name if args.file else "live"))
    return 0


def refused(args: argparse.Namespace, why: "CaptureRefusedError") -> int:
    """Print the reasons, as text on standard error or as JSON; nothing is written."""
    import sys

    from plumbob.calibration.report import refusal_numbers, refusal_text
    from plumbob.core.text import visible

    if args.json:
        common.print_json(_read(args) | {"out": None, "html": None} | refusal_numbers(why))
    else:
        told = visible(refusal_text(why), keep="\n")
        print(f"plumbob calibrate {args.kind}: {told}", file=sys.stderr)
    return 1


def _read(args: argparse.Namespace) -> dict[str, Any]:
    """What was read, and what a guide told about it."""
    return {"file": args.file and str(args.file), **getattr(args, "told", {})}
