"""What the pictures draw, and where: read from matplotlib's own objects, in the unit of the axis."""

import math

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from plumbob.core.units import from_si
from plumbob.noise import report
from plumbob.noise.report import lowest
from plumbob.noise.terms import variance


@pytest.fixture
def axes():
    """Axes on which a figure of the page was drawn."""

    def of(picture, what):
        drawn = Figure()
        picture(what).draw(drawn)
        return drawn.axes[0]

    return of


def lines(ax, marker):
    return [line for line in ax.get_lines() if line.get_marker() == marker]


def test_the_coefficients_are_read_at_their_places(axes, analyses):
    a = analyses[1]
    dots = [(line.get_xdata()[0], line.get_ydata()[0]) for line in lines(axes(report.channel_figure, a), "o")]
    n, b, k = (from_si(a.terms[letter].value, "deg/h") for letter in "NBK")
    # N at 1 s, B at the least deviation as 0.664 of it, K at 3 s, in °/h
    assert dots == [(1.0, pytest.approx(n)), (lowest(a).tau, pytest.approx(math.sqrt(2 * math.log(2) / math.pi) * b)),
                    (3.0, pytest.approx(k))]  # fmt: skip


def test_curve_model_and_terms_are_in_the_unit_of_the_axis(axes, analyses):
    a = analyses[4]
    ax = axes(report.channel_figure, a)
    assert ax.get_ylabel() == "Allan deviation [µg]"
    (curve, pale), (model, *terms) = lines(ax, ""), lines(ax, "None")
    assert np.allclose(curve.get_ydata(), from_si(a.curve.dev[: len(curve.get_xdata())], "ug"))
    assert curve.get_xdata()[-1] == pytest.approx(pale.get_xdata()[0])
    assert pale.get_xdata()[-1] == pytest.approx(a.curve.tau[-1])
    assert np.allclose(model.get_ydata(), from_si(a.model(model.get_xdata()), "ug"))
    assert [line.get_linestyle() for line in terms] == ["--"] * 3
    slopes = [np.diff(np.log(line.get_ydata()))[0] / np.diff(np.log(line.get_xdata()))[0] for line in terms]
    assert slopes == pytest.approx([-0.5, 0.0, 0.5], abs=1e-9)  # of N, B and K
    low, high = ax.get_ylim()
    assert low < curve.get_ydata().min()
    assert curve.get_ydata().max() < high


def test_the_mask_ends_where_it_ends(axes, analyses):
    ax = axes(report.channel_figure, analyses[0])
    spans = [p for p in ax.patches if p.get_facecolor()[:3] == pytest.approx((0xE9 / 255, 0xED / 255, 0xF1 / 255))]
    (mask,) = spans
    assert mask.get_extents().transformed(ax.transData.inverted()).x1 == pytest.approx(8 * 0.01)


def test_each_axis_has_its_colour(axes, analyses):
    from plumbob.noise.report import triads

    (gyr, _) = triads(analyses)
    ax = axes(report.triad_figure, gyr)
    first = [line for line in ax.get_lines() if line.get_alpha() == 1.0]
    assert [line.get_color() for line in first] == [colour for _, colour, _ in report.triad_figure(gyr).key[:3]]
    models = [line for line in ax.get_lines() if line.get_color() == report.MODEL]
    assert len(models) == 3
    masks = [a.mask.n * a.curve.dt for a in gyr.channels.values()]
    shade = [patch for patch in ax.patches if isinstance(patch, Rectangle)]
    assert [patch.get_x() + patch.get_width() for patch in shade] == [pytest.approx(max(masks))]
    for line, a in zip(first, gyr.channels.values(), strict=True):
        assert line.get_ydata()[0] == pytest.approx(from_si(a.curve.dev[0], "deg/h"))


def test_letters_stand_beside_their_own_lines_with_their_slopes(axes, analyses):
    """N falls and has its letter on the right; K rises and has it on the left; both are inside the picture."""
    ax = axes(report.channel_figure, analyses[1])
    placed = {text.get_text(): text for text in ax.texts if "=" not in text.get_text()}
    assert {name: text.get_ha() for name, text in placed.items()} == {"N −½": "left", "B 0": "left", "K +½": "right"}
    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    for name, text in placed.items():
        tau, dev = text.xy
        letter = name[0]
        assert dev == pytest.approx(from_si(math.sqrt(variance(letter, analyses[1].terms[letter].value, tau)), "deg/h"))
        assert left < tau < right
        assert low < dev < high
        assert (text.get_position()[0] > 0.0) == (text.get_ha() == "left")


def test_each_dot_has_its_value_with_the_unit_of_a_data_sheet(axes, analyses):
    """The fixture plants 0.3 °/√h, 12 °/h and 20 °/h/√h, for y 1.1 times as much."""
    ax = axes(report.channel_figure, analyses[1])
    values = {text.get_text(): text.xy for text in ax.texts if "=" in text.get_text()}
    assert list(values) == ["N = 0.330 °/√h", "B = 13.2 °/h", "K = 22.0 °/h/√h"]
    dots = [(line.get_xdata()[0], line.get_ydata()[0]) for line in lines(ax, "o")]
    assert list(values.values()) == dots
