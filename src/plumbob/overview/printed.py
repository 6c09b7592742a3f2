"""A page as a PDF, printed by Chromium or Chrome without a window."""

import os
import shutil
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from plumbob.core.errors import DecodeError, MissingExtraError, excerpt
from plumbob.core.files import replacing

BROWSERS: Final = (
    "chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "msedge", "microsoft-edge",
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
    "/Applications/Chromium.app/Contents/MacOS/Chromium",
    "C:/Program Files/Google/Chrome/Application/chrome.exe",
    "C:/Program Files (x86)/Microsoft/Edge/Application/msedge.exe",
)  # fmt: skip
"""Programs that print a page, the first one found is taken."""

_PATIENCE: Final = 180.0  # s


def browser() -> str:
    """Path of a program that prints pages.

    Raises
    ------
    MissingExtraError
        If none is installed.
    """
    program = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    if program is None:
        raise MissingExtraError(
            "a PDF is printed by Chromium or Chrome, and none was found. Install one, as 'apt install chromium' does, "
            "or write the page with --out and print it from your browser."
        )
    return program


def print_pdf(page: str, path: Path, *, overwrite: bool = False) -> Path:
    """Print a page to a file, which is there as a whole or not at all.

    Raises
    ------
    MissingExtraError
        If no browser is installed.
    DecodeError
        If the browser fails.
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
