"""Applying a calibration card: the equation, and what it refuses."""

from dataclasses import replace

import numpy as np
import pytest

from plumbob import ImuData, ImuMeta, flags, units
from plumbob.core.errors import CalibrationError
from plumbob.data.calibrated import apply_card, temperature_beyond, temperature_drift
from plumbob.data.cards import UNITS, CalibrationCard, Mount, TriadCalibration
from plumbob.data.cards.residuals import NOTHING

N = 300
EPS = np.finfo(float).eps
MATRIX = np.array([[1.01, 0.02, -0.03], [0.0, 0.98, 0.01], [0.004, -0.005, 1.02]])
BIAS = np.array([0.1, -0.2, 0.3])
COUPLING = np.array([[1e-3, -2e-3, 0.0], [0.0, 5e-4, 4e-3], [-3e-3, 0.0, 2e-3]])  # g-sensitivity
TRIADS = ("gyr", "acc", "mag")


def recording(**changes):
    rng = np.random.default_rng(0)
    whole = {
        "t": 0.01 * np.arange(N), "gyr": rng.normal(size=(N, 3)), "acc": [0, 0, 9.8] + rng.normal(size=(N, 3)),
        "mag": [20, 0, -40] + rng.normal(size=(N, 3)), "temp_c": np.linspace(20.0, 40.0, N),
        "meta": ImuMeta(device="unit 7"),
    }  # fmt: skip
    return ImuData(**(whole | changes))


def model(name, **changes):
    return TriadCalibration(
        **({"matrix": MATRIX, "bias": BIAS, "unit_in": UNITS[name], "unit_out": UNITS[name]} | changes)
    )


def card(*names, device="unit 7", **changes):
    return CalibrationCard(device, "2026-11-21", "test", **{name: model(name, **changes) for name in names})


@pytest.mark.parametrize("name", TRIADS)
def test_the_equation(name):
    """calibrated = M (measured − b), row by row; nothing else changes."""
    data = recording()
    before = getattr(data, name).copy()
    calibrated = apply_card(card(name), data)
    expected = [MATRIX @ (row - BIAS) for row in before]
    np.testing.assert_allclose(getattr(calibrated, name), expected, rtol=0, atol=4 * EPS * 60)
    assert np.array_equal(getattr(data, name), before) and data.meta.calibration is None
    for other in set(TRIADS) - {name}:
        assert getattr(calibrated, other) is getattr(data, other)


def test_it_inverts_the_sensor_model():
    """measured = M⁻¹ true + b + b_T (T − T_ref) is what a sensor does; the card takes it back."""
    data, per_k = recording(), np.array([0.01, -0.02, 0.005])
    drift = np.outer(data.temp_c - 25.0, per_k)
    measured = replace(data, acc=np.linalg.solve(MATRIX, data.acc.T).T + BIAS + drift)
    found = apply_card(card("acc", bias_per_k=per_k, temp_ref_c=25.0), measured).acc
    assert np.abs(found - data.acc).max() <= 32 * EPS * 20


def test_an_axis_error_is_on_the_right_side_and_a_part_without_a_magnetic_sample_can_be_calibrated():
    """Row 0 of M makes the new x: a card that adds 0.1 y to x must not add 0.1 x to y."""
    matrix = np.eye(3)
    matrix[0, 1] = 0.1
    data = recording()
    found = apply_card(card("gyr", matrix=matrix, bias=np.zeros(3)), data).gyr
    assert np.array_equal(found[:, 1:], data.gyr[:, 1:])
    np.testing.assert_allclose(found[:, 0], data.gyr[:, 0] + 0.1 * data.gyr[:, 1], atol=4 * EPS * 5)
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


def test_provenance_names_the_card_and_the_triads_that_it_leaves_uncalibrated():
    calibrated = apply_card(card("acc", "gyr", "mag"), recording())
    assert calibrated.meta.calibration == "unit 7 2026-11-21 (test)"
    unknown = {"acc_left": NOTHING, "mag_left": NOTHING}  # the card has no covariance
    assert calibrated.meta == replace(recording().meta, calibration=calibrated.meta.calibration, **unknown)
    with pytest.raises(CalibrationError, match="already calibrated, with unit 7 2026-11-21"):
        apply_card(card("acc"), calibrated)
    assert apply_card(card("acc"), recording()).meta.calibration == (
        "unit 7 2026-11-21 (test); NOT calibrated: gyr, mag"
    )
    assert "NOT" not in apply_card(card("acc"), recording(gyr=None, mag=None, temp_c=None)).meta.calibration


