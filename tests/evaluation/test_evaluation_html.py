"""The page: self-contained, harmless and small; and the numbers of its tables."""

import sys

import numpy as np
import pytest

from plumbob import evaluate, flags
from plumbob.core.errors import MissingExtraError, ShapeError
from plumbob.reporting.evaluation import side_by_side
from plumbob.rotations import North, quat_conjugate, quat_from_rotvec, quat_multiply
from tests.helpers.page_battery import HOSTILE, PageBattery


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
    facts = [("device", HOSTILE), (HOSTILE, "x")]
    return side_by_side({"first": judged, HOSTILE: judged}, title=HOSTILE, facts=facts).page()


class TestPage(PageBattery):
    def test_it_has_the_numbers_of_what_was_compared(self, judged, text):
        assert f"{np.degrees(judged.stats['total'].rmse):.3f}" in text
        assert flags.MEANING[flags.MAG_GATED][1] in text


def rows(table):
    """Cells of a table by the name of their row."""
    return {row[0]: row[1:] for row in table.rows}


def test_a_share_that_rounds_to_nothing_is_not_nothing_and_rows_that_cannot_be_compared(judged, track, monkeypatch):
    score = np.ones(judged.t.size)
    score[[1000]] = 0
    q = judged.estimate.q_nb
    _, samples = evaluate(track(judged.t, q), track(judged.t, q, score=score)).report().tables
    shares = [cells[1] for cells in rows(samples).values()]
    assert shares == ["100.0 %", "< 0.1 %"]
    other = evaluate(judged.estimate, judged.reference, settle=4.0)
    free = evaluate(track(judged.t, judged.estimate.q_nb, north=North.FREE), judged.reference)
    assert side_by_side({"a": judged, "b": judged}).remarks == []
    assert "the rows differ in the samples scored" in str(side_by_side({"a": judged, "b": other}).remarks[0])
    both = side_by_side({"free": free, "magnetic": judged}).page()  # with figures of the tilt alone
    assert both.count("not scored: the heading of the estimate counts from an arbitrary zero") == 1
    with pytest.raises(ShapeError, match="at least one evaluation"):
        side_by_side({})
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingExtraError, match=r'pip install "plumbob\[plot\]"'):
        side_by_side({"x": judged}).page()


@pytest.mark.parametrize("size", [1, 2, 3])
def test_numbers_of_tiny_tracks(track, judged, size):
    """Their errors by hand: of e = q_est q_ref⁻¹ = (w, x, y, z) the angle 2 acos |w|, and 2 acos √(w² + z²) of it."""
    few = slice(1000, 1000 + size)
    tiny = evaluate(track(judged.t[few], judged.estimate.q_nb[few]), judged.reference)
    errors, samples = side_by_side({"tiny": tiny}).parts[0].tables
    w, _, _, z = quat_multiply(judged.estimate.q_nb[few], quat_conjugate(judged.reference.q_nb[few])).T
    for name, cosine in (("total", np.abs(w)), ("inclination", np.hypot(w, z))):
        error = np.degrees(2.0 * np.arccos(cosine))
        rmse, mean, std, worst, at, *_ = (float(v.replace("−", "-")) for v in rows(errors)[name])
        by_hand = np.sqrt(np.mean(error**2)), error.mean(), error.std(), error.max()
        assert (rmse, mean, std, worst) == pytest.approx(by_hand, abs=6e-4)  # three decimals
        assert at == pytest.approx(judged.t[few][np.argmax(error)], abs=6e-3)
    assert rows(samples)["scored"][:2] == (str(size), "100.0 %")
    if size == 1:
        assert tiny.report().page().startswith("<!DOCTYPE html>")


@pytest.mark.parametrize("count", [100_000, pytest.param(1_000_000, marks=pytest.mark.long(reason="seconds"))])
def test_any_number_of_samples_makes_a_small_file(tmp_path, track, count):
    """Two numbers for each of 100 000 samples alone would be 2 MB of text or more."""
    t = np.arange(count) / 250.0
    q = quat_from_rotvec(np.random.default_rng(2).normal(0.0, 0.1, (t.size, 3)))
    level = np.tile([1.0, 0.0, 0.0, 0.0], (t.size, 1))
    path = evaluate(track(t, q), track(t, level)).write_html(tmp_path / "page.html")
    assert 50_000 < path.stat().st_size < 2_000_000
