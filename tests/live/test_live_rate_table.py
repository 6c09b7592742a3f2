"""A session on a rate table from the recording to the card, by found plateaus and by a plan."""

from dataclasses import replace

import numpy as np
import pytest

from plumbob import Frame, apply_card
from plumbob.calibration.calibrate_gyro import Plateau, calibrate_table, found_plateaus, read_plan
from plumbob.calibration.calibration import capture, card_of
from plumbob.calibration.fit import CaptureRefusedError
from plumbob.core.constants import G0
from plumbob.core.errors import DecodeError, ParameterError
from plumbob.core.units import dps
from plumbob.simulation import Module, TriadErrors, simulate
from tests.helpers.refusals import reason_kinds

NOMINAL = dps(np.array([50.0, 100.0, 200.0]))
COUPLING = dps(np.array([[0.05, -0.03, 0.02], [0.04, 0.06, -0.05], [-0.02, 0.03, 0.07]])) / G0
GYR = TriadErrors(
    bias=dps(np.array([3.0, -12.0, 1.0])), scale=(0.02, -0.01, 0.005),
    misalignment=((0.0, 0.004, -0.006), (-0.003, 0.0, 0.005), (0.002, 0.007, 0.0)), g_sensitivity=COUPLING,
    white_rpsd=dps(0.005), full_scale=dps(250.0),
)  # fmt: skip
HEADER = "from_s,to_s,rate_x_dps,rate_y_dps,rate_z_dps"


def simulated(**changes):
    unit = Module("unit", "test", gyr=changes.pop("gyr", GYR), acc=TriadErrors(white_rpsd=1e-3))
    return simulate("ratetable", frame=Frame.NED, sensors=unit, unit="random", seed=4, hold=4.0, **changes)


@pytest.fixture(scope="module")
def made():
    return simulated()


@pytest.fixture(scope="module")
def session(made):
    return capture(made.imu, triads=("gyr",))


@pytest.fixture(scope="module")
def planned(session):
    plateaus, remarks = found_plateaus(session.imu, NOMINAL)
    assert len(plateaus) == 42 and not remarks
    return plateaus


@pytest.fixture(scope="module")
def fitted(session, planned):
    return calibrate_table(session, planned)


def test_the_card_is_the_perfect_one_within_what_it_claims_and_makes_the_rates_right(made, session, planned, fitted):
    found = calibrate_table(session, planned, mounting=0.0).calibration
    perfect = made.calibration.gyr
    for name, sd in (("bias", found.bias_sd), ("matrix", found.matrix_sd), ("g_sensitivity", found.g_sensitivity_sd)):
        # 21 numbers: 4.5 standard deviations leave 1 chance in 7000
        assert (np.abs(getattr(found, name) - getattr(perfect, name)) < 4.5 * sd).all(), name
    # 0.005 °/s/√Hz over the 3 s that are left of 4 s: 0.0029 °/s
    assert found.bias_sd.max() < dps(0.0029) / np.sqrt(42) * 1.5
    assert found.temp_ref_c == 25.0
    applied = apply_card(card_of(session, {"gyr": fitted}), made.imu)
    for plateau in planned:
        inside = (applied.t >= plateau.start) & (applied.t < plateau.stop)
        # 6 standard deviations of the mean of 3 s and of the fit
        np.testing.assert_allclose(applied.gyr[inside].mean(axis=0), plateau.rate, rtol=0, atol=6.0 * dps(0.0029))


