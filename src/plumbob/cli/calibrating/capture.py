"""What the kinds of `plumbob calibrate` share: their options, the capture, and what is printed and written."""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plumbob.cli import common
from plumbob.cli.calibrating import live, room

if TYPE_CHECKING:
    from plumbob.calibration.calibration import Capture
    from plumbob.calibration.fit import Fitted
    from plumbob.calibration.mount import Mounted
    from plumbob.calibration.rejection import CaptureRefusedError


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


def gravity_of(args: argparse.Namespace) -> float:
    """Gravity that the options tell, m/s²: its value, else the latitude, else the place."""
    from plumbob.calibration.acc.poses import normal_gravity
    from plumbob.core.constants import G0
    from plumbob.core.errors import ParameterError
    from plumbob.core.units import Quantity, parse
    from plumbob.data.earth_field import parse_place

    place = getattr(args, "place", None)
    if args.latitude is None and args.height is not None:
        raise ParameterError("--height needs --latitude: both together give gravity. Give both.")
    if args.gravity is not None and args.latitude is not None:
        raise ParameterError("--gravity and --latitude both give gravity. Give one of them.")
    if args.latitude is not None and place is not None:
        raise ParameterError("--latitude and --place both give the place of the capture. Give one of them.")
    if args.gravity is not None:
        return parse(args.gravity, Quantity.ACCELERATION)
    if args.latitude is not None:
        height = 0.0 if args.height is None else parse(args.height, Quantity.LENGTH)
        return normal_gravity(parse(args.latitude, Quantity.ANGLE), height)
    if place is not None:
        latitude, _, height = parse_place(place)
        return normal_gravity(latitude, height)
    return G0


def field_of(args: argparse.Namespace, capture: "Capture") -> tuple[float | None, float | None, tuple[str, ...]]:
    """Strength, µT, and dip, rad, of the field on the day of a capture, as far as the options tell them; and a remark.

    The remark keeps the declination in the card. No verb takes it from there: a unit is used elsewhere too.
    """
    from plumbob.core.units import Quantity, parse
    from plumbob.data.earth_field import earth_field_at, parse_place

    if args.place is None:
        return None if args.strength is None else parse(args.strength, Quantity.FIELD), None, ()
    if not capture.dated:
        common.note(f"the recording has no date; the field is that of today, {capture.date}")
    field = earth_field_at(*parse_place(args.place), capture.date)
    common.note(f"field at the place: {field.told}")
    return field.strength, field.dip, (f"Field at the place of the capture: {field.told}.",)


def kept(fits: "Mapping[str, Fitted]", told: tuple[str, ...]) -> "dict[str, Fitted]":
    """Fits with the field of the place as a remark of the magnetometer."""
    from dataclasses import replace

    return {n: replace(fit, remarks=(*fit.remarks, *told)) if n == "mag" else fit for n, fit in fits.items()}


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
    p.add_argument("--html", type=Path, metavar="FILE", help="also write a page with figures that opens offline")
    common.add_force(p)
    common.add_json(p)
    p.set_defaults(told={}, live=False, guided=guide)
    if guide:
        live.add_options(p)


def opened(
    args: argparse.Namespace,
    *triads: str,
    if_present: tuple[str, ...] = (),
    inputs: tuple[Path | None, ...] = (),
) -> "Capture":
    """Capture that the options name, for the triads that are calibrated, some of them only where it has them.

    Without a triad it is the mounting that is found. What else is read is among `inputs`.
    """
    from plumbob.calibration.calibration import capture_of
    from plumbob.data.cards import CalibrationCard

    out = None if room.completes(args) else args.out
    common.check_outputs(args, out, args.html, inputs=(args.file, args.profile, args.calibration, *inputs))
    base = None if args.calibration is None else CalibrationCard.load(args.calibration)
    if args.live:
        return live.live_capture(args, triads, base)
    if args.guided:
        live.require_recording(args)
    found = capture_of(
        args.file,
        triads=triads,
        if_present=if_present,
        profile=args.profile,
        span=_span(args),
        device=args.device,
        base=base,
    )
    common.note(*(f"{args.file.name}: {line}" for line in found.found))
    made = {*triads, *(name for name in if_present if name in found.imu.triads)} or {"mount"}
    room.require_room(args, found.device, made, base)
    if args.guided and args.guide:
        live.tell(args, found.imu)
    return found


def finish(
    args: argparse.Namespace, capture: "Capture", fits: "Mapping[str, Fitted]", *, mounted: "Mounted | None" = None
) -> int:
    """Print what was found, and write the card."""
    from plumbob.calibration import certificate
    from plumbob.calibration.calibration import card_of

    card = card_of(capture, fits, mounted=mounted)
    if args.out is not None:
        card.save(args.out, overwrite=args.force or room.completes(args))
    if args.html is not None:
        title = f"Calibration of {card.device}"
        facts = {"recording": args.file.name if args.file else "live"}
        certificate.write_html(args.html, card, fits, title=title, facts=facts, overwrite=args.force)
    if args.json:
        written = {"out": args.out and str(args.out), "html": args.html and str(args.html)}
        common.print_json(_read(args) | written | certificate.as_dict(card, fits))
        return 0
    print(certificate.text(card, fits))
    print(f"card         {args.out}" if args.out else "card         NOT WRITTEN: name a file with --out")
    if args.html is not None:
        print(f"page         {args.html}")
    return 0


def refused(args: argparse.Namespace, why: "CaptureRefusedError") -> int:
    """Print the reasons, as text on standard error or as JSON; nothing is written."""
    import sys

    from plumbob.calibration import certificate
    from plumbob.core.text import visible

    if args.json:
        common.print_json(_read(args) | {"out": None, "html": None} | certificate.refusal_as_dict(why))
    else:
        told = visible(certificate.refusal_text(why), keep="\n")
        print(f"plumbob calibrate {args.kind}: {told}", file=sys.stderr)
    return 1


def _read(args: argparse.Namespace) -> dict[str, Any]:
    """What was read, and what a guide told about it."""
    return {"file": args.file and str(args.file), **getattr(args, "told", {})}


def _span(args: argparse.Namespace) -> tuple[float, float] | None:
    from plumbob.core.units import Quantity, parse

    if args.start is None and args.stop is None:
        return None
    first = 0.0 if args.start is None else parse(args.start, Quantity.TIME)
    return first, float("inf") if args.stop is None else parse(args.stop, Quantity.TIME)
