"""Open a card of either kind: the file says which it is."""

import json
from pathlib import Path

from plumbob.core.errors import DecodeError
from plumbob.core.files import text_of
from plumbob.data.cards.calibration import CalibrationCard
from plumbob.data.cards.noise import NoiseCard


def open_card(path: str | Path) -> CalibrationCard | NoiseCard:
    """Read a calibration card or a noise card.

    Raises
    ------
    DecodeError
        If the file is neither, or of a newer version.
    """
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
    raise DecodeError(f"{path} is not a card: its 'kind' must be '{CalibrationCard.KIND}' or '{NoiseCard.KIND}'.")
