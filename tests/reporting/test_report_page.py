"""A report as text, as a page and as a picture."""

import re

import numpy as np
import pytest

from plumbob.core.errors import MissingExtraError, ParameterError, ShapeError
from plumbob.core.resources import asset
from plumbob.core.result import plain
from plumbob.reporting.content import PALETTE, SERIES, Figure, Table
from plumbob.reporting.drawing import CHINESE, svg, variable
from plumbob.reporting.page import CSS
from plumbob.reporting.report import Report
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
