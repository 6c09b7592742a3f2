"""Applying a calibration card: the equation, and what it refuses."""

from dataclasses import replace

import numpy as np
import pytest

from plumbob import flags, units
from plumbob.calib.model import apply_card
from plumbob.cards import UNITS, CalibrationCard, TriadCalibration
from plumbob.data import ImuData, ImuMeta
from plumbob.errors import CalibrationError

N = 300
EPS = np.finfo(float).eps
MATRIX = np.array([[1.01, 0.02, -0.03], [0.0, 0.98, 0.01], [0.004, -0.005, 1.02]])
BIAS = np.array([0.1, -0.2, 0.3])


def recording(**changes):
    rng = np.random.default_rng(0)
    whole = {
        "t": 0.01 * np.arange(N),
        "gyr": rng.normal(size=(N, 3)),
        "acc": [0, 0, 9.8] + rng.normal(size=(N, 3)),
        "mag": [20, 0, -40] + rng.normal(size=(N, 3)),
        "temp_c": np.linspace(20.0, 40.0, N),
        "meta": ImuMeta(device="unit 7"),
    }
    return ImuData(**(whole | changes))


def model(name, **changes):
    return TriadCalibration(
        **({"matrix": MATRIX, "bias": BIAS, "unit_in": UNITS[name], "unit_out": UNITS[name]} | changes)
    )


def card(*names, device="unit 7", **changes):
    return CalibrationCard(device, "2026-11-21", "test", **{name: model(name, **changes) for name in names})


@pytest.mark.parametrize("name", ["gyr", "acc", "mag"])
def test_the_equation(name):
    """calibrated = M (measured − b), row by row."""
    data = recording()
    found = getattr(apply_card(card(name), data), name)
    expected = [MATRIX @ (row - BIAS) for row in getattr(data, name)]
    np.testing.assert_allclose(found, expected, rtol=0, atol=4 * EPS * 60)
    for other in {"gyr", "acc", "mag"} - {name}:
        assert getattr(apply_card(card(name), data), other) is getattr(data, other)


def test_it_inverts_the_sensor_model():
    """measured = M⁻¹ true + b + b_T (T − T_ref) is what a sensor does; the card takes it back."""
    data, per_k = recording(), np.array([0.01, -0.02, 0.005])
    drift = np.outer(data.temp_c - 25.0, per_k)
    measured = replace(data, acc=np.linalg.solve(MATRIX, data.acc.T).T + BIAS + drift)
    found = apply_card(card("acc", bias_per_k=per_k, temp_ref_c=25.0), measured).acc
    assert np.abs(found - data.acc).max() <= 32 * EPS * 20


def test_an_axis_error_is_on_the_right_side():
    """Row 0 of M makes the new x: a card that adds 0.1 y to x must not add 0.1 x to y."""
    matrix = np.eye(3)
    matrix[0, 1] = 0.1
    data = recording()
    found = apply_card(card("gyr", matrix=matrix, bias=np.zeros(3)), data).gyr
    assert np.array_equal(found[:, 1:], data.gyr[:, 1:])
    np.testing.assert_allclose(found[:, 0], data.gyr[:, 0] + 0.1 * data.gyr[:, 1], atol=4 * EPS * 5)


@pytest.mark.parametrize("size", [1, 2, 3, 7, 64])
def test_chunks_get_the_same_bits_as_the_whole(size):
    """A matrix product does not promise that: for a single row BLAS may add in another order."""
    data, both = recording(), card("gyr", "acc", "mag", bias_per_k=[0.01, 0.0, 0.0])
    whole = apply_card(both, data)
    for name in ("gyr", "acc", "mag", "flags"):
        parts = np.concatenate([getattr(apply_card(both, chunk), name) for chunk in data.chunks(size)])
        assert parts.tobytes() == getattr(whole, name).tobytes()


def test_a_part_without_a_magnetic_sample_can_be_calibrated():
    mag = np.tile([20.0, 0.0, -40.0], (N, 1))
    mag[100:250] = np.nan
    part = recording(mag=mag)[120:240]
    assert np.isnan(apply_card(card("mag"), part).mag).all()


def test_flags_tell_what_the_sensor_said():
    acc = np.tile([0.0, 0.0, 9.8], (N, 1))
    acc[5], acc[6, 0], acc[7, 1] = units.g(2.0), np.inf, np.nan
    data = recording(acc=acc, meta=ImuMeta(device="unit 7", acc_range=units.g(2.0)))
    found = apply_card(card("acc", matrix=1.2 * np.eye(3)), data)
    assert np.array_equal(found.flags, data.flags)
    assert found.flags[[5, 6, 7]].tolist() == [flags.ACC_CLIPPED, flags.ACC_INVALID, flags.ACC_ABSENT]
    assert np.flatnonzero(np.isnan(found.usable("acc")).all(axis=1)).tolist() == [6, 7]


def test_provenance():
    found = apply_card(card("acc"), recording())
    assert found.meta.calibration == "unit 7 2026-11-21 (test)"
    assert found.meta == replace(recording().meta, calibration=found.meta.calibration)
    with pytest.raises(CalibrationError, match="already calibrated, with unit 7 2026-11-21"):
        apply_card(card("acc"), found)


def test_the_recording_is_left_alone():
    data = recording()
    before = data.acc.copy()
    apply_card(card("acc"), data)
    assert np.array_equal(data.acc, before)
    assert data.meta.calibration is None


@pytest.mark.parametrize(
    ("made", "data", "says"),
    [
        (card("acc", device="unit 8"), {}, "for device 'unit 8', but the recording is of 'unit 7'"),
        (card("acc"), {"meta": ImuMeta()}, "the recording is of 'unknown'"),
        (card("acc", unit_in="g"), {}, "acc goes from g to m/s2; the recording is in m/s2"),
        (card("mag", unit_out="1"), {}, "mag goes from uT to 1; the recording is in uT"),
        (card("acc", bias_per_k=[0, 0, 1e-3]), {"temp_c": None}, "recording has no temp_c"),
        (card("acc", bias_per_k=[0, 0, 1e-3]), {"temp_c": np.r_[np.nan, np.zeros(N - 1)]}, "not in every sample"),
        (card("mag"), {"mag": None}, "the card has nothing for gyr, acc, the triads of the recording"),
        (card(), {}, "the card has nothing for gyr, acc, mag"),
    ],
)
def test_refused(made, data, says):
    with pytest.raises(CalibrationError, match=says):
        apply_card(made, recording(**data))


def test_temperature_does_not_matter_without_a_drift():
    assert apply_card(card("acc"), recording(temp_c=None)).temp_c is None
