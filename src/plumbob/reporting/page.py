"""A report as a page: one HTML file with figures that opens anywhere, without network.

Templates beside this file say how it looks. No script is in it but those that its policy names by their hash.
"""

import json
import os
import re
import shutil
import subprocess
from base64 import b64encode
from collections.abc import Sequence
from functools import partial
from hashlib import sha256
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from plumbob.core import check
from plumbob.core.errors import DecodeError, MissingExtraError, excerpt
from plumbob.core.files import replacing
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
    """HTML of a page by a template beside this file, which takes `content` and escapes every text of it.

    The policy of the page names each of the scripts, which may run, by its hash; nothing else may.
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
        "json": lambda value: Markup(  # that stands within a page
            json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
            .replace("<", "\\u003c")
            .replace("\u2028", "\\u2028")
            .replace("\u2029", "\\u2029")
        ),
    }
    hashes = [b64encode(sha256(script.encode()).digest()).decode() for script in scripts]
    policy = "; ".join([_POLICY, *(f"script-src 'sha256-{digest}'" for digest in hashes)])
    return jinja.get_template(template).render(lang=lang, style=style, scripts=scripts, policy=policy, **content)


def _cell_class(text: str, is_words: bool) -> str:
    """Class of a cell: long words have a column that is wide enough to read, and what is not known is pale."""
    if not is_words:
        return "none" if text.startswith(("<", "not ", "未")) or text == "-" else ""
    letters = len(text.encode("gb18030", "replace"))  # a Chinese sign counts as two
    return "text long" if letters > _LONG_CELL else "text" if letters > _SHORT_CELL else "text short"


BROWSERS: Final = (  # programs that print a page, the first one found is taken
    "chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "msedge", "microsoft-edge",
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
    "/Applications/Chromium.app/Contents/MacOS/Chromium",
    "C:/Program Files/Google/Chrome/Application/chrome.exe",
    "C:/Program Files (x86)/Microsoft/Edge/Application/msedge.exe",
)  # fmt: skip

_PATIENCE: Final = 180.0  # s


def browser() -> str:
    """Path of a program that prints pages."""
    program = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    if program is None:
        raise MissingExtraError(
            "a PDF is printed by Chromium or Chrome, and neither is installed. Install one, as 'apt install chromium' "
            "does, or write the page with --out and print it from your browser."
        )
    return program


def print_pdf(page: str, path: Path, *, overwrite: bool = False) -> Path:
    """Print a page to a file, which is there as a whole or not at all.

    MissingExtraError if no browser is installed, DecodeError if it fails.
    """
    program = browser()
    with TemporaryDirectory(prefix="plumbob-") as folder, replacing(path, overwrite=overwrite) as temporary:
        html, made = Path(folder) / "page.html", Path(folder) / "page.pdf"
        html.write_text(page, encoding="utf-8")
        words = [program, "--headless", "--disable-gpu", "--disable-extensions", f"--user-data-dir={folder}/profile",
                 "--no-first-run", "--no-pdf-header-footer", "--virtual-time-budget=20000",
                 f"--print-to-pdf={made}"]  # fmt: skip
        if hasattr(os, "geteuid") and os.geteuid() == 0:
            words.append("--no-sandbox")  # Chromium refuses its sandbox to the superuser
        try:
            done = subprocess.run(
                [*words, html.as_uri()],
                capture_output=True,
                text=True,
                errors="replace",
                timeout=_PATIENCE,
                check=False,
            )
        except subprocess.TimeoutExpired as error:
            raise DecodeError(
                f"{program} did not print the page within {_PATIENCE:g} s. Write the page with --out instead."
            ) from error
        if not made.is_file():
            raise DecodeError(f"{program} printed nothing ({excerpt(done.stderr.strip() or 'without a word', 160)}).")
        shutil.copyfile(made, temporary)
    return path
