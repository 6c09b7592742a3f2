"""The five papers, each run whole: from emulated bytes to its tables and figures.

`reproduce` runs them; each paper has a module of its own whose ``run`` makes its page and its outcomes: what the paper
prints, what its method gives here, what Plumbob gives at its best, and the bar that is to be met.
"""

from typing import TYPE_CHECKING

from plumbob.core.lazy import lazily

if TYPE_CHECKING:
    from plumbob.papers.outcome import Outcome, Paper, PaperItem
    from plumbob.papers.reproduce import NAMES, Reproduction, reproduce

__getattr__, __dir__ = lazily(
    __name__,
    {
        "NAMES": "reproduce",
        "PaperItem": "outcome",
        "Outcome": "outcome",
        "Paper": "outcome",
        "Reproduction": "reproduce",
        "reproduce": "reproduce",
    },
)

__all__ = ["NAMES", "Outcome", "Paper", "PaperItem", "Reproduction", "reproduce"]
