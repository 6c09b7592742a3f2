"""Streams against whole records: the same values however they are cut; and grids of averaging factors for them."""

import math

import numpy as np
import pytest

from plumbob.core.errors import ParameterError, ShapeError
from plumbob.noise import AllanStream, deviation, factors, log_factors, stream_factors
from plumbob.noise.factors import stream_steps
from tests.helpers import is_plain, slow_as_python
from tests.helpers.noise_records import drifting, walk, white

EPS = np.finfo(float).eps


TILE = 2**14  # samples that are worked on together
COUNTS = (2, 3, 1000, 3001) if is_plain() else (2, 3, 1000, TILE - 1, TILE, TILE + 1, 2 * TILE, 5 * TILE + 77)
RECORD = 1500 if is_plain() else 40_000


@pytest.fixture
def small(monkeypatch):
    """Longer steps from n = 32 on, as 10⁶ samples have them from 2¹⁴ on."""
    monkeypatch.setattr(factors, "STREAMED", 32)


def streamed(rate, n, cuts=()):
    rate = np.asarray(rate)
    found = AllanStream(n, channels=1 if rate.ndim == 1 else rate.shape[1])
    for block in np.split(rate, cuts):
        found.feed(block)
    return found.result()


def with_steps(rate, n):
    """The definition, with differences that begin every `step` samples only."""
    theta = np.concatenate(([0.0], np.cumsum(rate - rate.mean())))
    found = []
    for k, step in zip(n.tolist(), factors.stream_steps(n).tolist(), strict=True):
        differences = (theta[2 * k :] - 2.0 * theta[k:-k] + theta[: -2 * k])[::step]
        found.append(math.sqrt(np.mean(differences**2) / 2.0) / k)
    return np.array(found)


@pytest.mark.parametrize("count", COUNTS)
def test_the_definition_by_brute_force(small, count):
    rate = white(count)
    n = stream_factors(np.arange(1, 1200, 7))
    result = streamed(rate, n)
    assert (result.n == n[2 * n <= count]).all()
    np.testing.assert_allclose(result.dev[:, 0], with_steps(rate, result.n), rtol=1e-11)


def test_every_difference_below_the_first_longer_step():
    rate = walk(1500)
    result = streamed(rate, np.arange(1, 751))
    np.testing.assert_allclose(result.dev[:, 0], deviation(rate, result.n), rtol=1e-11)


@slow_as_python
def test_what_longer_steps_leave_out_is_far_below_the_uncertainty():
    """On white noise σ itself scatters by about √(n / N) / 2 or more; the steps move it by less than 1/500 of that."""
    rate = white(1_000_000)
    n = stream_factors(log_factors(rate.size))
    result = streamed(rate, n, [300_000])
    exact = deviation(rate, result.n)
    exactly = factors.stream_steps(result.n) == 1
    shift = np.abs(result.dev[:, 0] / exact - 1.0)
    assert shift[exactly].max() < 1e-12
    assert 0.0 < (shift / np.sqrt(result.n / rate.size) * 2.0)[~exactly].max() < 2e-3


@pytest.mark.parametrize("make", [white, walk, drifting])
def test_cuts_do_not_change_a_bit(small, make):
    """Sample by sample, blocks of any size, and empty ones."""
    rate = make(RECORD) + 1e6
    n = stream_factors(log_factors(RECORD))
    whole = streamed(rate, n)
    rng = np.random.default_rng(8)
    for cuts in (range(1, 1500), range(0, RECORD, 640), np.sort(rng.integers(0, RECORD, 20)), [700, 700, 700]):
        cut = streamed(rate, n, list(cuts))
        assert (cut.dev == whole.dev).all()
        assert (cut.mean, cut.sd, cut.low, cut.high) == (whole.mean, whole.sd, whole.low, whole.high)


