"""Ferraris sessions: a second program on a real one, and known errors on simulated ones."""

import csv

import numpy as np
import pytest

from plumbob.calibration.fit import CaptureRefusedError
from plumbob.calibration.gyr.ferraris import FACES, find_parts, fit_ferraris, parts_of_labels
from plumbob.core.constants import G0
from plumbob.core.errors import CalibrationError
from plumbob.core.units import dps, g
from tests.helpers.gyro_sessions import ferraris
from tests.helpers.real_data import DATA, needs
from tests.helpers.refusals import reasons

SESSION = DATA / "ferraris" / "annotated_session.csv"

# imucal 2.6.0 (MIT) on annotated_session.csv, raw counts: FerrarisCalibration(grav=9.80665, expected_angle=360)
# .compute(ferraris_regions_from_df(data), sampling_rate_hz=204.8, from_acc_unit="a.u.", from_gyr_unit="a.u.").
# Its K_a R_a, counts per m/s²; b_a, counts; K_g R_g, counts per °/s; b_g, counts; K_ga, counts per m/s².
K_R_A = [
    [208.59866335878752, 1.4857813652795524, -2.3251737907962524],
    [-1.6536284266299277, 208.00742291279576, 4.92067907658513],
    [4.585691365363849, -2.3165722597929608, 214.79649184681],
]
B_A = [-6.018868019671572, -48.287874016760156, -28.96636637224333]
K_R_G = [
    [16.676267572751069, 0.010243942017446125, -0.21800247824448904],
    [-0.089125744355972245, 16.175908011424166, 0.61644759033892194],
    [0.21367498052417258, -0.59336886427668722, 16.241122297524178],
]
B_G = [1.960686204431737, -4.472837741243746, -3.6511794138670477]
K_GA = [
    [0.0022934331113883357, -0.016140144077806486, 0.0184717436014643],
    [0.013878444350809548, 0.005445469899229707, -0.008815491251965365],
    [-0.009262268630645065, 0.008509212267697292, -0.003936726502507892],
]
PER_ACC, PER_GYR = g(1.0) / 2048.0, float(dps(1.0)) / 16.384  # ±16 g and ±2000 °/s in 16 bits


@needs("ferraris/annotated_session.csv")
def test_a_real_session_agrees_with_imucal():
    """[Ferraris1995]."""
    rows = list(csv.reader(SESSION.read_text().splitlines()))[1:]
    labels, counts = [row[0] for row in rows], np.array([[float(cell) for cell in row[2:]] for row in rows])
    parts = {name: slice(labels.index(name), len(labels) - labels[::-1].index(name)) for name in set(labels)}
    t = np.arange(len(rows)) / 204.8
    fits = fit_ferraris(t, counts[:, :3] * PER_ACC, counts[:, 3:] * PER_GYR, parts)
    acc, gyr = fits["acc"].calibration, fits["gyr"].calibration
    close = {"rtol": 1e-9, "atol": 1e-12}  # the same sums in another order; asked for is 1e-6
    assert np.allclose(np.linalg.inv(acc.matrix) / PER_ACC, K_R_A, **close)
    assert np.allclose(acc.bias / PER_ACC, B_A, **close)
    assert np.allclose(np.linalg.inv(gyr.matrix) / PER_GYR, np.array(K_R_G) / dps(1.0), **close)
    assert np.allclose(gyr.bias / PER_GYR, B_G, **close)
    assert np.allclose(gyr.g_sensitivity / PER_GYR, K_GA, **close)
    order = np.argsort([int(row[1]) for row in rows])  # in time; what lay between is cut out, the rests with it
    with pytest.raises(CaptureRefusedError, match="no turn x_rot, y_rot, z_rot"):
        find_parts(t, counts[order, :3] * PER_ACC, counts[order, 3:] * PER_GYR)


def fit(session, **options):
    return fit_ferraris(session.t, session.acc, session.gyr, session.parts, **options)


