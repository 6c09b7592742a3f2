"""A report as a page: one HTML file with figures that opens anywhere, without network.

Templates beside this file say how it looks. No script is in it but those that its policy names by their hash.
"""

import json
import re
from base64 import b64encode
from collections.abc import Sequence
from functools import partial
from hashlib import sha256
from itertools import count
from pathlib import Path
from typing import Any, Final

from plumbob.core import check
from plumbob.core.text import visible
from plumbob.reporting.content import LANGUAGES, said, scene_data
from plumbob.reporting.drawing import svg, variable

_SHORT_CELL, _LONG_CELL = 16, 60  # letters of a cell of words
_MINUS = re.compile(r"-(?=[\d.∞]|$)")  # of a number, or alone
_POLICY: Final = "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'"
_TEMPLATES: Final = Path(__file__).parent


def asset_text(name: str) -> str:
    """Text of a file beside this one: a style, or a script."""
    return (_TEMPLATES / name).read_text(encoding="utf-8")


CSS: Final = asset_text("page.css")


def page(report: Any, *, lang: str = "en") -> str:
    """HTML of a `Report`, which this file knows by its template alone; any text in it is safe."""
    moves = report.moves
    style, scripts = (CSS + asset_text("scene.css"), [asset_text("scene.js")]) if moves else (CSS, [])
    return render("page.html.j2", lang, style, scripts, title=report.title, names="", report=report)


def part_links(report: Any) -> list[tuple[str, str]]:
    """Links to the parts of the page of a `Report`, for its head."""
    return [(part.title, f"#part-{i}") for i, part in enumerate(report.parts, 1)]


def render(template: str, lang: str, style: str, scripts: Sequence[str], **content: Any) -> str:
    """HTML of a page by a template beside this file.

    Parameters
    ----------
    template : str
        Name of its file.
    lang : str
        Of the labels.
    style : str
        Its CSS.
    scripts : sequence of str
        Those that may run; the policy of the page names each by its hash, and nothing else may.
    **content
        What the template takes; every text of it is escaped.
    """
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from markupsafe import Markup

    check.one_of("lang", lang, LANGUAGES)
    number = count()
    jinja = Environment(
        loader=FileSystemLoader(_TEMPLATES), autoescape=True, undefined=StrictUndefined, keep_trailing_newline=True
    )
    jinja.filters |= {
        "say": lambda text: visible(said(text, lang), "\n"),
        "minus": partial(_MINUS.sub, "−"),
        "cell_class": _cell_class,
        "variable": variable,
        "svg": lambda figure: Markup(svg(figure, lang=lang, salt=f"{next(number)}")),
        "scene_data": partial(scene_data, lang=lang),
        "json": lambda value: Markup(_json_within(value)),
    }
    hashes = [b64encode(sha256(script.encode()).digest()).decode() for script in scripts]
    policy = "; ".join([_POLICY, *(f"script-src 'sha256-{digest}'" for digest in hashes)])
    return jinja.get_template(template).render(lang=lang, style=style, scripts=scripts, policy=policy, **content)


def _json_within(value: Any) -> str:
    """JSON that stands within a page."""
    text = json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def _cell_class(text: str, is_words: bool) -> str:
    """Class of a cell: long words have a column that is wide enough to read, and what is not known is pale."""
    if not is_words:
        return "none" if text.startswith(("<", "not ", "未")) or text == "-" else ""
    letters = len(text.encode("gb18030", "replace"))  # a Chinese sign counts as two
    return "text long" if letters > _LONG_CELL else "text" if letters > _SHORT_CELL else "text short"
