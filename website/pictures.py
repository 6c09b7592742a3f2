"""Pictures of README and docs, taken of the pages themselves in Chromium: ``python website/pictures.py``.

They show the emulated buoy: its live page after half a minute, in light and in dark, and the report of a recording;
and figures of the five papers, from the folder that ``make papers`` makes (``python website/pictures.py papers`` takes
these alone). Another run catches other moments of the waves, so that the files differ; what they show does not.
"""

import subprocess
import sys
import tempfile
import time
from base64 import b64encode
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from playwright.sync_api import Browser

IMAGES = Path(__file__).parents[1] / "docs" / "images"
SETTLED = 32.0
"""Time after which the charts of half a minute are full, s."""


PAPERS = {"fin": "Figure 4", "buoy": "Figure 7", "trackball": "Figure 4", "arm": "Figure 9", "rod": "Figure 6 a and b"}
"""Figures in the picture of the papers, by how their captions begin; the live page comes last."""


def papers(browser: "Browser") -> None:
    """Picture of five figures and the live page, two in a row."""
    folder = IMAGES.parents[1] / "reproduced"
    page = browser.new_page(viewport={"width": 760, "height": 1000}, device_scale_factor=1.5)
    shots = {}
    for name, caption in PAPERS.items():
        page.goto((folder / f"{name}.html").as_uri())
        figure = page.locator("figure").filter(has=page.locator("figcaption", has_text=caption)).first
        shots[name] = f"data:image/png;base64,{b64encode(figure.screenshot()).decode()}"
    live = f"data:image/png;base64,{b64encode((IMAGES / 'live.png').read_bytes()).decode()}"
    cells = "".join(f"<div><h2>{name}</h2><img src='{shot}'></div>" for name, shot in (*shots.items(), ("live", live)))
    page.goto("about:blank")  # a report's page lets no picture in
    page.set_viewport_size({"width": 1240, "height": 900})
    page.set_content(
        "<style>body{margin:12px;display:grid;grid-template-columns:1fr 1fr;gap:12px 24px;font:14px sans-serif}"
        f"h2{{font-size:15px;margin:4px 0;color:#5b6570}}img{{display:block;width:100%}}</style>{cells}"
    )
    page.screenshot(path=IMAGES / "papers.png", full_page=True)
    page.close()
    print(IMAGES / "papers.png")


def main(*which: str) -> None:
    """Take them all."""
    sys.path.insert(0, str(Path(__file__).parents[1]))
    from playwright.sync_api import sync_playwright

    from tests.helpers.browser import CHROMIUM, FLAGS, viewed
    from tests.helpers.commandline import PLUMBOB

    def shoot(browser: "Browser", name: str, url: str, width: int, height: int, *, dark: bool = False) -> None:
        page = browser.new_page(viewport={"width": width, "height": height}, color_scheme="dark" if dark else "light")
        page.goto(url)
        page.wait_for_timeout(4000)
        page.locator(".panel-scene select").first.select_option("buoy") if "token" in url else None
        page.wait_for_timeout(1500)
        page.screenshot(path=IMAGES / name)
        page.close()
        print(IMAGES / name)

    with tempfile.TemporaryDirectory() as text, sync_playwright() as driver:
        folder = Path(text)
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        if "papers" in which:
            papers(browser)
            return
        with viewed("--emulate", "buoy", "--also", "mahony,vqf", folder=folder) as view:
            time.sleep(SETTLED)
            shoot(browser, "live.png", view.url, 1440, 900)
            shoot(browser, "live-dark.png", view.url, 1440, 900, dark=True)
        sea = ("sim", "buoy", "--frame", "NED", "--sensors", "mpu6000+hmc5983", "--unit", "calibrated", "--seed", "1",
               "--duration", "20min", "--out", "sea.parquet")  # fmt: skip
        for words in (sea, ("report", "sea.parquet", "--out", "sea.html")):
            subprocess.run([*PLUMBOB, *words], cwd=folder, check=True, stdout=subprocess.DEVNULL)
        shoot(browser, "report.png", (folder / "sea.html").as_uri(), 1280, 1500)
        papers(browser)
        browser.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
