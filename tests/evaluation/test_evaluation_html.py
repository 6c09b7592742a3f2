"""The page: self-contained, harmless and small."""

import re
import sys

import numpy as np
import pytest

from plumbob.core import flags
from plumbob.core.errors import MissingExtraError, ShapeError
from plumbob.evaluation import comparison, evaluate
from plumbob.evaluation.report import _share
from plumbob.reporting.drawing import svg
from plumbob.rotations import North, quat_conjugate, quat_from_rotvec, quat_multiply
from tests.helpers.page_battery import HOSTILE, Outline, PageBattery


@pytest.fixture(scope="module")
def judged(track, motion):
    t = np.arange(6000) / 100.0
    error = np.random.default_rng(1).normal(0.0, 0.02, (t.size, 3))
    raised = np.where(t > 50.0, flags.MAG_GATED, 0)
    q_ref = motion(t)
    q_ref[2000:2500] = np.nan
    estimate = track(t, quat_multiply(motion(t), quat_from_rotvec(error)), source=HOSTILE, flags=raised)
    return evaluate(estimate, track(t, q_ref, source=HOSTILE), settle=3.0)


@pytest.fixture(scope="module")
def text(judged):
    return comparison(
        {"first": judged, HOSTILE: judged}, title=HOSTILE, facts=[("device", HOSTILE), (HOSTILE, "x")]
    ).page()


class TestPage(PageBattery):
    pass


def test_the_page_tells_what_was_compared(judged, text):
    for word in (
        "RMSE [°]",
        "settling",
        "the reference lost the body",
        "mag-gated",
        "time [s]",
        "yaw [°]",
    ):
        assert word in text
    assert f"{np.degrees(judged.stats['total'].rmse):.3f}" in text
    assert flags.MEANING[flags.MAG_GATED][1] in text


def test_the_same_evaluation_gives_the_same_bytes(judged, text):
    again = comparison(
        {"first": judged, HOSTILE: judged}, title=HOSTILE, facts=[("device", HOSTILE), (HOSTILE, "x")]
    ).page()
    assert again == text


def test_the_axis_of_time_is_below_the_last_panel(judged):
    drawn = svg(judged.report().figures[0], salt="x")
    (time,) = re.findall(r'y="([0-9.]+)"[^>]*>time \[s\]<', drawn)
    panels = re.findall(r'y="([0-9.]+)"[^>]*>(?:total|heading|inclination) \[°\]<', drawn)
    assert len(panels) == 3
    assert float(time) > max(map(float, panels))


def test_a_share_that_rounds_to_nothing_is_not_nothing():
    assert [_share(n, 5000) for n in (0, 1, 5, 5000)] == ["0.0 %", "< 0.1 %", "0.1 %", "100.0 %"]


def test_rows_that_cannot_be_compared_are_called_so(judged, text):
    assert "Not directly comparable" not in text
    other = evaluate(judged.estimate, judged.reference, settle=4.0)
    assert "the rows differ in the samples scored" in comparison({"a": judged, "b": other}).page()


def test_a_free_heading_leaves_its_figures_out(judged, track):
    free = evaluate(track(judged.t, judged.estimate.q_nb, north=North.FREE), judged.reference)
    both = comparison({"free": free, "magnetic": judged}).page()
    assert "Cumulative distribution of the inclination error" in both
    assert both.count("not scored: the heading of the estimate counts from an arbitrary zero") == 1
    Outline(both)


@pytest.mark.parametrize("size", [1, 2, 3])
def test_tiny_tracks_have_a_page(track, judged, size):
    """Their errors by hand: of e = q_est q_ref⁻¹ = (w, x, y, z) the angle 2 acos |w|, and 2 acos √(w² + z²) of it."""
    few = slice(1000, 1000 + size)
    tiny = evaluate(track(judged.t[few], judged.estimate.q_nb[few]), judged.reference)
    told = comparison({"tiny": tiny}).page()
    Outline(told)
    w, _, _, z = quat_multiply(judged.estimate.q_nb[few], quat_conjugate(judged.reference.q_nb[few])).T
    for name, cosine in (("total", np.abs(w)), ("inclination", np.hypot(w, z))):
        error = np.degrees(2.0 * np.arccos(cosine))
        row = (
            re.search(rf"<tr><th scope='row'>{name}</th>((<td>.*?</td>){{8}})</tr>", told)[1]
            .replace("<strong>", "")
            .replace("</strong>", "")
        )
        rmse, mean, std, worst, at, *_ = (float(v.replace("−", "-")) for v in re.findall("<td>(.*?)</td>", row))
        by_hand = np.sqrt(np.mean(error**2)), error.mean(), error.std(), error.max()
        assert (rmse, mean, std, worst) == pytest.approx(by_hand, abs=6e-4)  # three decimals
        assert at == pytest.approx(judged.t[few][np.argmax(error)], abs=6e-3)
        assert f"<td><strong>{by_hand[0]:.3f}</strong></td>" in told
    assert f"<tr><th scope='row'>scored</th><td>{size}</td><td>100.0 %</td>" in told


@pytest.mark.parametrize("count", [100_000, pytest.param(1_000_000, marks=pytest.mark.long(reason="seconds"))])
def test_any_number_of_samples_makes_a_small_file(tmp_path, track, count):
    """Two numbers for each of 100 000 samples alone would be 2 MB of text or more."""
    t = np.arange(count) / 250.0
    q = quat_from_rotvec(np.random.default_rng(2).normal(0.0, 0.1, (t.size, 3)))
    level = np.tile([1.0, 0.0, 0.0, 0.0], (t.size, 1))
    path = evaluate(track(t, q), track(t, level)).write_html(tmp_path / "page.html")
    assert 50_000 < path.stat().st_size < 2_000_000


def test_without_matplotlib_the_extra_is_named(judged, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingExtraError, match=r'pip install "plumbob\[plot\]"'):
        comparison({"x": judged}).page()


def test_a_page_about_nothing_is_refused():
    with pytest.raises(ShapeError, match="at least one evaluation"):
        comparison({})
