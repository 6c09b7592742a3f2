"""The parts of a page that every report has; text that comes in here is escaped."""

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Final

Rows = Iterable[tuple[str, str]]
"""Names and values."""

Key = Iterable[tuple[str, str, str]]
"""Lines of a figure: name, colour of the palette, and "solid", "dashed", "dotted" or "block"."""

_POLICY = "default-src 'none'; style-src 'unsafe-inline'"


def document(title: str, facts: Mapping[str, str], body: Iterable[str], *, footer: str, style: str = "") -> str:
    """Text of a page.

    Parameters
    ----------
    title : str
        Of the page.
    facts : mapping of str to str
        Provenance as name and value; any text is safe.
    body : iterable of str
        Sections, as HTML.
    footer : str
        Definitions, as HTML.
    style : str
        CSS that only this report needs, after the common one.
    """
    head = f"<header><h1>{escape(title)}</h1>{definitions_list(facts.items())}</header>"
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>\n{CSS}{style}</style>\n</head>\n<body>\n<main>\n"
        + "\n".join([head, *body, f"<footer><p>{footer}</p></footer>"])
        + "\n</main>\n</body>\n</html>\n"
    )


def definitions_list(rows: Rows) -> str:
    """Names with their values; nothing where there are none."""
    items = "".join(f"<div><dt>{escape(k)}</dt><dd>{escape(v)}</dd></div>" for k, v in rows)
    return f"<dl>{items}</dl>" if items else ""


def figure(caption: str, svg: str, keys: Key) -> str:
    """Figure with caption and key."""
    key = "".join(f"<span>{swatch(colour, dash)}{escape(name)}</span>" for name, colour, dash in keys)
    return f"<figure><figcaption>{escape(caption)}<span class='key'>{key}</span></figcaption>{svg}</figure>"


def swatch(colour: str, dash: str) -> str:
    """Sample of a line, or of an area where dash is "block"."""
    return f"<i class='{dash}' style='color: {variable(colour)}'></i>"


CSS = """\
:root {
  color-scheme: light dark;
  --paper: #ffffff; --ink: #1b1f24; --muted: #5b6570; --soft: #aab4be;
  --grid: #d8dde2; --shade: #e9edf1; --band: #f5f7f9;
  --blue: #0072b2; --red: #d55e00; --green: #009e73; --pink: #cc79a7; --amber: #e69f00; --sky: #56b4e9;
  --olive: #8a6d00;
}
@media (prefers-color-scheme: dark) {
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
h2 { font-size: 1.3rem; margin: 2.5rem 0 0.75rem; overflow-wrap: anywhere; }
h3 { font-size: 1rem; margin: 1.5rem 0 0.4rem; }
dl { margin: 0; display: grid; grid-template-columns: repeat(auto-fill, minmax(15rem, 1fr)); gap: 0.5rem 1.5rem; }
.columns dl { grid-template-columns: 1fr; }
dt { color: var(--muted); font-size: 0.8rem; }
dd { margin: 0; overflow-wrap: anywhere; }
.cards { display: grid; grid-template-columns: repeat(3, 1fr); gap: 1rem; margin: 0 0 1rem; }
.cards div { background: var(--band); border-top: 3px solid var(--blue); padding: 0.6rem 0.9rem; }
.cards div:nth-child(2) { border-color: var(--red); }
.cards div:nth-child(3) { border-color: var(--green); }
.cards span { display: block; color: var(--muted); font-size: 0.8rem; }
.cards b { font-size: 1.7rem; font-weight: 600; font-variant-numeric: tabular-nums; }
.cards small { font-size: 1rem; font-weight: 400; color: var(--muted); }
.note {
  margin: 0 0 1rem; padding: 0.6rem 0.9rem 0.6rem 1.9rem;
  background: var(--band); border-left: 3px solid var(--amber);
}
p.note { padding-left: 0.9rem; margin-top: 1rem; }
.source { color: var(--muted); margin: -0.5rem 0 1rem; overflow-wrap: anywhere; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; font-size: 0.9rem; }
caption { text-align: left; font-weight: 600; font-size: 1rem; padding-bottom: 0.3rem; }
th, td { padding: 0.28rem 0.5rem; text-align: right; white-space: nowrap; border-bottom: 1px solid var(--grid); }
th[scope=row], .text { text-align: left; white-space: normal; overflow-wrap: anywhere; }
th { font-weight: 500; }
thead th { border-bottom: 0; color: var(--muted); }
thead .units th { border-bottom: 1px solid var(--muted); padding-top: 0; font-weight: 400; font-size: 0.8rem; }
.none { color: var(--muted); }
.sum th, .sum td { border-bottom: 0; border-top: 1px solid var(--muted); }
figure { margin: 1.75rem 0 0; }
figcaption { font-weight: 600; display: flex; flex-wrap: wrap; justify-content: space-between; gap: 0.2rem 1.5rem; }
figure svg { display: block; width: 100%; height: auto; margin-top: 0.4rem; }
.key { font-weight: 400; color: var(--muted); display: flex; flex-wrap: wrap; gap: 0.2rem 1.1rem; font-size: 0.85rem; }
.key span { display: inline-flex; align-items: center; gap: 0.4rem; overflow-wrap: anywhere; }
.key i { width: 1.6rem; height: 0; border-top: 3px solid currentColor; flex: none; }
.key i.dashed { border-top-style: dashed; }
.key i.dotted { border-top-style: dotted; }
.key i.block { height: 0.9rem; border: 1px solid var(--grid); background: currentColor; }
.columns { display: grid; grid-template-columns: repeat(auto-fit, minmax(20rem, 1fr)); gap: 0 2.5rem; }
footer { margin-top: 2.5rem; border-top: 1px solid var(--grid); color: var(--muted); font-size: 0.85rem; }
@media print {
  :root {
    color-scheme: light;
    --paper: #ffffff; --ink: #000000; --muted: #444444; --soft: #aaaaaa;
    --grid: #cccccc; --shade: #e4e4e4; --band: #ffffff;
    --blue: #0072b2; --red: #d55e00; --green: #009e73; --pink: #cc79a7; --amber: #e69f00; --sky: #56b4e9;
    --olive: #8a6d00;
  }
  body { font-size: 8.5pt; line-height: 1.4; }
  main { max-width: none; padding: 0; }
  figure { margin-top: 1rem; }
  figure svg { width: 88%; }
  th, td { padding: 0.15rem 0.4rem; }
  section + section { break-before: page; }
  figure, table, .cards, .columns > div { break-inside: avoid; }
  h2, h3, caption { break-after: avoid; }
}
"""

