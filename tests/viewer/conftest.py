"""A real browser on the real page, and a server that runs for all tests of a file."""

from importlib import resources
from pathlib import Path

import pytest

from tests.helpers.browser import browser
from tests.helpers.feeding import hello, serving


@pytest.fixture(scope="module")
def chromium():
    """A browser for the tests of a file; Playwright keeps an event loop going, and no other test could run its own."""
    if not Path(str(resources.files("plumbob") / "web" / "view" / "index.html")).is_file():
        pytest.skip("the page is not built; 'make page' builds it, with Node 20 or newer")
    with browser() as found:
        yield found


@pytest.fixture(scope="module")
def served(request, tmp_path_factory):
    """A server that has got its hello; a file's `OPTIONS` are how it serves."""
    folder = tmp_path_factory.mktemp("view")
    with serving(**getattr(request.module, "OPTIONS", {}), folder=folder) as server:
        server.feed.say("hello", hello())
        yield server
