"""The magnetometer's own fit: accuracy as predicted, choice of the shape, and every refusal with its reason."""

import re

import numpy as np
import pytest

from plumbob.calibration.ellipsoid_fit import Shape, choose
from plumbob.calibration.fit import KINDS, CaptureRefusedError
from plumbob.calibration.mag.ellipsoid import fit_mag
from plumbob.calibration.mag.ellipsoid import moved as jumped
from plumbob.calibration.predicted import REGIONS
from plumbob.rotations import quat_from_rotvec, quat_multiply
from tests.helpers.mag_scene import STRENGTH, Unit, attitudes, field, force, heading_rms, soft_iron
from tests.helpers.refusals import reason_kinds, reasons

NOISE = 0.2  # µT


def capture(rng, q_nb, response=None, bias=(6.0, -4.0, 3.0)):
    return field(rng, Unit(np.eye(3) if response is None else response, np.array(bias)), q_nb)


def turned(axis, angle):
    """Quaternions (N, 4) of angles (N,) about a fixed axis (3,)."""
    return quat_from_rotvec(np.outer(angle, axis))


def test_the_error_is_the_predicted_one():
    """Root mean square heading over its predicted sd, 12 captures: mean square 1 ± √(2/9/12), three of these."""
    rng, ratios = np.random.default_rng(0), []
    for _ in range(12):
        unit = Unit(soft_iron(rng), 6.0 * rng.normal(size=3))
        made = fit_mag(field(rng, unit, attitudes(rng, 500))).calibration
        ratios.append((heading_rms(made, unit) / made.quality.heading_sd) ** 2)
    assert 0.6 < np.mean(ratios) < 1.4


def test_the_card_takes_the_errors_back():
    """A given strength is what the calibrated vectors have; the residual is that of the noise, √(1 − 9/500) of it."""
    rng = np.random.default_rng(1)
    mag = capture(rng, attitudes(rng, 500), soft_iron(rng))
    made = fit_mag(mag, strength=STRENGTH).calibration
    length = np.linalg.norm((mag - made.bias) @ made.matrix.T, axis=1)
    assert length.mean() == pytest.approx(STRENGTH, abs=4.0 * NOISE / np.sqrt(500))
    assert made.residual_rms == pytest.approx(NOISE, rel=0.25)
    assert made.reference == STRENGTH
    assert made.matrix_sd.max() < 1e-2


def test_scale_magnets_and_regions():
    rng = np.random.default_rng(2)
    fit = fit_mag(capture(rng, attitudes(rng, 300), soft_iron(rng)))
    assert np.linalg.det(fit.calibration.matrix) == pytest.approx(1.0, rel=1e-12)
    assert fit.calibration.reference is None
    assert any("own scale" in str(remark) for remark in fit.remarks)
    # 18 attitudes that show every direction once; and a grade as predicted
    mag = STRENGTH * REGIONS + [6.0, -4.0, 3.0] + NOISE * np.random.default_rng(15).normal(size=(18, 3))
    quality = fit_mag(mag).calibration.quality
    assert quality.regions == 18 and quality.grade in {"good", "fair"}


@pytest.mark.parametrize(("response", "expected"), [
    (np.eye(3), "sphere"),
    (np.diag([1.1, 0.93, 1.02]), "axis-aligned"),
    (np.diag([1.1, 0.93, 1.02]) + 0.03 * (np.ones((3, 3)) - np.eye(3)), "general"),
], ids=["sphere", "axes", "ellipsoid"])  # fmt: skip
def test_the_shape_is_the_smallest_that_holds(response, expected):
    """1 % of captures takes a larger shape than the true one, by the test's own significance."""
    rng = np.random.default_rng(3)
    methods = [fit_mag(capture(rng, attitudes(rng, 200), response)).calibration.method for _ in range(10)]
    assert sum(expected in method for method in methods) >= 9
    mag = capture(rng, attitudes(rng, 100))  # and the one that is asked for
    assert "general" in fit_mag(mag, shape=Shape.ELLIPSOID).calibration.method
    assert "axis-aligned" in fit_mag(mag[:9], shape=Shape.AXES).calibration.method


@pytest.mark.parametrize("low", [6.0, 15.0])
def test_a_few_bad_first_samples_are_set_aside(low):
    """4 of 150, as of a sensor that settles: not the field of the capture. As many at its end may be what stays."""
    rng = np.random.default_rng(19)
    mag = capture(rng, attitudes(rng, 150), soft_iron(rng))
    mag[:4] -= low
    fit = fit_mag(mag)
    assert not fit.used[:4].any() and any("Set aside as outliers" in str(remark) for remark in fit.remarks)
    (reason, *_) = reasons(fit_mag, mag[::-1])
    assert reason.kind == "magnet-moved" and "after 95 % of the samples" in reason.text


