"""Write docs/equations.md: where each published equation is in the code, from the citations in it.

``python website/equations.py > docs/equations.md``

A citation is ``[Key]`` with a key of docs/references.bib, and what of the source it means: ``(48c)``, ``(13), (14)``,
``(1) to (5)``, ``Table 7``, ``sec. 5.4``, ``step (3)`` or ``p. 12``; nothing where it means the source as a whole.
"""

import ast
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from plumbob.filters.known import bibliography, in_a_line

ROOT = Path(__file__).parents[1]
HEAD = """\
# Equations

Made by `python website/equations.py` from the citations in the code, which stand at the line: `# [Mahony2008] (48c)`.
`grep -rnF "[Mahony2008] (48c)" src tests` finds the lines; this page has the functions, and tests that cite the same.
A line `# departs from [Key] (n): why` says where the code differs from the source; the docstring of each filter lists
all of these. `plumbob list references FILTER --bib` prints the references of a filter.
"""
WHOLE = "as a whole"
NUMBER = r"\([0-9]+(?:[.-][0-9]+)*[a-z]?\)"
PART = rf"{NUMBER}(?:(?:,| to) {NUMBER})*|Annex [A-Z]|(?:Table|sec\.|p\.|step) \(?[A-Z]?[0-9.]*[0-9]\)?"
UNKNOWN = "[A-Z][A-Za-z]+[12][0-9]{3}[a-z]?"
TABLE = "| equation | code | tests |\n| --- | --- | --- |"


class Citation(NamedTuple):
    """A place that cites."""

    key: str
    part: str  # of the source; empty: all of it
    departs: bool
    file: str  # from the root of the repository
    name: str  # of the function, class or constant; empty: the module


def page() -> str:
    """The whole page."""
    known = bibliography()
    places = defaultdict(list)
    for citation in citations("src", "tests"):
        places[citation.key].append(citation)
    parts = [HEAD]
    for key in sorted(known, key=str.casefold):
        parts.append(f"## {key}\n\n{in_a_line(known[key]).partition('] ')[2]}.\n")
        if rows := list(_rows(places[key])):
            parts.append("\n".join((TABLE, *rows, "")))
    return "\n".join(parts)


def citations(*folders: str) -> Iterator[Citation]:
    """All citations in Python, TOML and Markdown below folders, also those of keys that the bibliography lacks."""
    keys = "|".join((*bibliography(), UNKNOWN))
    cited = re.compile(rf"(?P<departs>departs from )?\[(?P<key>{keys})\](?: (?P<part>{PART}))?")
    for path in sorted(path for folder in folders for path in (ROOT / folder).rglob("*.*")):
        if path.suffix in {".py", ".toml", ".md"} and path.name != "equations.md":
            text = path.read_text(encoding="utf-8")
            if found := list(cited.finditer(text)):
                yield from _placed(found, text, path)


def _placed(found: Iterable[re.Match[str]], text: str, path: Path) -> Iterator[Citation]:
    """Citations of a file with the names of what they stand in; one for each of several equations."""
    names = list(_names(ast.parse(text).body)) if path.suffix == ".py" else []
    for match in found:
        line = text.count("\n", 0, match.start()) + 1
        name = next((name for name, first, last in names if first <= line <= last), "")
        for part in _parts(match["part"] or ""):
            file = path.relative_to(ROOT).as_posix()
            yield Citation(match["key"], part, bool(match["departs"]), file, name)


def _parts(text: str) -> Iterator[str]:
    """Each equation of '(1) to (5), (7)'; anything else as it is."""
    for part in text.split(", "):
        span = re.fullmatch(r"\(([0-9]+)\) to \(([0-9]+)\)", part)
        yield from (f"({n})" for n in range(int(span[1]), int(span[2]) + 1)) if span else (part,)


def _names(body: Iterable[ast.stmt], outer: str = "") -> Iterator[tuple[str, int, int]]:
    """Name, first and last line of each function, class and constant, the inner first; a text below belongs to it."""
    before = ""
    for node in body:
        name = before if isinstance(node, ast.Expr) else ""
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            name = f"{outer}{node.name}"
            if isinstance(node, ast.ClassDef):
                yield from _names(node.body, f"{name}.")
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            target = node.targets[0] if isinstance(node, ast.Assign) else node.target
            name = f"{outer}{target.id}" if isinstance(target, ast.Name) else ""
        if name:
            yield name, node.lineno, node.end_lineno or node.lineno
        before = name


def _rows(places: Iterable[Citation]) -> Iterator[str]:
    """Rows of a source: its equations in order, then the source as a whole."""
    by_part = defaultdict(list)
    for place in places:
        by_part[place.part].append(place)
    for part in sorted(by_part, key=_order):
        code, tests = (
            _cell(place for place in by_part[part] if place.file.startswith(of)) for of in ("src/", "tests/")
        )
        yield f"| {part or WHOLE} | {code} | {tests} |"


def _order(part: str) -> tuple[bool, str, list[int], str]:
    """Kinds of parts together, by number; the whole comes last."""
    return not part, re.sub(r"[0-9].*", "", part), [int(number) for number in re.findall(r"[0-9]+", part)], part


def _cell(places: Iterable[Citation]) -> str:
    """Files with the names in them."""
    files: dict[str, list[str]] = defaultdict(list)
    for place in places:
        name = f"`{place.name}`{' (departs)' if place.departs else ''}" if place.name else ""
        if name not in files[place.file]:
            files[place.file].append(name)
    return "<br>".join(f"`{file}` {', '.join(filter(None, names))}".rstrip() for file, names in files.items())


if __name__ == "__main__":
    print(page(), end="")
