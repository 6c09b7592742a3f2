"""Least squares of all sensor axes, and recordings put on one time line."""

from dataclasses import replace

import numpy as np
import pytest

from plumbob import ImuMeta, flags
from plumbob.arm.array import combine, joined
from plumbob.core.errors import ClockError, ParameterError, ShapeError
from tests.helpers.arm_samples import ImuArray, ImuData, UnitMount, card, sampled, turned

T = np.arange(400) / 100.0
RATE = np.stack([np.sin(3.0 * T), 0.5 * np.cos(2.0 * T), 0.3 * np.sin(5.0 * T)], axis=1)
FORCE = np.stack([np.cos(T), np.sin(2.0 * T), 9.8 + 0.0 * T], axis=1)
FIELD = np.stack([20.0 + 0.0 * T, 3.0 * np.sin(T), 40.0 + 0.0 * T], axis=1)
MOUNTS = {
    "a": UnitMount(),
    "b": UnitMount(q_bs=turned(90.0, 0.0, 0.0), lever_b=(0.1, 0.0, 0.0)),
    "c": UnitMount(q_bs=turned(30.0, -40.0, 70.0), lever_b=(0.0, 0.2, 0.0)),
    "d": UnitMount(q_bs=turned(0.0, 180.0, 0.0), lever_b=(0.0, -0.1, 0.15)),
}


@pytest.fixture(scope="module")
def array():
    return sampled(T, MOUNTS, gyr=RATE, acc=FORCE, mag=FIELD)


def test_without_noise_the_body_comes_back_and_no_unit_measures_anything_beyond(array):
    one = combine(array)
    assert (one.imu.gyr, one.imu.mag) == (pytest.approx(RATE, abs=1e-12), pytest.approx(FIELD, abs=1e-12))
    # the angular acceleration of samples is a difference, exact to Δt²/6 of the third derivative: 5³·.3·1e-4/6 · .2 m
    assert one.imu.acc[2:-2] == pytest.approx(FORCE[2:-2], abs=2e-4)
    row = combine(ImuArray({name: unit[:1] for name, unit in array.units.items()}, MOUNTS)).imu
    assert np.isfinite(row.acc).all() and row.gyr == pytest.approx(RATE[:1], abs=1e-12)
    assert max(float(np.nanmax(np.abs(one.parity[t]))) for t in ("gyr", "mag")) < 1e-12
    assert np.abs(one.parity["acc"][2:-2]).max() < 4e-4  # of that acceleration and of its part in the force


def test_levers_alone_tell_the_angular_acceleration_where_they_span_it(array):
    """Without the levers' terms, the mean is off by those of the mean lever, which this computes."""
    bare = ImuArray(array.units, {k: replace(m, lever_b=(0.0, 0.0, 0.0)) for k, m in MOUNTS.items()})
    lever, turn = np.mean([m.lever_b for m in MOUNTS.values()], axis=0), np.gradient(RATE, T, axis=0, edge_order=2)
    off = np.cross(turn, lever) + np.cross(RATE, np.cross(RATE, lever))
    assert combine(bare).imu.acc - FORCE == pytest.approx(off, abs=1e-12)
    # without the accelerometers' own, causal differences would lag by half a step: ½ Δt ω̈ × the mean lever
    lag = np.abs(0.5 * 0.01 * np.cross(np.gradient(turn, T, axis=0), lever)).max()
    assert np.abs(combine(array, causal=True).imu.acc[3:] - FORCE[3:]).max() < lag


def test_noise_falls_with_the_square_root_of_the_number():
    t = np.arange(20_000) / 100.0
    mounts = {f"u{i}": UnitMount(q_bs=turned(0.0, 0.0, 40.0 * i), noise=card()) for i in range(9)}
    zero = np.zeros((t.size, 3))
    one = combine(sampled(t, mounts, gyr=zero, acc=zero + [0.0, 0.0, 9.8], noise=0.01))
    assert one.imu.gyr.std() == pytest.approx(0.01 / 3.0, rel=0.02)  # 60 000 values: 0.3 %, seven of which
    assert one.noise.gyr.n_rpsd == pytest.approx(np.full(3, 1e-3 / 3.0))
    # what is left has lost the mean's share: √(1 − 1/9)
    assert one.parity_rms["gyr"] == pytest.approx(np.full((9, 3), 0.01 * np.sqrt(8.0 / 9.0)), rel=0.03)


def test_a_noisy_unit_weighs_less_and_weights_by_range_need_ranges():
    t, zero = np.arange(50) / 10.0, np.zeros((50, 3))
    mounts = {"good": UnitMount(noise=card(gyr=1e-3)), "bad": UnitMount(noise=card(gyr=3e-3))}
    array = sampled(t, mounts, gyr=zero, acc=zero + [0.0, 0.0, 9.8])
    units = dict(array.units) | {"bad": ImuData(t, zero + 1.0, zero)}
    assert combine(ImuArray(units, mounts)).imu.gyr == pytest.approx(np.full((50, 3), 0.1))  # 1/(1 + 9)
    assert combine(ImuArray(units, mounts), weights="equal").imu.gyr == pytest.approx(np.full((50, 3), 0.5))
    fine = ImuData(t, gyr=zero, meta=ImuMeta(gyr_range=1.0))
    wide = ImuData(t, gyr=zero + 0.5, meta=ImuMeta(gyr_range=3.0))
    assert combine(ImuArray({"a": fine, "b": wide}), weights="range").imu.gyr == pytest.approx(np.full((50, 3), 0.05))
    with pytest.raises(ParameterError, match="gyr_range"):
        combine(ImuArray({"a": fine, "b": ImuData(t, gyr=zero)}), weights="range")


