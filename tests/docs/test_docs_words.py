"""Words that users do not meet: the project's private ones, and English that reads as a translation."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SRC = ROOT / "src" / "plumbob"
PAGES = sorted([*(ROOT / "docs").glob("*.md"), *ROOT.glob("*.md"), *(ROOT / "examples").glob("*.py")])

INSTEAD = {
    r"(?<!here )\b(is|are|was|were) no (?!(?:longer|more|less|better|worse|larger|smaller)\b)[a-z.]": "is not a",
    r"\btold\b": "known, given, separated, reported", r"[,;] for (it|they|nothing|otherwise)\b": "because",
    r"\btells\b": "shows, says, gives, separates", r"\btell (?:\w+ ){0,6}(?:apart|from)\b": "distinguish, separate",
    r"\banew\b": "again", r"\bfrom which on\b": "above which", r"\bso long\b": "this long, for this time",
    r"\bso large\b": "this large, up to", r"\bone['’]s own\b": "your own",
    r"\bbare (number|value)s?\b": "plain number, number without a unit", r"\blives on\b": "is in",
    r"\ba text never\b": "a text recording never replaces a file", r"\bshall\b": "default: the scenario's, is to",
    r"\bwhat the fit (left|leaves)\b": "residuals", r"\bsize of each sample\b": "magnitude",
    r"\bpale where\b": "pale: relative uncertainty above 50 %",
    r"\ba covariance that is meant\b": "a consistent covariance",
    r"\bshare of (all )?scored samples whose\b": "cumulative distribution of the error",
    r"\bof force\b, row": "g-sensitivity, row", r"\baxis off by\b": "axis misalignment",
    r"\bangle less 90": "non-orthogonality",
}  # fmt: skip
"""What does not come back, and what stands for it."""

MEANT = (
    "the disk tells the truth",  # the usual phrase
    "I am told",
)
"""Where a word of the list is right."""


def test_the_list_finds_what_it_is_for():
    """The first line of each pair was a message, a help or a title once; the second is plain English."""
    for before, after in (
        ("a.toml is no recording", "a.toml is not a recording; there is no such file"),
        ("which cannot be told apart", "which cannot be separated"),
        ("nothing tells them apart", "it is no longer read"),
        ("to tell rest from motion", "tell the maintainers"),
    ):
        assert hits(before)
        assert not hits(after)


@pytest.mark.parametrize("folder", sorted({path.relative_to(SRC).parts[0] for path in SRC.rglob("*.py")}))
def test_no_text_or_public_docstring_has_a_word_of_the_list(folder):
    """Texts are what may be printed: every string that is neither a name nor a docstring."""
    place = SRC / folder
    files = sorted(place.rglob("*.py")) if place.is_dir() else [place]
    assert [
        f"{path.relative_to(ROOT)}:{line}: {hit}" for path in files for line, text in texts(path) for hit in hits(text)
    ] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_no_page_has_a_word_of_the_list(page):
    assert hits(page.read_text(encoding="utf-8")) == []


def hits(text: str) -> list[str]:
    """Words of the list in a text, each with its surroundings and what to write."""
    line = " ".join(text.split())
    for phrase in MEANT:
        line = line.replace(phrase, "")
    return [
        f"'{line[max(0, found.start() - 30) : found.end() + 20]}': write '{instead}'"
        for word, instead in INSTEAD.items()
        for found in re.finditer(word, line, re.IGNORECASE)
    ]


def texts(path: Path) -> Iterator[tuple[int, str]]:
    """Strings of a module with their lines; of a formatted one what stands around its values."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    docs = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    parts: set[int] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            parts |= {id(part) for part in node.values}
            yield (
                node.lineno,
                "".join(str(part.value) if isinstance(part, ast.Constant) else "{}" for part in node.values),
            )
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docs | parts:
            yield node.lineno, "" if node.value.isidentifier() else node.value
    yield 1, ast.get_docstring(tree) or ""
    yield from docstrings(tree)


def docstrings(node: ast.Module | ast.ClassDef) -> Iterator[tuple[int, str]]:
    for inner in node.body:
        if isinstance(inner, (ast.FunctionDef, ast.ClassDef)) and not inner.name.startswith("_"):
            yield inner.lineno, ast.get_docstring(inner) or ""
            if isinstance(inner, ast.ClassDef):
                yield from docstrings(inner)