def test_what_is_missing_or_clipped_is_refused_and_can_be_left_out(made, session):
    clipped = simulated(gyr=TriadErrors(bias=GYR.bias, white_rpsd=dps(0.005), full_scale=dps(150.0)))
    whole = capture(clipped.imu, triads=("gyr",))
    planned, _ = found_plateaus(whole.imu, dps(np.array([50.0, 100.0, 150.0])))
    assert reason_kinds(calibrate_table, whole, planned)[0] == "clipping"
    planned, remarks = found_plateaus(whole.imu, dps(np.array([50.0, 100.0])))
    assert len(planned) == 30 and len(remarks) == 12 and "is left out" in remarks[0]
    assert calibrate_table(whole, planned).calibration.quality.samples == 30
    half = capture(made.imu, triads=("gyr",), span=(0.0, made.imu.t[-1] / 4.0))
    for analyse, error, words in (
        (lambda: calibrate_table(half, found_plateaus(half.imu, NOMINAL)[0]), CaptureRefusedError, "few.*about x or y"),
        (lambda: found_plateaus(session.imu, [2.0, 3.0]), CaptureRefusedError, "rates found are, in °/s"),
        (lambda: calibrate_table(session, [Plateau(9e3, 9001.0, np.zeros(3))]), ParameterError, "holds no sample"),
    ):
        with pytest.raises(error, match=words):
            analyse()


def test_a_plan_says_rates_and_specific_force(tmp_path, session, planned, fitted):
    path = tmp_path / "plan.csv"
    rows = [(plateau.start, plateau.stop, *np.degrees(plateau.rate).tolist()) for plateau in planned]
    path.write_text("\n".join((HEADER, *(", ".join(map(repr, row)) for row in rows))) + "\n")
    read = calibrate_table(session, read_plan(path)).calibration
    np.testing.assert_allclose(read.bias, fitted.calibration.bias, rtol=1e-12)
    path.write_text(f"{HEADER},acc_x_g,acc_y_g,acc_z_g\n0,5,0,0,90,0.0,0.5,-1\n")
    (one,) = read_plan(path)
    np.testing.assert_allclose(one.rate, [0.0, 0.0, np.pi / 2.0], rtol=1e-15)
    np.testing.assert_allclose(one.force, [0.0, 0.5 * G0, -G0], rtol=1e-15)
    assert (one.start, one.stop) == (0.0, 5.0)


@pytest.mark.parametrize(("text", "words"), [
    (f"{HEADER}\n0,5,0,0,9\n5,9,0,0,fast\n", "line 3: rate_z_dps must be a number, but it is 'fast'"),
    (f"{HEADER}\n0,5,0,0\n", "line 2: rate_z_dps must be a number, but it is None"),
    (f"{HEADER}\n0,5,0,0,9,4\n", "line 2: a column too many"),
    (f"{HEADER}\n5,5,0,0,9\n", "line 2: numbers must be finite, and from_s before to_s"),
    (f"{HEADER}\n0,5,0,0,nan\n", "line 2: numbers must be finite"),
    ("from_s,to_s,rate_x,rate_y,rate_z\n", "line 1: a plan has the columns from_s, to_s, rate_x_dps"),
    (f"{HEADER},acc_x_g\n", "line 1: .*all or none of acc_x_g"),
    ("", "line 1: .* this one has none"),
    ("\udcff\udcfe", "not UTF-8 text"),
])  # fmt: skip
def test_a_bad_plan_is_refused_by_its_line(tmp_path, text, words):
    path = tmp_path / "plan.csv"
    path.write_bytes(text.encode(errors="surrogateescape"))
    with pytest.raises(DecodeError, match=words):
        read_plan(path)


def test_what_the_card_so_far_means_is_said(made, session, planned, fitted):
    warm = replace(made.calibration, gyr=replace(made.calibration.gyr, bias_per_k=np.full(3, 1e-4)))
    based = calibrate_table(capture(made.imu, triads=("gyr",), base=warm), planned)
    uncoupled = calibrate_table(session, planned, model="12")
    for words, fit, times in (
        ("polynomial of temperature is gone", based, 1),
        ("accelerometer is not calibrated", based, 0),
        ("accelerometer is not calibrated", fitted, 1),
        ("accelerometer is not calibrated", uncoupled, 0),
    ):
        assert sum(words in str(remark) for remark in fit.remarks) == times
