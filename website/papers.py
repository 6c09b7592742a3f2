"""Write docs/papers.md from a run of all papers and their items: ``python website/papers.py OUTCOMES.json``.

Of several runs, with other seeds, it prints instead how many of them keep each bar, and how the figure scatters.

``make papers`` runs the papers, writes the page, and renews the README's table, which has some of its rows. A test
compares the page's items with the code and the README with the page, a long one the page's figures with a run.
"""

import json
import math
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from plumbob.papers.description import CLAIMS, PAPERS, PaperItem, cell, shown
from plumbob.papers.reproduce import NAMES

HEAD = """\
# The five papers, end to end

Made by `make papers` from a run, and from the lists of items in the code.

```text
plumbob reproduce all               # some minutes on two cores; one paper: plumbob reproduce buoy
plumbob reproduce --render reproduced/outcomes.json --lang zh    # its pages in Chinese, without another run
```

Five papers describe systems that Plumbob runs whole: the rig's bytes are emulated and recorded, a session decodes them,
and the paper's procedure makes its tables and figures. The folder `reproduced` then has `index.html`, a page for each
paper, `outcomes.json`, and the bytes, sessions, recordings and cards that they are made of. In Python:

```text
import plumbob as pb

found = pb.reproduce("buoy", out="buoy-paper")
print(found.met, found.folder)
```

In the tables, *paper* is what the paper prints, *its method* what that gives here once its misprints are corrected, and
*ours* what Plumbob recommends; a bar stands in brackets beside what must keep it. *Reached* says whether the paper's
own method gives the printed figure (*not stated* where the paper prints none) and what became of the claim: *refuted*
with the reason, *within the scatter of one run* where the paper prints a single run and so many of ours lie that far
off by chance, or not to be had at all. *Bar* is whether our limits are kept, *with* which units and runs a figure is
of. What is simulated cannot prove what a paper's hardware did: where noise or motion is not stated, it is assumed, and
the page of the paper says so. The papers' equations lead to the code through [Equations](equations.md), under `Ou2017`,
`Yu2018`, `Chen2013`, `HuangJiang` and `Li2012`.

`plumbob verify`, `info`, `run` and `report` take a recording of that folder (`.mcap`), `replay` those with a filter,
and `record` a session (`.session.toml`); `plumbob view --emulate buoy` shows a rig live.
"""


README: Final = Path(__file__).parents[1] / "README.md"
SHOWN: Final = {
    ("fin", "three.N.bias"): "error of white noise N, read off Allan plots of 220 s",
    ("buoy", "static.yaw"): "heading error at 36 rests, after calibration, that 95 % of units keep",
    ("buoy", "slide.gated.roll"): "largest roll error while it is slid over a desk",
    ("buoy", "sea.roll"): "roll error in waves, rms",
    ("trackball", "ramp.rms"): "rate error while the speed rises, rms",
    ("arm", "static.fuzzy.yaw"): "yaw at rest, standard deviation",
    ("arm", "turn.fuzzy.yaw"): "yaw in a turn, standard deviation",
    ("rod", "bytes.ahrs.pitch"): "largest pitch difference to the reference, 600 s, vibrating",
    ("rod", "drift.ratio"): "drift of the gyroscope alone over that of the fusion",
}
"""Figures of the README's table, and how it names them."""
_BEGIN, _END = "<!-- papers: made by make papers -->\n", "<!-- end of papers -->\n"


def readme(text: str, made: str) -> str:
    """README with its table made from the text of docs/papers.md."""
    lines = ["| paper | figure | printed | its method, corrected | reached | Plumbob | with |",
             "| --- | --- | ---: | ---: | --- | ---: | --- |"]  # fmt: skip
    for (name, key), told in SHOWN.items():
        cells = next(line for line in _section(made, name).splitlines() if line.startswith(f"| `{key}` |")).split(" | ")
        unit, values = cells[3], [cell.partition(" (")[0] for cell in cells[4:7]]
        near = unit if unit == "°" else f" {unit}"
        shown_s = [value if unit == "–" or not value[-1].isdigit() else value + near for value in values]
        paper, faithful, best = shown_s
        row = name, told, paper, faithful, cells[7].partition(":")[0], best, cells[9].removesuffix(" |")
        lines.append(f"| {' | '.join(row)} |".replace("| - |", "| – |"))
    _, _, *counts = next(line for line in made.splitlines() if line.startswith("| together")).split(" | ")
    of = dict(zip(CLAIMS, map(int, counts[: len(CLAIMS)]), strict=True))
    told = ", ".join(f"{count} {claim}" for claim, count in of.items() if count)
    lines += ["", f"Of {sum(of.values())} numbers and claims that the papers print: {told}."]
    head, _, rest = text.partition(_BEGIN)
    return head + _BEGIN + "\n".join(lines) + "\n" + _END + rest.partition(_END)[2]


def _section(made: str, name: str) -> str:
    return made.partition(f"\n## {name}\n")[2].partition("\n## ")[0]


