"""Draw the house: its rooms on their floors, and who imports whom, from the code itself.

``python website/draw_house.py > docs/images/house.svg``

Floors are the layers of the first contract of import-linter in pyproject.toml. An arrow says that a room imports
another; one that follows from a chain of others is left out, and so are those to the ground floor, on which all stand.
Rooms are ordered, and long arrows led between them, as in the layered drawings of Sugiyama.
"""

import ast
import re
import textwrap
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from html import escape
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from grimp import build_graph

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "plumbob"
WIDTH, SIDE, GAP, BETWEEN = 1240, 20, 42, 56  # px: picture, margin, most between rooms, between floors
ROOM, MODULE, PASSAGE = (164, 74), (108, 30), (10, 74)  # px: a folder, a file, where an arrow passes a floor
ON_GROUND = 8  # files side by side
INK, PAPER, FLOOR, LINE = "#1f2933", "#ffffff", "#eef2f5", "#7b8794"

Edge = tuple[str, str]


class Box(NamedTuple):
    """A place on a floor: a room, or a passage for an arrow where `name` is no room's."""

    name: str
    x: float  # px, of its middle
    y: float  # px, of its top
    width: float
    height: float


def floors() -> list[list[str]]:
    """Rooms of each floor, the highest first."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    layers = settings["tool"]["importlinter"]["contracts"][0]["layers"]
    return [[re.sub(r"^plumbob\.|[()]", "", name) for name in re.split(r"\s*[|:]\s*", layer)] for layer in layers]


def imports(rooms: Iterable[str]) -> set[Edge]:
    """Room and imported room, of all imports but those for types alone."""
    graph = build_graph("plumbob", include_external_packages=False, exclude_type_checking_imports=True, cache_dir=None)
    known = set(rooms)
    pairs = (
        (module.split(".")[1], found.split(".")[1])
        for module in graph.modules if "." in module
        for found in graph.find_modules_directly_imported_by(module) if "." in found
    )  # fmt: skip
    return {(a, b) for a, b in pairs if a != b and {a, b} <= known}


def shortest(edges: set[Edge]) -> set[Edge]:
    """Edges that no chain of others says already."""

    def reached(start: str, seen: set[str]) -> set[str]:
        for a, b in edges:
            if a == start and b not in seen:
                seen.add(b)
                reached(b, seen)
        return seen

    below = {a: {b for c, b in edges if c == a} for a, _ in edges}
    far = {a: set().union(*(reached(b, set()) for b in nexts)) for a, nexts in below.items()}
    return {(a, b) for a, b in edges if b not in far[a]}


def chains(edges: Iterable[Edge], floor_of: Mapping[str, int]) -> list[list[str]]:
    """Each edge as its room, a passage through every floor between, and the other room."""
    found = []
    for a, b in sorted(edges):
        between = range(floor_of[a] + 1, floor_of[b])
        found.append([a, *(f"{a}>{b}>{floor}" for floor in between), b])
    return found


def ordered(rows: list[list[str]], paths: list[list[str]]) -> list[list[str]]:
    """Rows with each place near the mean of those that it is tied to, by some sweeps down and up."""
    ties: dict[str, list[str]] = {}
    for path in paths:
        for a, b in pairwise(path):
            ties.setdefault(a, []).append(b)
            ties.setdefault(b, []).append(a)
    for sweep in range(12):
        at = {name: (i + 0.5) / len(row) for row in rows for i, name in enumerate(row)}
        for row in rows if sweep % 2 else reversed(rows):
            mean = {name: _mean([at[tied] for tied in ties.get(name, [])], at[name]) for name in row}
            row.sort(key=lambda name: (mean[name], name))
            at |= {name: (i + 0.5) / len(row) for i, name in enumerate(row)}
    return rows


def _mean(values: list[float], otherwise: float) -> float:
    return sum(values) / len(values) if values else otherwise


def placed(rows: list[list[str]]) -> dict[str, Box]:
    """Boxes of all places, floor by floor from above; the ground floor may take several lines."""
    lines = [*rows[:-1], *(rows[-1][i : i + ON_GROUND] for i in range(0, len(rows[-1]), ON_GROUND))]
    boxes: dict[str, Box] = {}
    y = float(SIDE + 14)
    for i, line in enumerate(lines):
        sizes = [_size(name, among=sum(">" not in other for other in line)) for name in line]
        height = max(size[1] for size in sizes)
        boxes |= _side_by_side(line, sizes, y, height)
        y += height + (BETWEEN if i < len(rows) - 1 else 10)
    return boxes


def _size(name: str, *, among: int) -> tuple[int, int]:
    """Size of a place; where a line has many, a folder is drawn as small as a file."""
    return PASSAGE if ">" in name else ROOM if (PACKAGE / name).is_dir() and among < ON_GROUND - 1 else MODULE


def _side_by_side(line: list[str], sizes: list[tuple[int, int]], y: float, height: float) -> Iterator[tuple[str, Box]]:
    """Boxes of a line, in the middle of the picture, with equal room between them."""
    taken = sum(size[0] for size in sizes)
    gap = min(float(GAP), (WIDTH - 2 * SIDE - 40 - taken) / max(len(line) - 1, 1))
    x = 0.5 * (WIDTH - taken - gap * (len(line) - 1))
    for name, (width, own) in zip(line, sizes, strict=True):
        tall = height if ">" in name else own
        yield name, Box(name, x + 0.5 * width, y + 0.5 * (height - tall), width, tall)
        x += width + gap


def summary(name: str) -> str:
    """First clause of a room's docstring, without the name that it begins with."""
    text = ast.get_docstring(ast.parse((PACKAGE / name / "__init__.py").read_text(encoding="utf-8"))) or ""
    text = re.sub(r"^[\w' ]+: ", "", " ".join(text.partition("\n\n")[0].split()))
    return re.split(r"[.:;] |[.:;]$", text)[0].replace("`", "")


