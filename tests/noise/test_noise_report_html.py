"""The page and the pictures."""

import re
import sys
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from plumbob.core.constants import G0
from plumbob.core.errors import MissingExtraError, ShapeError
from plumbob.noise import report
from plumbob.noise.curve import Curve
from plumbob.noise.fin import fin_report
from plumbob.noise.findings import Candidate, Coefficient, Estimates, Mask
from plumbob.noise.report import coefficient, datasheet
from plumbob.noise.terms import DATASHEET
from plumbob.reporting import drawing
from tests.helpers.page_battery import HOSTILE, Outline, PageBattery


def channel_figure(analysis):
    return drawing.svg(report.channel_figure(analysis), salt="x")


@pytest.fixture(scope="module")
def text(analyses, bare):
    hostile = replace(
        bare, name=HOSTILE, notes=(HOSTILE,), mask=Mask(2, 1.0, HOSTILE), candidates=(Candidate(HOSTILE, 1.0, True),),
        lines=Estimates(HOSTILE, {}),
    )  # fmt: skip
    made = datasheet([*analyses, hostile], facts=[("device", HOSTILE), (HOSTILE, "x")])
    return replace(made, parts=[*made.parts, fin_report(analyses)]).page()


class TestPage(PageBattery):
    pass


def test_the_coefficients_of_a_sensor_come_before_its_figures(analyses, text):
    first = "".join(part.partition("<svg")[0] for part in text.split("<h2>"))
    for a in analyses:
        for letter, c in a.terms.items():
            cell = coefficient(c, DATASHEET[a.quantity][letter])
            assert cell.replace("-", "−").replace("<", "&lt;") in first
    assert "N white noise [°/√h]" in first
    assert "K random walk [µg/s/√Hz]" in first


def test_the_page_says_what_its_columns_are(text):
    assert "IEEE Std 952 [%]" in text
    assert text.count("averaging time [s]</text>") == 2 + 7  # a figure for each triad and each channel
    assert text.count("Allan deviation [°/h]</text>") == 4
    assert text.count("<summary>oadev") == 7
    assert "Table 1 of Ou et al. 2017" in text


def test_the_same_analyses_give_the_same_bytes(plain):
    assert datasheet(plain).page() == datasheet(plain).page()


def test_the_terms_that_are_shown_are_named_in_the_figure(plain):
    drawing = channel_figure(plain[0])
    assert re.findall(r">([QNBKR] [^=<]*)</text>", drawing) == ["N −½", "B 0", "K +½"]
    hidden = {k: replace(c, observable=False) for k, c in plain[0].terms.items()}
    drawing = channel_figure(replace(plain[0], likelihood=Estimates("likelihood", hidden)))
    assert not re.search(r">[QNBKR] [^=<]*</text>", drawing)


def test_what_is_masked_is_shaded_and_what_scatters_is_pale(analyses):
    masked, unmasked = (channel_figure(a) for a in analyses[:2])
    assert "var(--shade)" in masked
    assert "var(--shade)" not in unmasked
    sure = replace(analyses[1].curve, edf=np.full(analyses[1].curve.n.size, 99.0))
    assert "opacity: 0.35" in unmasked
    assert "opacity: 0.35" not in channel_figure(replace(analyses[1], curve=sure))


def test_a_curve_of_every_averaging_factor_makes_a_small_page_and_keeps_its_spikes(tmp_path, plain):
    n = np.arange(1, 500_001)
    dev = 1e-3 / np.sqrt(n)
    dev[123_456] *= 40.0
    edf = 1e6 / n
    long = Curve("oadev", 0.01, 1_000_000, n, dev, 0.0 * dev, edf, dev * 0.9, dev * 1.1)
    a = replace(plain[0], curve=long)
    path = datasheet([a]).write_html(tmp_path / "page.html")
    assert 10_000 < path.stat().st_size < 300_000
    listed = re.search(r"(\d+) of 500000 averaging times", path.read_text(encoding="utf-8"))
    assert 30 < int(listed[1]) <= 40
    smooth = replace(long, dev=1e-3 / np.sqrt(n))
    assert channel_figure(a) != channel_figure(replace(a, curve=smooth))


