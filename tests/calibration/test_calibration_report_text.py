"""What a certificate says, as text and as JSON; expected texts are worked out from the planted numbers."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from plumbob.calibration.fit import CaptureRefusedError, Fitted, Reason
from plumbob.calibration.report import certificate, numbers, refusal_numbers, refusal_text
from plumbob.core.units import to_si
from plumbob.data.cards import CalibrationCard
from tests.helpers.certificate_samples import acc_calibration, covariance, gyr_calibration, mag_calibration


def one(name, model):
    return CalibrationCard("unit 7", "2026-11-21", "by hand", **{name: model})


def row(text, label):
    """Cells of the row with this label."""
    (line,) = [line for line in text.splitlines() if line.startswith(label)]
    return re.split(r"\s{2,}", line[len(label) :].strip())


@pytest.fixture(scope="module")
def text(card, fits):
    return certificate(card, fits).text()


class TestText:
    def test_the_head_says_what_it_is_and_what_the_intervals_are(self, text):
        assert text.splitlines()[:4] == [
            "Certificate of calibration",
            "device      unit 7",
            "date        2026-11-21",
            "made by     plumbob 0",
        ]
        assert "\n- ± and predicted errors: one standard deviation\n" in text

    def test_the_formula_has_the_terms_that_the_card_has(self, card, text):
        assert (
            "model calibrated = matrix · (measured − bias − temperature terms − g-sensitivity · specific force), "
            "turned into the axes of the body - ±"
        ) in " ".join(text.split())
        plain = certificate(one("mag", mag_calibration()), {}).text()
        assert "\nmodel       calibrated = matrix · (measured − bias)\n" in plain

    def test_remarks_on_the_mounting_stand_with_it(self, card):
        told = replace(card, mount=replace(card.mount, remarks=("nothing shows the heading.",)))
        assert certificate(told, {}).text().endswith("\n- nothing shows the heading.")
        assert numbers(told, {})["remarks"]["mount"] == ["nothing shows the heading."]

    def test_biases_are_in_the_units_of_data_sheets(self, text):
        assert row(text, "bias [°/s]") == ["1.5000 ± 0.0030", "-0.2500 ± 0.0030", "0.0100 ± 0.0030"]
        assert row(text, "bias [µT]") == ["12.34 ± 0.12", "-5.60 ± 0.12", "30.00 ± 0.12"]

    def test_an_accelerometer_is_told_in_mg_and_in_si(self):
        """30 mg are 0.2942 m/s², and 1.2 mg are 0.011768 m/s²."""
        text = certificate(one("acc", acc_calibration(covariance=covariance(to_si(1.2, "mg"), 0.0))), {}).text()
        assert row(text, "bias [mg]") == ["30.0 ± 1.2", "0.0 ± 1.2", "-12.0 ± 1.2"]
        assert row(text, "bias [m/s²]") == ["0.294 ± 0.012", "0.000 ± 0.012", "-0.118 ± 0.012"]

    def test_a_matrix_that_was_not_fitted_is_not_shown_as_a_result(self):
        for covered in (None, covariance(to_si(1.2, "mg"), 0.0)):
            card = one("acc", acc_calibration(covariance=covered, residual_rms=1e-17))
            text = certificate(card, {}).text()
            assert row(text, "matrix, scale, axes") == ["not found"] * 3
            assert not re.search("row x|scale error|axis misalignment|non-orthogonality|residual", text)
            found = numbers(card, {})["figures"]["acc"]
            assert [found[name] for name in ("matrix_sd", "scale", "scale_sd", "misalignment")] == [None] * 4
        fitted = certificate(one("acc", acc_calibration(covariance=covariance(to_si(1.2, "mg"), 1e-4))), {}).text()
        assert row(fitted, "matrix, row x") == ["1.00000 ± 0.00010", "0.00000 ± 0.00010", "0.00000 ± 0.00010"]

    def test_axes_are_told_in_percent_or_ppm(self, text):
        assert row(text, "scale error [%]") == ["2.00 ± 0.21", "0.00 ± 0.20", "0.00 ± 0.20"]
        assert row(text, "scale error [ppm]") == ["-400 ± 40", "0 ± 40", "400 ± 40"]
        assert re.search(r"non-orthogonality \[°\] +xy -1.00 +xz 0 +yz 0\n", text)

    def test_temperature_and_force_terms_have_their_rows(self, text):
        assert row(text, "bias per K [°/s/K]") == ["0.03000 ± 0.00050", "0.00000 ± 0.00050", "-0.02000 ± 0.00050"]
        assert row(text, "bias per K² [°/s/K²]")[0] == "0.00100 ± 0.00050"
        assert row(text, "g-sensitivity, row y [°/s/g]") == ["0.0000 ± 0.0060", "0.1000 ± 0.0060", "0.0000 ± 0.0060"]
        assert "calibrated from 10.0 to 45.0 °C; beyond, the bias" in text

    def test_terms_that_a_triad_has_not_have_none(self):
        text = certificate(one("mag", mag_calibration()), {}).text()
        assert "per K" not in text
        assert "g-sensitivity" not in text
        assert "temperature" not in text

    def test_a_polynomial_of_high_order_keeps_all_its_rows(self):
        text = certificate(
            one("gyr", gyr_calibration(bias_per_k=np.full((11, 3), 1e-9), bias_per_k_sd=None)), {}
        ).text()
        assert text.count("bias per K") == 11
        assert "bias per K¹¹ [°/s/K¹¹]" in text

    def test_quality_is_told(self, text):
        flat = " ".join(text.split())
        assert "Gyroscope: GOOD" in text
        assert "Magnetometer: FAIR" in text
        assert "300 data points, 3 outliers set aside, 17 of 18 directions, condition number 46" in flat
        assert "predicted heading error (tilt ≤ 45°): 0.31°" in flat
        assert "predicted scale error: 40 ppm" in flat
        assert "reference field of 48.2 µT" in flat
        assert "- the dip is 62.1° ± 0.3°." in text

    def test_the_mounting_is_told_as_angles(self, text):
        assert "turned      yaw 90.000°, pitch 2.000°, roll -1.000°" in text
        assert "±           x 0.10°, y 0.10°, z 0.50°, about the body's axes" in text

    def test_triads_that_the_card_lacks_are_named(self, text):
        assert "NOT in this card, which leaves them uncalibrated: accelerometer" in text
        whole = certificate(one("acc", acc_calibration()), {}).text()
        assert "which leaves them uncalibrated: gyroscope, magnetometer" in whole

    def test_a_card_alone_is_enough(self, card):
        text = certificate(card, {}).text()
        assert row(text, "bias [µT]") == ["12.34 ± 0.12", "-5.60 ± 0.12", "30.00 ± 0.12"]
        assert "residual    0.250 µT rms\n" in text
        assert "- the dip is 62.1° ± 0.3°." in text

    def test_a_bare_card_is_enough(self):
        bare = replace(mag_calibration(), covariance=None, quality=None, residual_rms=None, reference=None, method="")
        text = certificate(one("mag", bare), {}).text()
        assert "Magnetometer: NOT GRADED" in text
        assert row(text, "bias [µT]") == ["12.34", "-5.6", "30"]
        assert not re.search(r"nan|None|residual|predicted   |data   ", text)


class TestSizes:
    """Four samples on a sphere of 50 µT about a bias of 10 µT along x, one of them an outlier."""

    BIAS = np.array([10.0, 0.0, 0.0])
    MEASURED = np.array([[60.0, 0, 0], [-40.0, 0, 0], [10.0, 50, 0], [10.0, 0, 500]])

    def fit(self, **changes):
        model = mag_calibration(matrix=np.eye(3), bias=self.BIAS, **changes)
        return Fitted(model, self.MEASURED, np.array([0.0, 0, 0, 450]), np.array([True, True, True, False]))

    def figures(self, fit):
        return numbers(one("mag", fit.calibration), {"mag": fit})["figures"]["mag"]

    def test_before_and_after(self):
        found = self.figures(self.fit(reference=50.0))
        miss = np.array([60.0, 40.0, np.hypot(10.0, 50.0)]) - 50.0
        assert found["size_rms_before"] == pytest.approx(np.sqrt(np.mean(miss**2)), rel=1e-15)
        assert found["size_rms_after"] == 0.0
        assert found["size_expected"] == 50.0

    def test_without_a_reference_the_mean_after_is_what_is_expected(self):
        found = self.figures(self.fit(reference=None))
        assert (found["size_expected"], found["size_rms_after"]) == (50.0, 0.0)

    def test_as_text(self):
        fit = self.fit(reference=50.0)
        text = " ".join(certificate(one("mag", fit.calibration), {"mag": fit}).text().split())
        assert (
            "magnitude error 8.18 µT rms before calibration, 0 µT after" in text
        )  # √((100 + 100 + 0.9805)/3) = 8.18496

    def test_a_gyroscope_has_no_size(self, card, fits):
        found = numbers(card, fits)["figures"]["gyr"]
        assert found["size_expected"] is None
        assert found["size_rms_before"] is None


def test_json_holds_the_card_and_figures(card, fits):
    told = json.loads(json.dumps(numbers(card, fits), allow_nan=False))
    assert told["card"] == json.loads(card.text())
    assert told["refused"] == []
    assert told["remarks"] == {"mag": ["the dip is 62.1° ± 0.3°."], "gyr": [], "mount": []}
    assert told["units"] == {"gyr": "rad/s", "acc": "m/s2", "mag": "uT", "angles": "rad"}
    assert list(told["figures"]) == ["gyr", "mag", "mount"]
    assert told["figures"]["mag"]["scale"] == pytest.approx([0.02, 0.0, 0.0], abs=1e-14)
    assert told["figures"]["mag"]["bias_sd"] == pytest.approx([0.12] * 3, rel=1e-15)
    assert told["figures"]["mount"]["yaw_pitch_roll"] == pytest.approx(np.radians([90.0, 2.0, -1.0]), abs=1e-15)
    assert numbers(card, {})["figures"]["mag"]["size_rms_after"] is None


class TestRefusals:
    REFUSED = CaptureRefusedError(
        Reason("cone", "the field stays within 12° of a cone about z.", "Turn the unit about its other two axes too."),
        Reason("outliers", "12 % of 240 samples do not fit.", "Go outside."),
    )

    def test_the_first_reason_leads_and_each_has_its_advice(self):
        assert refusal_text(self.REFUSED).splitlines() == [
            "REFUSED, cone; no card is made",
            "- cone: the field stays within 12° of a cone about z.",
            "  Turn the unit about its other two axes too.",
            "- outliers: 12 % of 240 samples do not fit.",
            "  Go outside.",
        ]

    def test_json(self, card):
        told = refusal_numbers(self.REFUSED)
        assert [r["kind"] for r in told["refused"]] == ["cone", "outliers"]
        assert told["card"] is None
        assert set(told) == set(numbers(card, {}))