# After Okabe and Ito, told apart by colour-blind readers; the names are CSS variables of the page.
PALETTE: Final = {
    "#0072b2": "blue",
    "#d55e00": "red",
    "#009e73": "green",
    "#cc79a7": "pink",
    "#e69f00": "amber",
    "#56b4e9": "sky",
    "#8a6d00": "olive",
}
INK, MUTED, GRID, SHADE, SOFT = "#1b1f24", "#5b6570", "#d8dde2", "#e9edf1", "#aab4be"
VARIABLES: Final = {**PALETTE, INK: "ink", MUTED: "muted", GRID: "grid", SHADE: "shade", SOFT: "soft"}
SERIES: Final = tuple(PALETTE)
DASHES: Final = ("solid", "dashed", "dotted")


def variable(colour: str) -> str:
    """CSS variable of a colour of this module."""
    return f"var(--{VARIABLES[colour]})"


LABELS = "th[scope=row] { overflow-wrap: break-word; }\n"
"""Style of the first column of a table: whole words, however narrow the page; the table scrolls."""


def html_table(caption: str, head: Sequence[str], body: Iterable[Sequence[str]], words: Sequence[int] = ()) -> str:
    """Table whose first column names the rows; any text is safe, and the columns of `words` (from 0) are words."""

    def cell(i: int, value: str) -> str:
        if i == 0:
            return f"<th scope='row'>{escape(value)}</th>"
        kind = "text" if i in words else "none" if value.startswith(("<", "not ")) or value == "-" else ""
        style = f" class='{kind}'" if kind else ""
        return f"<td{style}>{escape(value.replace('-', '−') if i not in words else value)}</td>"

    lines = "".join(f"<tr>{''.join(cell(i, v) for i, v in enumerate(row))}</tr>" for row in body)
    names = "".join(
        f"<th scope='col'{' class=text' if i in words else ''}>{escape(name)}</th>" for i, name in enumerate(head)
    )
    return (
        f"<div class='scroll'><table><caption>{escape(caption)}</caption>"
        f"<thead><tr>{names}</tr></thead><tbody>{lines}</tbody></table></div>"
    )
