"""The smoother on a buoy, whose way goes with its tilt: neither is taken for an error of the gyroscope."""

import numpy as np
import pytest

import plumbob as pb
from benchmarks.waves import HULLS, SEAS, GaussianSea


@pytest.mark.parametrize(("sea", "hull", "most"), [("swell", "large", 0.2), ("calm", "small", 0.5)])
def test_no_scale_is_learned_of_a_calibrated_gyroscope_that_waves_seem_to_ask_for(sea, hull, most):
    """`most`: of the inclination, degrees; half a step of 0.1 s is 0.3° of the calm's rates of 6 °/s."""
    way, tilt, damping = HULLS[hull]
    plan = GaussianSea(trains=tuple(SEAS[sea]), way_period=way, tilt_period=tilt, tilt_damping=damping, heading=0.5)
    made = pb.simulate(plan, frame="NED", sensors="icm20948", unit="calibrated", seed=0, rate=10.0, duration=1200.0)
    estimate = pb.estimate(made.imu)
    assert np.abs(estimate.filter.learned.matrix).max() < 0.01  # 0.4 to 0.6 would take the ways of the waves away
    assert pb.evaluate(estimate.track, made.truth).summary()["inclination_rmse_deg"] < most
