"""A calibration, or the reason for its refusal, as JSON and as a table."""

import json
import textwrap
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any, Final

from plumbob.calibration.certificate.rows import (
    AXES,
    LEGEND,
    facts,
    formula,
    grade,
    mount_rows,
    sensing_axes,
    sizes,
    table_rows,
)
from plumbob.calibration.fit import Fitted
from plumbob.calibration.rejection import CaptureRefusedError
from plumbob.core.check import Floats
from plumbob.core.text import WIDTH, aligned, listed, pair
from plumbob.data import TITLES, TRIADS
from plumbob.data.cards import UNITS, CalibrationCard, TriadCalibration
from plumbob.rotations import euler_zyx_from_quat

_UNITS: Final = {**UNITS, "angles": "rad"}


def as_dict(card: CalibrationCard, fits: Mapping[str, Fitted]) -> dict[str, Any]:
    """Card, figures made of it and remarks, ready for JSON.

    Keys are `refused` (empty), `units`, `card`, `figures` and `remarks`, the last two by part of the card. Numbers of a
    triad are in the unit that `units` gives it, angles in that of `angles`; matrices and scales are relative. A figure
    that was not found is null.
    """
    told: dict[str, Any] = {"refused": [], "units": _UNITS, "card": json.loads(card.text())}
    figures = {name: _figures(name, getattr(card, name), fits.get(name)) for name in TRIADS if name in card.parts}
    if card.mount is not None:
        figures["mount"] = {"yaw_pitch_roll": euler_zyx_from_quat(card.mount.q_bs).tolist()}
    remarks = {name: list(part.remarks) for name, part in card.parts.items()}
    return told | {"figures": figures, "remarks": remarks}


def refusal_as_dict(refused: CaptureRefusedError) -> dict[str, Any]:
    """Reasons of a refusal, ready for JSON."""
    reasons = [asdict(reason) for reason in refused.reasons]
    return {"refused": reasons, "units": _UNITS, "card": None, "figures": {}, "remarks": {}}


def _figures(name: str, model: TriadCalibration, fit: Fitted | None) -> dict[str, Any]:
    axes = sensing_axes(model) if model.matrix_found else None
    found = None if fit is None else sizes(name, fit)
    before, after = (None, None) if found is None else found.rms()
    return {
        "bias_sd": _listed(model.bias_sd),
        "matrix_sd": _listed(model.matrix_sd if axes else None),
        "scale": _listed(axes and axes.scale),
        "scale_sd": _listed(axes and axes.scale_sd),
        "misalignment": _listed(axes and axes.misalignment),
        "skew_xy_xz_yz": _listed(axes and axes.skew),
        "size_expected": None if found is None else found.expected,
        "size_rms_before": before,
        "size_rms_after": after,
    }


def _listed(values: Floats | None) -> Any:
    return None if values is None else values.tolist()


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
    return ["", f"NOT in this card, which leaves them uncalibrated: {', '.join(lacking)}"] if lacking else []
