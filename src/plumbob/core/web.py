"""The page's files, which Vite makes of ``web/`` in the source and a wheel carries."""

from importlib import resources
from pathlib import Path
from typing import Final

from plumbob.core.errors import MissingExtraError

FOLDER: Final = "web"


def asset(name: str) -> Path:
    """Path of a file of the built pages, such as ``view/index.html`` or ``report.js``.

    Raises
    ------
    MissingExtraError
        If the pages were not built.
    """
    path = Path(str(resources.files("plumbob"))) / FOLDER / name
    if not path.is_file():
        raise MissingExtraError(
            f"the pages of Plumbob are not built here: {name} is missing. A wheel carries them; in a checkout, run "
            "'make page', which needs Node 20 or newer."
        )
    return path
