"""Noise: how much a sensor at rest wanders, by averaging time, and what of it belongs into a data sheet."""

from plumbob.noise.analysis import Averages, analyse, analyse_averages, with_curve
from plumbob.noise.compare import ChannelComparison, DeviationComparison, compare
from plumbob.noise.curve import ONE_SIGMA, Curve, curve, curves, edf, identify, interval, make_curve, skew_edf
from plumbob.noise.factors import KINDS, Averager, deviation, every_adev, log_factors, stream_factors
from plumbob.noise.findings import Analysis, Coefficient, Deviation, Estimates, GaussMarkov, Mask, Sinusoid
from plumbob.noise.stream import AllanStream, StreamResult
from plumbob.noise.terms import DATASHEET, DEVIATION, TERMS

__all__ = [
    "DATASHEET",
    "DEVIATION",
    "KINDS",
    "ONE_SIGMA",
    "TERMS",
    "AllanStream",
    "Analysis",
    "Averager",
    "Averages",
    "ChannelComparison",
    "Coefficient",
    "Curve",
    "Deviation",
    "DeviationComparison",
    "Estimates",
    "GaussMarkov",
    "Mask",
    "Sinusoid",
    "StreamResult",
    "analyse",
    "analyse_averages",
    "compare",
    "curve",
    "curves",
    "deviation",
    "edf",
    "every_adev",
    "identify",
    "interval",
    "log_factors",
    "make_curve",
    "skew_edf",
    "stream_factors",
    "with_curve",
]
