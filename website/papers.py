"""Write docs/papers.md from a run of all papers and their items: ``python website/papers.py OUTCOMES.json``.

``make papers`` runs the papers and writes the page. A test compares its items with the code, a long one its figures.
"""

import json
import math
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from plumbob.papers.outcome import Item, cell, shown
from plumbob.papers.reproduce import NAMES, TITLES, items

HEAD = """\
# The five papers, end to end

Made by `make papers` from a run, and from the lists of items in the code.

```text
plumbob reproduce all                    # some minutes on two cores; one paper: plumbob reproduce buoy
plumbob reproduce buoy --lang zh         # the page in Chinese
```

Five papers describe systems that Plumbob runs whole: the rig's bytes are emulated and recorded, a session decodes them,
and the paper's procedure makes its tables and figures. The folder `reproduced` then has `index.html`, a page for each
paper, `outcomes.json`, and the bytes, sessions, recordings and cards that they are made of. In Python:

```text
import plumbob as pb

found = pb.reproduce("buoy", out="buoy-paper")
print(found.met, found.folder)
```

In the tables, *paper* is what the paper prints, *faithful* what its method gives here once its misprints are
corrected, and *best* what Plumbob recommends; a bar stands in brackets beside what must keep it. The verdict is *pass*
or *missed* by the bars, *shown* where a figure has none, and *not reproducible* where the paper's method cannot give what
is printed. What is simulated cannot prove what a paper's hardware did: where noise or motion is not stated, it is
assumed, and the page of the paper says so. The papers' equations lead to the code through [Equations](equations.md),
under `Ou2017`, `Yu2018`, `Chen2013`, `HuangJiang` and `Li2012`.

`plumbob verify`, `info`, `run` and `plot` take a recording of that folder (`.mcap`), `replay` those with a filter, and
`record` a session (`.session.toml`); `plumbob view --emulate buoy` shows a rig live.
"""


def page(outcomes: Mapping[str, Sequence[Mapping[str, Any]]]) -> str:
    """Text of the page."""
    return (
        "\n".join([HEAD, *_counts(outcomes), *(line for name in NAMES for line in _paper(name, outcomes[name]))]) + "\n"
    )


def _counts(outcomes: Mapping[str, Sequence[Mapping[str, Any]]]) -> Iterator[str]:
    yield "| paper | figures | bars missed | not reproducible | items | of them not done |"
    yield "| --- | ---: | ---: | ---: | ---: | ---: |"
    total = [0] * 5
    for name in NAMES:
        own, listed = outcomes[name], items(name)
        numbers = [
            len(own),
            sum(not one["met"] for one in own),
            sum(one["verdict"].startswith("not reproducible") for one in own),
            len(listed),
            sum(bool(one.reason) for one in listed),
        ]
        total = [a + b for a, b in zip(total, numbers, strict=True)]
        yield f"| [{name}](#{name}) | " + " | ".join(map(str, numbers)) + " |"
    yield "| together | " + " | ".join(map(str, total)) + " |"
    yield ""


def _paper(name: str, outcomes: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    yield f"## {name}"
    yield ""
    yield f"{TITLES[name]}"
    yield ""
    yield "| key | where | figure | unit | paper | faithful | best | verdict |"
    yield "| --- | --- | --- | --- | ---: | ---: | ---: | --- |"
    for one in outcomes:
        cells = [
            f"`{one['key']}`",
            one["where"] or "–",
            one["what"],
            one["unit"] or "–",
            shown(one["paper"], one["digits"]),
        ]
        cells += [_ours(one, "faithful"), _ours(one, "best"), one["verdict"]]
        yield f"| {' | '.join(map(_escaped, cells))} |"
    yield ""
    yield from items_lines(name)


def items_lines(name: str) -> Iterator[str]:
    """Lines of a paper's items."""
    yield f"### Items of {name}"
    yield ""
    yield "| | where | item | done by, or why not |"
    yield "| ---: | --- | --- | --- |"
    for number, one in enumerate(items(name), 1):
        yield f"| {number} | {_escaped(one.where)} | {_escaped(one.what)} | {_done(one)} |"
    yield ""


def keys_of(text: str, name: str) -> set[str]:
    """Keys of a paper's outcomes on the page."""
    return set(
        re.findall(r"^\| `([\w.-]+)` \|", text.partition(f"\n## {name}\n")[2].partition("\n## ")[0], re.MULTILINE)
    )


def _done(one: Item) -> str:
    by = re.sub(r"\[([\w.-]+)\]", r"`\1`", one.by)
    return _escaped(" ".join(part for part in (by, f"**Not done**: {one.reason}" if one.reason else "") if part))


def _ours(one: Mapping[str, Any], which: str) -> str:
    low, high = one[f"{which}_bar"]
    bar = (-math.inf if low is None else low, math.inf if high is None else high)
    return cell(one[which], bar, one["digits"])


def _escaped(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


def main(path: str) -> int:
    """Print the page."""
    print(page(json.loads(Path(path).read_text(encoding="utf-8"))["papers"]), end="")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
