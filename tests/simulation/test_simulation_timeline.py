"""Time line: even sampling, stamps that scatter, samples that get lost, and a slower sensor's rows."""

import numpy as np
import pytest

from plumbob.core.errors import ParameterError
from plumbob.simulation.simulation import arrivals, time_line


def test_a_plain_line_is_even_to_the_nanosecond_and_stamps_scatter_by_the_jitter_in_their_order():
    line = time_line(rate=75.0, duration=4.0, seed=1)
    assert line.sampled.size == 300
    np.testing.assert_allclose(line.sampled, np.arange(300) / 75.0, atol=0.5e-9)
    np.testing.assert_array_equal(line.stamps, line.sampled)
    assert line.kept.all()
    line = time_line(rate=100.0, duration=200.0, jitter=1e-3, seed=3)
    stray = line.stamps - line.sampled
    np.testing.assert_allclose(stray.std(), 1e-3, rtol=4.0 / np.sqrt(2.0 * stray.size))  # sd of n normal numbers
    assert (np.diff(line.stamps) > 0.0).all()
    assert np.abs(stray).max() <= 0.45 / 100.0 + 1e-9  # to the nanosecond
    assert line.stamps[0] >= 0.0


def test_lost_samples_are_their_share_by_a_stream_of_their_own():
    kept = np.array([time_line(rate=100.0, duration=20.0, lost=0.3, seed=s).kept for s in range(20)])
    assert kept[:, 0].all()
    share = 1.0 - kept[:, 1:].mean()
    assert share == pytest.approx(0.3, abs=4.0 * np.sqrt(0.3 * 0.7 / kept[:, 1:].size))  # binomial
    alone = time_line(rate=100.0, duration=20.0, lost=0.3, seed=5).kept
    both = time_line(rate=100.0, duration=20.0, lost=0.3, jitter=1e-3, seed=5).kept
    np.testing.assert_array_equal(alone, both)


def test_a_slower_sensor_fills_the_next_row_and_another_every_row():
    # 75 Hz on 100 Hz: its samples 0, 13.3, 26.7, 40 ms arrive in rows 0, 2, 3, 4 (0, 20, 30, 40 ms)
    np.testing.assert_array_equal(arrivals(10, 100.0, 75.0), [0, 2, 3, 4, 6, 7, 8])
    np.testing.assert_array_equal(arrivals(10, 100.0, 20.0), [0, 5])
    np.testing.assert_array_equal(arrivals(5, 100.0, None), np.arange(5))
    np.testing.assert_array_equal(arrivals(5, 100.0, 220.0), np.arange(5))


@pytest.mark.parametrize("own", [0.7, 3.0, 33.3, 75.0, 99.9])
def test_rows_of_a_slower_sensor_keep_its_rate(own):
    rows = arrivals(20_000, 100.0, own)
    assert (np.diff(rows) > 0).all()
    due = np.arange(rows.size) / own
    late = rows / 100.0 - due
    assert late.min() >= -1e-9  # never before its instant
    assert late.max() < 0.01  # and always within one row


@pytest.mark.parametrize(
    "wrong",
    [{"rate": 0.0}, {"rate": np.nan}, {"duration": -1.0}, {"duration": 0.01}, {"duration": np.inf}, {"jitter": 0.002},
     {"jitter": -1e-9}, {"lost": 1.0}, {"lost": -0.1}, {"rate": 1e9}],
)  # fmt: skip
def test_impossible_lines_are_refused(wrong):
    with pytest.raises(ParameterError):
        time_line(**{"rate": 100.0, "duration": 10.0, "seed": 0, **wrong})
