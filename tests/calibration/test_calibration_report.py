"""Certificates: sensing axes of planted cards, what is said as text, JSON and page, what is drawn, and refusals."""

import json
import re
import sys
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from plumbob.calibration import fit as fitting
from plumbob.calibration.fit import CaptureRefusedError, Fitted, Reason
from plumbob.calibration.predicted import NAMES, REGIONS, filled, region_index
from plumbob.core.units import deg, dps, from_si, g, to_si
from plumbob.data.cards import CalibrationCard, Mount, Quality, TriadCalibration
from plumbob.reporting import calibration as report
from plumbob.reporting.drawing import svg
from plumbob.rotations import quat_from_euler_zyx
from tests.helpers.page_battery import HOSTILE, Outline, PageBattery


def covariance(bias_sd, matrix_sd):
    return np.diag(np.r_[np.full(3, bias_sd), np.full(9, matrix_sd)] ** 2)


def mag_calibration(**changes):
    """Hard iron of 12.34, −5.6, 30 µT; the x axis reads 2 % too much, y points 1° towards x."""
    response = np.array([[1.02, 0.0, 0.0], [np.sin(deg(1.0)), np.cos(deg(1.0)), 0.0], [0.0, 0.0, 1.0]])
    given = {
        "matrix": np.linalg.inv(response), "bias": [12.34, -5.6, 30.0], "unit_in": "uT", "unit_out": "uT",
        "covariance": covariance(0.12, 0.002), "residual_rms": 0.25, "reference": 48.2, "method": "ellipsoid",
        "date": "2026-11-20",
        "quality": Quality(grade="fair", samples=300, outliers=3, regions=17, condition=45.6, heading_sd=deg(0.31),
                           tilt_range=deg(45.0)),
    }  # fmt: skip
    return TriadCalibration(**given | changes)


def gyr_calibration(**changes):
    given = {
        "matrix": np.diag([1.0004, 1.0, 0.9996]), "bias": dps(np.array([1.5, -0.25, 0.01])), "unit_in": "rad/s",
        "unit_out": "rad/s", "covariance": covariance(dps(0.003), 4e-5), "bias_per_k": dps(np.array([[0.03, 0, -0.02],
        [1e-3, 0, 0]])), "bias_per_k_sd": dps(np.full((2, 3), 5e-4)), "temp_span_c": (10.0, 45.0),
        "g_sensitivity": dps(0.1) / g(1.0) * np.eye(3), "g_sensitivity_sd": dps(0.006) / g(1.0) * np.ones((3, 3)),
        "residual_rms": dps(0.02), "method": "rate table",
        "quality": Quality(grade="good", samples=42, scale_sd=4e-5),
    }  # fmt: skip
    return TriadCalibration(**given | changes)


def acc_calibration(**changes):
    given = {"matrix": np.eye(3), "bias": to_si(np.array([30.0, 0, -12]), "mg"), "unit_in": "m/s2", "unit_out": "m/s2"}
    return TriadCalibration(**given | changes)


