"""What tests of the smoother's pieces share: a stream that arrived, and a field over time."""

import numpy as np

from plumbob.filters.smoother.arriving import Arriving
from plumbob.filters.smoother.model import Params


def arrived(imu, size=1000):
    """Samples and steps of a stream in parts, and which samples are kept."""
    stream = Arriving(Params(), mag=True)
    return stream, np.concatenate([stream.take(part) for part in imu.chunks(size)])


def place(t, turned=0.0):
    """Field of a place (N, 3), µT, in axes that have turned about the vertical."""
    angle = turned + 0.0 * t
    return np.stack((20.0 * np.sin(angle), 20.0 * np.cos(angle), 0.0 * t - 40.0), axis=1)
