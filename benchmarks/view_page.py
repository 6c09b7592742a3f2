"""The live page in Chromium on the emulated buoy at 1 kHz: frames, first paint, size, and what the server costs.

Run with ``python -m benchmarks.view_page``; it takes about a minute and stays on this machine's loopback. Four further
clients read beside the page. Rendering is software's, on this machine's cores: frames compare, a user's GPU gives more.
"""

import argparse
import gzip
import subprocess
import sys
import tempfile
import threading
import time
from importlib import resources
from pathlib import Path

from benchmarks.view_load import used
from tests.helpers import until
from tests.helpers.browser import CHROMIUM, FLAGS, viewed
from tests.helpers.commandline import PLUMBOB

COUNT_FRAMES = """seconds => new Promise(done => {
  let frames = 0, longest = 0, before = performance.now();
  const start = before;
  const next = now => {
    frames++; longest = Math.max(longest, now - before); before = now;
    now - start < 1000 * seconds ? requestAnimationFrame(next) : done([frames / seconds, longest]);
  };
  requestAnimationFrame(next);
})"""
SIZES = (("desktop", 1440, 900), ("phone", 390, 844))


def size() -> tuple[float, float]:
    """Built page in kB: as it is, and compressed."""
    files = [path for path in (Path(str(resources.files("plumbob"))) / "web" / "view").rglob("*") if path.is_file()]
    return sum(f.stat().st_size for f in files) / 1e3, sum(len(gzip.compress(f.read_bytes(), 9)) for f in files) / 1e3


def reading(url: str, stop: threading.Event, got: list[int]) -> None:
    """A client that reads everything."""
    from websockets.sync.client import connect

    with connect(url.replace("http", "ws", 1).replace("/?", "/ws?"), max_size=None) as line:
        while not stop.is_set():
            got[0] += len(line.recv(timeout=5))


def measured(seconds: float, folder: Path) -> None:
    """Run it all, and print."""
    from playwright.sync_api import sync_playwright

    link, stop, got = folder / "port", threading.Event(), [0]
    rig = [*PLUMBOB, "emulate", "buoy", "--rate", "1000Hz", "--unit", "calibrated", "--link", str(link)]
    with subprocess.Popen(rig, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as emulated:
        until(link.exists, "no rig")
        line = ("--port", link, "--format", "buoy", "--frame", "NED", "--filter", "mekf", "--also", "mahony,vqf")
        try:
            with viewed(*line, folder=folder) as view, sync_playwright() as driver:
                clients = [threading.Thread(target=reading, args=(view.url, stop, got), daemon=True) for _ in range(4)]
                for client in clients:
                    client.start()
                browser = driver.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
                for name, width, height in SIZES:
                    page = browser.new_page(viewport={"width": width, "height": height})
                    page.goto(view.url)
                    page.wait_for_selector('html[data-connection="connected"]')
                    paint = page.evaluate("performance.getEntriesByName('first-contentful-paint')[0].startTime")
                    page.wait_for_timeout(3000)
                    before, started = [used(pid)[0] for pid in (view.server, view.process.pid)], time.monotonic()
                    frames, longest = page.evaluate(COUNT_FRAMES, seconds)
                    wall = time.monotonic() - started
                    cost = [100.0 * (used(pid)[0] - b) / wall
                            for pid, b in zip((view.server, view.process.pid), before, strict=True)]  # fmt: skip
                    print(
                        f"{name:8} first paint {paint:4.0f} ms   {frames:4.1f} frames/s, longest {longest:3.0f} ms   "
                        f"server {cost[0]:4.1f} % of a core, reader {cost[1]:4.1f} %   {used(view.server)[1]:.0f} MiB"
                    )
                    page.close()
                stop.set()
                link_ = view.get("/api/state")["link"]
                print(f"samples {link_['samples']}, lost {link_['lost']}, skipped {link_['skipped']}")
                browser.close()
        finally:
            emulated.terminate()


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=10.0)
    options = parser.parse_args()
    whole, compressed = size()
    print(f"built page {whole:.0f} kB, compressed {compressed:.0f} kB")
    if CHROMIUM is None:
        sys.exit("there is no Chromium on this machine.")
    with tempfile.TemporaryDirectory() as folder:
        measured(options.seconds, Path(folder))


if __name__ == "__main__":
    main()
