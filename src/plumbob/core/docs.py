"""Pages of the documentation, which an installed package has inside and a checkout beside it."""

from pathlib import Path

from plumbob.core.errors import PlumbobError

_PACKAGE = Path(__file__).parents[1]


def docs_folder() -> Path:
    """Folder of the pages and of the bibliography.

    Raises
    ------
    PlumbobError
        If there is none.
    """
    for folder in (_PACKAGE / "docs", _PACKAGE.parents[1] / "docs"):
        if (folder / "references.bib").is_file():
            return folder
    raise PlumbobError(f"The documentation is not installed: {_PACKAGE / 'docs'} is missing. Install plumbob again.")


def guide(page: str) -> str:
    """Where a page lies, for a message: in an installed package, or in the checkout."""
    installed = _PACKAGE / "docs" / page
    return str(installed) if installed.is_file() else f"docs/{page}"
