"""Apply a calibration card to a recording."""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np

from plumbob.core import check, flags
from plumbob.core.check import Floats
from plumbob.core.errors import CalibrationError
from plumbob.core.findings import Finding, warning
from plumbob.core.kernels import kernel
from plumbob.data.cards import UNITS, CalibrationCard, TriadCalibration
from plumbob.data.cards.residuals import left_by
from plumbob.data.imu import TRIADS, ImuData, ImuMeta
from plumbob.data.sample import ImuSample
from plumbob.rotations import dcm_from_quat


def apply_card(card: CalibrationCard, data: ImuData, *, live: bool = False) -> ImuData:
    """Return the recording with each triad of the card corrected, and the card's name in its meta.

    The meta also names the triads of the recording that the card leaves uncalibrated.

    Where the card knows how the unit sits on its body, all triads are turned into the axes of the body. Where it knows
    the gyroscope's g-sensitivity, a sample without a specific force has no rate either, and its flags say so.

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
        calibrated, or a temperature or the accelerometer is missing where the card needs one.
    """
    check.kind("card", card, CalibrationCard, hint="CalibrationCard.load(path) reads one.")
    check.kind("data", data, ImuData, hint="Of a Recording take its .imu.")
    if card.device != data.meta.device:
        raise CalibrationError(
            f"the card is for device '{card.device}', but the recording is of '{data.meta.device}'. A card "
            f"belongs to one unit: use the card of that unit, or name the recording's by device = '{card.device}' "
            "in the profile of a text file."
        )
    if data.meta.calibration is not None:
        raise CalibrationError(f"the recording is already calibrated, with {data.meta.calibration}.")
    _require_units(card)
    changed = dict[str, Any]()
    for name in _ORDER:
        model: TriadCalibration | None = getattr(card, name)
        measured: Floats | None = getattr(data, name)
        if model is not None and measured is not None:
            changed[name] = _corrected(model, measured, _offset(model, data, changed.get("acc"), live))
    if not changed and card.mount is None:
        raise CalibrationError(f"the card has nothing for {', '.join(data.triads)}, the triads of the recording.")
    if card.mount is not None:
        dcm_bs = dcm_from_quat(card.mount.q_bs)
        changed |= {name: times(dcm_bs, changed.get(name, getattr(data, name))) for name in data.triads}
    return data.corrected(**changed, meta=calibrated_meta(card, data.meta, data.triads))


def calibrated_meta(card: CalibrationCard, meta: ImuMeta, triads: Sequence[str]) -> ImuMeta:
    """Meta of calibrated samples with these triads: what calibrated them, and what that leaves."""
    acc_left, mag_left = left_by("acc", card.acc, card.mount), left_by("mag", card.mag, card.mount)
    fitted = card.gyr is not None and card.gyr.covariance is not None
    gyr_left = left_by("gyr", card.gyr, card.mount) if fitted else None
    missing = [name for name in triads if name not in card.parts]
    calibration = f"{card.name}; NOT calibrated: {', '.join(missing)}" if missing else card.name
    meta = meta if card.mount is None else meta.rotated(dcm_from_quat(card.mount.q_bs))
    return replace(meta, calibration=calibration, gyr_left=gyr_left, acc_left=acc_left, mag_left=mag_left)


_UNUSABLE: Final = flags.ACC_ABSENT | flags.ACC_INVALID
_ORDER: Final = ("acc", "gyr", "mag")  # the gyroscope's g-sensitivity asks for the calibrated specific force
_SIZE: Final = 22  # of a triad: whether the card has it, its matrix, bias, g-sensitivity; the same of its mounting
_MOUNT: Final = 3 * _SIZE


