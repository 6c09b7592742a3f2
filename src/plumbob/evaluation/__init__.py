"""Evaluation: what an attitude is worth against a reference, with every decision on record."""

from typing import TYPE_CHECKING

from plumbob.core.lazy import lazily
from plumbob.evaluation.align import Alignment, TimeOffset, find_time_offset
from plumbob.evaluation.associate import Fate, Match, associate
from plumbob.evaluation.evaluation import Evaluation, Settings, evaluate
from plumbob.evaluation.metrics import GIMBAL_GUARD, QUANTITIES, Consistency, Stats, attitude_errors

if TYPE_CHECKING:
    from plumbob.evaluation.html import write_html

__getattr__, __dir__ = lazily(__name__, {"write_html": "html"})

__all__ = [
    "GIMBAL_GUARD",
    "QUANTITIES",
    "Alignment",
    "Consistency",
    "Evaluation",
    "Fate",
    "Match",
    "Settings",
    "Stats",
    "TimeOffset",
    "associate",
    "attitude_errors",
    "evaluate",
    "find_time_offset",
    "write_html",
]
