"""From a static record to analyses: in memory and streamed, chosen averaging times, the simulator's noise."""

import math

import numpy as np
import pytest

from plumbob import Frame, NoiseCard, files, simulate
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.units import to_si
from plumbob.noise import KINDS, Averager, deviation
from plumbob.noise import allan as module
from plumbob.noise.allan import characterise, comparisons, deviations
from plumbob.noise.static_record import check_static, load_static


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
    with pytest.raises(ParameterError, match=r"τ = 301 s is too long: .* has 300 s at most"):
        characterise(*opened(numbers), taus=[301.0])
    with pytest.raises(ParameterError, match=r"not a multiple of the sampling time 0.01 s; the nearest is 0.01 s"):
        characterise(*opened(numbers), taus=[0.001])


def test_every_averaging_time(numbers):
    curve = characterise(*opened(numbers), taus="all")[1].curve
    assert curve.n.tolist() == list(range(1, 30_001))
    assert curve.dev[[0, 99, 29_999]] == pytest.approx(deviation(np.load(numbers)[:, 1], [1, 100, 30_000]), rel=1e-11)


def test_deviations_of_another_kind(numbers):
    found = deviations(*opened(numbers), "ohdev", taus=[1.0])
    assert [d.name for d in found] == ["column 1", "column 2"]
    assert found[0].curve.dev == pytest.approx(deviation(np.load(numbers)[:, 0], [100], "ohdev"), rel=1e-12)


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


def test_only_like_is_compared_with_like(numbers, tmp_path):
    one = tmp_path / "one.npy"
    np.save(one, np.load(numbers)[:, 0])
    with pytest.raises(ShapeError, match="before has column 1, column 2, but after has one"):
        comparisons(opened(numbers), opened(one))
    slower = load_static(one, rate=50.0, scale="1")
    with pytest.raises(ShapeError, match="at 100 Hz, but after is ratio at 50 Hz"):
        comparisons(opened(one), (slower, check_static(slower)))


def test_a_record_that_is_not_static_is_not_analysed(tmp_path):
    path = tmp_path / "moved.npy"
    np.save(path, np.random.default_rng(7).standard_normal(20_000) + 50.0 * (np.arange(20_000) > 9_000))
    with pytest.raises(ShapeError, match="not a static record"):
        characterise(*opened(path))


def test_the_simulator_s_noise_comes_back(tmp_path):
    """N, B and K of a unit's card, planted by `sim`, are found within three halves of their intervals."""
    simulated = simulate(
        "static", frame=Frame.ENU, sensors="mpu6000", unit="random", seed=3, rate=50.0, duration=3600.0
    )
    path = tmp_path / "static.parquet"
    files.write(path, simulated.imu)
    record = load_static(path)
    truth: NoiseCard = simulated.noise
    for analysis in characterise(record, check_static(record)):
        triad, axis = getattr(truth, analysis.name[:3]), "xyz".index(analysis.name[-1])
        for letter, planted in (("N", triad.n_rpsd), ("B", triad.b), ("K", triad.k_rpsd)):
            c, value = analysis.terms[letter], float(planted[axis])
            if value > 0.0 and c.observable:
                assert abs(math.log(c.value / value)) <= 3.0 * math.log(c.hi / c.lo) / 2.0, (analysis.name, letter)
            else:
                assert not c.observable and c.upper >= 0.5 * value, (analysis.name, letter)
        assert analysis.step == pytest.approx(
            to_si(1 / 131, "deg/s") if analysis.name[:3] == "gyr" else to_si(1 / 8192, "g"), rel=1e-3
        )


def test_a_file_s_name_may_hold_a_comma(tmp_path):
    """It names the channel, and findings about several channels list them with commas."""
    np.savetxt(tmp_path / "desk, 2.txt", np.full(5000, 3.0))
    record = load_static(tmp_path / "desk, 2.txt", rate=100.0, scale="1")
    report = check_static(record)
    assert report.refused("desk, 2")
    with pytest.raises(ShapeError, match="not a static record: desk, 2: all 5000 values are 3"):
        characterise(record, report)
