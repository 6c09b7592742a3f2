"""A real browser on the real page: Debian's Chromium, driven by Playwright."""

import shutil
from importlib import resources
from pathlib import Path

import pytest

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
FLAGS = ["--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader"]


@pytest.fixture(scope="module")
def chromium():
    """A browser for the tests of a module; Playwright's loop runs in this thread as long as it is open."""
    playwright = pytest.importorskip("playwright.sync_api")
    if CHROMIUM is None:
        pytest.skip("there is no Chromium on this machine")
    if not Path(str(resources.files("plumbob") / "web" / "view" / "index.html")).is_file():
        pytest.skip("the page is not built; 'make page' builds it, with Node 20 or newer")
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield browser
        browser.close()
