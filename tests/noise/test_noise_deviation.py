"""Deviations of all kinds against published tables, closed forms and the definitions."""

import math

import numpy as np
import pytest

from plumbob.core.errors import ParameterError, ShapeError
from plumbob.noise import KINDS, deviation, kernels
from tests.helpers import is_plain, slow_as_python
from tests.helpers.noise_records import NBS14, drifting, exactly, flicker, riley_1000, walk, white

EPS = np.finfo(float).eps
RECORDS = {"white": white, "flicker": flicker, "walk": walk, "drifting": drifting}
LONGEST = {"oadev": 2, "adev": 2, "mdev": 3, "ohdev": 3, "hdev": 3, "totdev": 2}


PUBLISHED = {  # of the nine rates at 1 and 2, and of the thousand at 1, 10 and 100
    "oadev": (91.22945, 85.95287, 2.922319e-1, 9.159953e-2, 3.241343e-2),
    "adev": (91.22945, 115.8082, 2.922319e-1, 9.965736e-2, 3.897804e-2),
    "mdev": (91.22945, 74.78849, 2.922319e-1, 6.172376e-2, 2.170921e-2),
    "ohdev": (70.80607, 85.61487, 2.943883e-1, 9.581083e-2, 3.237638e-2),
    "hdev": (70.80607, 116.7980, 2.943883e-1, 1.052754e-1, 3.910861e-2),
    "totdev": (91.22945, 93.90379, 2.922319e-1, 9.134743e-2, 3.406530e-2),
}


