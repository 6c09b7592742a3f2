"""Filters: from sensor data to attitude, one file each, all behind `Filter`."""

from plumbob.filters.base import CommonParams, Filter
from plumbob.filters.known import SMOOTHER, FilterModule, estimator_names, filter_names, load, takes_noise
from plumbob.filters.start import Start

__all__ = [
    "SMOOTHER",
    "CommonParams",
    "Filter",
    "FilterModule",
    "Start",
    "estimator_names",
    "filter_names",
    "load",
    "takes_noise",
]
