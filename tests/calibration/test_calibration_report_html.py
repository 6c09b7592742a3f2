"""The page of a calibration and its pictures."""

import re
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from plumbob.calibration import report
from plumbob.calibration.predicted import NAMES, REGIONS
from plumbob.calibration.report import certificate
from plumbob.core.units import from_si
from plumbob.data.cards import CalibrationCard, Mount
from plumbob.reporting.drawing import svg
from tests.helpers.certificate_samples import acc_calibration, gyr_fit, mag_calibration, mag_fit
from tests.helpers.page_battery import HOSTILE, Outline, PageBattery


@pytest.fixture(scope="module")
def text(card):
    """A page in which every text that a user can give is hostile."""
    hostile = {"method": HOSTILE, "remarks": (HOSTILE,)}
    marked = {name: replace(getattr(card, name), **hostile) for name in ("gyr", "mag")}
    told = CalibrationCard(HOSTILE, "2026-11-21", HOSTILE, acc=acc_calibration(method=HOSTILE), software=HOSTILE,
                           mount=Mount([1.0, 0.0, 0.0, 0.0], **hostile), **marked)  # fmt: skip
    fits = {"mag": mag_fit(marked["mag"], remarks=(HOSTILE,)), "gyr": gyr_fit(marked["gyr"], remarks=(HOSTILE,))}
    return certificate(told, fits, recording=HOSTILE).page()


class TestPage(PageBattery):
    pass


def test_it_says_what_the_text_says(card, fits):
    told = certificate(card, fits).page()
    expected = ["12.34 ± 0.12", "−400 ± 40", "Gyroscope: GOOD", "Magnetometer: FAIR", "the dip is 62.1° ± 0.3°."]
    expected += ["which leaves them uncalibrated: accelerometer", "yaw 90.000°, pitch 2.000°, roll -1.000°", "unit 7"]
    expected += ["temperature terms − g-sensitivity · specific force), turned into the axes of the body"]
    for part in expected:
        assert part in told
    assert "Directions covered: 17 / 18" in told
    assert "<dt>not covered</dt><dd>+x−z</dd>" in told


def test_a_gyroscope_has_no_map_of_directions(card, fits):
    assert certificate(card, fits).page().count("<svg") == 2 + 3
    assert "Directions" not in certificate(card, {"gyr": fits["gyr"]}).page()


def test_a_card_alone_has_a_page_without_figures(tmp_path, card):
    path = certificate(card, {}, recording="a.mcap").write_html(tmp_path / "card.html")
    told = path.read_text(encoding="utf-8")
    Outline(told)
    assert "<svg" not in told
    assert "a.mcap" in told
    assert "the dip is 62.1° ± 0.3°." in told


def test_the_same_calibration_gives_the_same_bytes(card, fits):
    assert certificate(card, fits).page() == certificate(card, fits).page()


def test_a_million_samples_make_a_small_page(card):
    many = mag_fit(card.mag, count=200_000)
    assert len(certificate(card, {"mag": many}).page()) < 800_000


def some_of(fit, keep):
    return replace(fit, measured=fit.measured[:keep], residuals=fit.residuals[:keep], used=fit.used[:keep])


@pytest.mark.parametrize("keep", [1, 2, 9])
def test_few_samples_have_a_page_that_counts_their_regions(card, keep):
    """A region is the nearest of 18 directions."""
    some = some_of(mag_fit(card.mag), keep)
    nearest = {int(np.argmax(REGIONS @ (vector - card.mag.bias))) for vector in some.measured}
    told = certificate(card, {"mag": some}).page()
    Outline(told)
    assert f"Directions covered: {len(nearest)} / 18" in told
    missing = re.search(r"<dt>not covered</dt><dd>([^<]*)<", told)[1]
    assert all(
        (name in missing) is (i not in nearest) for i, name in enumerate(NAMES) if "z" in name and len(name) == 4
    )


