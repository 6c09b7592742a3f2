"""Cards: what a calibration and a noise analysis leave behind, and what simulator and filters take up.

A card is a small JSON file with a version, a device, units and a date. It refuses what it was not made for.
"""

import json
from pathlib import Path
from typing import TYPE_CHECKING

from plumbob.core import lazily
from plumbob.core.errors import DecodeError
from plumbob.core.files import text_of
from plumbob.data.sample import UNITS

if TYPE_CHECKING:
    from plumbob.data.cards.calibration import CalibrationCard, Mount, Quality, TriadCalibration
    from plumbob.data.cards.noise import NoiseCard, TriadNoise

__getattr__, __dir__ = lazily(
    __name__,
    {
        "CalibrationCard": "calibration",
        "Mount": "calibration",
        "NoiseCard": "noise",
        "Quality": "calibration",
        "TriadCalibration": "calibration",
        "TriadNoise": "noise",
    },
)

__all__ = ["UNITS", "CalibrationCard", "Mount", "NoiseCard", "Quality", "TriadCalibration", "TriadNoise", "open_card"]


def open_card(path: str | Path) -> "CalibrationCard | NoiseCard":
    """Read a calibration card or a noise card.

    Raises
    ------
    DecodeError
        If the file is neither, or of a newer version.
    """
    from plumbob.data.cards.calibration import CalibrationCard
    from plumbob.data.cards.noise import NoiseCard

    text = text_of(path)
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise DecodeError(f"{path} is not a card: {error}.") from error
    kind = content.get("kind") if isinstance(content, dict) else None
    for cls in (CalibrationCard, NoiseCard):
        if kind == cls.KIND:
            card: CalibrationCard | NoiseCard = cls.from_text(text, str(path))
            return card
    kinds = f"'{CalibrationCard.KIND}' or '{NoiseCard.KIND}'"
    raise DecodeError(
        f"{path} is not a card: its 'kind' must be {kinds}; a log is an array of objects with a sample each, and "
        "'plumbob profile' describes it."
    )
