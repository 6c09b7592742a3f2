"""Which filters there are, and what each takes and claims."""

from importlib import import_module
from typing import TYPE_CHECKING, cast

from plumbob.core.check import said
from plumbob.core.errors import ParameterError

if TYPE_CHECKING:
    from plumbob.filters.base import FilterModule

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


def filter_names() -> tuple[str, ...]:
    """Names that `Filter` and the command line accept."""
    return _MODULES


def load(name: str) -> "FilterModule":
    """Module of a filter.

    Raises
    ------
    ParameterError
        If there is no filter of that name.
    """
    if not isinstance(name, str) or name not in _MODULES:
        raise ParameterError(f"there is no filter {said(name)}; known are {', '.join(_MODULES)}.")
    return cast("FilterModule", import_module(f"plumbob.filters.{name}"))


def claims_covariance(name: str) -> bool:
    """Whether a filter claims a covariance of its attitude."""
    return hasattr(load(name), "COVARIANCE")


def takes_noise(name: str) -> bool:
    """Whether a filter takes parameters from a `NoiseCard`."""
    return hasattr(load(name), "from_noise")
