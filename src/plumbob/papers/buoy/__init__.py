"""Drifting buoy [Yu2018]: boot, calibration, static test, slide and sea; one unit through bytes, and many beside."""

from plumbob.papers.buoy.items import ITEMS
from plumbob.papers.buoy.run import run

__all__ = ["ITEMS", "run"]
