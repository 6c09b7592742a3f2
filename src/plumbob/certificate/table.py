"""A calibration as text."""

import textwrap
from collections.abc import Mapping

from plumbob.calib.fitted import Fitted
from plumbob.calib.refusal import CaptureRefusedError
from plumbob.cards import CalibrationCard, TriadCalibration
from plumbob.certificate.rows import AXES, LEGEND, facts, formula, grade, mount_rows, table_rows
from plumbob.data import TITLES
from plumbob.plain import WIDTH, aligned, listed, pair


def text(card: CalibrationCard, fits: Mapping[str, Fitted]) -> str:
    """Tell what a card holds, with units and standard deviations.

    Parameters
    ----------
    card : CalibrationCard
        The card.
    fits : mapping of str to Fitted
        By triad, the fits that it was just made of; may be empty.
    """
    made = f", by {card.software}" if card.software else ""
    lines = [f"{card.device}: calibration of {card.date}{made}", LEGEND, formula(card)]
    for name, title in TITLES.items():
        model: TriadCalibration | None = getattr(card, name)
        if model is not None:
            lines += ["", f"{title}: {grade(model).upper()}", *_triad(name, model, fits.get(name))]
    if card.mount is not None:
        lines += ["", "mounting of the unit on its body", *(pair(*row) for row in mount_rows(card.mount))]
        lines += listed(card.mount.remarks)
    return "\n".join(lines + _missing(card))


def refusal_text(refused: CaptureRefusedError) -> str:
    """Tell why a capture was refused, and what to do."""
    lines = [f"REFUSED, {refused.reasons[0].kind}; no card is made"]
    for reason in refused.reasons:
        lines += listed([f"{reason.kind}: {reason.text}"])
        lines += textwrap.wrap(reason.advice, WIDTH, initial_indent="  ", subsequent_indent="  ")
    return "\n".join(lines)


def _triad(name: str, model: TriadCalibration, fit: Fitted | None) -> list[str]:
    lines = aligned(["", *AXES], *table_rows(name, model))
    lines += [pair(*fact) for fact in facts(name, model, fit)]
    return lines + listed(model.remarks)


def _missing(card: CalibrationCard) -> list[str]:
    lacking = [title for name, title in TITLES.items() if name not in card.parts]
    return ["", f"NOT in this card, left uncalibrated by it: {', '.join(lacking)}"] if lacking else []
