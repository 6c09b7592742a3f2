"""Tables of a page."""

from collections.abc import Iterable, Sequence
from html import escape

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