def test_a_dead_unit_a_slow_magnetometer_and_a_clipped_axis_are_left_out_of_their_rows(array):
    units = dict(array.units)
    gyr, mag = units["a"].gyr.copy(), units["b"].mag.copy()
    gyr[100:] = np.nan
    mag[1::2] = np.nan
    end = float(np.abs(RATE[:, 0]).max()) * 0.8
    clipped = np.clip(units["d"].gyr, -end, end)
    units["a"] = ImuData(T, gyr, units["a"].acc, units["a"].mag)
    units["b"] = ImuData(T, units["b"].gyr, units["b"].acc, mag)
    units["d"] = ImuData(T, clipped, units["d"].acc, units["d"].mag, meta=ImuMeta(gyr_range=end))
    assert (units["d"].flags & flags.GYR_CLIPPED).any()
    one = combine(ImuArray(units, MOUNTS))
    assert (one.imu.gyr, one.imu.mag) == (pytest.approx(RATE, abs=1e-12), pytest.approx(FIELD, abs=1e-12))


def test_axes_of_single_axis_units_make_one_vector():
    """Three gyroscopes of one axis each, along x, y and z of their cases, turned so that they span the body."""
    t = np.arange(20) / 10.0
    rate = np.tile([0.1, -0.2, 0.3], (20, 1))
    z = np.array([np.nan, np.nan, 1.0])
    mounts = {
        "x": UnitMount(q_bs=turned(0.0, 90.0, 0.0)), "y": UnitMount(q_bs=turned(-90.0, 0.0, 0.0)), "z": UnitMount(),
    }  # fmt: skip
    units = {name: ImuData(t, (rate @ m.dcm) * z, np.zeros((20, 3))) for name, m in mounts.items()}
    assert combine(ImuArray(units, mounts)).imu.gyr == pytest.approx(rate, abs=1e-12)
    del units["y"], mounts["y"]
    assert np.isnan(combine(ImuArray(units, mounts)).imu.gyr).all()
    with pytest.raises(ShapeError, match="do not span"):
        combine(ImuArray({"a": ImuData(t, gyr=rate * z[::-1])}))


def test_what_a_mask_excludes_is_left_out_and_flagged(array):
    out = np.zeros((len(T), 4), dtype=bool)
    out[50:60, 2] = True
    units = dict(array.units)
    units["c"] = ImuData(T, units["c"].gyr + 1.0, units["c"].acc)
    one = combine(ImuArray(units, MOUNTS), excluded={"gyr": out})
    assert one.imu.gyr[50:60] == pytest.approx(RATE[50:60], abs=1e-12)
    assert ((one.imu.flags & flags.UNIT_EXCLUDED) != 0).tolist() == out.any(axis=1).tolist()
    with pytest.raises(ShapeError, match=r"\(400, 4\)"):
        combine(array, excluded={"gyr": out[1:]})


def test_late_clocks_are_put_right_by_interpolation_and_own_times_joined_but_not_across_a_gap():
    """Linear interpolation of sin 3t leaves (3 Δt)²/8 of it: 1.1e-4 at 100 Hz."""
    late = UnitMount(clock_offset=0.0137)
    then = np.stack([np.sin(3.0 * (T + 0.0137))] * 3, axis=1)
    now = np.stack([np.sin(3.0 * T)] * 3, axis=1)
    one = combine(ImuArray({"a": ImuData(T, gyr=now), "b": ImuData(T, gyr=then)}, {"b": late}))
    assert one.imu.gyr == pytest.approx(now, abs=1.2e-4)
    own = np.delete(np.arange(0.003, 4.0, 0.01), slice(100, 150))  # no samples from 1.003 s to 1.503 s
    line = ImuData(T, gyr=np.stack([T, 2.0 * T, -T], axis=1) * 0.1)
    other = ImuData(own, gyr=np.stack([own, 2.0 * own, -own], axis=1) * 0.1)
    array = joined({"a": line, "b": other})
    known = np.isfinite(array.units["b"].gyr).all(axis=1)
    assert np.array_equal(array.t, T)
    assert array.units["b"].gyr[known] == pytest.approx(line.gyr[known], abs=1e-12)
    assert not known[(T > 1.0) & (T < 1.5)].any() and known[(T > 0.01) & (T < 0.99)].all()
    assert not known[0]  # before its first sample
    with pytest.raises(ClockError, match="no time in common"):
        joined({"a": line, "b": ImuData(own + 100.0, gyr=other.gyr)})
