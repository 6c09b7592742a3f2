"""What pages and pictures share: colours, languages, and labels in Chinese, which stand in a file beside."""

import re
import tomllib
from functools import cache
from pathlib import Path
from typing import Final, Self

from plumbob.core.findings import Finding, Note

LANGUAGES: Final = ("en", "zh")
"""Of the labels of pages and pictures."""

# After Okabe and Ito, distinguished by colour-blind readers; the names are CSS variables of the page.
PALETTE: Final = {
    "#0072b2": "blue",
    "#d55e00": "red",
    "#009e73": "green",
    "#cc79a7": "pink",
    "#e69f00": "amber",
    "#56b4e9": "sky",
    "#8a6d00": "olive",
}
INK, MUTED, GRID, SHADE, SOFT = "#1b1f24", "#5b6570", "#d8dde2", "#e9edf1", "#aab4be"
SERIES: Final = tuple(PALETTE)
VARIABLES: Final = {**PALETTE, INK: "ink", MUTED: "muted", GRID: "grid", SHADE: "shade", SOFT: "soft"}
"""Names of all colours."""
COLOURS: Final = {name: colour for colour, name in VARIABLES.items()}

_APART = re.compile(r"(: |, | \[[^\]]*\])")
_NUMBER = re.compile(r"\d+(?:\.\d+)?")


class Both(str):
    """English text that carries its Chinese, for sentences that no dictionary of labels could hold.

    Parameters
    ----------
    en, zh : str
        The text in both languages. As a string, it is the English one.
    """

    zh: str

    def __new__(cls, en: str, zh: str) -> Self:
        """Make it of both."""
        made = super().__new__(cls, en)
        made.zh = zh
        return made

    def __str__(self) -> str:
        """Itself: what asks for a string, as a plot's label does, keeps the Chinese."""
        return self

    def __reduce__(self) -> tuple[type, tuple[str, str]]:
        """What makes it again."""
        return type(self), (self[:], self.zh)


def said(label: Note, lang: str) -> str:
    """A label in a language; what is not a label stays as it is.

    Parts of a label that stand apart by a colon, a comma or a unit in brackets are looked up one by one, where the
    first of them is known; a number in it stands as # in the dictionary.
    """
    if isinstance(label, Finding):
        return label.sentence(lang)
    if isinstance(label, Both):
        return label[:] if lang == "en" else label.zh
    if lang == "en":
        return label
    first, *others = [label] if _chinese(label) else _APART.split(label)
    return "".join([_chinese(first), *(_chinese(part) or part for part in others)]) if _chinese(first) else label


def _chinese(part: str) -> str:
    numbers = iter(_NUMBER.findall(part))
    return re.sub("#", lambda _: next(numbers), chinese_labels().get(_NUMBER.sub("#", part), ""))


@cache
def chinese_labels() -> dict[str, str]:
    """All labels that have a Chinese word, with # for each number in them."""
    labels: dict[str, str] = tomllib.loads((Path(__file__).parent / "zh.toml").read_text(encoding="utf-8"))
    return labels