def page(outcomes: Mapping[str, Sequence[Mapping[str, Any]]]) -> str:
    """Text of the page."""
    return (
        "\n".join([HEAD, *_counts(outcomes), *(line for name in NAMES for line in _paper(name, outcomes[name]))]) + "\n"
    )


def _counts(outcomes: Mapping[str, Sequence[Mapping[str, Any]]]) -> Iterator[str]:
    yield f"| paper | figures | {' | '.join(CLAIMS)} | bars missed | items | of them not done |"
    yield f"| --- |{' ---: |' * (len(CLAIMS) + 4)}"
    total = [0] * (len(CLAIMS) + 4)
    for name in NAMES:
        own, listed = outcomes[name], PAPERS[name].items
        numbers = [
            len(own),
            *(sum(one["claim"] == claim for one in own) for claim in CLAIMS),
            sum(not one["met"] for one in own),
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
    yield f"{PAPERS[name].title}"
    yield ""
    yield "| key | where | figure | unit | paper | its method | ours | reached | bar | with |"
    yield "| --- | --- | --- | --- | ---: | ---: | ---: | --- | --- | --- |"
    for one in outcomes:
        cells = [
            f"`{one['key']}`",
            one["where"] or "–",
            one["what"],
            one["unit"] or "–",
            shown(one["paper"], one["digits"]),
        ]
        cells += [_ours(one, "faithful"), _ours(one, "best"), *_verdict(one)]
        yield f"| {' | '.join(map(_escaped, cells))} |"
    yield ""
    yield from items_lines(name)


def items_lines(name: str) -> Iterator[str]:
    """Lines of a paper's items."""
    yield f"### Items of {name}"
    yield ""
    yield "| | where | item | done by, or why not |"
    yield "| ---: | --- | --- | --- |"
    for number, one in enumerate(PAPERS[name].items, 1):
        yield f"| {number} | {_escaped(one.where)} | {_escaped(one.what)} | {_done(one)} |"
    yield ""


def keys_of(text: str, name: str) -> set[str]:
    """Keys of a paper's outcomes on the page."""
    return set(
        re.findall(r"^\| `([\w.-]+)` \|", text.partition(f"\n## {name}\n")[2].partition("\n## ")[0], re.MULTILINE)
    )


def _done(one: PaperItem) -> str:
    by = re.sub(r"\[([\w.-]+)\]", r"`\1`", one.by)
    return _escaped(" ".join(part for part in (by, f"**Not done**: {one.reason}" if one.reason else "") if part))


def _ours(one: Mapping[str, Any], which: str) -> str:
    low, high = one[f"{which}_bar"]
    bar = (-math.inf if low is None else low, math.inf if high is None else high)
    return cell(one[which], bar, one["digits"], one["error"])


def _verdict(one: Mapping[str, Any]) -> list[str]:
    reached, kept = one["verdict"]
    why = one["reason"] if one["reason"] and (one["reached"] is False or not one["met"]) else ""
    if one["reached"] is False:
        reached = f"no, {one['claim']}{': ' if why else ''}{why}"
    return [reached,
            f"{kept}: {why}" if why and one["reached"] is not False else kept, one["with"] or "–"]  # fmt: skip


def _escaped(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


def kept(runs: Sequence[Mapping[str, Sequence[Mapping[str, Any]]]]) -> Iterator[str]:
    """A line for each bar: how many of the runs keep it, and the mean and the standard deviation of its figure."""
    bars = every = 0
    for name in NAMES:
        by_key: dict[str, list[Mapping[str, Any]]] = {}
        for run in runs:
            for one in run.get(name, ()):
                by_key.setdefault(one["key"], []).append(one)
        for key, ones in by_key.items():
            for which in ("faithful", "best"):
                if ones[0][f"{which}_bar"] == [None, None] or ones[0][which] is None:
                    continue
                values = [one[which] for one in ones if one[which] is not None]
                met, mean = sum(one["met"] for one in ones), sum(values) / len(values)
                sd = math.sqrt(sum((value - mean) ** 2 for value in values) / max(len(values) - 1, 1))
                bars, every = bars + 1, every + (met == len(ones))
                bar = [f"{end:g}" if end is not None else "" for end in ones[0][f"{which}_bar"]]
                yield f"{name:10} {key:28} kept {met:2} of {len(ones):2}  {mean:.4g} ± {sd:.2g}  bar {' … '.join(bar)}"
    yield f"{every} of {bars} bars are kept by every one of the runs"


def main(path: str, *more: str) -> int:
    """Write the page, and renew the README's table; or print what the bars of several runs are worth."""
    if more:
        print(*kept([json.loads(Path(one).read_text(encoding="utf-8"))["papers"] for one in (path, *more)]), sep="\n")
        return 0
    made = page(json.loads(Path(path).read_text(encoding="utf-8"))["papers"])
    (README.parent / "docs" / "papers.md").write_text(made, encoding="utf-8")
    README.write_text(readme(README.read_text(encoding="utf-8"), made), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
