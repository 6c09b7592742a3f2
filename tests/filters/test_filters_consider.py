"""What a calibration leaves is counted in what a filter claims: the sensitivity, the sum, and units against claims."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.claims import judged, limits
from plumbob import CalibrationCard, Filter, Frame, ImuData, ImuMeta, apply_card, files
from plumbob.data.cards import Mount, TriadCalibration
from plumbob.data.cards.residuals import NOTHING, full_covariance, left_by, uncalibrated, upper_half
from plumbob.evaluation.metrics import BOUNDS
from plumbob.filters.settling import considered
from plumbob.rotations import quat_conjugate, quat_from_euler_zyx, quat_multiply, quat_rotate, rotvec_from_quat
from tests.helpers.filter_state import through_json
from tests.helpers.motion import noisy, seen_by

STEP = 1e-6
"""Size of the parameters' errors: what is not linear in them is of its square, 1e-12, a millionth of the effect."""


def own(data, **meta):
    return replace(data, meta=replace(data.meta, **meta))


def turned_by(frame, q, declination, triad, k):
    """Error of tilt and compass in body axes per parameter k of a triad's (d, E), by a difference, and the attitude."""
    right, p = seen_by(q[np.newaxis], frame), np.zeros(12)
    p[k] = STEP
    wrong = {**right, triad: right[triad] + p[:3] + right[triad] @ p[3:].reshape(3, 3).T}
    meta = ImuMeta(declination=declination)
    got, true = (
        Filter("tilt_compass", frame=frame).process(ImuData(t=[0.0], gyr=np.zeros((1, 3)), **seen, meta=meta)).q_nb[0]
        for seen in (wrong, right)
    )
    return rotvec_from_quat(quat_multiply(quat_conjugate(got), true)) / STEP, true


@pytest.mark.parametrize("frame", list(Frame))
@pytest.mark.parametrize("triad", ["acc", "mag"])
def test_the_sensitivity_is_that_of_tilt_and_compass(frame, triad):
    q = quat_from_euler_zyx(np.radians([40.0, 25.0, -35.0]))
    errors, attitudes = zip(*(turned_by(frame, q, 0.2, triad, k) for k in range(12)), strict=True)
    slope, true = np.stack(errors, axis=1), attitudes[0]
    h_n = quat_rotate(true, seen_by(q[np.newaxis], frame)["mag"][0])
    north = np.cos(0.2) * frame.north + np.sin(0.2) * frame.east
    field = np.array([[np.hypot(h_n[0], h_n[1]), h_n[2]]])
    roots = np.random.default_rng(3).standard_normal((12, 12))
    for root in (roots, *np.eye(12)[:, :, np.newaxis]):
        halves = [upper_half(root @ root.T) if name == triad else NOTHING for name in ("acc", "mag")]
        found = considered(true[np.newaxis], field, float(frame.up[2]), (north[0], north[1]), *halves)[0]
        wanted = slope @ root @ root.T @ slope.T
        # gravity of the samples is g to rounding; the differences are good to STEP and to rounding over STEP
        assert found == pytest.approx(wanted, abs=1e-4 * (np.abs(wanted).max() + 1e-6))


@pytest.mark.parametrize("name", ["mekf", "ekf7"])
def test_it_is_added_to_the_claim_and_leaves_the_estimate_alone(name):
    data, f = noisy(), Filter(name, frame=Frame.NED)
    perfect = Filter(name, frame=Frame.NED).process(own(data, calibration="known"), covariance=True)
    bare = f.process(data, covariance=True)
    assert bare.q_nb.tobytes() == perfect.q_nb.tobytes()
    assert bare.flags.tobytes() == perfect.flags.tobytes()
    more = bare.cov_b - perfect.cov_b
    assert (np.linalg.eigvalsh(more) > -1e-12).all()
    # two tilts, each of an offset of ±62 mg, uniform; matrix and heading only add to it
    assert (np.trace(more, axis1=1, axis2=2) > 2.0 * 0.062**2 / 3.0).all()
    assert through_json(f).cov_b.tobytes() == f.cov_b.tobytes() == bare.cov_b[-1].tobytes()


def test_what_a_card_leaves_is_in_the_axes_of_the_body():
    """Against samples of the card's covariance, applied to a vector as a card is."""
    rng = np.random.default_rng(5)
    root = 1e-3 * rng.standard_normal((12, 12))
    scale = np.diag([1.1, 0.9, 1.0]) + 0.05
    model = TriadCalibration(scale, [0.3, -0.2, 0.1], "m/s2", "m/s2", covariance=root @ root.T)
    mount = Mount(quat_from_euler_zyx([0.7, -0.4, 1.9]))
    measured, wanted = np.array([2.0, -3.0, 9.0]), full_covariance(left_by("acc", model, mount))

    def calibrated(p):
        return quat_rotate(mount.q_bs, (model.matrix + p[3:].reshape(3, 3)) @ (measured - model.bias - p[:3]))

    steps = [1e-6 * column for column in np.eye(12)]
    slope = np.stack([(calibrated(p) - calibrated(-p)) / 2e-6 for p in steps], axis=1)
    u_b = calibrated(np.zeros(12))
    by_left = np.hstack([np.eye(3), np.kron(np.eye(3), u_b)])
    assert by_left @ wanted @ by_left.T == pytest.approx(slope @ model.covariance @ slope.T, rel=1e-6)
    bias_only = TriadCalibration(np.eye(3), np.zeros(3), "m/s2", "m/s2", covariance=np.zeros((12, 12)))
    left, none = full_covariance(left_by("acc", bias_only, None)), full_covariance(uncalibrated("acc"))
    assert (left[3:, 3:] == none[3:, 3:]).all() and not left[:3].any()


def test_an_applied_card_says_what_it_leaves_and_a_file_keeps_it(tmp_path):
    data = own(noisy(), device="unit")
    acc = TriadCalibration(np.eye(3), [0.1, 0, 0], "m/s2", "m/s2", covariance=1e-6 * np.eye(12))
    done = apply_card(CalibrationCard("unit", "2026-01-01", "made up", acc=acc), data)
    assert done.meta.acc_left == left_by("acc", acc, None)
    assert done.meta.mag_left == uncalibrated("mag")  # the card leaves it as it is
    assert files.read(files.write(tmp_path / "a.parquet", done)).imu.meta == done.meta


def test_units_with_a_poor_card_are_as_wrong_as_is_claimed():
    """Ten independent units: fewer than seven inside have a probability of 0.1 %; without the card's part none is."""
    inside = [BOUNDS[0] <= judged("poor card", "static", seed)[0] <= BOUNDS[1] for seed in range(10)]
    assert sum(inside) >= 7


@pytest.mark.long("40 simulated units for each of six cases")
@pytest.mark.parametrize("motion", ["static", "buoy"])
@pytest.mark.parametrize("case", ["good card", "poor card", "uncalibrated"])
def test_the_share_inside_the_bounds_is_that_of_a_consistent_claim(case, motion):
    """At sea with a good card the claim is too large instead: the field may bend by more than the card leaves."""
    least, _ = limits(40)
    found = [judged(case, motion, seed)[0] for seed in range(100, 140)]
    assert sum(nees <= BOUNDS[1] for nees in found) >= least
    if (case, motion) != ("good card", "buoy"):
        assert sum(BOUNDS[0] <= nees <= BOUNDS[1] for nees in found) >= least