@pytest.mark.parametrize(("made", "data", "says"), [
    (card("acc", device="unit 8"), {}, "for device 'unit 8', but the recording is of 'unit 7'"),
    (card("acc"), {"meta": ImuMeta()}, "the recording is of 'unknown'"),
    (card("acc", unit_in="g"), {}, "acc goes from g to m/s2; the recording is in m/s2"),
    (card("mag", unit_out="1"), {}, "mag goes from uT to 1; the recording is in uT"),
    (card("acc", bias_per_k=[0, 0, 1e-3]), {"temp_c": None}, "recording has no temp_c"),
    (card("acc", bias_per_k=[0, 0, 1e-3]), {"temp_c": np.r_[np.nan, np.zeros(N - 1)]}, "not in every sample"),
    (card("mag"), {"mag": None}, "the card has nothing for gyr, acc, the triads of the recording"),
    (card("gyr", g_sensitivity=COUPLING), {"acc": None}, "corrects for g-sensitivity, but the recording has no acc"),
])  # fmt: skip
def test_refused(made, data, says):
    with pytest.raises(CalibrationError, match=says):
        apply_card(made, recording(**data))


class TestTemperature:
    """b(T) = p₁ u + p₂ u² + p₃ u³ with u = T − T_ref within the span, and its tangent beyond."""

    SPAN, REF = (10.0, 40.0), 25.0
    P = np.array([[1e-2, -2e-2, 0.0], [3e-4, 0.0, -1e-4], [0.0, 2e-5, 1e-5]])

    def drift(self, temp_c, **changes):
        made = model("gyr", **{"bias_per_k": self.P, "temp_ref_c": self.REF, "temp_span_c": self.SPAN} | changes)
        return temperature_drift(made, np.asarray(temp_c, dtype=float))

    def value(self, temp_c):
        u = temp_c - self.REF
        return self.P[0] * u + self.P[1] * u**2 + self.P[2] * u**3

    def slope(self, temp_c):
        u = temp_c - self.REF
        return self.P[0] + 2.0 * self.P[1] * u + 3.0 * self.P[2] * u**2

    def test_within_the_span_and_where_there_is_none(self):
        for temp_c in (10.0, 17.3, 25.0, 40.0):
            np.testing.assert_allclose(self.drift([temp_c])[0], self.value(temp_c), rtol=0, atol=8 * EPS * 0.5)
        np.testing.assert_allclose(self.drift([60.0], temp_span_c=None)[0], self.value(60.0), rtol=0, atol=16 * EPS)
        assert np.isnan(self.drift([np.nan])).all()

    @pytest.mark.parametrize(("temp_c", "end"), [(-20.0, 10.0), (9.0, 10.0), (41.0, 40.0), (85.0, 40.0)])
    def test_beyond_the_span(self, temp_c, end):
        expected = self.value(end) + self.slope(end) * (temp_c - end)
        np.testing.assert_allclose(self.drift([temp_c])[0], expected, rtol=0, atol=16 * EPS * 2.0)
        assert np.abs(expected - self.value(temp_c)).max() > 1e-5  # the polynomial itself would be somewhere else

    def test_beyond_a_span_without_the_reference_and_in_the_measurement(self):
        drift = self.drift([50.0], temp_span_c=(30.0, 40.0))[0]
        np.testing.assert_allclose(drift, self.value(40.0) + 10.0 * self.slope(40.0), rtol=0, atol=16 * EPS * 2.0)
        # from 0 to 60 °C: by hand below the span, in it and above it, where the drift goes on along its tangent
        data = recording(temp_c=np.linspace(0.0, 60.0, N))
        made = card("gyr", bias_per_k=self.P, temp_ref_c=self.REF, temp_span_c=self.SPAN)
        held = [min(max(float(t), self.SPAN[0]), self.SPAN[1]) for t in data.temp_c]
        drift = [self.value(h) + self.slope(h) * (t - h) for t, h in zip(data.temp_c.tolist(), held, strict=True)]
        expected = (data.gyr - BIAS - np.array(drift)) @ MATRIX.T
        np.testing.assert_allclose(apply_card(made, data).gyr, expected, rtol=0, atol=32 * EPS * 5)

    @pytest.mark.parametrize(("changes", "data", "share"), [
        ({"temp_span_c": (22.0, 38.0)}, {}, 20),  # 20 to 40 °C evenly: 2 K of 20 at either end
        ({"temp_span_c": (20.0, 40.0)}, {}, None),
        ({"temp_span_c": None}, {}, None),
        ({"temp_span_c": (22.0, 38.0), "bias_per_k": np.zeros(3)}, {}, None),
        ({"temp_span_c": (22.0, 38.0)}, {"temp_c": None}, None),
        ({"temp_span_c": (22.0, 38.0)}, {"temp_c": np.full(N, np.nan)}, None),
    ])  # fmt: skip
    def test_leaving_the_span_is_told(self, changes, data, share):
        made = card("acc", **{"bias_per_k": [1e-3, 0.0, 0.0]} | changes)
        expected = share and (
            f"temperature: {share} % of the samples are at 20.0 to 40.0 °C, beyond the 22.0 to 38.0 °C of the "
            "calibration of acc, where its polynomial is extrapolated."
        )
        assert list(map(str, temperature_beyond(made, recording(**data)))) == ([expected] if expected else [])

    def test_a_live_sample_without_temperature_becomes_absent(self):
        data = recording(temp_c=np.r_[np.nan, np.full(N - 1, 25.0)])
        made = card("gyr", bias_per_k=self.P)
        found = apply_card(made, data, live=True)
        assert np.flatnonzero(np.isnan(found.gyr).any(axis=1)).tolist() == [0]
        assert np.flatnonzero(found.flags & flags.GYR_ABSENT).tolist() == [0]
        assert np.array_equal(found.acc, data.acc)


