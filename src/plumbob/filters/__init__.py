"""Filters: from sensor data to attitude, one file each, all behind `Filter`."""

from importlib import import_module
from typing import cast

from plumbob.check import said
from plumbob.errors import ParameterError
from plumbob.filters.base import CommonParams, Filter, FilterModule
from plumbob.filters.start import Start

_MODULES = (
    "complementary",
    "ekf7",
    "ekf_quaternion",
    "fuzzy_pi",
    "integrate",
    "integrate_first_order",
    "madgwick",
    "mahony",
    "mekf",
    "tilt_compass",
    "vqf",
)

__all__ = [
    "CommonParams",
    "Filter",
    "FilterModule",
    "Start",
    "claims_covariance",
    "filter_names",
    "load",
    "takes_noise",
]


def filter_names() -> tuple[str, ...]:
    """Names that `Filter` and the command line accept."""
    return _MODULES


def load(name: str) -> FilterModule:
    """Module of a filter.

    Raises
    ------
    ParameterError
        If there is no filter of that name.
    """
    if not isinstance(name, str) or name not in _MODULES:
        raise ParameterError(f"there is no filter {said(name)}; known are {', '.join(_MODULES)}.")
    return cast(FilterModule, import_module(f"plumbob.filters.{name}"))


def claims_covariance(name: str) -> bool:
    """Whether a filter claims a covariance of its attitude."""
    return hasattr(load(name), "COVARIANCE")


def takes_noise(name: str) -> bool:
    """Whether a filter takes parameters from a `NoiseCard`."""
    return hasattr(load(name), "from_noise")
