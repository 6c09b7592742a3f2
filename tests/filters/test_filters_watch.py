"""Stuck or not: the same for long and often is, a slow sensor and an absent one are not."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from plumbob.core import flags
from plumbob.filters.input_checks import LONG, MANY, watch
from plumbob.filters.layout import LAST, OWN

STUCK = (flags.GYR_STUCK, flags.ACC_STUCK, flags.MAG_STUCK)
NAN = (math.nan,) * 3
FIELD = np.array([50.0, -43.0, 20.0])


class Stream:
    """The watch with its state; a triad that is not given says something new each time."""

    def __init__(self):
        self.x, self.count = np.zeros(OWN), 0

    def take(self, dt, **triads):
        """Feed one sample; returns its flags."""
        self.count += 1
        new = (float(self.count), 0.0, 0.0)
        return watch.py_func(self.x, dt, *(v for name in ("gyr", "acc", "mag") for v in triads.get(name, new)))


@pytest.mark.parametrize("triad", ["gyr", "acc", "mag"])
@pytest.mark.parametrize("rate", [10.0, 50.0, 100.0, 200.0, 1000.0])
def test_it_takes_long_and_many(rate, triad):
    stream, flag = Stream(), STUCK[("gyr", "acc", "mag").index(triad)]
    answers = [stream.take(1.0 / rate, **{triad: (0.1, -0.2, 0.3)}) for _ in range(300)]
    assert set(answers) == {0, flag}
    repeats = answers.index(flag)  # the first sample repeats nothing
    assert repeats > MANY - 1.0  # a sum of steps may pass the limit by its rounding, one repeat early
    assert repeats / rate > LONG - 1.0 / rate
    assert repeats == pytest.approx(max(MANY, LONG * rate), abs=1.001)
    assert all(answers[repeats:])
    assert stream.take(1.0 / rate, **{triad: (0.1, -0.2, 0.30001)}) == 0


def test_each_triad_is_watched_by_itself():
    """Zeros from the start are stuck like any other value."""
    stream = Stream()
    for _ in range(60):
        word = stream.take(0.01, gyr=(1.0, 2.0, 3.0), mag=(0.0, 0.0, 0.0))
    assert word == flags.GYR_STUCK | flags.MAG_STUCK


@pytest.mark.parametrize(("rate", "said"), [
    # 10 Hz: each value stands for 0.1 s, less than `LONG`
    *((r, lambda k, r=r: {"mag": (math.floor(k * 10.0 / r), 0.0, 5.0)}) for r in (100.0, 400.0, 1000.0)),
    (100.0, lambda k: {"mag": (float(k), 0.0, 5.0) if k % 10 == 0 else NAN}),  # absent in between
    (100.0, lambda k: {"mag": NAN}),
    (100.0, lambda k: {"gyr": (0.1 * (k % 2), 0.0, 0.0)}),
    *((100.0, lambda k, axis=axis: {"acc": tuple(np.where(axis, np.nan, [1.0, 2.0, 3.0]))}) for axis in np.eye(3)),
    # 10 nT, below any magnetometer's last digit
    *((100.0, lambda k, axis=axis: {"mag": tuple(FIELD + 0.01 * (k % 2) * axis)}) for axis in np.eye(3)),
])  # fmt: skip
def test_what_is_not_stuck(rate, said):
    """A slow field, repeated or absent in between; what is absent; alternating values; one axis that lives.

    Its last bit, of a value about 50 µT, shows in the sum of all three.
    """
    stream = Stream()
    assert not any(stream.take(1.0 / rate, **said(k)) for k in range(3000)) and np.isfinite(stream.x).all()


def test_what_says_the_same_before_and_after_an_absence_is():
    """The clock goes on while nothing is said."""
    stream = Stream()
    found = [stream.take(0.01, mag=(1.0, 2.0, 3.0) if k % 10 == 0 else NAN) for k in range(200)]
    said = found[::10]
    first = said.index(flags.MAG_STUCK)
    assert LONG < first * 0.1 < LONG + 0.11
    assert all(said[first:])
    assert not any(word for k, word in enumerate(found) if k % 10)  # an absent one is not called stuck


def sums(triads):
    """The number that stands for each triad in the state."""
    x, found = np.zeros(OWN), []
    for v in triads:
        watch.py_func(x, 0.01, *v, *NAN, *NAN)
        found.append(x[LAST])
    return found


LSB = st.sampled_from([1.0, 9.80665 / 16384, math.radians(1.0 / 16.4), 0.15, 2.0**-11, 0.1])
CODES = st.tuples(*[st.integers(-(2**15), 2**15 - 1)] * 3)


@given(LSB, st.lists(CODES, min_size=2, max_size=12, unique=True))
def test_two_quantised_triads_do_not_collide(lsb, codes):
    """Codes of 16 bits times a last digit."""
    found = sums([tuple(lsb * k for k in code) for code in codes])
    assert len(set(found)) == len(codes)


@given(LSB, CODES, st.permutations([0, 1, 2]), st.tuples(*[st.integers(-3, 3)] * 3))
def test_neighbours_swaps_and_signs_do_not_collide(lsb, code, order, change):
    """What a plain sum would mistake for the same."""
    others = [
        tuple(code[k] for k in order),
        tuple(-k for k in code),
        tuple(a + b for a, b in zip(code, change, strict=True)),
    ]
    for other in others:
        if other != code:
            a, b = sums([tuple(lsb * k for k in code), tuple(lsb * k for k in other)])
            assert a != b


def test_no_change_of_up_to_2047_digits_is_lost_in_rounding():
    """All of them: the least |i + √2 j + √3 k| is far above what 16-bit sums round.

    The sum of |codes| up to 2¹⁵ is below 4.15 · 2¹⁵ digits; two roundings of products and two of sums, each of half an
    ε of that, on both sides.
    """
    size, least = 2047, math.inf
    j = np.arange(-size, size + 1, dtype=float)
    for k in range(size + 1):
        rest = math.sqrt(2.0) * j + math.sqrt(3.0) * k
        change = (np.abs(np.rint(rest)) <= size) & ((j != 0.0) | (k > 0))
        least = min(least, float(np.abs(rest - np.rint(rest)).min(where=change, initial=1.0)))
    assert least > 100 * (2 * 4 * 0.5 * np.finfo(float).eps * 4.15 * 2**15)
    # A sample is three zeros with erf(1/√2)³ = 0.32, and 25 in a row are with 0.32²⁵ = 4e-13; a digit of 0.5 mg.
    rng = np.random.default_rng(1)
    stream = Stream()
    assert not any(stream.take(0.01, acc=tuple(0.005 * np.rint(0.5 * rng.normal(size=3)))) for _ in range(10_000))
