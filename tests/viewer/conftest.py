"""A real browser on the real page."""

from importlib import resources
from pathlib import Path

import pytest

from tests.helpers.browser import browser


@pytest.fixture(scope="module")
def chromium():
    """A browser for the tests of a file; Playwright keeps an event loop going, and no other test could run its own."""
    if not Path(str(resources.files("plumbob") / "web" / "view" / "index.html")).is_file():
        pytest.skip("the page is not built; 'make page' builds it, with Node 20 or newer")
    with browser() as found:
        yield found
