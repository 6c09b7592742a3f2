"""Batteries: what every filter, decoder, format and page must pass, and what their tests share."""

import os
from typing import Any

from hypothesis import settings


def examples(share: float, **more: Any) -> settings:
    """As many random cases as this share of those that the profile of the run asks for (100, or 1000 in a long run)."""
    return settings(max_examples=max(1, round(share * settings.default.max_examples)), **more)


def jit_disabled() -> bool:
    """Whether kernels run as plain Python in this process, as ``NUMBA_DISABLE_JIT=1`` asks for."""
    return os.environ.get("NUMBA_DISABLE_JIT") == "1"