def cells_of(told):
    """Rows of the curve's table as numbers: averaging time, deviation and its interval, degrees of freedom."""
    curve = told.split("<summary>oadev")[1]
    rows = re.findall(r"<tr><th scope='row'>(.+?)</th>" + "<td>(.+?)</td>" * 4, curve)
    return np.array(rows, dtype=float).T


def test_odd_curves_have_a_page_with_their_numbers(plain):
    few = plain[0].curve
    for keep in (slice(0, 1), slice(0, 2), slice(-1, None)):
        short = Curve(
            few.kind, few.dt, few.count, *(getattr(few, f)[keep] for f in ("n", "dev", "alpha", "edf", "lo", "hi"))
        )
        per_hour = np.degrees(1.0) * 3600.0  # a value inside is in rad/s
        wanted = (short.tau, *(per_hour * v for v in (short.dev, short.lo, short.hi)), short.edf)
        known = [np.isfinite(v).all() for v in wanted]
        nothing = Estimates("likelihood", {k: Coefficient(0.0, observable=False) for k in "QNBKR"})
        for changes in ({}, {"mask": Mask(10**9)}, {"likelihood": nothing}):
            told = datasheet([replace(plain[0], curve=short, **changes)]).page()
            Outline(told)
            for found, exact in zip(cells_of(told), np.array(wanted)[known], strict=True):
                assert found == pytest.approx(exact, rel=5e-3)  # three digits, four of deviations


@pytest.fixture
def drawn(monkeypatch):
    """Figures that pictures are made of, in the order in which they are drawn."""
    made, finish = [], drawing._finish

    def record(canvas, lang):
        finish(canvas, lang)
        made.append(canvas)

    monkeypatch.setattr(drawing, "_finish", record)
    return made


def test_pictures_show_the_curves_that_were_asked_for(tmp_path, analyses, bare, drawn):
    """A panel for each triad, 3.75 inches of 200 dots high, with three curves; or one channel with its model."""
    from matplotlib.image import imread

    hostile = replace(bare, name=HOSTILE)
    keys = ["x", "y", "z", "models", "masked on an axis"]
    asked = {
        "all": (analyses, ["Allan deviation [°/h]", "Allan deviation [µg]"], keys),
        "one": (analyses[:1], ["Allan deviation [°/h]"], None),
        "hostile": ([hostile], ["Allan deviation [1]"], None),
    }
    for name, (of, labels, keys) in asked.items():
        pixels = imread(datasheet(of).plot(tmp_path / f"{name}.png"))
        panels = drawn[-len(labels) :]
        assert pixels.shape[:2] == (750 * len(labels), 1500)
        assert [panel.axes[0].get_ylabel() for panel in panels] == labels
        texts = [[text.get_text() for text in panel.legends[0].get_texts()] for panel in panels]
        assert keys is None or texts == [keys] * len(panels)
        for panel, a in zip(panels, of[:: 3 if keys else 1], strict=True):
            line = panel.axes[0].get_lines()[0]
            unit = {"rad/s": np.degrees(1.0) * 3600.0, "m/s2": 1e6 / G0, "1": 1.0}[a.quantity.value]
            assert line.get_ydata() == pytest.approx(unit * a.curve.dev[: line.get_ydata().size])
            assert line.get_xdata() == pytest.approx(a.curve.tau[: line.get_xdata().size])
            colour = np.array(to_rgb(line.get_color()))
            assert (np.abs(pixels[..., :3] - colour).max(axis=2) < 0.01).sum() > 500  # it is in the picture, too
    assert drawn[-1].get_suptitle() == f"{HOSTILE}: Allan deviation, model and terms"


def test_without_matplotlib_the_extra_is_named(tmp_path, plain, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingExtraError, match=r'pip install "plumbob\[plot\]"'):
        datasheet(plain).page()
    with pytest.raises(MissingExtraError, match=r'pip install "plumbob\[plot\]"'):
        datasheet(plain).plot(tmp_path / "x.png")


def test_a_page_about_nothing_is_refused():
    with pytest.raises(ShapeError, match="at least one analysis"):
        datasheet([])


def test_labels_of_rows_break_between_words_only(text):
    rules = re.findall(r"th\[scope=row\][^{]*{[^}]*overflow-wrap: ([a-z-]+)", text)
    assert rules[-1] == "break-word"  # the last rule counts; anywhere would break a label into letters
