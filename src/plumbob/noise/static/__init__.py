"""Is a record static, and fit for a noise analysis? Findings in words, and the longest still stretch."""

from plumbob.noise.static.artefacts import find_step
from plumbob.noise.static.judge import FEWEST_SAMPLES, StaticCheck, judge
from plumbob.noise.static.report import Remark, StaticReport, bridged

__all__ = ["FEWEST_SAMPLES", "Remark", "StaticCheck", "StaticReport", "bridged", "find_step", "judge"]
