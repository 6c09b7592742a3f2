"""Pictures of README and docs, taken of the pages themselves in Chromium: ``python website/pictures.py``.

They show the emulated buoy: its live page after half a minute, in light and in dark, and the report
of a recording. Another run catches other moments of the waves, so that the files differ; what they show does not.
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

IMAGES = Path(__file__).parents[1] / "docs" / "images"
SETTLED = 32.0
"""Time after which the charts of half a minute are full, s."""


def main() -> None:
    """Take them all."""
    sys.path.insert(0, str(Path(__file__).parents[1]))
    from playwright.sync_api import Browser, sync_playwright

    from tests.battery.browser import CHROMIUM, FLAGS, viewed
    from tests.battery.commandline import PLUMBOB

    def shoot(browser: Browser, name: str, url: str, width: int, height: int, *, dark: bool = False) -> None:
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
        with viewed("--emulate", "buoy", "--also", "mahony,vqf", folder=folder) as view:
            time.sleep(SETTLED)
            shoot(browser, "live.png", view.url, 1440, 900)
            shoot(browser, "live-dark.png", view.url, 1440, 900, dark=True)
        sea = ("sim", "buoy", "--frame", "NED", "--sensors", "mpu6000+hmc5983", "--unit", "calibrated", "--seed", "1",
               "--duration", "20min", "--out", "sea.parquet")  # fmt: skip
        for words in (sea, ("report", "sea.parquet", "--out", "sea.html")):
            subprocess.run([*PLUMBOB, *words], cwd=folder, check=True, stdout=subprocess.DEVNULL)
        shoot(browser, "report.png", (folder / "sea.html").as_uri(), 1280, 1500)
        browser.close()


if __name__ == "__main__":
    main()
