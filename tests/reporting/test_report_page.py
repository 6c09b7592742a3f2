"""A report as text, as a page and as a picture."""

import re

import pytest

from plumbob.core.errors import MissingExtraError, ParameterError, ShapeError
from plumbob.reporting import PALETTE, SERIES, Figure, Report, Table, plain
from plumbob.reporting.drawing import CHINESE, svg, variable
from plumbob.reporting.page import CSS
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


def test_text_has_facts_tables_remarks_and_parts_in_this_order():
    table = Table("Errors [°]", ["", "rmse", "at [s]"], [["total", "0.5", "1.25"], ["yaw", "-12.25", "3"]])
    part = Report("Gyroscope", [("method", "at rest")], [Table("", ["", "x"], [["bias", "1 ± 2"]])], ["It is good."])
    text = Report("Title", [("a name that is long", "value")], [table], ["One remark."], parts=[part]).text()
    assert text.splitlines() == [
        "Title",
        "a name that is long value",
        "",
        "Errors [°]",
        "         rmse  at [s]",
        "total     0.5    1.25",
        "yaw    -12.25       3",
        "",
        "- One remark.",
        "",
        "Gyroscope",
        "          x",
        "bias  1 ± 2",
        "method      at rest",
        "- It is good.",
    ]


def test_a_detail_is_folded_on_the_page_and_in_the_text_only_where_asked():
    report = Report("Title", tables=[Table("Curve", ["n", "value"], [["1", "2.5"]], detail="curve")])
    assert report.text() == "Title"
    assert report.text("curve").splitlines() == ["Title", "", "Curve", "n  value", "1    2.5"]
    assert "<details><summary>Curve</summary><div class='scroll'><table><thead>" in report.page()


def test_a_long_table_comes_after_the_figures_of_a_page_and_is_folded():
    table = Table("Curve", ["n"], [[str(i)] for i in range(21)])
    page = Report("Title", tables=[table], figures=[Figure("Line", line)]).page()
    assert page.index("</figure>") < page.index("<details><summary>Curve</summary>")


def test_words_that_are_too_long_stand_below_their_row():
    rows = [["a", "1", "x" * 90], ["b", "22", "short"]]
    table = Table("", ["", "n", "remark"], rows, words=(2,))
    assert list(table.text()) == ["    n", "a   1", f"     {'x' * 90}", "b  22", "     short"]


def test_numbers_are_strict_json():
    import numpy as np

    assert plain({"a": np.array([1.0, np.nan]), "b": float("inf"), "c": (1, None, True)}) == {
        "a": [1.0, None],
        "b": None,
        "c": [1, None, True],
    }


@pytest.mark.parametrize("colour", SERIES)
def test_every_colour_is_a_variable_of_the_style_for_light_and_dark(colour):
    assert variable(colour) == f"var(--{PALETTE[colour]})"
    assert CSS.count(f"--{PALETTE[colour]}:") == 2
    assert f"--{PALETTE[colour]}: {colour};" in CSS


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


def test_a_picture_has_the_captions_of_the_first_figures_that_there_are(tmp_path):
    figures = [Figure("Line", line, [("one", SERIES[0], "solid")])]
    deep = Report("Top", parts=[Report("Left", figures=figures), Report("Right", parts=[Report("x", figures=figures)])])
    picture = deep.plot(tmp_path / "a.svg").read_text()
    assert re.findall(">([^<>]*Line)<", picture) == ["Left: Line", "Right: x: Line"]


def test_other_pictures_and_empty_ones_are_refused(tmp_path):
    figures = [Figure("Line", line)]
    with pytest.raises(ParameterError, match=r"must end in \.svg, \.png, \.pdf, but it is .*a\.jpg"):
        Report("Title", figures=figures).plot(tmp_path / "a.jpg")
    with pytest.raises(ParameterError, match="this report has no figure"):
        Report("Title").plot(tmp_path / "a.png")
    with pytest.raises(ShapeError, match="lang must be one of en, zh"):
        Report("Title", figures=figures).page(lang="de")


def test_chinese_pictures_have_a_font_or_say_that_there_is_none(tmp_path):
    from matplotlib import font_manager

    report = Report("Title", figures=[Figure("Residuals", line)])
    assert ">残差</text>" in report.plot(tmp_path / "a.svg", lang="zh").read_text(encoding="utf-8")
    if {*CHINESE} & {*font_manager.get_font_names()}:
        assert report.plot(tmp_path / "a.png", lang="zh").stat().st_size > 1000
    else:
        with pytest.raises(MissingExtraError, match="need a Chinese font"):
            report.plot(tmp_path / "a.png", lang="zh")
