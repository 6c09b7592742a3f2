"""Every citation leads somewhere, stands in the one form, and every source is cited."""

import re
from functools import cache
from pathlib import Path

import pytest

from plumbob.filters import filter_names, load
from plumbob.filters.known import bibliography
from website import equations
from website.equations import PART, citations

ROOT = Path(__file__).parents[2]
KEYS = set(bibliography())
COMMENT = re.compile(rf"(departs from )?\[\w+\]( ({PART}))?(:.+|$)")


@cache
def citations_in(folder):
    return list(citations(folder))


def cited(*folders):
    return {citation.key for folder in folders for citation in citations_in(folder)}


def test_every_cited_key_is_in_the_bibliography():
    found = cited("src", "docs", "tests", "benchmarks", "examples")
    assert found <= KEYS, found - KEYS


def test_every_key_of_the_bibliography_is_cited():
    assert cited("src", "docs", "tests") >= KEYS


@pytest.mark.parametrize("name", filter_names())
def test_every_filter_cites_its_sources_and_its_equations(name):
    """In the docstring, which ends with its departures, and at the lines of its functions."""
    module = load(name)
    assert module.REFERENCES and set(module.REFERENCES) <= KEYS
    file = Path(module.__file__).relative_to(ROOT).as_posix()
    found = [citation for citation in citations_in("src/plumbob/filters") if citation.file == file]
    assert set(module.REFERENCES) <= {citation.key for citation in found}
    assert any(citation.name for citation in found)
    assert "Departures" in module.__doc__


def test_a_comment_that_cites_has_the_one_form():
    """'[Key] (n)' or 'departs from [Key] (n): why', with words after a colon."""
    for path in sorted((ROOT / "src").rglob("*.py")):
        for comment in re.findall(r"(?:^|\s)#:? (.*\[[A-Z]\w+\].*)", path.read_text(encoding="utf-8")):
            if set(re.findall(r"\[(\w+)\]", comment)) & KEYS:
                assert COMMENT.fullmatch(comment), (path.name, comment)


def test_numbers_and_ranges_of_equations_are_told_apart(tmp_path, monkeypatch):
    text = (
        '"""After <Yu2018>."""\nGAIN = 1  # <Yu2018> (3), (4-1)\n"""Of <Yu2018> Table 2."""\n'
        "class Fit:\n    def solve(self):\n        pass  # departs from <Chen2013> (1) to (3): why\n"
        "# <Nobody1999>\n"
    )
    (tmp_path / "a.py").write_text(text.replace("<", "[").replace(">", "]"))  # so that this file cites none of them
    monkeypatch.setattr(equations, "ROOT", tmp_path)
    found = [(c.key, c.part, c.departs, c.name) for c in equations.citations(".")]
    assert found == [
        ("Yu2018", "", False, ""), ("Yu2018", "(3)", False, "GAIN"), ("Yu2018", "(4-1)", False, "GAIN"),
        ("Yu2018", "Table 2", False, "GAIN"), ("Chen2013", "(1)", True, "Fit.solve"),
        ("Chen2013", "(2)", True, "Fit.solve"), ("Chen2013", "(3)", True, "Fit.solve"), ("Nobody1999", "", False, ""),
    ]  # fmt: skip
