"""The page on formats names every key, every type and every check that the reader knows."""

from pathlib import Path

from plumbob import json_schema
from plumbob.protocols import checksum
from plumbob.protocols.field import MARKS, ROLES, SIZES, WORDS
from tests.helpers.io_samples import schema_keys

PAGE = (Path(__file__).parents[2] / "docs" / "formats.md").read_text(encoding="utf-8")


def test_every_key_is_in_the_page():
    assert {key for key in schema_keys(json_schema("format")) if f"`{key}`" not in PAGE} == set()


def test_every_word_is_in_the_page():
    words = [*checksum.KINDS, *SIZES, *ROLES, *WORDS]
    assert [word for word in words if f"`{word}`" not in PAGE] == []
    assert [mark for mark in MARKS if mark not in PAGE] == []
