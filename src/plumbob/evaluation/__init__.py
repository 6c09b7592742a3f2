"""Evaluation: what an attitude is worth against a reference, with every decision on record."""

from plumbob.evaluation.align import Alignment, Fate, Match, TimeOffset, associate, find_time_offset
from plumbob.evaluation.evaluation import Evaluation, Settings, evaluate
from plumbob.evaluation.metrics import GIMBAL_GUARD, QUANTITIES, Consistency, Stats, attitude_errors
from plumbob.evaluation.report import comparison

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
    "comparison",
    "evaluate",
    "find_time_offset",
]
