"""What a scenario is: a motion with a few parameters."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from plumbob.core.errors import ParameterError
from plumbob.core.params import checked, describe, shown
from plumbob.simulation.motion import Motion


@dataclass(frozen=True, kw_only=True)
class Scenario(ABC):
    """A motion to simulate.

    Attributes
    ----------
    rate : float
        Sampling rate that suits it, Hz.

    Raises
    ------
    ParameterError
        If a parameter is outside its domain.
    """

    rate: ClassVar[float] = 100.0

    def __post_init__(self) -> None:
        """Check every parameter's domain."""
        for p in describe(type(self)):
            checked(type(self).__name__.lower(), p, getattr(self, p.name))

    @property
    def told(self) -> str:
        """Name with its parameters, each in its unit."""
        values = (f"{p.name}={shown(p, getattr(self, p.name))}" for p in describe(type(self)))
        return f"{type(self).__name__.lower()} ({', '.join(values)})"

    @property
    def duration(self) -> float:
        """Time that it takes, s."""
        return 60.0

    @abstractmethod
    def motion(self, rng: np.random.Generator, duration: float) -> Motion:
        """Motion over the first `duration` s, with what is left to chance drawn from `rng`."""


def require_whole(name: str, value: float) -> None:
    """Refuse a count that is not a whole number."""
    if value != round(value):
        raise ParameterError(f"{name} must be a whole number, but it is {value:g}.")