def test_known_errors_come_back_within_their_standard_deviations_and_turns_have_their_direction():
    for seed in range(3):
        session = ferraris(seed)
        fits = fit(session)
        gyr, acc = fits["gyr"].calibration, fits["acc"].calibration
        assert (np.abs(gyr.matrix - session.matrix) <= 4.0 * gyr.matrix_sd).all()
        assert (np.abs(gyr.bias - session.bias) <= 5.0 * gyr.bias_sd).all()
        assert (np.abs(acc.matrix - np.eye(3)) <= 5.0 * acc.matrix_sd).all()
        assert (np.abs(gyr.g_sensitivity) <= 6.0 * gyr.g_sensitivity_sd).all()
    one, other = (fit(ferraris(1, white=0.0, acc_sd=0.0, turn=turn)) for turn in (2.0 * np.pi, -2.0 * np.pi))
    assert np.abs(one["gyr"].calibration.matrix - other["gyr"].calibration.matrix).max() < 1e-6


def test_how_the_faces_were_put_down_is_told():
    session = ferraris(2)
    rng = np.random.default_rng(7)
    acc = session.acc.copy()
    for face in FACES:
        acc[session.parts[face]] += np.radians(1.0) * G0 * rng.standard_normal(3)
    found = fit(session._replace(acc=acc))["acc"].calibration
    across = np.sqrt(found.matrix_sd[~np.eye(3, dtype=bool)] ** 2 * 2.0)  # of one position, rad
    assert np.degrees(across.mean()) == pytest.approx(1.0, rel=0.9)  # six degrees of freedom: ± 29 %, three times


def test_parts_are_found_where_they_lie():
    session = ferraris(3)
    found = find_parts(session.t, session.acc, session.gyr)
    assert set(found) == set(session.parts)
    for name, part in session.parts.items():
        if name.endswith("_rot"):
            assert found[name].start <= part.start + 60 and found[name].stop >= part.stop - 60  # quiet ends of 1 − cos
        else:
            assert session.t[found[name].start] >= session.t[part.start] - 1.0
    matrix = fit(session._replace(parts=found))["gyr"].calibration.matrix
    assert np.abs(matrix - fit(session)["gyr"].calibration.matrix).max() < 2e-3


def test_parts_that_are_missing_or_none_are_refused():
    session = ferraris(4)
    parts, clipped, gone = session.parts, np.zeros(session.t.size, dtype=bool), session.gyr.copy()
    clipped[parts["y_rot"].start + 300], gone[parts["x_p"].start] = True, np.nan
    for changes, options, kind in (
        ({}, {"clipped": clipped}, "clipping"),
        ({"acc": 1.3 * session.acc}, {}, "wrong-gravity"),
        ({"parts": parts | {"x_p": parts["y_p"], "y_p": parts["x_p"]}}, {}, "implausible"),
        ({}, {"angle": np.pi}, "no-motion"),
        ({"parts": parts | {"x_p": parts["x_rot"]}}, {}, "not-still"),
        ({"parts": parts | {"x_p": slice(0, 5)}}, {}, "too-few"),
    ):
        (reason, *_) = reasons(fit, session._replace(**changes), **options)
        assert reason.kind == kind and ("instead of 180°" in reason.text) is ("angle" in options)
    end = parts["z_rot"].stop + 100
    first, second = reasons(find_parts, session.t[:end], session.acc[:end], session.gyr[:end])
    assert (first.kind, second.kind) == ("not-still", "no-motion") and "x_p, x_a, y_p, y_a, z_a" in first.text
    with pytest.raises(CalibrationError, match="x_p has samples without a number"):
        fit(session._replace(gyr=gone))
    with pytest.raises(CalibrationError, match="missing are x_rot, unknown none"):
        fit(session._replace(parts={k: v for k, v in parts.items() if k != "x_rot"}))


def test_labels_name_one_place_each():
    assert parts_of_labels(["x_p", "x_p", "", "x_a"]) == {"x_p": slice(0, 2), "x_a": slice(3, 4)}
    with pytest.raises(CalibrationError, match="x_p lies in two places, from sample 0 and from 2"):
        parts_of_labels(["x_p", "", "x_p"])
