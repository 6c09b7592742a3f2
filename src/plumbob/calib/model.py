"""Apply a calibration card to a recording."""

from dataclasses import replace
from typing import Any

import numpy as np

from plumbob.cards import UNITS, CalibrationCard, TriadCalibration
from plumbob.check import Floats
from plumbob.data import TRIADS, ImuData
from plumbob.errors import CalibrationError


def apply_card(card: CalibrationCard, data: ImuData, *, live: bool = False) -> ImuData:
    """Return the recording with each triad of the card corrected, and the card's name in its meta.

    Parameters
    ----------
    card : CalibrationCard
        The card.
    data : ImuData
        The recording.
    live : bool
        Whether it is a part of a stream, in which a sample without the temperature that the card needs becomes absent
        instead of an error.

    Raises
    ------
    CalibrationError
        If the card belongs to another device or unit or has nothing for this recording, the recording is already
        calibrated, or a temperature is missing where the card needs one.
    """
    if card.device != data.meta.device:
        raise CalibrationError(f"the card is for device '{card.device}', but the recording is of '{data.meta.device}'.")
    if data.meta.calibration is not None:
        raise CalibrationError(f"the recording is already calibrated, with {data.meta.calibration}.")
    changed: dict[str, Any] = {}
    for name in TRIADS:
        model: TriadCalibration | None = getattr(card, name)
        measured: Floats | None = getattr(data, name)
        if model is None or measured is None:
            continue
        if (model.unit_in, model.unit_out) != (UNITS[name], UNITS[name]):
            raise CalibrationError(
                f"the card's {name} goes from {model.unit_in} to {model.unit_out}; the recording is in {UNITS[name]}."
            )
        changed[name] = _corrected(model, measured, data.temp_c, live)
    if not changed:
        raise CalibrationError(f"the card has nothing for {', '.join(data.triads)}, the triads of the recording.")
    return data.corrected(**changed, meta=replace(data.meta, calibration=card.name))


def _corrected(model: TriadCalibration, measured: Floats, temp_c: Floats | None, live: bool) -> Floats:
    bias: Floats = model.bias
    if model.bias_per_k.any():
        if temp_c is None or not (live or np.isfinite(temp_c).all()):
            raise CalibrationError(
                "the card corrects for temperature, but the recording has no temp_c, or not in every sample; fill it."
            )
        bias = model.bias + np.outer(temp_c - model.temp_ref_c, model.bias_per_k)
    with np.errstate(invalid="ignore", over="ignore"):  # an infinite value stays flagged and becomes what it may
        x, y, z = np.moveaxis(measured - bias, 1, 0)
        # In components, because a matrix product may round a part of a recording otherwise than the whole.
        return np.stack([row[0] * x + row[1] * y + row[2] * z for row in model.matrix], axis=1)
