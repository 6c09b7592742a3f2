"""What an uneven field may leave: counted where a capture cannot show it, and ruled out only by evidence."""

import numpy as np
import pytest

from plumbob.calibration.autocorrelation import Alike
from plumbob.calibration.ellipsoid_fit import Shape
from plumbob.calibration.mag.checks import FieldEstimate
from plumbob.calibration.mag.ellipsoid import fit_mag
from plumbob.calibration.mag.field_gradient import PATCH, USUAL, Unevenness, unevenness
from plumbob.calibration.predicted import heading_apart
from plumbob.rotations import quat_conjugate, quat_rotate
from tests.helpers.mag_scene import STRENGTH, field, heading_rms, tumbling, unit_of


def turning(count, path):
    """Directions (N, 3) along a great circle, rad in all."""
    angle = np.linspace(0.0, path, count)
    return np.stack((np.cos(angle), np.sin(angle), np.zeros(count)), axis=1)


def whole(residuals, directions, **options):
    return unevenness(residuals, directions, np.ones(len(residuals), dtype=bool), **options)


def test_a_short_capture_is_taken_to_be_in_a_usual_room_and_evidence_counts_with_its_noise():
    """Eight patches tell nothing beyond nine parameters, however small the residuals are."""
    found = whole(1e-3 * np.random.default_rng(1).normal(size=2000), turning(2000, 8.0 * PATCH))
    assert found.sd == USUAL
    assert found.patches == pytest.approx(8.0, rel=0.05)
    # Noise of 0.2 µT over 60 patches: its chance, 40 times as much, is far below the power of a usual room.
    residuals = 0.2 * np.random.default_rng(2).normal(size=6000)
    found = whole(residuals, turning(6000, 60.0 * PATCH), lengths=False)
    assert found.sd < 0.02 * USUAL
    assert found.seen == 0.0
    found = whole(5.0 * np.random.default_rng(3).normal(size=6000), turning(6000, 60.0 * PATCH))
    assert found.sd == pytest.approx(USUAL, rel=0.05)
    # A wave of power 0.5 along 20 rad of turning, which neighbouring visits share; 9 of 100 patches are taken up
    path = np.linspace(0.0, 100.0 * PATCH, 20_000)
    found = whole(np.sin(2.0 * np.pi * path / 20.0), turning(20_000, 100.0 * PATCH))
    assert found.seen**2 == pytest.approx(2.0 * 0.5 / (1.0 - 9.0 / found.patches), rel=0.05)
    assert found.sd >= found.seen


def test_no_length_shows_a_field_that_changes_along_itself():
    """½/(2 + ½) of a usual room's power stays, however even lengths are; but not in readings of one pose each."""
    residuals = 0.2 * np.random.default_rng(2).normal(size=6000)
    found = whole(residuals, turning(6000, 60.0 * PATCH))
    assert found.sd == pytest.approx(np.sqrt(0.5 / 2.5) * USUAL)
    assert not found.short
    poses = np.random.default_rng(3).normal(size=(6000, 3))
    assert whole(residuals, poses).sd < 0.02 * USUAL
    assert whole(np.ones(99), turning(99, 10.0)) == Unevenness()  # readings of single poses are noise


def test_the_unseen_turns_the_matrix_and_shifts_the_centre():
    """√(⅔) s per axis of hard iron, and s over the field of turn: of an identity, of every entry off the diagonal."""
    found = Unevenness(0.6, 0.0, 10.0).counted(0.0, memory=1.0, residuals=np.zeros(1), matrix=np.eye(3), radius=50.0)
    assert np.diag(found)[:3] == pytest.approx(2.0 / 3.0 * 0.36)
    assert np.diag(found)[3:].reshape(3, 3) == pytest.approx((0.6 / 50.0) ** 2 * (1.0 - np.eye(3)))


OTHER = pytest.mark.long(reason="another length")


def in_gradient(seed, *, duration, gradient=2.0, arm=0.25):
    """Unit, and its field while a hand turns it on an arm in a field that changes by some µT a metre."""
    rng = np.random.default_rng([31, seed])
    unit = unit_of(rng, turned=False)
    _, q_nb, _ = tumbling(rng, duration=duration)
    bend = rng.normal(size=(3, 3))
    bend = bend + bend.T - 2.0 / 3.0 * np.trace(bend) * np.eye(3)
    bend *= gradient * np.sqrt(3.0) / np.linalg.norm(bend)
    off_b = quat_rotate(quat_conjugate(q_nb), quat_rotate(q_nb, np.array([arm, 0.0, 0.0])) @ bend)
    return unit, field(rng, unit, q_nb) + off_b @ unit.distortion.T


@pytest.mark.parametrize("duration", [15.0, *(pytest.param(s, marks=OTHER) for s in (30.0, 120.0))])
def test_captures_of_lengths_in_a_room_are_never_good_and_honest(duration):
    """Without the floors the error of 15 s is 4 times the predicted one, and half of them are good."""
    ratios = []
    for seed in range(9):
        unit, mag = in_gradient(seed, duration=duration)
        try:
            fit = fit_mag(mag, shape=Shape.ELLIPSOID, strength=STRENGTH)
        except ValueError:
            continue
        assert fit.calibration.quality.grade != "good"
        ratios.append(heading_rms(fit.calibration, unit) / fit.calibration.quality.heading_sd)
    assert len(ratios) > 3 and np.sqrt(np.mean(np.square(ratios))) < 1.5


def test_headings_apart_are_those_of_a_hard_iron():
    """A hard iron b turns level headings by b/h/√2 on average over courses; h = 50 µT · cos 60°."""
    same = np.eye(3), np.zeros(3)
    off = heading_apart(
        (np.eye(3), np.array([0.5, 0.0, 0.0])), same, same, size=50.0, dip=np.radians(60.0), tilt_range=1e-6
    )
    assert off == pytest.approx(0.5 / 25.0 / np.sqrt(2.0), rel=1e-3)


@pytest.mark.parametrize(("shown", "kind"), [(True, "uneven-field"), (False, "too-few-regions")])
def test_a_refusal_over_an_uneven_field_says_whether_it_was_seen(shown, kind):
    estimate = FieldEstimate(*9 * [None], dip=1.0, tilt_range=1.0, alike=Alike(1.0, 2.0 if shown else 1.0))
    assert [estimate.uncertain(1.0, even, "", np.eye(3)).kind for even in (0.0, 1.0)] == [kind, "too-few-regions"]
    assert estimate.uncertain(1.0, 0.0, "", None).kind == (kind if shown else "ill-conditioned")


def test_a_long_capture_in_an_even_field_is_fair_by_its_length_alone():
    """And where the centre drifts by 0.7 µT from one half to the other, slowly enough that nothing jumps, parts of it
    disagree, which widens the prediction."""
    unit, mag = in_gradient(1, duration=120.0, gradient=0.0)
    drift = np.linspace(0.0, 1.4, len(mag))[:, np.newaxis] * [1.0, 0.0, 0.0]
    even, drifting = (fit_mag(samples, shape=Shape.ELLIPSOID, strength=STRENGTH) for samples in (mag, mag + drift))
    quality = even.calibration.quality
    assert quality.grade == "fair"
    assert heading_rms(even.calibration, unit) < 0.1 * quality.heading_sd
    assert [remark.code for remark in even.remarks if remark.severity == "warning"] == ["calibration.length_alone"]
    assert drifting.calibration.quality.heading_sd > 1.5 * quality.heading_sd
