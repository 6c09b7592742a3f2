"""Grids of averaging factors: even on a logarithmic axis, the same for every record, fit for a stream."""

import numpy as np
import pytest

from plumbob.core.errors import ParameterError
from plumbob.noise import log_factors, stream_factors
from plumbob.noise.factors import stream_steps


@pytest.mark.parametrize("count", [2, 3, 10, 1000, 999_999, 10_000_000])
def test_a_grid_is_even_and_fits_the_record(count):
    n = log_factors(count)
    assert n[0] == 1
    assert n[-1] <= count // 2 < 10.0 ** (1 / 16) * n[-1] + 1.0
    assert (np.diff(n) > 0).all()
    ratio = n[1:] / n[:-1]
    assert np.abs(np.log10(ratio[n[1:] > 1000]) * 16.0 - 1.0).max(initial=0.0) < 0.01  # rounded by 1/2 of 1000


def test_records_share_their_averaging_times():
    short, long = log_factors(10_000), log_factors(777_777)
    assert (long[: short.size] == short).all()
    assert (log_factors(10_000, per_decade=1) == [1, 10, 100, 1000]).all()
    assert len(log_factors(10**6)) == 84
    assert len(log_factors(10**7)) == 100


def test_a_stream_takes_multiples_of_a_step():
    n = log_factors(10**9)
    fit = stream_factors(n)
    steps = stream_steps(fit)
    assert (fit % steps == 0).all()
    assert (fit[fit < 2**14] == n[n < 2**14]).all()
    longer = fit // steps
    assert longer[steps > 1].min() >= 2**13
    assert longer.max() < 2**14
    assert np.abs(fit / n - 1.0).max() <= 1.0 / 2**14
    assert (stream_factors(fit) == fit).all()
    assert stream_factors([2**15 - 1, 1, 2**14, 1]).tolist() == [1, 2**14, 2**15]


def test_what_is_no_grid_is_refused():
    for count, per_decade in ((1, 16), (1000, 0)):
        with pytest.raises(ParameterError, match="two samples or more"):
            log_factors(count, per_decade=per_decade)
    with pytest.raises(ParameterError, match=r"n\[1\] = 2.5, but for a stream whole numbers from 1"):
        stream_factors([1, 2.5])
