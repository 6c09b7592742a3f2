"""The fuzzy regulator by its definition: all sets, all rules, and the weighted mean of what they conclude."""

import numpy as np

from plumbob.filters.fuzzy_pi import conclusion

PAPER = (0.2, 3.0, 0.02)
"""Near, far in deg/s and ki of the table that reproduces the paper: c = 0.3, s = 2c/3."""
SUM = (3.0, 9.0, 3.0)
NUMBERS = range(-3, 4)


def triangle(value, centre, half):
    return np.maximum(0.0, 1.0 - np.abs(value - centre) / half)


def memberships(error, integral):
    """All seven grades of E and all seven of I, from the definition of the sets."""
    k = np.arange(-3, 4)
    return triangle(np.clip(3.0 * error, -6.0, 6.0), 2.0 * k, 2.0), triangle(np.clip(integral, -3.0, 3.0), 1.0 * k, 1.0)


def by_all_rules(error, integral, near, far, ki):
    """Product of the grades as strength of each of the 49 rules, weighted mean of their conclusions."""
    strength = np.outer(*memberships(error, integral))
    table = np.array([[conclusion(e, i, near, far, ki) for i in NUMBERS] for e in NUMBERS])
    return np.sum(strength * table) / np.sum(strength)
