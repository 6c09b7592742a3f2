"""Attitude of an array: what units beyond one are worth, and what is lost when one goes."""

import numpy as np
import pytest

from plumbob import Frame, flags
from plumbob.arm.array import estimate
from plumbob.arm.array.direction_filter import Params, track_directions
from plumbob.arm.array.monitoring import MonitoringSettings
from plumbob.core.errors import ParameterError, PlumbobError
from plumbob.core.units import dps
from plumbob.papers.arm import REST, arm_array, pair, turn_errors
from plumbob.rotations import dcm_from_quat
from tests.helpers.arm_samples import ImuArray, ImuData, as_array, moved

SETTINGS = MonitoringSettings(gyr_bias=REST.bias / np.sqrt(3.0))


def rms(array, truth, filter_, rows=slice(0, None), **options):
    return float(
        np.sqrt(np.mean(turn_errors(estimate(array, filter_, frame=Frame.NED, **options).track.q_nb, truth)[rows] ** 2))
    )


def without(array, name):
    units = {k: one for k, one in array.units.items() if k != name}
    return ImuArray(units, {k: array.mounts[k] for k in units})


def test_six_units_are_better_than_two_as_the_square_root_says():
    """Noise falls by √3; seeds scatter by a tenth."""
    found = []
    for units in (2, 6):
        runs = [arm_array(seed, turns=False) for seed in range(1, 6)]
        runs = [(pair(array), truth) for array, truth in runs] if units == 2 else runs
        found.append(np.sqrt(np.mean([rms(*run, "directions", settings=SETTINGS) ** 2 for run in runs])))
    assert found[0] / found[1] == pytest.approx(np.sqrt(3.0), rel=0.3)


@pytest.mark.parametrize("kind", ["dead", "biased"])
@pytest.mark.parametrize("filter_", ["directions", "mekf", None])
def test_a_unit_that_breaks_costs_no_more_than_not_to_have_had_it(kind, filter_):
    found = moved(31, 80.0, moving=True)
    truth, broken = found["truth"]["q_nb"], dict(found["u3"])
    broken["gyr"] = found["u3"]["gyr"].copy()
    if kind == "dead":
        broken = {k: np.where(np.arange(800)[:, np.newaxis] < 500, v, np.nan) for k, v in found["u3"].items()}
    else:
        broken["gyr"][500:, 0] += dps(2.0)
    whole = as_array(found)
    five = rms(without(whole, "u3"), truth, filter_, slice(500, None))
    less = estimate(as_array(found | {"u3": broken}), filter_, frame=Frame.NED)
    error = float(np.sqrt(np.mean(turn_errors(less.track.q_nb, truth)[500:] ** 2)))
    assert error < 1.2 * five
    assert (less.track.flags[600] & flags.UNIT_EXCLUDED) != 0


def test_the_covariance_of_the_small_filter_is_that_of_its_errors_deg():
    """Normalised squared error of three angles over 40 seeds: χ² of 120 gives 3 ± 0.39."""
    squares = []
    for seed in range(1, 41):
        array, truth = arm_array(seed, turns=False)
        track = estimate(array, "directions", frame=Frame.NED, settings=SETTINGS).track
        e = np.radians(turn_errors(track.q_nb[-1:], truth[-1:])[0])
        squares.append(e @ np.linalg.solve(track.cov_b[-1], e))
    assert np.mean(squares) == pytest.approx(3.0, abs=3.0 * 0.39)


def test_the_noise_of_the_force_counts_once_and_a_push_counts_more():
    """At rest the tilt is the mean of n forces: its standard deviation is 0.1 / g / √n. Only a push is no gravity."""
    force = np.array([0.0, 0.0, -9.80665]) + 0.1 * np.random.default_rng(1).normal(size=(200, 3))
    force[100, 2] -= 2.0
    imu = ImuData(np.arange(200) / 10.0, np.zeros((200, 3)), force)
    track = track_directions(imu, Frame.NED, Params(gyr_noise=1e-9, acc_noise=0.1 * np.sqrt(0.1)))
    c_nb = dcm_from_quat(track.q_nb)
    sd = np.sqrt((c_nb @ track.cov_b @ np.swapaxes(c_nb, 1, 2))[:, 0, 0])
    assert sd[:100] == pytest.approx(0.1 / 9.80665 / np.sqrt(np.arange(1, 101)), rel=0.01)
    assert sd[100] > 0.9999 * sd[99]


def test_the_frame_of_the_units_is_taken():
    array, _ = arm_array(1, turns=False)
    assert estimate(array, "directions").track.frame is Frame.NED
    bare = ImuArray({k: ImuData(one.t, one.gyr, one.acc, one.mag) for k, one in array.units.items()}, array.mounts)
    for given, more, match in (
        (bare, {}, "frame"),
        (array, {"lag": 1.0}, "neither lag nor init"),
        (array, {"params": {"kp": 1.0}}, "no parameter 'kp'"),
    ):
        with pytest.raises(ParameterError if more else PlumbobError, match=match):
            estimate(given, "directions", **more)
