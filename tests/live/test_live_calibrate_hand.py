"""A whole unit from one capture by hand: every planted error is found, in the right order, or none."""

import json
from dataclasses import replace

import numpy as np
import pytest

from plumbob.calibration.acc import calibrate_accel
from plumbob.calibration.calibrate_gyro import calibrate_by_hand, fit_gyro
from plumbob.calibration.calibrate_mag import calibrate_mag
from plumbob.calibration.calibration import Capture, capture, card_of
from plumbob.core.errors import CalibrationError
from plumbob.core.units import dps
from plumbob.rotations import Frame
from plumbob.simulation import Module, TriadErrors, simulate
from tests.helpers import is_plain
from tests.helpers.refusals import reasons

# Axes of the accelerometer are those of the case, because its poses do not show a turn of them.
UNIT = Module(
    "unit",
    "test",
    gyr=TriadErrors(
        white_rpsd=dps(0.005),
        bias=dps(np.array([1.5, -2.0, 0.7])),
        scale=[0.01, -0.01, 0.02],
        misalignment=[[0.0, 0.01, -0.005], [0.008, 0.0, 0.012], [-0.01, 0.004, 0.0]],
    ),
    acc=TriadErrors(white_rpsd=4e-3, bias=[0.2, -0.3, 0.1], scale=[0.01, -0.02, 0.015]),
    mag=TriadErrors(
        white_sd=0.2,
        hard_iron=[13.0, -24.0, 10.0],
        scale=[0.03, -0.02, 0.05],
        misalignment=[[0.0, 0.02, 0.01], [-0.02, 0.0, 0.03], [0.01, -0.01, 0.0]],
    ),
)


@pytest.fixture(scope="module")
def simulated():
    return simulate("poses", frame=Frame.NED, sensors=UNIT, unit="random", seed=1, number=18, rate=50.0, move=2.0)


@pytest.fixture(scope="module")
def whole(simulated) -> Capture:
    return capture(simulated.imu, triads=("acc",), if_present=("gyr", "mag"))


@pytest.fixture(scope="module")
def fits(whole):
    return calibrate_by_hand(whole, strength=50.0)


def triads_of(card):
    """What a card's file says of each triad."""
    return {name: json.loads(card.text())[name] for name in ("gyr", "acc", "mag")}


def help_of(on):
    """What a capture's card says of the sensors that help the magnetometer."""
    return {"gyr_calibrated": on.gyr_calibrated, "acc_calibrated": on.acc_calibrated}


def test_every_planted_error_is_found(simulated, fits):
    assert list(fits) == ["acc", "gyr", "mag"]
    for name, fit in fits.items():
        found, truth = fit.calibration, getattr(simulated.calibration, name)
        off = np.r_[found.bias - truth.bias, (found.matrix - truth.matrix).ravel()]
        assert (np.abs(off) <= 5.0 * np.sqrt(np.diag(found.covariance)) + 1e-12).all(), name


def test_each_is_found_with_the_card_of_those_before_which_is_replaced_and_not_applied_twice(whole, fits):
    """The same bits as one kind after the other, each given the card of the last."""
    card, steps = None, {}
    for name, fit in (
        ("acc", lambda on: calibrate_accel(on.imu)),
        ("gyr", lambda on: fit_gyro(on, "auto")),
        ("mag", lambda on: calibrate_mag(on.imu, strength=50.0, **help_of(on))),
    ):
        on = capture(whole.imu, triads=(name,), base=card)
        steps[name] = fit(on)
        card = card_of(on, {name: steps[name]})
    assert triads_of(card) == triads_of(card_of(whole, fits))
    assert steps["gyr"].remarks == fits["gyr"].remarks
    again = capture(whole.imu, triads=("acc",), if_present=("gyr", "mag"), base=card_of(whole, fits))
    assert np.array_equal(again.imu.mag, whole.imu.mag)
    assert triads_of(card_of(again, calibrate_by_hand(again, strength=50.0))) == triads_of(card_of(whole, fits))


def test_what_the_recording_lacks_is_left_out(whole):
    assert list(calibrate_by_hand(replace(whole, imu=replace(whole.imu, mag=None)))) == ["acc", "gyr"]
    alone = replace(whole.imu, mag=None, gyr=None)
    assert list(calibrate_by_hand(replace(whole, imu=alone))) == ["acc"]
    with pytest.raises(CalibrationError, match="has no acc"):
        capture(replace(whole.imu, acc=None), triads=("acc",), if_present=("gyr", "mag"))


def turned_to_one_side(imu):
    return replace(imu, acc=np.tile([0.0, 0.0, -9.8], (len(imu), 1)))


def late_magnet(imu):
    """A magnet that is put beside the unit halfway."""
    return replace(imu, mag=imu.mag + np.where(imu.t[:, np.newaxis] > 0.5 * imu.t[-1], [30.0, 0.0, 0.0], 0.0))


def rates_of_another_hour(imu):
    return replace(imu, gyr=imu.gyr[::-1])


@pytest.mark.parametrize(("change", "kinds", "start", "advice"), [
    (turned_to_one_side, {"too-few-regions"}, "accelerometer: no pose", "so it comes first."),
    (rates_of_another_hour, None, "gyroscope: ", "'plumbob calibrate accel' alone would do"),
    pytest.param(
        late_magnet,
        {"magnet-moved", "outliers"},
        "magnetometer: ",
        "'plumbob calibrate accel', then 'gyro', would do",
        marks=pytest.mark.skipif(is_plain(), reason="a quarter of a minute as plain Python"),
    ),
])  # fmt: skip
def test_a_triad_that_cannot_be_calibrated_refuses_all(whole, change, kinds, start, advice):
    """The reasons name it, and what would do."""
    found = reasons(calibrate_by_hand, replace(whole, imu=change(whole.imu)))
    assert kinds is None or {reason.kind for reason in found} & kinds
    assert found[0].text.startswith(start)
    assert advice in "".join(reason.advice for reason in found)
