"""Where a card is to be written: what is there already must not be lost."""

import argparse
from collections.abc import Collection
from typing import TYPE_CHECKING

from plumbob.cli import common

if TYPE_CHECKING:
    from plumbob.data.cards import CalibrationCard


def completes(args: argparse.Namespace) -> bool:
    """Whether the card so far is the card to write: then it is completed, and nothing of it is lost."""
    both = args.out is not None and args.calibration is not None
    return both and common.is_same_file(args.out, args.calibration)


def require_room(args: argparse.Namespace, device: str, made: Collection[str], base: "CalibrationCard | None") -> None:
    """Refuse to write a card over that of another unit, one that has more, or a part over another without --force."""
    from plumbob.core.errors import DecodeError, ParameterError
    from plumbob.data.cards import CalibrationCard

    out = args.out
    if out is None or not out.is_file():
        return
    try:
        there = CalibrationCard.load(out)
    except DecodeError:
        return
    if there.device != device:
        raise ParameterError(f"{out} is the card of '{there.device}', not of '{device}'; name another file.")
    kept = base.parts if base else ()
    if lost := [name for name in there.parts if name not in {*made, *kept}]:
        raise ParameterError(
            f"{out} has {' and '.join(lost)}, which this would lose; complete it with --calibration {out}, or name "
            "another file."
        )
    if not args.force and (again := [name for name in there.parts if name in made]):
        raise ParameterError(f"{out} has {' and '.join(again)} already. Name another file, or replace it with --force.")
