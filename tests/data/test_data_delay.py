"""By how much a gyroscope lags its accelerometer: found where it does, and not where it does not."""

import numpy as np
import pytest

from plumbob import Frame, ImuData
from plumbob.data.delay import gyr_delay
from plumbob.filters.smoother import Smoother
from tests.helpers.motion import consistent

N = 6000
DATA, _ = consistent(N, amplitude=2.0)


def late(by, *, push=0.0, bias=0.0):
    """Samples whose rates are that much later, s, of a body that is pushed about."""
    rng = np.random.default_rng(0)
    gyr = np.stack([np.interp(DATA.t - by, DATA.t, column) for column in DATA.gyr.T], axis=1)
    noise = np.cumsum(rng.normal(0.0, 0.1, (N, 3)), axis=0)
    acc = DATA.acc + push * (noise - noise.mean(axis=0)) / noise.std(axis=0) + rng.normal(0.0, 0.03, (N, 3))
    return ImuData(t=DATA.t, gyr=gyr + bias + rng.normal(0.0, 0.002, (N, 3)), acc=acc)


@pytest.mark.parametrize(("by", "push"), [(0.02, 0.5), (0.05, 0.0), (-0.03, 0.5), (0.1, 0.5)])
def test_a_delay_is_found(by, push):
    delay = gyr_delay(late(by, push=push, bias=0.03))
    assert delay.found
    assert delay.delay == pytest.approx(by, abs=max(3.0 * delay.sd, 1e-3))


def test_no_delay_is_none_nor_is_there_one_of_forces_that_have_nothing_to_do_with_the_rates():
    delay = gyr_delay(late(0.0, push=0.5))
    assert not delay.found and abs(delay.delay) < 3.0 * delay.sd
    # forces of 5 m/s² that have nothing to do with the rates
    found = gyr_delay(late(0.0, push=5.0))
    assert found is None or not found.found
    still = ImuData(t=DATA.t, gyr=np.zeros((N, 3)), acc=np.tile([0.0, 0.0, 9.81], (N, 1)))
    assert not gyr_delay(still).found
    assert gyr_delay(ImuData(t=DATA.t, gyr=DATA.gyr)) is None
    assert gyr_delay(DATA[:500]) is None
    smoother = Smoother(frame=Frame.ENU)
    smoother.process(late(0.05))
    assert str(smoother.remarks[0]).startswith("the gyroscope seems to lag the accelerometer by 50 ± ")
    assert len(smoother.remarks) == 1
    smoother.process(late(-0.03))
    assert str(smoother.remarks[0]).startswith("the accelerometer seems to lag the gyroscope by 30 ± ")
    smoother.process(late(0.0))
    assert smoother.remarks == ()
