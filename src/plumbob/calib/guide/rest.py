"""Guide of a gyroscope's capture at rest: until it has lain untouched for long enough."""

from typing import Final

from plumbob.calib.guide.guide import Guide, Progress
from plumbob.calib.guide.stream_blocks import Block

LONG_ENOUGH: Final = 20.0
"""Rest in one piece that is asked for, s."""

_FIRST: Final = 2.0


class RestGuide(Guide):
    """Asks for the unit to be left alone."""

    triad = "gyr"

    def __init__(self) -> None:
        super().__init__()
        self._was_lying = False

    def progress(self) -> Progress:
        """State after the last whole block."""
        lasting = min(self._rest.lasting, LONG_ENOUGH)
        done = self._done or lasting >= LONG_ENOUGH
        words = f"leave the unit untouched: {lasting:.1f} of {LONG_ENOUGH:.0f} s"
        return Progress(
            elapsed=self._now,
            filled=None,
            still_for=self._rest.lasting,
            next_step="done" if done else words,
            share=1.0 if done else lasting / LONG_ENOUGH,
            warnings=self._warnings,
            done=done,
        )

    def _look(self, block: Block) -> None:
        lying = self._rest.lasting >= _FIRST
        if lying != self._was_lying:
            self._say("at rest" if lying else "touched: the rest starts anew")
        self._was_lying = lying
