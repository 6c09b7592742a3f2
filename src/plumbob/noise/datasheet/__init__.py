"""Datasheet: what the noise of a sensor looks like to a reader: text, JSON, page, picture, cards."""

from plumbob.noise.datasheet.card import card_text, kalibr_yaml, noise_card
from plumbob.noise.datasheet.comparison import compared_as_dict, compared_text, write_comparison, write_comparison_png
from plumbob.noise.datasheet.figure import write_png
from plumbob.noise.datasheet.fin import fin_report, fin_section
from plumbob.noise.datasheet.html import write_html
from plumbob.noise.datasheet.table import as_dict, curves_as_dict, curves_text, text

__all__ = [
    "as_dict",
    "card_text",
    "compared_as_dict",
    "compared_text",
    "curves_as_dict",
    "curves_text",
    "fin_report",
    "fin_section",
    "kalibr_yaml",
    "noise_card",
    "text",
    "write_comparison",
    "write_comparison_png",
    "write_html",
    "write_png",
]
