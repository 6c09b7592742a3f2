"""Noise: how much a sensor at rest wanders, by averaging time, and what of it belongs into a data sheet."""

from plumbob.noise.analysis import analyse
from plumbob.noise.compare import DeviationComparison, compare
from plumbob.noise.curve import Curve, curve, curves, edf, interval
from plumbob.noise.factors import KINDS, Averager, deviation, every_adev, log_factors, stream_factors
from plumbob.noise.findings import Analysis, Coefficient
from plumbob.noise.stream import AllanStream

__all__ = [
    "KINDS",
    "AllanStream",
    "Analysis",
    "Averager",
    "Coefficient",
    "Curve",
    "DeviationComparison",
    "analyse",
    "compare",
    "curve",
    "curves",
    "deviation",
    "edf",
    "every_adev",
    "interval",
    "log_factors",
    "stream_factors",
]
