"""Every citation in the code leads somewhere."""

import re
from pathlib import Path

import pytest

from plumbob.filters import filter_names, load

ROOT = Path(__file__).parents[2]
KEYS = set(re.findall(r"^@\w+\{(\w+),", (ROOT / "docs" / "references.bib").read_text(encoding="utf-8"), re.MULTILINE))


def test_every_key_in_the_code_is_in_the_bibliography():
    cited = set()
    for folder in ("src", "tests", "benchmarks"):
        for path in (ROOT / folder).rglob("*.py"):
            cited |= set(re.findall(r"\[((?:[A-Z][A-Za-z]+[12]\d{3})|DLMF)\]", path.read_text(encoding="utf-8")))
    assert len(cited) > 10
    assert cited <= KEYS, cited - KEYS


@pytest.mark.parametrize("name", filter_names())
def test_every_filter_cites_its_sources_and_its_equations(name):
    module = load(name)
    assert module.REFERENCES
    assert set(module.REFERENCES) <= KEYS
    source = Path(module.__file__).read_text(encoding="utf-8")
    for key in module.REFERENCES:
        assert f"[{key}]" in source
    assert "Departures" in source