def test_published_rates():
    """[Riley2008] Tables 30 and 31, to the last of the seven digits that they print."""
    assert set(PUBLISHED) == set(KINDS)
    for kind, values in PUBLISHED.items():
        made = [*deviation(NBS14, [1, 2], kind), *deviation(riley_1000(), [1, 10, 100], kind)]
        assert made == pytest.approx(values, rel=5e-7), kind


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("n", [1, 2, 3, 7, 33])
def test_the_definitions_by_brute_force(kind, n):
    """[Riley2008] (7), (11), (14), (18), (20), (25): every difference that fits, and no other.

    Differences of averages, where [Chen2013] (13) as printed squares the averages. Sums of a hundred terms round by a
    hundred eps at worst.
    """
    rate = white(100) + 5.0
    assert deviation(rate, [n], kind)[0] == pytest.approx(exactly(rate, n, kind), rel=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_the_longest_average_is_one_difference(kind):
    """And one sample more is refused; the total deviation has its N − 1 differences at every n."""
    for count in (11, 12, 13):
        longest = (count + (kind == "mdev")) // LONGEST[kind]
        rate = white(count)
        assert deviation(rate, [longest], kind)[0] == pytest.approx(exactly(rate, longest, kind), rel=1e-12)
        with pytest.raises(ParameterError, match=f"{kind} of {count} samples whole numbers from 1 to {longest} can"):
            deviation(rate, [longest + 1], kind)


@slow_as_python
@pytest.mark.parametrize("kind", KINDS)
def test_a_drift_of_a_hundred_times_the_noise_costs_few_digits(kind):
    """Against extended precision. θ reaches N · 100 / 8 < 2²², so each of its sums rounds to multiples of 2^-31.

    That is white noise of 2^-31 / √12 = 1.3e-10 on the rates, whose own noise is 1, and σ changes by no more;
    4 of it are allowed.
    """
    if np.finfo(np.longdouble).eps > 2e-19:
        pytest.skip("this machine has no extended precision")
    rate = drifting(300_000)
    n = [1, 2, 10, 100, 1365, 1366, 5000]
    exact = rate.astype(np.longdouble)
    theta = np.concatenate((np.zeros(1, np.longdouble), np.cumsum(exact - exact.mean())))
    expected = []
    for k in n:
        if kind == "totdev":
            inner = theta[-2:0:-1]
            points = np.concatenate((2 * theta[0] - inner, theta, 2 * theta[-1] - inner))[300_000 - k : 599_999 + k]
        else:
            points = theta[::k] if kind in {"adev", "hdev"} else theta
        spacing = 1 if kind in {"adev", "hdev"} else k
        for _ in range(3 if kind in {"ohdev", "hdev"} else 2):
            points = points[spacing:] - points[:-spacing]
        if kind == "mdev":
            running = np.concatenate((np.zeros(1, np.longdouble), np.cumsum(points)))
            points = (running[k:] - running[:-k]) / k
        expected.append(float(np.sqrt(np.mean(points**2) / (6 if kind in {"ohdev", "hdev"} else 2)) / k))
    assert np.abs(deviation(rate, n, kind) / expected - 1.0).max() < 4 * 1.35e-10


def test_drifts_in_closed_form():
    """rate = R t: averages a time τ apart differ by R τ, so σ = R τ / √2 exactly; third differences do not see it.

    rate = c t²: third differences of θ = c t³ / 3 are 2 c τ³, so the Hadamard deviation is 2 c τ² / √6.
    """
    n = np.array([1, 10, 100, 300])
    rate, bent = 0.3 * np.arange(1000), 1e-3 * np.arange(1000.0) ** 2
    for kind in ("oadev", "adev", "mdev"):
        np.testing.assert_allclose(deviation(rate, n, kind), 0.3 * n / math.sqrt(2.0), rtol=1e-9)
    for kind in ("ohdev", "hdev"):
        assert deviation(rate, n, kind).max() < 1000.0**2 * EPS * 0.3 * 8.0
        np.testing.assert_allclose(deviation(bent, n, kind), 2e-3 * n.astype(float) ** 2 / math.sqrt(6.0), rtol=1e-7)


@pytest.mark.parametrize("kind", KINDS)
def test_an_offset_does_not_cost_digits(kind):
    """A million times the noise on top, as a converter's counts may have: only the samples' own rounding is lost."""
    rate = white(3000, seed=4)
    n = [1, 100, 1000]
    rounded = (rate + 2.0**20) - 2.0**20  # what is left of the samples after the offset rounded them
    found = deviation(rate + 2.0**20, n, kind)
    assert np.abs(found / deviation(rounded, n, kind) - 1.0).max() < 2.0**20 * EPS
    assert np.abs(found / deviation(rate, n, kind) - 1.0).max() < 1e-7


def test_factors_in_any_order_groups_and_tiles_channels_and_constants():
    rate = white(300)
    n = [7, 1, 150, 7, 2, 30, 90, 3]
    assert deviation(rate, n).tolist() == [deviation(rate, sorted(set(n)))[sorted(set(n)).index(k)] for k in n]
    # A tile is longer than most records here.
    count = 3000 if is_plain() else 5 * kernels.TILE // 2
    rate = white(count)
    theta = np.concatenate(([0.0], np.cumsum(rate - rate.mean())))
    for n in ([1, 2, 3], [5], [1, 40, count // 4, count // 2], [1, 2, 3, 5, 8, count // 3, count // 2 - 1]):
        expected = [math.sqrt(np.mean((theta[2 * k :] - 2 * theta[k:-k] + theta[: -2 * k]) ** 2) / 2) / k for k in n]
        np.testing.assert_allclose(deviation(rate, n), expected, rtol=1e-12)
    for n in ([1, count // 3], [7, count // 5]):
        third = [theta[3 * k :] - 3 * theta[2 * k : -k] + 3 * theta[k : -2 * k] - theta[: -3 * k] for k in n]
        expected = [math.sqrt(np.mean(d**2) / 6) / k for d, k in zip(third, n, strict=True)]
        np.testing.assert_allclose(deviation(rate, n, "ohdev"), expected, rtol=1e-12)
    rate = np.random.default_rng(5).standard_normal((300, 3))
    for kind in KINDS:
        both = deviation(rate, [1, 7], kind)
        assert both.shape == (2, 3) and deviation(rate[:, 0], [1, 7], kind).shape == (2,)
        for axis in range(3):
            assert (both[:, axis] == deviation(rate[:, axis], [1, 7], kind)).all()
        assert (deviation(np.full(30, 7.3), [1, 5, 10], kind) == 0.0).all()


GONE = np.zeros((10, 3))
GONE[4, 2] = math.nan


@pytest.mark.parametrize(("rate", "options", "error", "text"), [
    (NBS14, {"n": [0]}, ParameterError, "whole numbers from 1 to 4"),
    (NBS14, {"n": [5]}, ParameterError, r"n\[0\] = 5"),
    (NBS14, {"n": [1, 1.5]}, ParameterError, r"n\[1\] = 1.5"),
    (NBS14, {"n": [math.nan]}, ParameterError, "n"),
    (NBS14, {"n": [1], "kind": "theo1"}, ShapeError, "kind must be one of oadev, adev, mdev, ohdev, hdev, totdev"),
    (GONE, {}, ShapeError, r"rate\[4, 2\] is not finite \(1 such values\).*without gaps"),
    ([1.0, 2.0, math.inf, -math.inf], {}, ShapeError, r"rate\[2\] is not finite \(2 such"),
    ([1.7e308, 1.7e308], {}, ShapeError, r"too large to be added, up to 1.7e\+308"),
    (np.zeros((2, 3, 4)), {}, ShapeError, "shape"),
    (np.zeros(0), {}, ShapeError, "shape"),
    (np.zeros(()), {}, ShapeError, "shape"),
])  # fmt: skip
def test_what_cannot_be_analysed_is_refused(rate, options, error, text):
    with pytest.raises(error, match=text):
        deviation(rate, **({"n": [1]} | options))
