"""The skeleton of a page and its parts."""

import pytest

from plumbob.report import PALETTE, SERIES, definitions_list, document, figure, svg, swatch, variable
from plumbob.report.document import CSS
from tests.battery.pages import HOSTILE, Outline


def test_whatever_comes_in_as_text_is_escaped():
    text = document(
        HOSTILE, {HOSTILE: HOSTILE}, [figure(HOSTILE, "<svg></svg>", [(HOSTILE, SERIES[0], "solid")])], footer="f"
    )
    assert not Outline(text).names & {"img", "script"}
    assert text.count("&lt;script&gt;") == 6  # title twice, a fact's name and value, caption and key


def test_a_reports_own_style_comes_after_the_common_one():
    text = document("t", {}, ["<p>body</p>"], footer="<b>end</b>", style="h9 { color: red; }\n")
    assert f"{CSS}h9 {{ color: red; }}\n</style>" in text
    assert text.index("<p>body</p>") < text.index("<footer><p><b>end</b></p></footer>")
    assert "<dl>" not in text
    assert definitions_list([]) == ""


@pytest.mark.parametrize("colour", SERIES)
def test_every_colour_is_a_variable_of_the_style_for_light_dark_and_paper(colour):
    assert variable(colour) == f"var(--{PALETTE[colour]})"
    assert variable(colour) in swatch(colour, "solid")
    assert CSS.count(f"--{PALETTE[colour]}:") == 3
    assert f"--{PALETTE[colour]}: {colour};" in CSS


def test_a_figure_has_neither_size_nor_font_nor_colour_of_its_own():
    drawing = svg(lambda figure: figure.subplots().plot([0, 1], color=SERIES[1]), height=1.0, salt="x")
    assert drawing.startswith("<svg")
    assert "var(--red)" in drawing
    assert "font-family" not in drawing
    assert " width=" not in drawing[: drawing.index(">")]
    assert svg(lambda figure: figure.subplots().plot([0, 1], color=SERIES[1]), height=1.0, salt="x") == drawing
