"""A report as a page: one HTML file with figures that opens anywhere, without network.

No script is in it but the one that moves its scenes, where it has any.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from html import escape
from itertools import count
from typing import TYPE_CHECKING

from plumbob.core import check
from plumbob.reporting import scene
from plumbob.reporting.drawing import svg, variable
from plumbob.reporting.style import LANGUAGES, said

if TYPE_CHECKING:
    from plumbob.reporting.content import Figure, ReportContent, Table

_SHORT_CELL, _LONG_CELL = 16, 60  # letters of a cell of words
_MINUS = re.compile(r"-(?=[\d.∞]|$)")  # of a number, or alone
_LONG = 20  # rows of a titled table that is not folded away
_PART = "part-"  # and its number: where a link of the page leads
_POLICY = "default-src 'none'; style-src 'unsafe-inline'"


def page(report: "ReportContent", *, lang: str = "en") -> str:
    """HTML of a report; any text in it is safe."""
    check.one_of("lang", lang, LANGUAGES)
    title = escape(said(report.title, lang))
    foot = "".join(f"<p>{escape(said(text, lang))}</p>" for text in report.definitions)
    moves = _moves(report)
    policy = f"{_POLICY}; {scene.policy()}" if moves else _POLICY
    style = CSS + scene.STYLE if moves else CSS
    script = f"<script>{scene.SCRIPT}</script>\n" if moves else ""
    body = [
        f"<header><h1>{title}</h1>{_links(report.links, lang)}{facts_html(report.facts, lang)}</header>",
        *_body(report, lang, count(), depth=1),
    ]
    return (
        f'<!DOCTYPE html>\n<html lang="{lang}">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{title}</title>\n<style>\n{style}</style>\n</head>\n<body>\n<main>\n"
        + "\n".join([*body, f"<footer>{foot}</footer>"])
        + f"\n</main>\n{script}</body>\n</html>\n"
    )


def _moves(report: "ReportContent") -> bool:
    return bool(report.scenes) or any(map(_moves, report.parts))


def _body(report: "ReportContent", lang: str, number: "count[int]", *, depth: int) -> Iterator[str]:
    folded = [table for table in report.tables if table.detail or (table.title and len(table.rows) > _LONG)]
    yield from (table_html(table, lang) for table in report.tables if table not in folded)
    if depth > 1:
        yield facts_html(report.facts, lang)
    if report.remarks:
        yield f"<ul class='note'>{''.join(f'<li>{escape(said(remark, lang))}</li>' for remark in report.remarks)}</ul>"
    yield from (scene.scene_html(view, lang) for view in report.scenes)
    yield from (_figure(figure, lang, f"{next(number)}") for figure in report.figures)
    for table in folded:
        inside = table_html(replace(table, title=""), lang)
        yield f"<details><summary>{escape(said(table.title, lang))}</summary>{inside}</details>"
    for i, part in enumerate(report.parts, 1):
        name = f" id='{_PART}{i}'" if depth == 1 else ""
        yield f"<section{name}><h{min(depth + 1, 6)}>{escape(said(part.title, lang))}</h{min(depth + 1, 6)}>"
        yield from _body(part, lang, number, depth=depth + 1)
        yield "</section>"


def part_links(report: "ReportContent") -> list[tuple[str, str]]:
    """Links to the parts of a page, for its head."""
    return [(part.title, f"#{_PART}{i}") for i, part in enumerate(report.parts, 1)]


def _links(links: Sequence[tuple[str, str]], lang: str) -> str:
    items = " · ".join(f"<a href='{escape(address)}'>{escape(said(name, lang))}</a>" for name, address in links)
    return f"<nav>{items}</nav>" if items else ""


def facts_html(facts: Sequence[tuple[str, str]], lang: str) -> str:
    """List of names and values; any text in it is safe."""
    items = "".join(
        f"<div><dt>{escape(said(name, lang))}</dt><dd>{escape(said(value, lang))}</dd></div>" for name, value in facts
    )
    return f"<dl>{items}</dl>" if items else ""


def table_html(table: "Table", lang: str) -> str:
    """A table that scrolls in a narrow window, with its first column standing still."""
    words = {0, *table.words}

    def cell(row: int, i: int, value: str) -> str:
        value = said(value, lang)
        if i == 0:
            return f"<th scope='row'>{escape(value)}</th>"
        kind = _width(value) if i in words else "none" if value.startswith(("<", "not ", "未")) or value == "-" else ""
        text = escape(value if i in words else _MINUS.sub("−", value))
        strong = f"<strong>{text}</strong>" if (row, i) in table.strong else text
        return f"<td class='{kind}'>{strong}</td>" if kind else f"<td>{strong}</td>"

    names = "".join(
        f"<th scope='col'{' class=text' if i in words else ''}>{escape(said(name, lang))}</th>"
        for i, name in enumerate(table.head)
    )
    rows = "".join(
        f"<tr>{''.join(cell(n, i, value) for i, value in enumerate(row))}</tr>" for n, row in enumerate(table.rows)
    )
    title = f"<caption>{escape(said(table.title, lang))}</caption>" if table.title else ""
    head = f"<thead><tr>{names}</tr></thead>" if any(table.head) else ""
    return f"<div class='scroll'><table>{title}{head}<tbody>{rows}</tbody></table></div>"


def _width(words: str) -> str:
    """Classes of a cell of words: long ones have a column that is wide enough to read."""
    letters = len(words.encode("gb18030", "replace"))  # a Chinese sign counts as two
    return "text long" if letters > _LONG_CELL else "text" if letters > _SHORT_CELL else "text short"


def _figure(figure: "Figure", lang: str, salt: str) -> str:
    key = "".join(
        f"<span><i class='{dash}' style='color: {variable(colour)}'></i>{escape(said(name, lang))}</span>"
        for name, colour, dash in figure.key
    )
    caption = f"<figcaption>{escape(said(figure.caption, lang))}<span class='key'>{key}</span></figcaption>"
    return f"<figure>{caption}<div class='scroll'>{svg(figure, lang=lang, salt=salt)}</div></figure>"


CSS = """\
:root {
  color-scheme: light dark;
  --paper: #ffffff; --ink: #1b1f24; --muted: #5b6570; --soft: #aab4be;
  --grid: #d8dde2; --shade: #e9edf1; --band: #f5f7f9;
  --blue: #0072b2; --red: #d55e00; --green: #009e73; --pink: #cc79a7; --amber: #e69f00; --sky: #56b4e9;
  --olive: #8a6d00;
}
@media screen and (prefers-color-scheme: dark) {
  :root {
    --paper: #14181d; --ink: #e6eaee; --muted: #9aa5b1; --soft: #5d6873;
    --grid: #2e353d; --shade: #262d35; --band: #1b2026;
    --blue: #58aee0; --red: #f0833a; --green: #35c496; --pink: #dd9cbf; --amber: #f0b537; --sky: #8fcdf2;
    --olive: #c7a83a;
  }
}
* { box-sizing: border-box; }
body {
  margin: 0; background: var(--paper); color: var(--ink);
  font: 15px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, "Noto Sans", "DejaVu Sans", sans-serif;
}
main { max-width: 1020px; margin: 0 auto; padding: 2.5rem 1.5rem 3rem; }
header { border-bottom: 2px solid var(--ink); padding-bottom: 1.25rem; }
h1 { font-size: 1.75rem; line-height: 1.2; margin: 0 0 1rem; overflow-wrap: anywhere; }
h2 { font-size: 1.3rem; margin: 2.5rem 0 0; overflow-wrap: anywhere; }
h3 { font-size: 1rem; margin: 2rem 0 0; overflow-wrap: anywhere; }
nav { margin: -0.4rem 0 1rem; }
a { color: var(--blue); }
dl { margin: 0; }
section dl { margin-top: 1.25rem; }
dl div { display: grid; grid-template-columns: 8rem 1fr; gap: 0 1rem; padding: 0.1rem 0; }
dt { color: var(--muted); }
dd { margin: 0; overflow-wrap: anywhere; }
.note {
  margin: 1.25rem 0 0; padding: 0.6rem 0.9rem 0.6rem 1.9rem; overflow-wrap: anywhere;
  background: var(--band); border-left: 3px solid var(--amber);
}
.scroll { overflow-x: auto; }
.scroll:has(table) { margin-top: 1.25rem; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; font-size: 0.9rem; }
caption { text-align: left; font-weight: 600; font-size: 1rem; padding-bottom: 0.3rem; }
th, td { padding: 0.28rem 0.5rem; text-align: right; white-space: nowrap; border-bottom: 1px solid var(--grid); }
th[scope=row], .text { text-align: left; white-space: normal; overflow-wrap: break-word; }
td.text { min-width: 7.5rem; }
td.short { min-width: 0; white-space: nowrap; }
td.long { min-width: 15rem; }
th { font-weight: 500; }
th:first-child { position: sticky; left: 0; background: var(--paper); text-align: left; min-width: 6.5rem; }
thead th { color: var(--muted); border-bottom: 1px solid var(--muted); }
.none { color: var(--muted); }
details { margin-top: 1rem; }
summary { cursor: pointer; font-weight: 600; }
figure { margin: 1.75rem 0 0; }
figcaption { font-weight: 600; display: flex; flex-wrap: wrap; justify-content: space-between; gap: 0.2rem 1.5rem; }
figure svg { display: block; width: 100%; min-width: 32rem; height: auto; margin-top: 0.4rem; }
.key { font-weight: 400; color: var(--muted); display: flex; flex-wrap: wrap; gap: 0.2rem 1.1rem; font-size: 0.85rem; }
.key span { display: inline-flex; align-items: center; gap: 0.4rem; overflow-wrap: anywhere; }
.key i { width: 1.6rem; height: 0; border-top: 3px solid currentColor; flex: none; }
.key i.dashed { border-top-style: dashed; }
.key i.dotted { border-top-style: dotted; }
.key i.block { height: 0.9rem; border: 1px solid var(--grid); background: currentColor; }
footer { margin-top: 2.5rem; border-top: 1px solid var(--grid); color: var(--muted); font-size: 0.85rem; }
@media (max-width: 30rem) {
  main { padding: 1.25rem 1rem 2rem; }
  dl div { display: block; padding: 0.2rem 0; }
  dt { font-size: 0.8rem; }
  th:first-child { max-width: 9rem; }
  caption { max-width: calc(100vw - 2rem); }
  td.text:not(.short, .long) { min-width: 5.5rem; }
}
@media print {
  body { font-size: 8.5pt; line-height: 1.4; }
  main { max-width: none; padding: 0; }
  figure { margin-top: 1rem; }
  figure svg { width: 88%; min-width: 0; }
  th, td { padding: 0.15rem 0.4rem; }
  main > section + section { break-before: page; }
  figure, table { break-inside: avoid; }
  h2, h3, caption { break-after: avoid; }
}
"""
