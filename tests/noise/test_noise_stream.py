"""A stream against whole records: the same values however it is cut, and what longer steps leave out."""

import math

import numpy as np
import pytest

from plumbob.core._jit import jit_disabled
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.noise import AllanStream, deviation, factors, log_factors, stream, stream_factors
from tests.helpers.noise_records import drifting, walk, white

EPS = np.finfo(float).eps


@pytest.fixture
def small(monkeypatch):
    """Tiles of 64 samples, and longer steps from n = 32 on: a short record then does what 10⁶ samples do."""
    monkeypatch.setattr(stream, "_TILE", 64)
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


@pytest.mark.parametrize("count", [2, 3, 63, 64, 65, 127, 128, 129, 1000, 2048, 2049, 3001])
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


@pytest.mark.parametrize("make", [white, walk, drifting])
def test_cuts_do_not_change_a_bit(small, make):
    """Sample by sample, blocks of any size, and empty ones."""
    rate = make(1500) + 1e6
    n = stream_factors(log_factors(1500))
    whole = streamed(rate, n)
    rng = np.random.default_rng(8)
    for cuts in (range(1, 1500), range(0, 1500, 64), np.sort(rng.integers(0, 1500, 20)), [700, 700, 700]):
        cut = streamed(rate, n, list(cuts))
        assert (cut.dev == whole.dev).all()
        assert (cut.mean, cut.sd, cut.low, cut.high) == (whole.mean, whole.sd, whole.low, whole.high)


def test_results_in_between_leave_the_stream_alone(small):
    rate = white(1000)
    n = stream_factors(log_factors(1000))
    found = AllanStream(n, channels=1)
    for stop in (10, 64, 333, 1000):
        found.feed(rate[found.count : stop])
        assert found.count == stop
        assert (found.result().dev == streamed(rate[:stop], n).dev).all()
        assert (found.result().dev == found.result().dev).all()


def test_channels_are_streams_of_their_own(small):
    rate = np.stack((white(700), walk(700), drifting(700) - 1e3), axis=1)
    n = stream_factors(log_factors(700))
    together = streamed(rate, n, [100, 101, 500])
    for axis in range(3):
        alone = streamed(rate[:, axis], n)
        assert (together.dev[:, axis] == alone.dev[:, 0]).all()
        assert (together.mean[axis], together.sd[axis]) == (alone.mean[0], alone.sd[0])


def test_moments():
    """Sums about a mean of 64-bit numbers; 1e6 + noise keeps 52 − 20 bits of the noise in the sd."""
    rate = white(1000) + 1e6
    result = streamed(rate, [1])
    assert result.count == 1000
    assert result.mean[0] == pytest.approx(math.fsum(rate) / 1000, rel=8 * EPS)
    assert result.sd[0] == pytest.approx(np.std(rate, ddof=1), rel=1e6 * EPS)
    assert (result.low[0], result.high[0]) == (rate.min(), rate.max())


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


def test_an_offset_does_not_matter(small):
    rate = white(3000)
    n = stream_factors(log_factors(3000))
    assert np.abs(streamed(rate + 1e6, n).dev / streamed(rate, n).dev - 1.0).max() < 1e-7


def test_a_constant_record_does_not_wander(small):
    result = streamed(np.full(300, 7.3), [1, 5])
    assert (result.dev == 0.0).all()
    assert (result.sd, result.low, result.mean) == (0.0, 7.3, 7.3)


@pytest.mark.skipif(jit_disabled(), reason="minutes of plain Python")
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


def test_a_sample_that_is_not_finite_is_named(small):
    rate = np.zeros((300, 2))
    rate[200, 1] = math.nan
    found = AllanStream([1], channels=2)
    found.feed(rate[:150])
    with pytest.raises(ShapeError, match=r"sample 200 of channel 1 is not finite.*without gaps"):
        found.feed(rate[150:])
    with pytest.raises(ShapeError, match="too large to be added"):
        AllanStream([1], channels=1).feed([1.7e308, 1.7e308])


def test_what_does_not_fit_is_refused():
    for n in (2**14 + 1, 2**20 + 64):
        with pytest.raises(ParameterError, match=rf"n holds {n}, .* at multiples of .* pass stream_factors"):
            AllanStream([1, n], channels=1)
    with pytest.raises(ParameterError, match="channels = 0"):
        AllanStream([1], channels=0)
    with pytest.raises(ParameterError, match="n must hold"):
        AllanStream([], channels=1)
    found = AllanStream([1], channels=2)
    for shape in ((4,), (4, 3), (4, 2, 1)):
        with pytest.raises(ShapeError, match=r"block must have shape \(rows, 2\)"):
            found.feed(np.zeros(shape))
    with pytest.raises(ShapeError, match="masked"):
        found.feed(np.ma.masked_equal(np.ones((3, 2)), 1.0))
    found.feed(np.zeros((1, 2)))
    with pytest.raises(ShapeError, match="1 samples came, but"):
        found.result()
