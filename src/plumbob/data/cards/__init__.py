"""Cards: what a calibration and a noise analysis leave behind, and what simulator and filters take up.

A card is a small JSON file with a version, a device, units and a date. It refuses what it was not made for.
"""

from typing import TYPE_CHECKING

from plumbob.core.lazy import lazily
from plumbob.data.cards.file import UNITS

if TYPE_CHECKING:
    from plumbob.data.cards.calibration import CalibrationCard, Mount, Quality, TriadCalibration
    from plumbob.data.cards.noise import NoiseCard, TriadNoise
    from plumbob.data.cards.opened import open_card

__getattr__, __dir__ = lazily(
    __name__,
    {
        "CalibrationCard": "calibration",
        "Mount": "calibration",
        "NoiseCard": "noise",
        "Quality": "calibration",
        "TriadCalibration": "calibration",
        "TriadNoise": "noise",
        "open_card": "opened",
    },
)

__all__ = ["UNITS", "CalibrationCard", "Mount", "NoiseCard", "Quality", "TriadCalibration", "TriadNoise", "open_card"]
