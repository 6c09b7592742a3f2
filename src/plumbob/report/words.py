"""Labels of pages and pictures in Chinese, in the terms of the papers that this field writes in it."""

import re
from typing import Final

_APART = re.compile(r"(: |, | \[[^\]]*\])")


def said(label: str, lang: str) -> str:
    """A label in a language; what is not a label stays as it is.

    Parts of a label that stand apart by a colon, a comma or a unit in brackets are looked up one by one, where the
    first of them is known.
    """
    if lang == "en" or label in CHINESE:
        return label if lang == "en" else CHINESE[label]
    first, *others = _APART.split(label)
    return "".join([CHINESE[first], *(CHINESE.get(part, part) for part in others)]) if first in CHINESE else label


CHINESE: Final[dict[str, str]] = {}
