"""A gyroscope alone, from stop to stop: gain, axes, what stays unknown, and what is refused."""

import numpy as np
import pytest

import plumbob
from benchmarks.harness.calibration_stops import FINS, measure_stops
from plumbob.calibration.gyr.rest import Rates
from plumbob.calibration.gyr.stops import fit_stops
from plumbob.core.errors import ParameterError
from plumbob.core.units import deg, dps
from tests.helpers.gyro_sessions import Body
from tests.helpers.refusals import reason_kinds, reasons

QUARTER, WHOLE = 0.5 * np.pi, 2.0 * np.pi


def turned(*turns, seed=0, off=0.0):
    """Session of turns about axes 0 to 2 by angles, rad, each with 3 s of rest after it, the stops exact or `off`."""
    rng, body = np.random.default_rng(seed), Body(100.0)
    body.rest(10.0)
    for axis, angle in turns:
        vector = angle * np.eye(3)[axis] + off * rng.standard_normal(3)
        body.turn(vector, np.linalg.norm(vector), 2.0 + abs(angle) / 3.0)
        body.rest(3.0)
    return body.measured(rng, dps(0.01), 0.0)


SIX = [(axis, sign * QUARTER) for sign in (1.0, -1.0) for axis in range(3)]


def test_gain_and_drift_are_as_predicted():
    section = measure_stops(range(8))
    assert all(bar.met for bar in section.bars[:2])
    error, predicted, _, within = section.rows[FINS[0]]
    assert 0.5 < predicted / error < 2.0 and 45.0 < within < 90.0  # 32 instants of 8 units that hang together


def test_exact_stops_give_the_matrix_and_what_no_turn_shows_stays_unknown():
    session = turned(*SIX)
    made = fit_stops(Rates(session.t, session.gyr), angle_sd=deg(0.02)).calibration
    assert np.abs(made.matrix - session.matrix).max() < 5e-4 and made.matrix_sd.max() < 4e-4
    assert made.g_sensitivity_sd.max() > 0.0
    session = turned((2, WHOLE), (2, -WHOLE))
    fit = fit_stops(Rates(session.t, session.gyr), angle=WHOLE)
    made, sd = fit.calibration, fit.calibration.matrix_sd
    assert abs(made.matrix[2, 2] - session.matrix[2, 2]) < 3.0 * sd[2, 2] < 0.005
    assert sd[0, 0] > 0.1 and sd[0, 2] > 0.01  # neither turned, nor shown by a whole turn
    assert made.quality.grade == "poor" and "calibration.unturned" in {getattr(r, "code", "") for r in fit.remarks}
    assert made.bias_sd.min() > dps(0.05)  # one pose says nothing about gravity


def test_turns_that_miss_what_was_assumed_widen_it():
    ratios = []
    for seed in range(12):
        session = turned(*SIX, seed=seed, off=deg(2.0))
        made = fit_stops(Rates(session.t, session.gyr)).calibration
        ratios.append((made.matrix - session.matrix) / made.matrix_sd)
    assert np.sqrt(np.mean(np.square(ratios))) < 1.5  # 4 without


def test_what_was_not_turned_as_said_is_refused():
    session = turned(*SIX)
    rates, plan = Rates(session.t, session.gyr), [(axis, size) for axis, size in SIX]
    assert fit_stops(rates, turns=plan).calibration.quality.samples == 6
    assert reason_kinds(fit_stops, rates._replace(gyr=session.gyr * [1.0, -1.0, 1.0]), turns=plan) == ["mirrored"]
    assert reason_kinds(fit_stops, rates, turns=plan[:5]) == ["no-motion"]
    assert reason_kinds(fit_stops, rates, angle=WHOLE) == ["implausible"]
    (reason,) = reasons(fit_stops, rates._replace(gyr=deg(session.gyr)))
    assert reason.kind == "no-motion" and "check the unit" in reason.advice
    clipped = np.abs(session.gyr).max(axis=1) > dps(20.0)
    assert reason_kinds(fit_stops, rates._replace(clipped=clipped)) == ["clipping"]
    imu = plumbob.ImuData(t=session.t, gyr=session.gyr, meta=plumbob.ImuMeta(device="a"))
    card = plumbob.calibrate(
        imu, "gyro", method="stops", turns=", ".join(f"{'xyz'[a]} {s:+.9f} rad" for a, s in SIX)
    ).card
    assert np.allclose(card.gyr.matrix, fit_stops(rates, turns=plan).calibration.matrix, atol=1e-8)
    for options in ({"angle": "90 deg"}, {"method": "stops", "turns": "x"}, {"method": "stops", "angle": "-90 deg"}):
        with pytest.raises(ParameterError):
            plumbob.calibrate(imu, "gyro", **options)
