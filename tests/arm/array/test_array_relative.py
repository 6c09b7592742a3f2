"""Small rotations, relative biases and clock offsets that were planted, within their own uncertainty."""

from dataclasses import replace

import numpy as np
import pytest

from plumbob.arm.array import combine, info
from plumbob.arm.array.relative import corrected
from plumbob.core.errors import ParameterError
from plumbob.rotations import quat_from_rotvec, quat_multiply
from tests.helpers.arm_samples import ImuArray, ImuData, UnitMount, card, sampled, turned

T = np.arange(3000) / 100.0
RATE = np.stack([np.sin(2.0 * T), np.cos(1.5 * T), 0.7 * np.sin(0.8 * T + 1.0)], axis=1)
FORCE = 9.8 * np.stack([np.sin(0.6 * T), 0.5 * np.cos(0.8 * T), np.cos(0.6 * T)], axis=1)
FIELD = 45.0 * np.stack([np.cos(0.5 * T), np.sin(0.5 * T), 0.6 * np.cos(0.7 * T)], axis=1)
TRUE = {"a": np.zeros(3), "b": np.array([0.01, -0.02, 0.005]), "c": np.array([-0.004, 0.0, 0.015])}
BIAS = {"a": np.zeros(3), "b": np.array([0.0, 0.01, -0.005]), "c": np.array([0.02, 0.0, 0.0])}
NOISE = 0.01


@pytest.fixture(scope="module")
def array():
    """Units turned beyond what their mounts say, with biases of their gyroscopes."""
    noise = card(*[NOISE / np.sqrt(100.0)] * 3)
    nominal = {name: UnitMount(q_bs=turned(0.0, 0.0, 90.0 * i), noise=noise) for i, name in enumerate(TRUE)}
    real = {
        name: replace(m, q_bs=tuple(quat_multiply(quat_from_rotvec(TRUE[name]), np.array(m.q_bs)).tolist()))
        for name, m in nominal.items()
    }
    made = sampled(T, real, gyr=RATE, acc=FORCE, mag=FIELD, noise=NOISE, seed=4)
    units = {k: ImuData(T, one.gyr + BIAS[k] @ real[k].dcm, one.acc, one.mag) for k, one in made.units.items()}
    return ImuArray(units, nominal)


def test_what_was_planted_is_found_against_the_mean_and_corrected_units_agree(array):
    found = info(array)
    mean_turn, mean_bias = np.mean(list(TRUE.values()), axis=0), np.mean(list(BIAS.values()), axis=0)
    for one in found.units:
        off = (one.rotation - (TRUE[one.name] - mean_turn)) / one.rotation_sd
        assert np.abs(off).max() < 4.0  # standard deviations
        assert np.abs((one.bias["gyr"] - (BIAS[one.name] - mean_bias)) / one.bias_sd["gyr"]).max() < 4.0
        assert one.rotation_sd.max() < 1e-3 and abs(one.clock_offset) < 4.0 * one.clock_sd
    assert found.summary()["units"][0]["name"] == "a"
    # What is left is the noise alone, less the mean's share: √(1 − 1/3).
    left = combine(array, correct=True).parity_rms
    assert left["gyr"] == pytest.approx(np.full((3, 3), NOISE * np.sqrt(2.0 / 3.0)), rel=0.06)  # 3000 samples: 1.3 %
    assert combine(array).parity_rms["mag"].max() > 20.0 * left["mag"].max()


def test_a_late_clock_is_found_and_put_right():
    late = 0.0537
    mounts = {name: UnitMount(noise=card(*[NOISE / np.sqrt(100.0)] * 3)) for name in "abc"}
    rng = np.random.default_rng(5)

    def unit(shift):
        t = T + shift
        gyr = np.stack([np.sin(2.0 * t), np.cos(1.5 * t), 0.7 * np.sin(0.8 * t + 1.0)], axis=1)
        return ImuData(T, gyr + NOISE * rng.normal(size=gyr.shape), np.tile([0.0, 0.0, 9.8], (T.size, 1)))

    array = ImuArray({"a": unit(0.0), "b": unit(0.0), "c": unit(late)}, mounts)
    found = info(array)
    # the values of c were taken later; against the mean of three that is two thirds of it
    assert found["c"].clock_offset == pytest.approx(late * 2.0 / 3.0, abs=4.0 * found["c"].clock_sd + 2e-4)
    assert found["c"].clock_sd < 1e-3
    again = info(corrected(array, found))
    assert abs(again["c"].clock_offset) < 1e-3


def test_at_rest_the_clock_stays_unknown():
    t = np.arange(500) / 100.0
    mounts = {name: UnitMount(noise=card(*[NOISE / np.sqrt(100.0)] * 3)) for name in "ab"}
    zero = np.zeros((500, 3))
    found = info(sampled(t, mounts, gyr=zero, acc=zero + [0.0, 0.0, 9.8], noise=NOISE))
    assert np.isnan(found["a"].clock_offset)
    assert found["a"].rotation_sd[2] > 0.1  # about the vertical, nothing shows it: half of the prior at least
    with pytest.raises(ParameterError, match="no unit 'z'"):
        found["z"]
    with pytest.raises(ParameterError, match="two units"):
        info(ImuArray({"a": ImuData(T, RATE)}))