def mag_fit(model, *, count=300, missing="+x−z", remarks=()):
    """Samples of a field of 48.2 µT in every region but one, with noise of 0.25 µT and three planted outliers."""
    rng = np.random.default_rng(7)
    directions = rng.normal(size=(2 * count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    truth = 48.2 * directions
    measured = truth @ np.linalg.inv(model.matrix).T + model.bias + 0.25 * rng.normal(size=truth.shape)
    keep = region_index(measured - model.bias) != NAMES.index(missing)
    measured = measured[keep][:count]
    used = np.ones(len(measured), dtype=bool)
    used[[10, 100, 200]] = False
    measured[~used] += 20.0
    residuals = np.linalg.norm((measured - model.bias) @ model.matrix.T, axis=1) - 48.2
    return Fitted(model, measured, residuals, used, remarks)


def gyr_fit(model, *, remarks=()):
    rates = dps(50.0) * np.repeat(REGIONS, 2, axis=0)
    residuals = dps(0.02) * np.random.default_rng(3).normal(size=rates.shape)
    return Fitted(model, rates, residuals, np.ones(len(rates), dtype=bool), remarks)


EPS = np.finfo(float).eps
DIP = "the dip is 62.1° ± 0.3°."
MOUNT = Mount(quat_from_euler_zyx(deg(np.array([90.0, 2.0, -1.0]))), sd=deg(np.array([0.1, 0.1, 0.5])), method="hung")
CARD = CalibrationCard(
    "unit 7", "2026-11-21", "ellipsoid; rate table; hung", gyr=gyr_calibration(), mag=mag_calibration(remarks=(DIP,)),
    mount=MOUNT, software="plumbob 0",
)  # fmt: skip
"""Everything but the accelerometer."""
FITS = {"mag": mag_fit(CARD.mag, remarks=(DIP,)), "gyr": gyr_fit(CARD.gyr)}


def alone(name, model):
    return CalibrationCard("unit 7", "2026-11-21", "by hand", **{name: model})


def text_of(card, fits=()):
    return report.calibrated(card, dict(fits)).text()


def rows(text, label):
    """Cells of the rows whose label begins so."""
    lines = [line for line in text.splitlines() if line.startswith(label)]
    return [re.split(r"\s{2,}", line[len(label) :].strip()) for line in lines]


def test_planted_axes_are_found_and_a_turn_is_no_skew():
    axes = fitting.sensing_axes(mag_calibration())
    assert axes.scale == pytest.approx([0.02, 0.0, 0.0], abs=8 * EPS)
    assert axes.misalignment == pytest.approx([0.0, deg(1.0), 0.0], abs=1e-12)  # √(1 − cos²) of 1° keeps 12 digits
    assert axes.skew == pytest.approx([-deg(1.0), 0.0, 0.0], abs=16 * EPS)  # y leans towards x: less than 90°
    perfect = fitting.sensing_axes(acc_calibration())
    assert not np.concatenate([perfect.scale, perfect.misalignment, perfect.skew]).any() and perfect.scale_sd is None
    # A turn by 2° about z moves x and y, keeps z and all angles between axes
    c, s = np.cos(deg(2.0)), np.sin(deg(2.0))
    axes = fitting.sensing_axes(acc_calibration(matrix=[[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]))
    assert axes.misalignment == pytest.approx([deg(2.0), deg(2.0), 0.0], abs=1e-12)
    assert np.array_equal((axes.scale, axes.skew), np.zeros((2, 3)))


def test_standard_deviations_of_the_gains_follow_the_matrix():
    """To first order: the gain of axis i of (M + h e_k e_lᵀ)⁻¹ over h, by central differences.

    And of a diagonal matrix s = 1/m, sd(s) = sd(m)/m².
    """
    half = np.random.default_rng(5).normal(size=(12, 12)) * 1e-3
    model = mag_calibration(covariance=half @ half.T)
    h, slopes = 1e-6, np.zeros((3, 9))
    for k in range(9):
        step = h * np.eye(9)[k].reshape(3, 3)
        up, down = (np.linalg.norm(np.linalg.inv(model.matrix + sign * step), axis=1) for sign in (1.0, -1.0))
        slopes[:, k] = (up - down) / (2.0 * h)
    expected = np.sqrt(np.diag(slopes @ model.covariance[3:, 3:] @ slopes.T))
    # rounding eps/h and curvature h² of numbers near 1
    assert fitting.sensing_axes(model).scale_sd == pytest.approx(expected, rel=10 * EPS / h)
    axes = fitting.sensing_axes(acc_calibration(matrix=np.diag([0.5, 1.0, 2.0]), covariance=covariance(0.0, 1e-3)))
    assert axes.scale == pytest.approx([1.0, 0.0, -0.5], abs=4 * EPS)
    assert axes.scale_sd == pytest.approx([4e-3, 1e-3, 2.5e-4], rel=8 * EPS)


def test_the_text_has_the_planted_numbers_in_units_of_data_sheets():
    text = text_of(CARD, FITS)
    for label, cells in {
        "bias [°/s]": ["1.5000 ± 0.0030", "-0.2500 ± 0.0030", "0.0100 ± 0.0030"],
        "bias [µT]": ["12.34 ± 0.12", "-5.60 ± 0.12", "30.00 ± 0.12"],
        "scale error [%]": ["2.00 ± 0.21", "0.00 ± 0.20", "0.00 ± 0.20"],
        "scale error [ppm]": ["-400 ± 40", "0 ± 40", "400 ± 40"],
        "bias per K [°/s/K]": ["0.03000 ± 0.00050", "0.00000 ± 0.00050", "-0.02000 ± 0.00050"],
        "bias per K² [°/s/K²]": ["0.00100 ± 0.00050", "0.00000 ± 0.00050", "0.00000 ± 0.00050"],
        "g-sensitivity, row y [°/s/g]": ["0.0000 ± 0.0060", "0.1000 ± 0.0060", "0.0000 ± 0.0060"],
        "turned": ["yaw 90.000°, pitch 2.000°, roll -1.000°"],
    }.items():
        assert rows(text, label) == [cells]
    flat = " ".join(text.split())
    for part in (
        "matrix · (measured − bias − temperature terms − g-sensitivity · specific force), turned into the axes",
        "xy -1.00 xz 0 yz 0",
        "x 0.10°, y 0.10°, z 0.50°",
        "calibrated from 10.0 to 45.0 °C",
        "Gyroscope: GOOD",
        "Magnetometer: FAIR",
        "300 data points, 3 outliers set aside, 17 of 18 directions, condition number 46",
        "predicted heading error (tilt ≤ 45°): 0.31°",
        "predicted scale error: 40 ppm",
        "reference field of 48.2 µT",
        "residual 0.250 µT rms",
        "which leaves them uncalibrated: accelerometer",
        DIP,
    ):
        assert part in flat


def test_terms_that_a_card_has_not_are_left_out():
    plain = text_of(alone("mag", mag_calibration()))
    assert "calibrated = matrix · (measured − bias)\n" in plain
    assert not re.search("per K|g-sensitivity|temperature", plain)
    bare = replace(mag_calibration(), covariance=None, quality=None, residual_rms=None, reference=None, method="")
    text = text_of(alone("mag", bare))
    assert "Magnetometer: NOT GRADED" in text and "uncalibrated: gyroscope, accelerometer" in text
    assert rows(text, "bias [µT]") == [["12.34", "-5.6", "30"]]
    assert not re.search(r"nan|None|residual|predicted   |data   |field of", text)
    many = text_of(alone("gyr", gyr_calibration(bias_per_k=np.full((11, 3), 1e-9), bias_per_k_sd=None)))
    assert len(rows(many, "bias per K")) == 11 and "bias per K¹¹ [°/s/K¹¹]" in many
    mounted = replace(CARD, mount=replace(MOUNT, remarks=("nothing shows the heading.",)))
    assert text_of(mounted).endswith("\n- nothing shows the heading.")
    assert fitting.numbers(mounted, {})["remarks"]["mount"][0]["text"] == "nothing shows the heading."


def test_a_matrix_that_was_not_fitted_is_not_shown_as_a_result():
    """30 mg are 0.2942 m/s², and 1.2 mg are 0.011768 m/s²."""
    covered = covariance(to_si(1.2, "mg"), 0.0)
    for given in (None, covered):
        card = alone("acc", acc_calibration(covariance=given, residual_rms=1e-17))
        text = text_of(card)
        assert rows(text, "matrix, scale, axes") == [["not found"] * 3]
        assert not re.search("row x|scale error|axis misalignment|non-orthogonality|residual", text)
        figures = fitting.numbers(card, {})["figures"]["acc"]
        assert [figures[name] for name in ("matrix_sd", "scale", "scale_sd", "misalignment")] == [None] * 4
    assert rows(text, "bias [mg]") == [["30.0 ± 1.2", "0.0 ± 1.2", "-12.0 ± 1.2"]]
    assert rows(text, "bias [m/s²]") == [["0.294 ± 0.012", "0.000 ± 0.012", "-0.118 ± 0.012"]]
    fitted = text_of(alone("acc", acc_calibration(covariance=covariance(to_si(1.2, "mg"), 1e-4))))
    assert rows(fitted, "matrix, row x") == [["1.00000 ± 0.00010", "0.00000 ± 0.00010", "0.00000 ± 0.00010"]]


def test_sizes_before_and_after():
    """Four samples on a sphere of 50 µT about a bias of 10 µT along x, one of them an outlier; without a reference the
    mean after is what is expected."""
    measured = np.array([[60.0, 0, 0], [-40.0, 0, 0], [10.0, 50, 0], [10.0, 0, 500]])
    miss = np.array([60.0, 40.0, np.hypot(10.0, 50.0)]) - 50.0
    for reference in (50.0, None):
        model = mag_calibration(matrix=np.eye(3), bias=np.array([10.0, 0.0, 0.0]), reference=reference)
        fit = Fitted(model, measured, np.array([0.0, 0, 0, 450]), np.array([True, True, True, False]))
        card = alone("mag", model)
        figures = fitting.numbers(card, {"mag": fit})["figures"]["mag"]
        assert figures["size_rms_before"] == pytest.approx(np.sqrt(np.mean(miss**2)), rel=1e-15)
        assert (figures["size_expected"], figures["size_rms_after"]) == (50.0, 0.0)
        # √((100 + 100 + 0.9805)/3) = 8.18496
        assert "8.18 µT rms before calibration, 0 µT after" in " ".join(text_of(card, {"mag": fit}).split())
    figures = fitting.numbers(CARD, FITS)["figures"]["gyr"]  # a gyroscope has no size
    assert figures["size_expected"] is None and figures["size_rms_before"] is None


def test_json_holds_the_card_and_figures():
    said = json.loads(json.dumps(fitting.numbers(CARD, FITS), allow_nan=False))
    assert said["card"] == json.loads(CARD.text())
    assert said["refused"] == []
    texts = {name: [remark["text"] for remark in remarks] for name, remarks in said["remarks"].items()}
    assert texts == {"mag": [DIP], "gyr": [], "mount": []}
    assert said["units"] == {"gyr": "rad/s", "acc": "m/s2", "mag": "uT", "angles": "rad"}
    assert list(said["figures"]) == ["gyr", "mag", "mount"]
    assert said["figures"]["mag"]["scale"] == pytest.approx([0.02, 0.0, 0.0], abs=1e-14)
    assert said["figures"]["mag"]["bias_sd"] == pytest.approx([0.12] * 3, rel=1e-15)
    assert said["figures"]["mount"]["yaw_pitch_roll"] == pytest.approx(np.radians([90.0, 2.0, -1.0]), abs=1e-15)
    assert fitting.numbers(CARD, {})["figures"]["mag"]["size_rms_after"] is None


def test_refusals():
    refused = CaptureRefusedError(
        Reason("cone", "the field stays within 12° of a cone about z.", "Turn the unit about its other two axes too."),
        Reason("outliers", "12 % of 240 samples do not fit.", "Go outside."),
    )
    assert report.refusal_text(refused).splitlines() == [
        "REFUSED, cone; no card is made", "- cone: the field stays within 12° of a cone about z.",
        "  Turn the unit about its other two axes too.", "- outliers: 12 % of 240 samples do not fit.",
        "  Go outside.",
    ]  # fmt: skip
    said = refused.summary()
    assert [reason["kind"] for reason in said["refused"]] == ["cone", "outliers"]
    assert said["card"] is None and set(said) == set(fitting.numbers(CARD, {}))


@pytest.fixture(scope="module")
def text():
    """A page of many samples in which every text that a user can give is hostile."""
    hostile = {"method": HOSTILE, "remarks": (HOSTILE,)}
    marked = {name: replace(getattr(CARD, name), **hostile) for name in ("gyr", "mag")}
    mount = Mount([1.0, 0.0, 0.0, 0.0], **hostile)
    acc = acc_calibration(method=HOSTILE)
    card = CalibrationCard(HOSTILE, "2026-11-21", HOSTILE, acc=acc, software=HOSTILE, mount=mount, **marked)
    fits = {
        "mag": mag_fit(marked["mag"], count=100_000, remarks=(HOSTILE,)),
        "gyr": gyr_fit(marked["gyr"], remarks=(HOSTILE,)),
    }
    return report.calibrated(card, fits, recording=HOSTILE).page()


class TestPage(PageBattery):
    def test_it_says_what_the_text_says_and_is_small(self, text):
        """A gyroscope has no map of directions."""
        for part in ("12.34 ± 0.12", "−400 ± 40", "Gyroscope: GOOD", "<dt>not covered</dt><dd>+x−z</dd>"):
            assert part in text
        assert text.count("<svg") == 1 + 3 and "Directions covered: 17 / 18" in text and len(text) < 800_000


def test_a_card_alone_has_a_page_without_figures_and_needs_no_plots(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    page = report.calibrated(CARD, recording="a.mcap").write_html(tmp_path / "card.html").read_text(encoding="utf-8")
    Outline(page)
    assert "<svg" not in page and "a.mcap" in page and DIP in page and "12.34" in page
    assert page == report.calibrated(CARD, recording="a.mcap").page()


def axes_of(picture):
    drawn = Figure()
    picture.draw(drawn)
    return drawn.axes


def first(fit, count):
    return replace(fit, measured=fit.measured[:count], residuals=fit.residuals[:count], used=fit.used[:count])


@pytest.mark.parametrize("count", [2, 300])
def test_the_map_keeps_areas_and_each_sample_has_its_place_in_its_hemisphere(count):
    """Lambert's map: a cap of half angle θ has the area 2π(1 − cos θ), and here the radius √(1 − cos θ)."""
    fit = first(FITS["mag"], count)
    seen = (fit.measured - CARD.mag.bias)[fit.used]
    directions = seen / np.linalg.norm(seen, axis=1, keepdims=True)
    picture = report.coverage_figure(report.Coverage(directions, filled(seen) > 0))
    regions = set(region_index(seen).tolist())
    assert f"{len(regions)} / 18" in picture.caption
    for side, ax in zip((1.0, -1.0), axes_of(picture), strict=True):
        here = directions[side * directions[:, 2] >= 0.0]
        places = np.stack(ax.get_lines()[0].get_data(), axis=1)
        assert np.sum(places**2, axis=1) == pytest.approx(1.0 - np.abs(here[:, 2]), abs=1e-12)
        across = here[:, :2] / np.linalg.norm(here[:, :2], axis=1, keepdims=True)
        assert np.sum(across * places, axis=1) == pytest.approx(np.linalg.norm(places, axis=1), abs=1e-12)
        fills = [area for area in ax.collections if len(area.get_facecolor())]
        assert len(fills) == len(ax.texts) == 9 + 4  # 1 pole, 4 edges on this side, and 4 faces and 4 edges on the rim
        for label in ax.texts:
            region, place = NAMES.index(label.get_text()), np.array(label.xy)
            place *= min(1.0, 0.97 / max(1e-9, np.linalg.norm(place)))
            (fill,) = [area for area in fills if any(path.contains_point(place) for path in area.get_paths())]
            assert (fill.get_facecolor()[0][3] == pytest.approx(0.12)) == (region not in regions)


@pytest.mark.parametrize("count", [1, 2, 300])
def test_residuals_are_in_their_places_and_outliers_on_the_edge(count):
    """1.5 times the largest residual is the edge, also where all have one sign."""
    fit = first(FITS["mag"], count)
    for shown in (fit, replace(fit, residuals=-np.abs(fit.residuals))):
        (ax,) = axes_of(report.residual_figure("mag", shown))
        dots = ax.get_lines()[0]
        places = np.flatnonzero(np.isfinite(dots.get_ydata()))
        assert dots.get_xdata()[places] == pytest.approx(np.flatnonzero(shown.used) + 1.0)
        assert dots.get_ydata()[places] == pytest.approx(shown.residuals[shown.used])
        edge = 1.5 * np.abs(shown.residuals[shown.used]).max()
        assert ax.get_ylim() == pytest.approx((-edge, edge))
        for marks in [line for line in ax.get_lines() if line.get_marker() == "x"]:
            outlying = np.isfinite(marks.get_ydata())
            assert marks.get_xdata()[outlying].tolist() == [11.0, 101.0, 201.0]
            assert np.abs(marks.get_ydata()[outlying]) == pytest.approx(edge)


def test_a_gyroscope_is_drawn_in_degrees_per_second():
    """0.03 °/s/K and 0.001 °/s/K² about 25 °C: at 45 °C, x has left its bias by 0.03 · 20 + 0.001 · 400 = 1 °/s."""
    fit = FITS["gyr"]
    (ax,) = axes_of(report.residual_figure("gyr", fit))
    lines = [line.get_ydata() for line in ax.get_lines() if line.get_marker() == "."]
    assert np.stack(lines, axis=1) == pytest.approx(from_si(fit.residuals, "deg/s"))
    assert ax.get_ylabel() == "residual [°/s]"
    soak = np.column_stack((np.arange(len(fit.residuals)), np.linspace(25.0, 45.0, len(fit.residuals))))
    over_temperature, _ = report.temperature_figures("gyr", fit, soak)
    x = axes_of(over_temperature)[0].get_lines()[3]
    assert (x.get_xdata()[-1], x.get_ydata()[-1]) == pytest.approx((45.0, 1.0))
    small = replace(FITS["mag"], residuals=FITS["mag"].residuals * 0.01)
    labels = re.findall(r">(?:−|-)?(0\.\d+)</text>", svg(report.residual_figure("mag", small), salt="x"))
    assert max(len(label) for label in labels) > len("0.00")
