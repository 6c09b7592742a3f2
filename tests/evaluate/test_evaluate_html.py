"""The page: self-contained, harmless, small, and no spike lost."""

import html.parser
import re
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from plumbob import flags
from plumbob.errors import MissingExtraError, ShapeError
from plumbob.evaluate import evaluate, write_html
from plumbob.evaluate.envelope import envelope, runs
from plumbob.evaluate.html import page
from plumbob.rotations import North, quat_from_rotvec, quat_multiply

RELAXED = settings(deadline=None)  # a shared machine stalls now and then

HOSTILE = "<img src=x onerror=\"alert(1)\">$\\frac{1}$ & 'quotes' </svg></style><script>"
VOID = {"meta", "br", "img", "link", "input"}


class Outline(html.parser.HTMLParser):
    """Element names and attributes; complains about elements that do not close."""

    def __init__(self, text):
        super().__init__()
        self.names, self.attributes, self.open = set(), [], []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.names.add(tag)
        self.attributes += attrs
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.names.add(tag)
        self.attributes += attrs

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


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
    return page({"first": judged, HOSTILE: judged}, title=HOSTILE, facts={"device": HOSTILE, HOSTILE: "x"})


def test_the_page_reaches_for_nothing(text):
    outside = re.sub(r'xmlns(:xlink)?="http://www\.w3\.org/[^"]*"', "", text)
    assert re.findall(r"https?:|//[a-z]|@import|url\(\s*[\"']?(?!#)", outside) == []
    links = [value for name, value in Outline(text).attributes if name in {"href", "xlink:href", "src"}]
    assert links
    assert all(value.startswith("#") for value in links)


def test_hostile_names_are_only_text(text):
    outline = Outline(text)
    assert not outline.names & {"img", "script", "object", "iframe", "link"}
    assert not [name for name, _ in outline.attributes if name.startswith("on")]
    assert "&lt;img src=x onerror=" in text


def test_ids_are_unique_and_every_link_has_its_target(text):
    attributes = Outline(text).attributes
    ids = [value for name, value in attributes if name == "id"]
    assert len(ids) == len(set(ids))
    targets = set(re.findall(r"url\(#([^)]*)\)", text)) | {v[1:] for n, v in attributes if n == "xlink:href"}
    assert targets <= set(ids)


def test_the_page_tells_what_was_compared(judged, text):
    for word in (
        "total RMSE",
        "settling",
        "the reference lost the body",
        "mag-gated",
        "time [s]",
        "yaw [°]",
        "Comparison",
    ):
        assert word in text
    assert f"{np.degrees(judged.stats['total'].rmse):.3f}" in text
    assert flags.MEANING[flags.MAG_GATED][1] in text


def test_figures_have_no_colour_of_their_own(text):
    drawings = "".join(re.findall(r"<svg.*?</svg>", text, flags=re.DOTALL))
    assert "var(--blue)" in drawings
    assert re.findall(r"#[0-9a-f]{6}\b(?=[;\"])", drawings) == []


def test_the_same_evaluation_gives_the_same_bytes(judged, text):
    again = page({"first": judged, HOSTILE: judged}, title=HOSTILE, facts={"device": HOSTILE, HOSTILE: "x"})
    assert again == text


def test_rows_that_cannot_be_compared_are_called_so(judged, text):
    assert "Not like with like" not in text
    other = evaluate(judged.estimate, judged.reference, settle=4.0)
    assert "the rows differ in the samples scored" in page({"a": judged, "b": other}, title="", facts={})


def test_a_free_heading_leaves_its_figures_out(judged, track):
    free = evaluate(track(judged.t, judged.estimate.q_nb, north=North.FREE), judged.reference)
    both = page({"free": free, "magnetic": judged}, title="t", facts={})
    assert "whose inclination error is at most so large" in both
    assert both.count("not scored: the heading of the estimate counts from an arbitrary zero") == 1
    Outline(both)


@pytest.mark.parametrize("size", [1, 2, 3])
def test_tiny_tracks_have_a_page(track, judged, size):
    few = slice(1000, 1000 + size)
    tiny = evaluate(track(judged.t[few], judged.estimate.q_nb[few]), judged.reference)
    Outline(page({"tiny": tiny}, title="t", facts={}))


def test_a_million_samples_make_a_small_file(tmp_path, track):
    t = np.arange(1_000_000) / 250.0
    q = quat_from_rotvec(np.random.default_rng(2).normal(0.0, 0.1, (t.size, 3)))
    level = np.tile([1.0, 0.0, 0.0, 0.0], (t.size, 1))
    path = write_html(tmp_path / "page.html", {"x": evaluate(track(t, q), track(t, level))}, title="t", facts={})
    assert 50_000 < path.stat().st_size < 2_000_000


def test_without_matplotlib_the_extra_is_named(judged, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingExtraError, match=r'pip install "plumbob\[plot\]"'):
        page({"x": judged}, title="t", facts={})


def test_a_page_about_nothing_is_refused(tmp_path):
    with pytest.raises(ShapeError, match="at least one evaluation"):
        write_html(tmp_path / "x.html", {}, title="t", facts={})


def test_spikes_survive_thinning():
    t, y = np.arange(100_000) / 100.0, np.zeros(100_000)
    y[[0, 12_345, 77_777, 99_999]] = (3.0, 9.0, -7.0, 5.0)
    short_t, short_y = envelope(t, y, 300)
    assert short_t.size <= 600
    for at, value in ((123.45, 9.0), (777.77, -7.0), (999.99, 5.0), (0.0, 3.0)):
        assert value in short_y[short_t == at]
    assert (np.diff(short_t) >= 0.0).all()


@RELAXED
@given(st.data())
def test_thinning_keeps_the_range_and_invents_nothing(data):
    size = data.draw(st.integers(1, 300))
    y = np.array(data.draw(st.lists(st.sampled_from([0.0, 1.0, 2.0, -3.0, np.nan]), min_size=size, max_size=size)))
    t = np.cumsum(np.array(data.draw(st.lists(st.sampled_from([1.0, 1.0, 1.0, 50.0]), min_size=size, max_size=size))))
    columns = data.draw(st.integers(2, 40))
    short_t, short_y = envelope(t, y, columns, gap=10.0)
    known, kept = np.isfinite(y), np.isfinite(short_y)
    assert set(zip(short_t[kept], short_y[kept], strict=True)) <= set(zip(t[known], y[known], strict=True))
    if known.any():
        assert short_y[kept].max() == y[known].max()
        assert short_y[kept].min() == y[known].min()
    assert kept.sum() <= 4 * columns


@pytest.mark.parametrize("size", [40, 4000])
def test_lines_break_at_holes_gaps_and_wraps(size):
    t = np.arange(size, dtype=float)
    t[size // 4 :] += size  # a gap in time
    y = np.zeros(size)
    y[size // 2 : size // 2 + size // 10] = np.nan  # a hole
    y[3 * size // 4 :] = 6.0  # a wrap
    _, short_y = envelope(t, y, 100, gap=10.0, jump=np.pi)
    assert np.isnan(short_y).sum() == 3
    assert np.isnan(envelope(t, y, 100)[1]).sum() == 1


def test_runs_are_those_of_the_mask():
    mask = np.array([0, 1, 1, 0, 0, 1], dtype=bool)
    assert runs(np.arange(6.0), mask, 10) == [(1.0, 2.0)]  # the last sample has no width
    assert runs(np.arange(6.0), mask, 2) == []