def svg() -> str:
    """The whole picture."""
    *upper, ground = floors()
    floor_of = {name: i for i, floor in enumerate(upper) for name in floor}
    paths = chains(shortest(imports(floor_of)), floor_of)
    rows = [[*floor, *(name for path in paths for name in path[1:-1] if name.endswith(f">{i}"))]
            for i, floor in enumerate(upper)]  # fmt: skip
    boxes = placed([*ordered(rows, paths), ground])
    height = max(box.y + box.height for box in boxes.values()) + SIDE + 22
    parts = [*_floors([*rows, ground], boxes), *_arrows(paths, boxes)]
    parts += [part for box in boxes.values() if ">" not in box.name for part in _box(box)]
    parts.append(_text(WIDTH / 2, height - 10, "Every room stands on the ground floor; those arrows are left out.", 12))
    return "\n".join(
        [_HEAD.format(width=WIDTH, height=round(height), ink=INK, paper=PAPER, line=LINE), *parts, "</svg>\n"]
    )


_HEAD = """\
<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="system-ui, sans-serif" fill="{ink}">
<title>The rooms of the package on their floors; an arrow points to what is imported</title>
<defs><marker id="head" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto">\
<path d="M0 0 8 4 0 8z" fill="{line}"/></marker></defs>
<rect width="{width}" height="{height}" fill="{paper}"/>"""


def _floors(rows: list[list[str]], boxes: Mapping[str, Box]) -> Iterator[str]:
    for row in rows:
        top = min(boxes[name].y for name in row) - 10
        bottom = max(boxes[name].y + boxes[name].height for name in row) + 10
        yield _rect(SIDE, top, WIDTH - 2 * SIDE, bottom - top, f'fill="{FLOOR}"')


def _rect(x: float, y: float, width: float, height: float, look: str) -> str:
    return f'<rect x="{x:.0f}" y="{y:.0f}" width="{width:.0f}" height="{height:.0f}" rx="5" {look}/>'


def _arrows(paths: list[list[str]], boxes: Mapping[str, Box]) -> Iterator[str]:
    """Curves from the lower edge of a room to another; each starts and ends at a place of its own."""
    out, into = _ports(paths, boxes, end=0), _ports(paths, boxes, end=-1)
    for path, start, end in zip(paths, out, into, strict=True):
        places = [boxes[name] for name in path]
        neighbours = places[-1].y < places[0].y + places[0].height
        yield _arrow(_below(places[0], places[1], start) if neighbours else _down(places, start, end))


def _below(a: Box, b: Box, x: float) -> str:
    """Path below two rooms of a floor."""
    y, up = a.y + a.height, b.y + b.height + 1
    return f"M{x:.0f} {y:.0f}C{x:.0f} {y + 34:.0f} {b.x:.0f} {y + 34:.0f} {b.x:.0f} {up:.0f}"


def _down(places: list[Box], start: float, end: float) -> str:
    """Path from a room through the floors between to the upper edge of another."""
    x, y = start, places[0].y + places[0].height
    d = f"M{x:.0f} {y:.0f}"
    for passage in places[1:-1]:
        d += _curve(x, y, passage.x, passage.y) + f"V{passage.y + passage.height:.0f}"
        x, y = passage.x, passage.y + passage.height
    return d + _curve(x, y, end, places[-1].y - 1)


def _arrow(d: str) -> str:
    return f'<path d="{d}" fill="none" stroke="{LINE}" stroke-width="1.3" marker-end="url(#head)"/>'


def _ports(paths: list[list[str]], boxes: Mapping[str, Box], *, end: int) -> list[float]:
    """Where each path leaves its first room, or enters its last: side by side, in the order of where they go."""
    beside = 1 if end == 0 else -2
    x = [0.0] * len(paths)
    for name in {path[end] for path in paths}:
        mine = [i for i, path in enumerate(paths) if path[end] == name]
        mine.sort(key=lambda i: boxes[paths[i][beside]].x)
        for k, i in enumerate(mine):
            x[i] = boxes[name].x + boxes[name].width * 0.8 * ((k + 0.5) / len(mine) - 0.5)
    return x


def _curve(x0: float, y0: float, x1: float, y1: float) -> str:
    middle = 0.5 * (y0 + y1)
    return f"C{x0:.0f} {middle:.0f} {x1:.0f} {middle:.0f} {x1:.0f} {y1:.0f}"


def _box(box: Box) -> Iterator[str]:
    """A room with its name and what it is for; a file has its name alone."""
    yield _rect(box.x - box.width / 2, box.y, box.width, box.height, f'fill="{PAPER}" stroke="{LINE}"')
    if box.height == MODULE[1]:
        yield _text(box.x, box.y + 20, box.name, 13)
        return
    yield _text(box.x, box.y + 18, box.name, 14, bold=True)
    for i, line in enumerate(textwrap.wrap(summary(box.name), 27, max_lines=3, placeholder=" …")):
        yield _text(box.x, box.y + 35 + 15 * i, line, 11)


def _text(x: float, y: float, text: str, size: int, *, bold: bool = False) -> str:
    weight = ' font-weight="600"' if bold else ""
    return f'<text x="{x:.0f}" y="{y:.0f}" font-size="{size}"{weight} text-anchor="middle">{escape(text)}</text>'


if __name__ == "__main__":
    print(svg(), end="")