def test_results_in_between_leave_the_stream_alone_and_channels_are_streams_of_their_own(small):
    rate = white(RECORD)
    n = stream_factors(log_factors(RECORD))
    stream = AllanStream(n, channels=1)
    for stop in (10, 64, 333, RECORD // 2, RECORD):
        stream.feed(rate[stream.count : stop])
        assert stream.count == stop
        assert (stream.result().dev == streamed(rate[:stop], n).dev).all()
        assert (stream.result().dev == stream.result().dev).all()
    rate = np.stack((white(RECORD), walk(RECORD), drifting(RECORD) - 1e3), axis=1)
    n = stream_factors(log_factors(RECORD))
    together = streamed(rate, n, [100, 101, 500])
    for axis in range(3):
        alone = streamed(rate[:, axis], n)
        assert (together.dev[:, axis] == alone.dev[:, 0]).all()
        assert (together.mean[axis], together.sd[axis]) == (alone.mean[0], alone.sd[0])


@pytest.mark.parametrize("kind", [np.float32, np.int16, np.uint8, np.dtype(">f8")])
def test_any_real_type(small, kind, tmp_path):
    """Converted piece by piece, also from a memory map."""
    rate = (100.0 + 20.0 * white(500)).astype(kind)
    n = stream_factors(log_factors(500))
    expected = streamed(rate.astype(np.float64), n)
    assert (streamed(rate, n, [77]).dev == expected.dev).all()
    rate.tofile(tmp_path / "rate")
    mapped = np.memmap(tmp_path / "rate", kind, "r", shape=(500, 1))
    assert (streamed(mapped, n).dev == expected.dev).all()


def test_moments_offsets_and_constants():
    """Sums about a mean of 64-bit numbers; 1e6 + noise keeps 52 − 20 bits of the noise in the sd."""
    rate = white(RECORD) + 1e6
    result = streamed(rate, [1, 7])
    assert result.count == RECORD
    assert result.mean[0] == pytest.approx(math.fsum(rate) / RECORD, rel=8 * EPS)
    assert result.sd[0] == pytest.approx(np.std(rate, ddof=1), rel=1e6 * EPS)
    assert (result.low[0], result.high[0]) == (rate.min(), rate.max())
    assert np.abs(result.dev / streamed(rate - 1e6, [1, 7]).dev - 1.0).max() < 1e-7
    constant = streamed(np.full(300, 7.3), [1, 5])
    assert (constant.dev == 0.0).all() and (constant.sd, constant.low, constant.mean) == (0.0, 7.3, 7.3)


def feeding(*blocks, channels=2):
    stream = AllanStream([1], channels=channels)
    for block in blocks:
        stream.feed(block)
    return stream.result()


GONE = np.zeros((300, 2))
GONE[200, 1] = math.nan


@pytest.mark.parametrize(("call", "error", "text"), [
    (lambda: feeding(GONE[:150], GONE[150:]), ShapeError, r"rate\[200, 1\] is not finite.*without gaps"),
    (lambda: feeding([1.7e308, 1.7e308], channels=1), ShapeError, "too large to be added"),
    (lambda: feeding(channels=0), ParameterError, "channels = 0"),
    (lambda: AllanStream([], channels=1), ParameterError, "n must hold"),
    (lambda: feeding(np.zeros(4)), ShapeError, r"block must have shape \(rows, 2\)"),
    (lambda: feeding(np.zeros((4, 3))), ShapeError, r"block must have shape \(rows, 2\)"),
    (lambda: feeding(np.zeros((4, 2, 1))), ShapeError, r"block must have shape \(rows, 2\)"),
    (lambda: feeding(np.ma.masked_equal(np.ones((3, 2)), 1.0)), ShapeError, "masked"),
    (lambda: feeding(np.zeros((1, 2))), ShapeError, "at least 2 samples, but got 1"),
    (lambda: log_factors(1, per_decade=16), ParameterError, "two samples or more"),
    (lambda: log_factors(1000, per_decade=0), ParameterError, "two samples or more"),
    (lambda: stream_factors([1, 2.5]), ParameterError, r"n\[1\] = 2.5, but for a stream whole numbers from 1"),
])  # fmt: skip
def test_what_does_not_fit_is_refused(call, error, text):
    with pytest.raises(error, match=text):
        call()


@pytest.mark.parametrize("count", [2, 3, 10, 1000, 999_999, 10_000_000])
def test_a_grid_is_even_and_fits_the_record(count):
    n = log_factors(count)
    assert n[0] == 1
    assert n[-1] <= count // 2 < 10.0 ** (1 / 16) * n[-1] + 1.0
    assert (np.diff(n) > 0).all()
    ratio = n[1:] / n[:-1]
    assert np.abs(np.log10(ratio[n[1:] > 1000]) * 16.0 - 1.0).max(initial=0.0) < 0.01  # rounded by 1/2 of 1000


def test_records_share_their_averaging_times_of_which_a_stream_takes_multiples_of_a_step():
    short, long = log_factors(10_000), log_factors(777_777)
    assert (long[: short.size] == short).all()
    assert (log_factors(10_000, per_decade=1) == [1, 10, 100, 1000]).all()
    assert len(log_factors(10**6)) == 84
    assert len(log_factors(10**7)) == 100
    n = log_factors(10**9)
    fit = stream_factors(n)
    steps = stream_steps(fit)
    assert (fit % steps == 0).all() and (fit[fit < 2**14] == n[n < 2**14]).all()
    longer = fit // steps
    assert longer[steps > 1].min() >= 2**13 and longer.max() < 2**14
    assert np.abs(fit / n - 1.0).max() <= 1.0 / 2**14 and (stream_factors(fit) == fit).all()
    assert stream_factors([2**15 - 1, 1, 2**14, 1]).tolist() == [1, 2**14, 2**15]
