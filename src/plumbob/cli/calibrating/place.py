"""What the place of a capture tells: its gravity, and its magnetic field."""

import argparse
from collections.abc import Mapping
from typing import TYPE_CHECKING

from plumbob.cli import common

if TYPE_CHECKING:
    from plumbob.calib.fitted import Fitted
    from plumbob.pipeline.calibration import Capture


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
        help="where the capture was taken, degrees and metres: the World Magnetic Model of its day tells the field",
    )


def gravity_of(args: argparse.Namespace) -> float:
    """Gravity that the options tell, m/s²: its value, else the latitude, else the place."""
    from plumbob.calib.acc.gravity import normal_gravity
    from plumbob.constants import G0
    from plumbob.earth_field import parse_place
    from plumbob.errors import ParameterError
    from plumbob.units import Quantity, parse

    place = getattr(args, "place", None)
    if args.latitude is None and args.height is not None:
        raise ParameterError("--height says nothing about gravity without --latitude; give both.")
    if args.gravity is not None and args.latitude is not None:
        raise ParameterError("--gravity and --latitude both say what gravity is; give one.")
    if args.latitude is not None and place is not None:
        raise ParameterError("--latitude and --place both say where the capture was taken; give one.")
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
    from plumbob.earth_field import earth_field_at, parse_place
    from plumbob.units import Quantity, parse

    if args.place is None:
        return None if args.strength is None else parse(args.strength, Quantity.FIELD), None, ()
    if not capture.dated:
        common.note(f"the recording does not tell its date; the field is that of today, {capture.date}")
    field = earth_field_at(*parse_place(args.place), capture.date)
    common.note(f"field at the place: {field.told}")
    return field.strength, field.dip, (f"Field at the place of the capture: {field.told}.",)


def kept(fits: "Mapping[str, Fitted]", told: tuple[str, ...]) -> "dict[str, Fitted]":
    """Fits with what the place told as a remark of the magnetometer."""
    from dataclasses import replace

    return {n: replace(fit, remarks=(*fit.remarks, *told)) if n == "mag" else fit for n, fit in fits.items()}
