"""Streams with clocks of their own on one time line."""

import numpy as np
import pytest

from plumbob.core.errors import ClockError, ShapeError
from plumbob.data import ImuMeta
from plumbob.files.foreign.logged import Readings, joined, seconds_to_ns

MS = 1_000_000


def lines(t_ns, slope):
    """Values (N, 3) that grow linearly in time, so that interpolation must find them to rounding."""
    return np.outer(np.asarray(t_ns) / 1e9, slope)


def test_a_stream_of_like_rate_is_interpolated_on_the_gyroscopes_stamps():
    gyr_ns = np.arange(200) * 5 * MS + 1_000 * MS
    acc_ns = np.arange(220) * 5 * MS + 990 * MS + 1_234_567
    imu, _, notes = joined(
        {"gyr": Readings(gyr_ns, lines(gyr_ns, [0.1, 0.2, 0.3])), "acc": Readings(acc_ns, lines(acc_ns, [1, 2, 9]))},
        meta=ImuMeta(unit_check=False),
        epoch_ns=0,
    )
    assert imu.t.tolist() == ((gyr_ns - gyr_ns[0]) / 1e9).tolist()
    assert imu.meta.t0_ns == gyr_ns[0]
    np.testing.assert_allclose(imu.acc, lines(gyr_ns, [1, 2, 9]), rtol=1e-12)  # linear in time: closed form
    assert len(notes) == 1 and "interpolated linearly at those of gyr" in str(notes[0])


def test_a_slow_stream_keeps_its_own_values_and_a_fast_one_is_averaged_without_folding():
    gyr_ns = np.arange(1000) * 5 * MS
    mag_ns = np.arange(50) * 100 * MS + 2 * MS
    mag = 40 + np.arange(150).reshape(50, 3) / 100
    imu, _, notes = joined({"gyr": Readings(gyr_ns, np.zeros((1000, 3))), "mag": Readings(mag_ns, mag)}, meta=ImuMeta())
    known = np.isfinite(imu.mag).all(axis=1)
    assert known.sum() == 50
    np.testing.assert_array_equal(imu.mag[known], mag)
    np.testing.assert_array_equal(np.flatnonzero(known), np.arange(50) * 20)  # 2 ms are nearer to 0 than to 5 ms
    assert "nearest row" in str(notes[0])
    gyr_ns, acc_ns = np.arange(500) * 10 * MS, np.arange(5000) * MS
    vibration = np.sin(2 * np.pi * 99.0 * acc_ns / 1e9)  # single samples at 100 Hz would show it at 1 Hz
    acc = np.column_stack([vibration, np.zeros(5000), np.full(5000, 9.81)])
    imu, _, notes = joined({"gyr": Readings(gyr_ns, np.zeros((500, 3))), "acc": Readings(acc_ns, acc)}, meta=ImuMeta())
    # a mean over 11 samples of 1 ms keeps |sin(11 π f T) / (11 sin(π f T))| of it: Dirichlet kernel, f T = .099
    kept = abs(np.sin(11 * np.pi * 0.099) / (11 * np.sin(np.pi * 0.099)))
    assert np.abs(imu.acc[5:-5, 0]).max() == pytest.approx(kept, rel=0.01)
    assert "averaged" in str(notes[0])


def test_nothing_is_made_up_in_gaps_or_beside_missing_values():
    gyr_ns = np.arange(100) * 10 * MS
    acc_ns = np.concatenate([np.arange(10, 40), np.arange(60, 90)]) * 10 * MS + MS
    acc = np.tile([0.0, 0.0, 9.81], (60, 1))
    imu, *_ = joined({"gyr": Readings(gyr_ns, np.zeros((100, 3))), "acc": Readings(acc_ns, acc)}, meta=ImuMeta())
    known = np.flatnonzero(np.isfinite(imu.acc).all(axis=1))
    assert known.tolist() == [*range(11, 40), *range(61, 90)]
    gyr_ns = np.arange(50) * 10 * MS
    acc = np.tile([0.0, 0.0, 9.81], (50, 1))
    acc[20] = np.nan
    imu, *_ = joined({"gyr": Readings(gyr_ns, np.zeros((50, 3))), "acc": Readings(gyr_ns + MS, acc)}, meta=ImuMeta())
    assert np.flatnonzero(np.isnan(imu.acc).any(axis=1)).tolist() == [0, 20, 21]  # row 0 lies before the first stamp


def test_stamps_that_repeat_keep_their_samples_on_an_even_clock():
    stamps = np.arange(1000) * 10 * MS
    stamps[[200, 500]] = stamps[[199, 100]]
    imu, _, notes = joined({"gyr": Readings(stamps, np.zeros((1000, 3)))}, meta=ImuMeta())
    assert imu.t == pytest.approx(np.arange(1000) * 0.01, abs=1e-3)
    assert (notes[0].code, notes[0].values["count"]) == ("reading.clock_leaps", 1)
    assert (notes[1].code, notes[1].values["repeated"]) == ("reading.clock_fitted", 1)
    with pytest.raises(ClockError, match="not as a clock jitters"):
        joined({"gyr": Readings(np.random.default_rng(1).permutation(1000) * MS, np.zeros((1000, 3)))}, meta=ImuMeta())


def test_without_a_gyroscope_the_fastest_leads_and_without_a_triad_it_is_refused():
    fast, slow = np.arange(100) * 10 * MS, np.arange(10) * 100 * MS
    imu, *_ = joined(
        {"mag": Readings(slow, np.full((10, 3), 25.0)), "acc": Readings(fast, np.full((100, 3), 5.66))}, meta=ImuMeta()
    )
    assert len(imu) == 100
    with pytest.raises(ShapeError, match="a stream of gyr, acc or mag"):
        joined({"temp_c": Readings(slow, np.full(10, 25.0))}, meta=ImuMeta())


def test_streams_on_clocks_that_nothing_relates_are_refused():
    gyr, mag = Readings(np.arange(9) * MS, np.ones((9, 3))), Readings(np.arange(9) * MS + 10**18, np.ones((9, 3)))
    with pytest.raises(ClockError, match=r"mag does not overlap gyr in time: one has stamps from 1e\+09"):
        joined({"gyr": gyr, "mag": mag}, meta=ImuMeta())


def test_stamps_in_seconds_must_be_times():
    assert seconds_to_ns("t", [0.0, 1.5]).tolist() == [0, 1_500_000_000]
    with pytest.raises(ClockError, match="not times in seconds"):
        seconds_to_ns("t", [0.0, np.nan])


@pytest.mark.parametrize("rows", [[0], [500], [500, 501, 502], [998, 999]])
def test_samples_whose_stamps_are_damaged_are_kept_at_their_places(rows):
    stamps = np.arange(1000) * 10 * MS
    damaged = stamps + np.isin(np.arange(1000), rows) * 2**40 * MS
    _, rows_ns, notes = joined({"gyr": Readings(damaged, np.zeros((1000, 3)))}, meta=ImuMeta())
    assert np.array_equal(rows_ns, stamps) and notes[0].values["count"] == len(rows)
