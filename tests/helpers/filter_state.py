"""What the kernels of a filter read and write, by the public door: its saved state, and the layout of both arrays."""

import json

import numpy as np

from plumbob import Filter
from plumbob.filters import load
from plumbob.filters.layout import MAX_GAP, NORTH_X, NORTH_Y, OWN, OWN_C, UP, USE_MAG


def state_of(f):
    """All numbers that evolve."""
    return np.array(f.save()["state"])


def fresh_state(name):
    """A state of zeros, as large as that of a filter."""
    return np.zeros(OWN + load(name).STATE)


def coefficients_of(f):
    """What a kernel reads of a filter without a declination."""
    own = load(f.name).coefficients(f.params)
    c = np.zeros(OWN_C + len(own))
    c[UP], c[[NORTH_X, NORTH_Y]], c[MAX_GAP], c[USE_MAG] = f.frame.up[2], f.frame.north[:2], f.common.max_gap, 1.0
    c[OWN_C:] = own
    return c


def through_json(f):
    """The filter that goes on where this one was saved as text."""
    return Filter.restore(json.loads(json.dumps(f.save())))
