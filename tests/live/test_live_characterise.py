"""From a static record to analyses: in memory and streamed, chosen averaging times, the simulator's noise."""

import math

import numpy as np
import pytest

from plumbob import Frame, files, simulate
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.units import to_si
from plumbob.door.allan import load_static
from plumbob.noise import KINDS, Averager, deviation
from plumbob.noise import allan as module
from plumbob.noise.allan import characterise, comparisons, deviations
from plumbob.noise.static_record import check_static


@pytest.fixture(scope="module")
def numbers(tmp_path_factory):
    """Two columns of white noise and random walk, in a file of bare numbers."""
    path = tmp_path_factory.mktemp("characterise") / "two.npy"
    rng = np.random.default_rng(5)
    np.save(path, rng.standard_normal((60_000, 2)) + 0.01 * np.cumsum(rng.standard_normal((60_000, 2)), axis=0))
    return path


def opened(path, **options):
    record = load_static(path, rate=100.0, scale="1", **options)
    return record, check_static(record)


def test_a_file_larger_than_memory_gives_what_memory_gives(numbers, monkeypatch):
    """Deviations to rounding below 2¹⁴ samples; coefficients are of averages then, and differ by less than their ±."""
    whole = characterise(*opened(numbers))
    monkeypatch.setattr(module, "IN_MEMORY", 0)
    monkeypatch.setattr(module, "Averager", lambda channels: Averager(channels, kept=1 << 14))
    told = []
    streamed = characterise(*opened(numbers), progress=told.append)
    assert told[-1] == numbers.stat().st_size
    for a, b in zip(whole, streamed, strict=True):
        short = a.curve.n < 1 << 14
        assert b.curve.dev[: short.sum()] == pytest.approx(a.curve.dev[short], rel=1e-9)
        assert (b.mean, b.sd) == (pytest.approx(a.mean, abs=1e-9), pytest.approx(a.sd, rel=1e-4))
        for letter in ("N", "K"):
            x, y = a.terms[letter], b.terms[letter]
            assert abs(x.value - y.value) <= y.hi - y.lo
        assert not b.terms["Q"].observable


def test_means_of_a_stream_do_not_depend_on_its_blocks():
    x = np.random.default_rng(6).standard_normal((10_007, 2))
    for sizes in ((10_007,), (1, 0, 3, 9_000, 1_003)):
        averager = Averager(2, kept=1000)
        for block in np.split(x, np.cumsum(sizes)[:-1]):
            averager.feed(block)
        assert averager.averaged == 16
        expected = x[: 10_007 // 16 * 16].reshape(-1, 16, 2).mean(axis=1)
        assert np.abs(averager.values() - expected).max() < 1e-14


@pytest.mark.parametrize("limit", [0, 1 << 24])
def test_chosen_averaging_times(numbers, monkeypatch, limit):
    monkeypatch.setattr(module, "IN_MEMORY", limit)
    found = characterise(*opened(numbers), taus=[0.1, 1.0, 20.0])[0]
    assert found.curve.n.tolist() == [10, 100, 2000]
    assert found.curve.dev == pytest.approx(deviation(np.load(numbers)[:, 0], [10, 100, 2000]), rel=1e-9)
    for tau, words in ((301.0, "τ = 301 s is too long: .* has 300 s at most"), (0.001, "the nearest is 0.01 s")):
        with pytest.raises(ParameterError, match=words):
            characterise(*opened(numbers), taus=[tau])


def test_every_averaging_time_and_another_kind(numbers, tmp_path):
    curve = characterise(*opened(numbers), taus="all")[1].curve
    assert curve.n.tolist() == list(range(1, 30_001))
    assert curve.dev[[0, 99, 29_999]] == pytest.approx(deviation(np.load(numbers)[:, 1], [1, 100, 30_000]), rel=1e-11)
    np.save(tmp_path / "short.npy", np.load(numbers)[:1001])
    shared = comparisons(opened(tmp_path / "short.npy"), opened(numbers), taus="all")[0].comparison
    assert shared.before.n.tolist() == shared.after.n.tolist() == list(range(1, 501))  # which the shorter one has
    first, second = deviations(*opened(numbers), "ohdev", taus=[1.0])
    assert (first.name, second.name) == ("column 1", "column 2")
    assert first.curve.dev == pytest.approx(deviation(np.load(numbers)[:, 0], [100], "ohdev"), rel=1e-12)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("count", [1000, 1001])
def test_every_averaging_time_of_every_kind(tmp_path, kind, count):
    """Three averages where a kind takes third differences or averages its second ones, and two otherwise."""
    np.save(tmp_path / "x.npy", np.random.default_rng(0).standard_normal(count))
    opening = opened(tmp_path / "x.npy")
    (found,) = deviations(*opening, kind, taus="all")
    longest = {"mdev": (count + 1) // 3, "ohdev": count // 3, "hdev": count // 3}.get(kind, count // 2)
    assert found.curve.n.tolist() == list(range(1, longest + 1))
    with pytest.raises(ParameterError, match=rf"for {kind}, a record of .* has {longest / 100:.6g} s at most"):
        deviations(*opening, kind, taus=[(longest + 1) / 100])


def moved(path):
    np.save(path, np.random.default_rng(7).standard_normal(20_000) + 50.0 * (np.arange(20_000) > 9_000))
    return path


def test_what_is_not_analysed(numbers, tmp_path):
    """Only like is compared with like; a comma in a file's name does no harm to findings about several channels."""
    one, comma = tmp_path / "one.npy", tmp_path / "desk, 2.txt"
    np.save(one, np.load(numbers)[:, 0])
    np.savetxt(comma, np.full(5000, 3.0))
    slower = load_static(one, rate=50.0, scale="1")
    assert check_static(load_static(comma, rate=100.0, scale="1")).refused("desk, 2")
    for analyse, words in (
        (lambda: comparisons(opened(numbers), opened(one)), "before has column 1, column 2, but after has one"),
        (lambda: comparisons(opened(one), (slower, check_static(slower))), "at 100 Hz, but after is ratio at 50 Hz"),
        (lambda: characterise(*opened(moved(tmp_path / "moved.npy"))), "not a static record"),
        (lambda: characterise(*opened(comma)), "not a static record: desk, 2: all 5000 values are 3"),
    ):
        with pytest.raises(ShapeError, match=words):
            analyse()


def test_the_simulator_s_noise_comes_back(tmp_path):
    """N, B and K of a unit's card, planted by `sim`, are found within three halves of their intervals."""
    setting = {"sensors": "mpu6000", "unit": "random", "seed": 3, "rate": 50.0, "duration": 3600.0}
    simulated = simulate("static", frame=Frame.ENU, **setting)
    record = load_static(files.write(tmp_path / "static.parquet", simulated.imu))
    steps = {"gyr": to_si(1 / 131, "deg/s"), "acc": to_si(1 / 8192, "g")}
    for analysis in characterise(record, check_static(record)):
        triad, axis = getattr(simulated.noise, analysis.name[:3]), "xyz".index(analysis.name[-1])
        for letter, planted in (("N", triad.n_rpsd), ("B", triad.b), ("K", triad.k_rpsd)):
            c, value = analysis.terms[letter], float(planted[axis])
            if value > 0.0 and c.observable:
                assert abs(math.log(c.value / value)) <= 3.0 * math.log(c.hi / c.lo) / 2.0, (analysis.name, letter)
            else:
                assert not c.observable and c.upper >= 0.5 * value, (analysis.name, letter)
        assert analysis.step == pytest.approx(steps[analysis.name[:3]], rel=1e-3)
