"""The parts of a page that every report has; whatever text comes in here is escaped."""

from collections.abc import Iterable, Mapping
from html import escape

from plumbob.page.palette import variable
from plumbob.page.stylesheet import CSS

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