class TestPictures:
    @pytest.fixture
    def axes(self):
        def of(picture):
            drawn = Figure()
            picture.draw(drawn)
            return drawn.axes

        return of

    def test_the_map_keeps_areas_and_has_the_equator_on_its_rim(self):
        """Lambert's map: a cap of half angle θ has the area 2π(1 − cos θ), and here the radius √(1 − cos θ)."""
        theta = np.radians([0.0, 30.0, 60.0, 90.0])
        directions = np.stack([np.sin(theta), np.zeros(4), np.cos(theta)], axis=1)
        radii = np.linalg.norm(report._mapped(directions, 1.0), axis=1)
        assert radii**2 == pytest.approx(1.0 - np.cos(theta), abs=1e-15)
        assert radii[-1] == pytest.approx(1.0, abs=1e-15)

    @pytest.mark.parametrize("side", [1.0, -1.0])
    def test_the_map_goes_back(self, side):
        half = REGIONS[side * REGIONS[:, 2] >= 0.0]
        x, y = report._mapped(half, side).T
        assert report._unmapped(x, y, side) == pytest.approx(half, abs=4e-16 * 4)

    def test_each_hemisphere_names_its_own_regions(self, axes, fits):
        up, down = axes(report.coverage_figure(fits["mag"]))
        named = [{text.get_text() for text in ax.texts} for ax in (up, down)]
        assert named[0] | named[1] == set(NAMES)
        assert named[0] & named[1] == {name for name in NAMES if "z" not in name}
        assert "+z" in named[0]

    def test_a_region_without_a_sample_is_drawn_as_missing(self, axes, fits):
        _, seen = report._coverage(fits["mag"])
        assert [NAMES[i] for i in np.flatnonzero(~seen)] == ["+x−z"]
        _, down = axes(report.coverage_figure(fits["mag"]))
        fills = [c.get_facecolor()[0] for c in down.collections if len(c.get_facecolor())]
        missing = [colour for colour in fills if colour[3] == pytest.approx(0.12)]
        assert len(missing) == 1
        assert len(fills) == 9 + 4  # 1 pole, 4 edges below, and 4 faces and 4 edges on the rim

    def test_samples_are_in_their_own_hemisphere(self, axes, fits):
        directions, _ = report._coverage(fits["mag"])
        up, down = axes(report.coverage_figure(fits["mag"]))
        counts = [ax.get_lines()[0].get_xdata().size for ax in (up, down)]
        assert counts == [np.sum(directions[:, 2] >= 0.0), np.sum(directions[:, 2] < 0.0)]

    def test_residuals_of_one_sign_have_room(self, axes, fits):
        below = replace(fits["mag"], residuals=-np.abs(fits["mag"].residuals))
        (ax,) = axes(report.residual_figure("mag", below))
        low, high = ax.get_ylim()
        assert low == -high < 0.999 * from_si(below.residuals[below.used].min(), "µT")

    @pytest.mark.parametrize("keep", [1, 2])
    def test_few_samples_are_drawn_as_dots_each_in_its_place(self, axes, fits, keep):
        some = some_of(fits["mag"], keep)
        up, down = axes(report.coverage_figure(some))
        assert sum(ax.get_lines()[0].get_xdata().size for ax in (up, down)) == keep
        (ax,) = axes(report.residual_figure("mag", some))
        (line,) = [line for line in ax.get_lines() if line.get_marker() == "."]
        assert line.get_xdata() == pytest.approx(np.arange(1.0, keep + 1.0))
        assert line.get_ydata() == pytest.approx(some.residuals)
        assert (ax.get_ylabel(), ax.get_xlabel()) == ("residual [µT]", "sample")

    def test_outliers_stand_on_the_edge_and_the_rest_in_its_scale(self, axes, fits):
        fit = fits["mag"]
        (ax,) = axes(report.residual_figure("mag", fit))
        largest = np.abs(fit.residuals[fit.used]).max()
        assert ax.get_ylim() == pytest.approx((-1.5 * largest, 1.5 * largest))
        (marks,) = [line for line in ax.get_lines() if line.get_marker() == "x"]
        at, shown = marks.get_xdata(), marks.get_ydata()
        assert at[np.isfinite(shown)].tolist() == [11.0, 101.0, 201.0]
        assert np.abs(shown[np.isfinite(shown)]) == pytest.approx(1.5 * largest)

    def test_residuals_of_three_axes_are_in_degrees_per_second(self, axes, fits):
        (ax,) = axes(report.residual_figure("gyr", fits["gyr"]))
        assert ax.get_ylabel() == "residual [°/s]"
        lines = [line for line in ax.get_lines() if line.get_marker() == "."]
        assert np.stack([line.get_ydata() for line in lines], axis=1) == pytest.approx(
            np.degrees(fits["gyr"].residuals)
        )
        assert [name for name, *_ in report.residual_figure("gyr", fits["gyr"]).key] == ["x", "y", "z"]


def test_the_bias_leaves_its_value_over_temperature_as_the_card_says(fits):
    """0.03 °/s/K and 0.001 °/s/K² about 25 °C: at 45 °C, x has left its bias by 0.03 · 20 + 0.001 · 400 = 1 °/s."""
    drawn = Figure()
    report.temperature_figure("gyr", fits["gyr"].calibration).draw(drawn)
    x, *_ = drawn.axes[0].get_lines()
    assert (x.get_xdata()[-1], x.get_ydata()[-1]) == pytest.approx((45.0, 1.0))
    assert drawn.axes[0].get_ylabel() == "change of bias [°/s]"


def test_labels_of_a_picture_keep_their_digits(card, fits):
    small = replace(fits["mag"], residuals=fits["mag"].residuals * 0.01)
    labels = re.findall(r">(?:−|-)?(0\.\d+)</text>", svg(report.residual_figure("mag", small), salt="x"))
    assert max(len(label) for label in labels) > len("0.00")


def test_without_figures_no_plots_are_needed(card, monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert "12.34" in certificate(card, {}).page()


def test_the_reference_is_shown_in_the_unit_of_the_triad(card):
    told = certificate(replace(card, mag=mag_calibration(reference=None)), {}).page()
    assert "field of" not in told
