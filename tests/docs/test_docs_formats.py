"""The page on formats names every key, every type and every check that the reader knows."""

from pathlib import Path

import pytest

from plumbob.protocols import checksum, format_toml
from plumbob.protocols.field import MARKS, ROLES, SIZES, WORDS

PAGE = (Path(__file__).parents[2] / "docs" / "formats.md").read_text(encoding="utf-8")
FORMS = ("_FORMAT", "_FRAME", "_FIELD", "_EMBED", "_MESSAGE", "_OPTION", "_REGISTER", "_FACT", "_CHECKSUM", "_LENGTH")


@pytest.mark.parametrize("form", FORMS)
def test_every_key_is_in_the_page(form):
    assert [key for key in getattr(format_toml, form) if f"`{key}`" not in PAGE] == []


def test_every_word_is_in_the_page():
    words = [*checksum.KINDS, *SIZES, *ROLES, *WORDS]
    assert [word for word in words if f"`{word}`" not in PAGE] == []
    assert [mark for mark in MARKS if mark not in PAGE] == []
