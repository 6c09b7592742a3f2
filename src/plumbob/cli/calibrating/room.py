"""Where a card is to be written: what is there already must not be lost."""

from collections.abc import Collection
from pathlib import Path


def require_room(out: Path | None, device: str, parts: Collection[str]) -> None:
    """Refuse to write a card of a unit with these parts over a card of another unit, or one that has more."""
    from plumbob.cards import CalibrationCard
    from plumbob.errors import DecodeError, ParameterError

    if out is None or not out.is_file():
        return
    try:
        there = CalibrationCard.load(out)
    except DecodeError:
        return
    if there.device != device:
        raise ParameterError(f"{out} is the card of '{there.device}', not of '{device}'; name another file.")
    if lost := [name for name in there.parts if name not in parts]:
        raise ParameterError(
            f"{out} has {' and '.join(lost)}, which this would lose; complete it with --calibration {out}, or name "
            "another file."
        )