def test_a_jump_is_judged_by_what_one_centre_leaves():
    """A sphere of 50 µT of which half is shifted by 1 µT, and the centre of the first half: the jump explains all."""
    mag = STRENGTH * np.tile(REGIONS, (20, 1))
    first = choose(mag, Shape.SPHERE).fit
    mag[len(mag) // 2 :, 0] += 1.0
    place, size, _, explained = map(float, re.findall(r"(\d+\.?\d*) (?:%|µT)", jumped(mag, first).text))
    assert (place, explained) == (50.0, 100.0) and size == pytest.approx(1.0, rel=0.02)
    rng = np.random.default_rng(10)
    for count in (30, 100, 1000):
        for _ in range(5):
            fit_mag(capture(rng, attitudes(rng, count), soft_iron(rng)))


def test_outliers():
    rng = np.random.default_rng(11)
    mag = capture(rng, attitudes(rng, 400), soft_iron(rng))
    wrong = rng.permutation(400)
    mag[wrong[:20]] += 10.0 * rng.normal(size=(20, 3))
    fit = fit_mag(mag)
    assert 15 <= fit.calibration.quality.outliers <= 20
    mag[wrong[:80]] += 20.0 * rng.normal(size=(80, 3))
    assert "outliers" in reason_kinds(fit_mag, mag)


def test_dip_by_the_specific_force():
    """The predicted heading error goes with 1/cos of the dip; that of the capture is 60°, which is also assumed."""
    rng = np.random.default_rng(14)
    q_nb = attitudes(rng, 200)
    mag = capture(rng, q_nb)
    alone, known = fit_mag(mag), fit_mag(mag, acc=force(rng, q_nb, sd=0.0))
    steep = fit_mag(mag, dip=np.radians(80.0))
    assert known.calibration.quality.heading_sd == pytest.approx(alone.calibration.quality.heading_sd, rel=0.02)
    assert steep.calibration.quality.heading_sd > 2.0 * alone.calibration.quality.heading_sd


def test_small_tilts_are_not_wrong_silently():
    """Up to 15°: either refused, or the true error is within 4 of the predicted sd."""
    rng = np.random.default_rng(8)
    for _ in range(6):
        unit = Unit(soft_iron(rng), 6.0 * rng.normal(size=3))
        try:
            made = fit_mag(field(rng, unit, attitudes(rng, 1000, np.radians(15.0)))).calibration
        except CaptureRefusedError:
            continue
        assert heading_rms(made, unit) < 4.0 * made.quality.heading_sd


@pytest.mark.parametrize("count", [18, 36, 1000])
def test_rings_and_cones_are_refused(count):
    """papers.md 001: 18 attitudes of a level ring leave errors of 180°. A cone is a constant tilt of 15°, or a table
    that is tilted by 15°."""
    rng, lean = np.random.default_rng(5), turned([0, 1.0, 0], [np.radians(15.0)])
    level = turned([0, 0, 1.0], 2.0 * np.pi * np.arange(count) / count)
    for way, kind in (
        (level, "level-ring"),
        (quat_multiply(level, lean), "cone"),
        (quat_multiply(lean, level), "cone"),
    ):
        q_nb = quat_multiply(way, quat_from_rotvec(np.radians(1.0) * rng.normal(size=(count, 3))))
        assert reason_kinds(fit_mag, capture(rng, q_nb), acc=force(rng, q_nb, sd=0.0)) == [kind]
        assert kind == "cone" or reason_kinds(fit_mag, capture(rng, q_nb)) == [kind]


def moved(seed, size, count):
    """A field of 45 µT of a unit that was hardly turned."""
    return np.array([20.0, 0.0, 40.0]) + size * np.random.default_rng(seed).normal(size=(count, 3))


def captured(count=300, *, response=None, tilt=None, jump=0.0, seed=12):
    rng = np.random.default_rng(seed)
    q_nb = attitudes(rng, count) if tilt is None else attitudes(rng, count, tilt)
    mag = capture(rng, q_nb, response)
    mag[round(0.6 * count) :] += [jump, 0.0, 0.0]
    return mag


@pytest.mark.parametrize(("mag", "options", "kind", "text"), [
    (captured(11), {}, "too-few", "11 samples"),
    (captured(400, tilt=np.radians(8.0)), {}, "level-ring", ""),
    (captured(1000, jump=2.0), {}, "magnet-moved", r"after 60 % of the samples.* jumped by (1\.9|2) µT"),
    (4.0 * captured(), {}, "wrong-field", ""),
    (0.2 * captured(), {}, "wrong-field", ""),
    (captured(), {"strength": 25.0}, "wrong-field", ""),
    (captured(response=np.diag([1.0, 1.0, 0.3])), {}, "implausible", ""),
    # around their mean, even noise is seen in all directions; 2√3 µT ± 0.03 of it
    (moved(12, 2.0, 2000), {}, "no-motion", r"the measured field only changed by 3\.[45] µT"),
    # its sensitivity and its strength are those of noise; they were told, by a factor of 200000
    (moved(0, 4.0, 500), {}, "too-few-regions", r"leaves a heading error of 15° \(1 sd\)"),
    (moved(1, 4.0, 500), {}, "too-few-regions", "leaves no heading at all"),
    (moved(6, 4.0, 500), {}, "too-few-regions", "no ellipsoid fits; the field changed by 7 µT about a mean of 45"),
])  # fmt: skip
def test_captures_that_tell_nothing_are_refused(mag, options, kind, text):
    reason, *others = reasons(fit_mag, mag, **options)
    assert reason.kind == kind and re.search(text, reason.text) and reason.advice and kind in KINDS
    assert others == [] or kind == "magnet-moved"  # when it turned too little for an even field, too