@kernel
def correct_values(c: Floats, values: Floats, out: Floats) -> None:
    """Nine values of a sample by a card's numbers; the terms in the order of `apply_card`, for the same bits."""
    for k in range(3):
        at, place = k * _SIZE, 3 if k == 0 else (0 if k == 1 else 6)
        x, y, z = values[place], values[place + 1], values[place + 2]
        if c[at] != 0.0:
            bx, by, bz = c[at + 10], c[at + 11], c[at + 12]
            if c[at] > 1.0:
                fx, fy, fz = out[3], out[4], out[5]
                bx += c[at + 13] * fx + c[at + 14] * fy + c[at + 15] * fz
                by += c[at + 16] * fx + c[at + 17] * fy + c[at + 18] * fz
                bz += c[at + 19] * fx + c[at + 20] * fy + c[at + 21] * fz
            x, y, z = x - bx, y - by, z - bz
            for i in range(3):
                row = at + 1 + 3 * i
                out[place + i] = c[row] * x + c[row + 1] * y + c[row + 2] * z
        else:
            out[place], out[place + 1], out[place + 2] = x, y, z
    if c[_MOUNT] != 0.0:
        for place in range(0, 9, 3):
            x, y, z = out[place], out[place + 1], out[place + 2]
            for i in range(3):
                row = _MOUNT + 1 + 3 * i
                out[place + i] = c[row] * x + c[row + 1] * y + c[row + 2] * z


class SampleCorrection:
    """Applies a card to single samples, with the bits of `apply_card`."""

    def __init__(self, card: CalibrationCard) -> None:
        _require_units(card)
        self._c, self._warm, self._temp_c = np.zeros(_MOUNT + 10), list[tuple[int, TriadCalibration]](), np.nan
        self._correct = correct_values.compiled
        for k, name in enumerate(_ORDER):
            model: TriadCalibration | None = getattr(card, name)
            if model is not None and model.per_load is not None:
                raise CalibrationError(
                    f"the card takes the field of {', '.join(model.loads)} off mag, but a sample has none: "
                    "correct a recording that has it."
                )
            if model is not None:
                at = k * _SIZE
                self._c[at] = 2.0 if model.g_sensitivity.any() else 1.0
                self._c[at + 1 : at + _SIZE] = np.r_[model.matrix.ravel(), model.bias, model.g_sensitivity.ravel()]
                self._warm += [(at + 10, model)] if model.bias_per_k.any() else []
        self._by_force = bool((self._c[0:_MOUNT:_SIZE] > 1.0).any())
        if card.mount is not None:
            self._c[_MOUNT] = 1.0
            self._c[_MOUNT + 1 :] = dcm_from_quat(card.mount.q_bs).ravel()

    def __call__(self, sample: ImuSample) -> ImuSample:
        """The sample corrected; errors as of `CalibrationCard.correct`."""
        if self._warm and sample.temp_c != self._temp_c:
            self._heed(sample.temp_c)
        out = np.empty(9)
        self._correct(self._c, sample.values, out)
        if self._by_force and sample.flags & _UNUSABLE:
            out[:3] = np.nan
        return sample.corrected(out)

    def _heed(self, temp_c: float | None) -> None:
        """Take the biases at another temperature."""
        if temp_c is None:
            raise CalibrationError("the card corrects for temperature, but the sample has no temp_c; fill it.")
        for at, model in self._warm:
            self._c[at : at + 3] = model.bias + temperature_drift(model, np.array([temp_c]))[0]
        self._temp_c = temp_c


def calibrating(
    calibration: CalibrationCard | str | Path, meta: ImuMeta | None
) -> tuple[CalibrationCard, SampleCorrection, ImuMeta]:
    """Card that a filter applies, what corrects its samples, and the meta that these then have."""
    card = CalibrationCard.of(calibration)
    meta = calibrated_meta(card, meta or ImuMeta(device=card.device), tuple(card.parts))
    return card, SampleCorrection(card), meta


correction = lru_cache(maxsize=32)(SampleCorrection)  # The `SampleCorrection` of a card, made once


