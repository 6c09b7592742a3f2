"""plumbob docs as a user meets it."""

import os
import sys
from pathlib import Path

import pytest

import plumbob
from tests.helpers import commandline

DOCS = Path(__file__).parents[2] / "docs"
TIME = (DOCS / "time.md").read_text(encoding="utf-8")


def test_a_page_is_printed_by_the_name_that_a_message_gives_and_else_all_are_listed():
    for name in ("time", "time.md", "docs/time.md", str(DOCS / "time.md")):
        assert commandline.ok("docs", name).stdout == plumbob.docs(name) == TIME
    assert plumbob.docs("allan") == plumbob.docs("noise")  # a verb leads to its page
    lines = commandline.ok("docs").stdout.splitlines()
    assert lines == plumbob.docs().splitlines()
    assert [line.split()[0] for line in lines] == sorted(page.stem for page in DOCS.glob("*.md"))


@pytest.mark.skipif(os.name != "posix", reason="the browser is a shell script")
def test_open_gives_the_page_to_the_browser(tmp_path):
    """The browser is a script that writes down what it was given."""
    browser = tmp_path / "browser"
    browser.write_text(f'#!/bin/sh\necho "$1" > {tmp_path}/seen\n')
    browser.chmod(0o755)
    for words, page in ((("time",), "time.md"), ((), "start.md")):
        done = commandline.start("docs", *words, "--open", BROWSER=str(browser))
        assert done.returncode == 0, done.stderr
        assert (tmp_path / "seen").read_text().strip() == (DOCS / page).as_uri()


@pytest.mark.skipif(sys.platform != "linux", reason="other systems open a browser in ways of their own")
def test_without_a_browser_the_error_says_where_the_page_is(tmp_path):
    done = commandline.start("docs", "time", "--open", BROWSER="", PATH=str(tmp_path), DISPLAY="", WAYLAND_DISPLAY="")
    assert done.returncode == 1
    assert done.stderr.strip() == f"plumbob docs: No browser could be opened. The page is {DOCS / 'time.md'}."
