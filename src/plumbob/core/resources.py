"""What a wheel carries beside Python: the documentation, as a checkout has it, and the pages for a browser."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from plumbob.core.errors import MissingExtraError, PlumbobError, unknown_name

_PACKAGE = Path(__file__).parents[1]
WEB: Final = _PACKAGE / "web"  # what Vite makes of ``web/`` in the source


def packaged(name: str) -> str:
    """Text of a file that lies in the package, by its path there."""
    return (_PACKAGE / name).read_text(encoding="utf-8")


def docs_folder() -> Path:
    """Folder of the pages and of the bibliography."""
    for folder in (_PACKAGE / "docs", _PACKAGE.parents[1] / "docs"):
        if (folder / "references.bib").is_file():
            return folder
    raise PlumbobError(f"The documentation is not installed: {_PACKAGE / 'docs'} is missing. Install plumbob again.")


def guide(page: str) -> str:
    """Where a page lies, for a message: in an installed package, or in the checkout."""
    installed = _PACKAGE / "docs" / page
    return str(installed) if installed.is_file() else f"docs/{page}"


def docs(page: str | None = None) -> str:
    """Text of a page of the documentation, or a list of all pages.

    Parameters
    ----------
    page : str, optional
        Its name, as in a message or short: ``"docs/time.md"``, ``"time"``; or a verb of the command line, as "allan".

    Returns
    -------
    str
        The page as Markdown; without `page`, a line with the name and title of each.

    Raises
    ------
    ParameterError
        If there is no such page.

    Examples
    --------
    >>> docs("conventions").splitlines()[0]
    '# Conventions'
    """
    if page is None:
        return "".join(f"{name:16} {_title(path)}\n" for name, path in _pages().items())
    return page_path(page).read_text(encoding="utf-8")


def page_path(page: str) -> Path:
    """File of a page, by a name as `docs` takes it."""
    pages = _pages()
    name = Path(page).name.removesuffix(".md") if isinstance(page, str) else ""
    name = name if name in pages else _page_of_verb(name, pages)
    if name not in pages:
        raise unknown_name("page", page, pages)
    return pages[name]


def _pages() -> dict[str, Path]:
    return {path.stem: path for path in sorted(docs_folder().glob("*.md"), key=lambda path: path.stem)}


def _title(page: Path) -> str:
    with page.open(encoding="utf-8") as lines:
        return next(lines).strip("# \n")


def _page_of_verb(verb: str, pages: Mapping[str, Path]) -> str:
    """Page that the reference of the command line names at a verb; empty where there is none."""
    text = pages["command-line"].read_text(encoding="utf-8") if "command-line" in pages else ""
    section = re.search(rf"^#+ {re.escape(verb)}\n(?:(?!^#).*\n)*?documentation: \[([\w-]+)\.md\]", text, re.M)
    return section[1] if section and verb else ""


def asset(name: str) -> Path:
    """Path of a file of the built pages, such as ``view/index.html`` or ``report.js``."""
    path = WEB / name
    if not path.is_file():
        raise MissingExtraError(
            f"the pages of Plumbob are not built here: {name} is missing. A wheel carries them; in a checkout, run "
            "'make page', which needs Node 20 or newer."
        )
    return path
