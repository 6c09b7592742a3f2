"""Thinning for a picture: no spike lost, nothing invented."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from plumbob.reporting.drawing import envelope, runs


def test_spikes_survive_thinning():
    t, y = np.arange(100_000) / 100.0, np.zeros(100_000)
    y[[0, 12_345, 77_777, 99_999]] = (3.0, 9.0, -7.0, 5.0)
    short_t, short_y = envelope(t, y, 300)
    assert short_t.size <= 600
    for at, value in ((123.45, 9.0), (777.77, -7.0), (999.99, 5.0), (0.0, 3.0)):
        assert value in short_y[short_t == at]
    assert (np.diff(short_t) >= 0.0).all()


@settings(max_examples=40)
@given(st.data())
def test_thinning_keeps_the_range_and_invents_nothing(data):
    size = data.draw(st.integers(1, 300))
    y = np.array(data.draw(st.lists(st.sampled_from([0.0, 1.0, 2.0, -3.0, np.nan]), min_size=size, max_size=size)))
    t = np.cumsum(np.array(data.draw(st.lists(st.sampled_from([1.0, 1.0, 1.0, 50.0]), min_size=size, max_size=size))))
    columns = data.draw(st.integers(2, 40))
    short_t, short_y = envelope(t, y, columns, gap=10.0)
    known, kept = np.isfinite(y), np.isfinite(short_y)
    assert set(zip(short_t[kept], short_y[kept], strict=True)) <= set(zip(t[known], y[known], strict=True))
    if known.any():
        assert short_y[kept].max() == y[known].max()
        assert short_y[kept].min() == y[known].min()
    assert kept.sum() <= 4 * columns


@pytest.mark.parametrize("size", [40, 4000])
def test_lines_break_at_holes_gaps_and_wraps(size):
    t = np.arange(size, dtype=float)
    t[size // 4 :] += size  # a gap in time
    y = np.zeros(size)
    y[size // 2 : size // 2 + size // 10] = np.nan  # a hole
    y[3 * size // 4 :] = 6.0  # a wrap
    _, short_y = envelope(t, y, 100, gap=10.0, jump=np.pi)
    assert np.isnan(short_y).sum() == 3
    assert np.isnan(envelope(t, y, 100)[1]).sum() == 1


def test_runs_are_those_of_the_mask():
    mask = np.array([0, 1, 1, 0, 0, 1], dtype=bool)
    assert runs(np.arange(6.0), mask, 10) == [(1.0, 2.0)]  # the last sample has no width
    assert runs(np.arange(6.0), mask, 2) == []
