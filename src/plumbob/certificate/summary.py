"""A calibration as JSON."""

import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any, Final

from plumbob.calib.fitted import Fitted
from plumbob.calib.refusal import CaptureRefusedError
from plumbob.cards import UNITS, CalibrationCard, TriadCalibration
from plumbob.certificate.axes import sensing_axes
from plumbob.certificate.size import sizes
from plumbob.check import Floats
from plumbob.data import TRIADS
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
