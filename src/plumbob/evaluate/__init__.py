"""Evaluation: what an attitude is worth against a reference, with every decision on record."""

from typing import TYPE_CHECKING

from plumbob._lazy import lazily
from plumbob.evaluate.align import Alignment
from plumbob.evaluate.associate import Fate, Match, associate
from plumbob.evaluate.consistency import Consistency, claimed_sd
from plumbob.evaluate.evaluation import Evaluation, Settings, evaluate
from plumbob.evaluate.metrics import GIMBAL_GUARD, QUANTITIES, attitude_errors
from plumbob.evaluate.statistics import Stats
from plumbob.evaluate.timeshift import TimeOffset, find_time_offset

if TYPE_CHECKING:
    from plumbob.evaluate.html import write_html

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
    "claimed_sd",
    "evaluate",
    "find_time_offset",
    "write_html",
]