class TestGSensitivity:
    def test_the_specific_force_that_counts_is_calibrated_where_it_can_be(self):
        """rate = M_g (measured − b − G f), and f = M_a (measured − b) where the card has it."""
        data = recording()
        both = replace(card("gyr", g_sensitivity=COUPLING), acc=model("acc", matrix=1.1 * np.eye(3)))
        force = 1.1 * (data.acc - BIAS)
        expected = (data.gyr - BIAS - force @ COUPLING.T) @ MATRIX.T
        np.testing.assert_allclose(apply_card(both, data).gyr, expected, rtol=0, atol=32 * EPS * 5)
        expected = (data.gyr - BIAS - data.acc @ COUPLING.T) @ MATRIX.T
        found = apply_card(card("gyr", g_sensitivity=COUPLING), data).gyr
        np.testing.assert_allclose(found, expected, rtol=0, atol=32 * EPS * 5)
        acc = recording().acc.copy()
        acc[5], acc[9] = np.nan, 1e6  # absent, invalid
        found = apply_card(card("gyr", g_sensitivity=COUPLING), recording(acc=acc))
        assert np.flatnonzero(np.isnan(found.gyr).any(axis=1)).tolist() == [5, 9]
        assert np.flatnonzero(found.flags & flags.GYR_ABSENT).tolist() == [5, 9]


class TestMount:
    """A unit that lies on its side: its x axis is the body's y, its y the body's −x."""

    QUARTER = Mount([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])

    def test_all_triads_are_turned_after_they_are_corrected(self):
        data = recording()
        made = replace(card("acc"), mount=self.QUARTER)
        found, corrected = apply_card(made, data), apply_card(card("acc"), data)
        for name in TRIADS:
            x, y, z = getattr(corrected, name).T
            np.testing.assert_allclose(getattr(found, name), np.stack([-y, x, z], axis=1), rtol=0, atol=8 * EPS * 100)

    def test_a_mounting_turns_ranges_is_a_calibration_and_needs_all_axes(self):
        """A quarter turn about z: the body's x is the case's −y, and its y the case's x."""
        data = recording(meta=ImuMeta(device="unit 7", gyr_range=(10.0, 20.0, 40.0), acc_range=100.0))
        found = apply_card(replace(card(), mount=self.QUARTER), data)
        np.testing.assert_allclose(found.meta.full_scale("gyr"), [20.0, 10.0, 40.0], rtol=8 * EPS)
        np.testing.assert_allclose(found.meta.full_scale("acc"), [100.0, 100.0, 100.0], rtol=8 * EPS)
        data = recording(mag=None)
        hung = apply_card(replace(card(), mount=self.QUARTER), data)
        np.testing.assert_allclose(hung.gyr[:, 1], data.gyr[:, 0], rtol=0, atol=8 * EPS * 10)
        assert hung.mag is None
        assert hung.meta.calibration == "unit 7 2026-11-21 (test); NOT calibrated: gyr, acc"
        mag = recording().mag.copy()
        mag[3, 0] = np.nan
        found = apply_card(replace(card(), mount=self.QUARTER), recording(mag=mag))
        assert np.flatnonzero(found.flags & flags.MAG_ABSENT).tolist() == [3]
        assert not np.flatnonzero(found.flags & flags.ACC_ABSENT).size


@pytest.mark.parametrize("size", [1, 7, 64])
def test_chunks_get_the_same_bits_with_everything_that_a_card_can_hold(size):
    """A matrix product does not promise that: for a single row BLAS may add in another order."""
    acc = recording().acc.copy()
    acc[100] = np.nan
    data = recording(acc=acc, temp_c=np.linspace(0.0, 60.0, N))[40:240]  # from below the span to beyond it
    polynomial = {"bias_per_k": TestTemperature.P, "temp_span_c": TestTemperature.SPAN}
    gyr = model("gyr", **polynomial, g_sensitivity=COUPLING)
    made = replace(card("acc", "mag", **polynomial), gyr=gyr, mount=Mount(np.array([0.5, 0.5, -0.5, 0.5])))
    together = apply_card(made, data)
    assert np.isnan(together.gyr[60]).all()
    for name in (*TRIADS, "flags"):
        parts = np.concatenate([getattr(apply_card(made, chunk), name) for chunk in data.chunks(size)])
        assert parts.tobytes() == getattr(together, name).tobytes()