def temperature_beyond(card: CalibrationCard, data: ImuData) -> tuple[Finding, ...]:
    """How far a recording's temperature leaves the span of the card's temperature terms; nothing where it does not."""
    for name in TRIADS:
        model: TriadCalibration | None = getattr(card, name)
        if model is None or model.temp_span_c is None or not model.bias_per_k.any() or (temp_c := data.temp_c) is None:
            continue
        low, high = model.temp_span_c
        finite = temp_c[np.isfinite(temp_c)]
        share = float(np.mean((finite < low) | (finite > high))) if finite.size else 0.0
        if share > 0.0:
            coldest, warmest = float(finite.min()), float(finite.max())
            return (
                warning(
                    "card.temperature_beyond", percent=100.0 * share, coldest_c=coldest, warmest_c=warmest, low_c=low,
                    high_c=high, sensor=name,
                ),
            )  # fmt: skip
    return ()


def temperature_drift(model: TriadCalibration, temp_c: Floats) -> Floats:
    """Change of the bias (N, 3) from that at the reference temperature: a polynomial, its tangent beyond the span."""
    inside = temp_c if model.temp_span_c is None else np.clip(temp_c, *model.temp_span_c)
    warmer, beyond = inside - model.temp_ref_c, temp_c - inside
    drift, slope, power = np.zeros((temp_c.size, 3)), np.zeros((temp_c.size, 3)), np.ones_like(temp_c)
    for k, row in enumerate(model.bias_per_k, start=1):
        slope += np.outer(k * power, row)
        power = power * warmer
        drift += np.outer(power, row)
    return np.asarray(drift + beyond[:, np.newaxis] * slope)


def _require_units(card: CalibrationCard) -> None:
    for name in TRIADS:
        model: TriadCalibration | None = getattr(card, name)
        if model is not None and (model.unit_in, model.unit_out) != (UNITS[name], UNITS[name]):
            raise CalibrationError(
                f"the card's {name} goes from {model.unit_in} to {model.unit_out}; the recording is in {UNITS[name]}."
            )


def _offset(model: TriadCalibration, data: ImuData, acc: Floats | None, live: bool) -> Floats:
    """What is taken off the measurement, (3,) or (N, 3)."""
    offset: Floats = model.bias
    if model.bias_per_k.any():
        if data.temp_c is None or not (live or np.isfinite(data.temp_c).all()):
            raise CalibrationError(
                "the card corrects for temperature, but the recording has no temp_c, or not in every sample; fill it."
            )
        offset = offset + temperature_drift(model, data.temp_c)
    if model.g_sensitivity.any():
        if data.acc is None:
            raise CalibrationError("the card corrects for g-sensitivity, but the recording has no acc; record it too.")
        force = data.acc if acc is None else acc
        unusable = (data.flags & np.uint32(_UNUSABLE)) != 0
        offset = offset + times(model.g_sensitivity, np.where(unusable[:, np.newaxis], np.nan, force))
    if model.per_load is not None:
        if data.load is None or data.load.shape[1] != len(model.loads):
            raise CalibrationError(
                f"the card takes the field of {', '.join(model.loads)} off the magnetometer, but the recording has no "
                "such load: in Python give ImuData its load, or calibrate without it."
            )
        offset = offset + np.sum(data.load[:, :, np.newaxis] * model.per_load, axis=1)
    return offset


def _corrected(model: TriadCalibration, measured: Floats, offset: Floats) -> Floats:
    with np.errstate(invalid="ignore", over="ignore"):  # an infinite value stays flagged and becomes what it may
        return times(model.matrix, measured - offset)


def times(matrix: Floats, vectors: Floats) -> Floats:
    """Matrix times each row; in components, because a matrix product may round a part otherwise than the whole."""
    with np.errstate(invalid="ignore", over="ignore"):
        x, y, z = np.moveaxis(vectors, 1, 0)
        return np.stack([row[0] * x + row[1] * y + row[2] * z for row in matrix], axis=1)
