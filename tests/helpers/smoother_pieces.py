"""What tests of the smoother share: a stream that arrived, a field over time, short stretches, all bits of a track."""

import hashlib

import numpy as np

from plumbob import ImuData
from plumbob.filters.smoother import Params, Smoother, samples
from plumbob.filters.smoother.preprocess import Arriving
from tests.helpers.motion import noisy


def arrived(imu, size=1000):
    """Samples and steps of a stream in parts, and which samples are kept."""
    stream = Arriving(Params(), mag=True)
    return stream, np.concatenate([stream.take(part) for part in imu.chunks(size)])


def place(t, turned=0.0):
    """Field of a place (N, 3), µT, in axes that have turned about the vertical."""
    angle = turned + 0.0 * t
    return np.stack((20.0 * np.sin(angle), 20.0 * np.cos(angle), 0.0 * t - 40.0), axis=1)


def digest():
    """All numbers of a track of two seconds without physical sense, with missing values and a gap.

    Every kernel but the attached field's runs.
    """
    imu = noisy(160, seed=4)
    t = np.where(np.arange(160) < 80, imu.t, imu.t + 1.0)
    track = Smoother(frame="ENU").process(ImuData(t=t, gyr=imu.gyr, acc=imu.acc, mag=imu.mag))
    numbers = (track.q_nb, track.bias_b, track.cov_b, track.flags)
    return hashlib.sha256(b"".join(values.tobytes() for values in numbers)).hexdigest()


def in_stretches(monkeypatch, *, long, core, margin):
    """What is longer than `long`, s, is smoothed in parts."""
    for name, value in (("LONG", long), ("CORE", core), ("MARGIN", margin)):
        monkeypatch.setattr(samples, name, value)
