"""Pages that a program makes are up to date, and the site has every page."""

import re
from pathlib import Path

from plumbob import json_schema
from plumbob.protocols import checksum
from plumbob.protocols.field import MARKS, ROLES, SIZES, WORDS
from tests.helpers.io_samples import schema_keys
from website import command_line, draw_house, equations, sentences, view_types

ROOT = Path(__file__).parents[2]
BY_HOOKS = {f"{name}.md" for name in ("index", "examples", "reference", "changelog", "contributing", "security")}


def test_the_page_of_the_command_line_is_up_to_date():
    """Otherwise: make pages."""
    assert (ROOT / "docs" / "command-line.md").read_text(encoding="utf-8") == command_line.page()


def test_the_drawing_of_the_house_is_up_to_date():
    """Otherwise: make pages."""
    assert (ROOT / "docs" / "images" / "house.svg").read_text(encoding="utf-8") == draw_house.svg()


def test_the_page_of_equations_is_up_to_date():
    """Otherwise: make pages."""
    assert (ROOT / "docs" / "equations.md").read_text(encoding="utf-8") == equations.page()


def test_the_types_of_the_live_page_are_those_of_its_messages():
    """Otherwise: make pages."""
    assert (ROOT / "web" / "src" / "messages.ts").read_text(encoding="utf-8") == view_types.page()


def test_every_sentence_of_the_program_stands_in_one_file_to_be_read_through():
    """Otherwise: make pages."""
    assert (ROOT / "tests" / "docs" / "sentences.txt").read_text(encoding="utf-8") == sentences.page()


def test_every_page_is_in_the_menu_of_the_site():
    menu = (ROOT / "mkdocs.yml").read_text(encoding="utf-8").partition("\nnav:")[2]
    named = re.findall(r"([\w-]+\.md)$", menu, re.MULTILINE)
    assert sorted(named) == sorted({page.name for page in (ROOT / "docs").glob("*.md")} | BY_HOOKS)


def test_files_that_the_pages_name_exist():
    """A path with a placeholder, as src/plumbob/filters/<name>.py, names a folder that exists."""
    pages = [*(ROOT / "docs").glob("*.md"), *ROOT.glob("*.md")]
    for page in pages:
        for path in re.findall(r"`((?:src|tests|benchmarks|examples|website|docs)/[^\s`]*)`", page.read_text("utf-8")):
            assert (ROOT / path.partition("<")[0]).exists(), (page.name, path)


PAGE = (Path(__file__).parents[2] / "docs" / "formats.md").read_text(encoding="utf-8")


def test_every_key_is_in_the_page():
    assert {key for key in schema_keys(json_schema("format")) if f"`{key}`" not in PAGE} == set()


def test_every_word_is_in_the_page():
    words = [*checksum.KINDS, *SIZES, *ROLES, *WORDS]
    assert [word for word in words if f"`{word}`" not in PAGE] == []
    assert [mark for mark in MARKS if mark not in PAGE] == []
