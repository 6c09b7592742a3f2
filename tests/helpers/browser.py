"""A real browser, Debian's Chromium driven by Playwright, and `plumbob view` for it."""

import json
import re
import shutil
import subprocess
import threading
import urllib.request
from contextlib import contextmanager, suppress
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import pytest

from tests.helpers import until
from tests.helpers.commandline import PLUMBOB

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
FLAGS = ["--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader"]
COLD = 240.0  # the first view compiles kernels, which a busy machine takes minutes for


@contextmanager
def browser():
    """A browser; the test is skipped where there is none."""
    playwright = pytest.importorskip("playwright.sync_api")
    if CHROMIUM is None:
        pytest.skip("there is no Chromium on this machine")
    with playwright.sync_playwright() as driver:
        found = driver.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield found
        found.close()


class View:
    def __init__(self, process, said):
        self.process, self.said = process, said
        self.url = until(self._url, lambda: f"no address: {''.join(said)}", COLD)

    def _url(self):
        return next((found[0] for line in self.said if (found := re.search(r"http://\S+", line))), None)

    @property
    def token(self):
        return parse_qs(urlsplit(self.url).query)["token"][0]

    def get(self, path):
        request = urllib.request.Request(urlsplit(self.url)._replace(path=path, query="").geturl())
        request.add_header("Authorization", f"Bearer {self.token}")
        with urllib.request.urlopen(request, timeout=10) as answer:
            return json.load(answer)

    @property
    def server(self):
        port = urlsplit(self.url).port
        for folder in Path("/proc").iterdir():
            with suppress(OSError):
                words = (folder / "cmdline").read_bytes().split(b"\0") if folder.name.isdigit() else []
                status = (folder / "status").read_text() if b"plumbob.viewer.serve" in words else ""
                if f"PPid:\t{self.process.pid}\n" in status:
                    return int(folder.name)
        raise AssertionError(f"no server of port {port}")


@contextmanager
def viewed(*words, folder):
    """A view of something, which takes commands."""
    said = []
    command = [
        *PLUMBOB, "view", *map(str, words), "--http-port", "0", "--no-open", "--control", "--folder", str(folder),
    ]  # fmt: skip
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        reader = threading.Thread(target=lambda: said.extend(process.stdout))
        reader.start()
        try:
            yield View(process, said)
        finally:
            process.terminate()
            process.wait(20)
            reader.join()
