"""Pages of reports: their words, and what encloses them."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

import plumbob
from plumbob.core import flags
from plumbob.core.errors import MissingExtraError, ParameterError, ShapeError
from plumbob.core.resources import asset
from plumbob.core.result import plain
from plumbob.data.cards import CalibrationCard, Mount
from plumbob.filters import CommonParams, load
from plumbob.papers.static_test import static_test
from plumbob.reporting.calibration import calibrated
from plumbob.reporting.content import PALETTE, SERIES, Figure, Table, chinese_labels, said
from plumbob.reporting.drawing import CHINESE, envelope, runs, svg, variable
from plumbob.reporting.evaluation import side_by_side
from plumbob.reporting.noise import NOISE
from plumbob.reporting.page import CSS
from plumbob.reporting.report import Report
from tests.helpers.labels import labels
from tests.helpers.page_battery import HOSTILE, PageBattery


def line(canvas):
    canvas.subplots().plot([0, 1], color=SERIES[0])


def hostile():
    table = Table(HOSTILE, [HOSTILE, HOSTILE], [[HOSTILE, HOSTILE]], words=(1,))
    figure = Figure(HOSTILE, line, [(HOSTILE, SERIES[0], "solid")], height=1.0)
    whole = Report(HOSTILE, [(HOSTILE, HOSTILE)], [table], [HOSTILE], [figure], definitions=[HOSTILE])
    return Report(HOSTILE, [(HOSTILE, HOSTILE)], [table], [HOSTILE], [figure], parts=[whole], definitions=[HOSTILE])


@pytest.fixture(scope="module", params=["en", "zh"])
def text(request):
    return hostile().page(lang=request.param)


class TestPage(PageBattery):
    pass


def test_every_colour_is_a_variable_of_the_style_for_light_and_dark():
    for colour in SERIES:
        assert variable(colour) == f"var(--{PALETTE[colour]})"
        assert CSS.count(f"--{PALETTE[colour]}:") == 2


def test_text_has_every_cell_and_a_detail_only_where_it_is_asked_for():
    """Facts, tables, remarks and parts in this order; words that are too long stand below their row."""
    table = Table("Errors [°]", ["", "rmse", "at"], [["total", "0.5", "x" * 90], ["yaw", "-12.25", "3"]], words=(2,))
    part = Report("Gyroscope", [("method", "at rest")], [Table("", ["", "x"], [["bias", "1 ± 2"]])], ["It is good."])
    curve = Table("Curve", ["n", "value"], [["1", "2.5"]], detail="curve")
    report = Report("Title", [("name", "value")], [table, curve], ["One remark."], parts=[part])
    text = report.text()
    order = f"Title|value|Errors|total|{'x' * 90}|-12.25|One remark.|Gyroscope|1 ± 2|at rest|good".split("|")
    assert [text.index(words) for words in order] == sorted(text.index(words) for words in order)
    assert ["2.5" in told for told in (text, report.text("curve"))] == [False, True]
    assert max(map(len, text.splitlines())) < 100


def test_numbers_are_strict_json():
    numbers = {"a": np.array([1.0, np.nan]), "b": float("inf"), "c": (1, None, True)}
    assert plain(numbers) == {"a": [1.0, None], "b": None, "c": [1, None, True]}


def test_a_figure_has_neither_size_nor_font_nor_colour_of_its_own():
    figure = Figure("", lambda canvas: canvas.subplots().plot([0, 1], color=SERIES[1]), height=1.0)
    drawing = svg(figure, salt="x")
    assert drawing.startswith("<svg")
    assert "var(--red)" in drawing
    assert "font-family" not in drawing
    assert " width=" not in drawing[: drawing.index(">")]
    assert svg(figure, salt="x") == drawing


@pytest.mark.parametrize(("name", "begins"), [("a.svg", b"<?xml"), ("a.PNG", b"\x89PNG"), ("a.pdf", b"%PDF")])
def test_a_picture_is_what_its_name_says_and_the_same_each_time(tmp_path, name, begins):
    report = Report("Title", figures=[Figure("Line", line, [("one", SERIES[0], "solid")])])
    first = report.plot(tmp_path / name).read_bytes()
    assert first.startswith(begins)
    assert report.plot(tmp_path / name, overwrite=True).read_bytes() == first


def test_a_picture_has_the_figures_of_parts_and_others_are_refused(tmp_path):
    figures = [Figure("Line", line, [("one", SERIES[0], "solid")])]
    deep = Report("Top", parts=[Report("Left", figures=figures), Report("Right", parts=[Report("x", figures=figures)])])
    picture = deep.plot(tmp_path / "a.svg").read_text()
    assert re.findall(">([^<>]*Line)<", picture) == ["Left: Line", "Right: x: Line"]
    for call, error, why in (
        (lambda: deep.plot(tmp_path / "a.jpg"), ParameterError, r"must end in \.svg, \.png, \.pdf, but it is .*a\.jpg"),
        (lambda: Report("Title").plot(tmp_path / "a.png"), ParameterError, "this report has no figure"),
        (lambda: deep.page(lang="de"), ShapeError, "lang must be one of en, zh"),
        (lambda: asset("none.js"), MissingExtraError, r"none\.js is missing\. .* in a checkout, run 'make page'"),
    ):
        with pytest.raises(error, match=why):
            call()


def test_chinese_pictures_have_a_font_or_say_that_there_is_none(tmp_path):
    from matplotlib import font_manager

    report = Report("Title", figures=[Figure("Residuals", line)])
    assert ">残差</text>" in report.plot(tmp_path / "a.svg", lang="zh").read_text(encoding="utf-8")
    if {*CHINESE} & {*font_manager.get_font_names()}:
        assert report.plot(tmp_path / "a.png", lang="zh").stat().st_size > 1000
    else:
        with pytest.raises(MissingExtraError, match="need a Chinese font"):
            report.plot(tmp_path / "a.png", lang="zh")


def test_spikes_survive_thinning():
    t, y = np.arange(100_000) / 100.0, np.zeros(100_000)
    y[[0, 12_345, 77_777, 99_999]] = (3.0, 9.0, -7.0, 5.0)
    short_t, short_y = envelope(t, y, 300)
    assert short_t.size <= 600
    for at, value in ((123.45, 9.0), (777.77, -7.0), (999.99, 5.0), (0.0, 3.0)):
        assert value in short_y[short_t == at]
    assert (np.diff(short_t) >= 0.0).all()


@settings(max_examples=40)
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


SIM = {"frame": "NED", "sensors": "mpu6000+hmc5983", "unit": "random", "seed": 1}
SYMBOLS = r"Gauss-Markov|\bPI\b|IEEE|BIC|Hz|RMS|rms|\[[^\]]*\]|\b[QNBKR] = \S+ .*"
"""What has no other word in Chinese: names, symbols, and values with their units."""


@pytest.fixture(scope="module")
def hand():
    """A simulated capture by hand, and what was found from it."""
    poses = plumbob.simulate("poses", **SIM)
    return poses, plumbob.calibrate(poses.imu, "hand")


def evaluations(_):
    sea = plumbob.simulate("buoy", duration=20.0, **(SIM | {"unit": "calibrated"}))
    track = plumbob.estimate(sea.imu, "mekf").track
    both = [plumbob.evaluate(track, sea.truth, align=align, settle=5.0) for align in ((), ("time", "heading"))]
    facts = [("files", ""), ("scenario", ""), ("sensors", ""), ("calibration", "")]
    return side_by_side(dict(zip("ab", both, strict=True)), facts=facts), both[0].report()


def certificates(hand):
    _, whole = hand
    gyr = {"bias_per_k": np.full((3, 3), 1e-5), "temp_span_c": (10.0, 40.0)}
    parts = {name: fit.calibration for name, fit in whole.fits.items()}
    warm = replace(parts["gyr"], **gyr)
    bare = replace(parts["acc"], matrix=np.eye(3), covariance=None, quality=None)
    card = CalibrationCard(
        "d", "2026-11-23", "m", gyr=warm, acc=bare, mag=parts["mag"], mount=Mount([1, 0, 0, 0], sd=np.ones(3))
    )
    fits = {**whole.fits, "gyr": replace(whole.fits["gyr"], calibration=warm)}
    return whole.report(recording="x"), calibrated(card, fits)


def noise(_):
    still = plumbob.simulate("static", duration=60.0, **SIM).imu
    found = plumbob.allan(still, triads=("gyr", "acc"))
    raw = np.random.default_rng(0).standard_normal(5000)
    smooth = lfilter([0.1], [1.0, -0.9], raw)
    compared = plumbob.allan(raw, smooth, rate=100, scale="1", label=("a", "b")).report()
    alone = plumbob.allan(still.gyr[:, 0], rate=100, scale="1")
    return found.report(), compared, alone.report()


def static(hand):
    poses, found = hand
    test = static_test(poses.imu, reference=poses.truth, calibration=found.card)
    return (test.report(facts=[("recording", ""), ("reference", "")]),)


@pytest.mark.parametrize("subject", [evaluations, certificates, noise, static])
def test_every_label_of_a_page_has_its_chinese_word(subject, hand):
    for report in subject(hand):
        names = ("a", "b", "values", "column", *load("mekf").Params._fields, *CommonParams._fields)
        left = {label: said(label, "zh") for label in labels(report, names=names)}
        assert not {k: v for k, v in left.items() if re.search("[A-Za-z]{2,}", re.sub(SYMBOLS, "", v))}


def test_so_have_flags_grades_and_kinds_of_noise():
    rare = {name for name, _ in flags.MEANING.values()} | {*NOISE.values()} | {"GOOD", "FAIR", "POOR", "NOT GRADED"}
    assert rare <= chinese_labels().keys()
    assert said("Directions covered: 17 / 18", "zh") == "覆盖方向: 17 / 18"
    assert said("deviation, 68.3 % interval", "zh") == "偏差, 68.3 % 置信区间"
    assert said("bias [°/s]", "zh") == "零偏 [°/s]"
    for text in ("unit 7: bias", "0.25 ± 0.01", "a sentence, with scale in it."):
        assert said(text, "zh") == text
    assert said("bias", "en") == "bias"
