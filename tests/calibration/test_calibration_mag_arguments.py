"""Arguments of the magnetometer fits: lists do, and what cannot be is refused by name at the door."""

import numpy as np
import pytest

from plumbob.calibration.fit import CaptureRefusedError
from plumbob.calibration.mag import fit_mag, fit_mag_acc, fit_mag_gyr, fit_mag_level
from plumbob.core.constants import G0
from plumbob.core.errors import ClockError, ParameterError, ShapeError
from tests.helpers.mag_scene import FIELD_N, STRENGTH, attitudes, field, force, rates, trajectory, unit_of
from tests.helpers.refusals import reason_kinds

COUNT = 60
MAG = np.random.default_rng(1).normal(size=(COUNT, 3)) * 30.0
ACC = np.tile([0.0, 0.0, G0], (COUNT, 1))
T = np.arange(COUNT) * 0.02
NOTHING = np.zeros((0, 3))
FITS = {
    "alone": lambda mag=MAG, **options: fit_mag(mag, **options),
    "acc": lambda mag=MAG, acc=ACC, **options: fit_mag_acc(mag, acc, **options),
    "level": lambda mag=MAG, **options: fit_mag_level(mag, **options),
    "gyr": lambda t=T, mag=MAG, gyr=0.1 * MAG, **options: fit_mag_gyr(t, mag, gyr, **options),
}


def with_nan(samples):
    spoilt = samples.copy()
    spoilt[7, 1] = np.nan
    return spoilt


@pytest.mark.parametrize(("ways", "options", "error", "text"), [
    ("alone", {"mag": MAG.T}, ShapeError, r"mag must have shape \(N, 3\).*pass mag.T"),
    ("alone acc level", {"mag": with_nan(MAG)}, ShapeError, r"mag must be finite, but mag\[7\]"),
    ("alone acc level", {"acc": ACC[1:]}, ShapeError, r"acc must have one row per sample of the field \(60\)"),
    ("alone", {"acc": with_nan(ACC)}, ShapeError, r"acc must be finite, but acc\[7\]"),
    ("acc", {"acc": ACC * (T > 0.0)[:, np.newaxis]}, ShapeError, r"acc\[0\] is zero"),
    ("gyr", {"mag": MAG[1:]}, ShapeError, r"mag must have one row per time stamp \(60\)"),
    ("gyr", {"gyr": MAG[1:]}, ShapeError, "gyr must have one row per time stamp"),
    ("gyr", {"gyr": with_nan(MAG)}, ShapeError, "gyr must be finite"),
    ("gyr", {"acc": ACC[1:]}, ShapeError, "acc must have one row per time stamp"),
    ("gyr", {"acc": ACC * [np.nan, 1.0, 1.0]}, ShapeError, "acc must have a finite sample"),
    ("gyr", {"t": T[::-1]}, ClockError, "t must strictly increase"),
    ("alone acc level gyr", {"strength": 0.0}, ParameterError, "strength must be above 0 µT, but it is 0 µT"),
    ("alone acc level gyr", {"strength": np.nan}, ParameterError, "strength must be above 0 µT"),
    ("alone level", {"dip": np.nan}, ParameterError, "dip must lie between"),
    ("alone level", {"dip": 66.0}, ParameterError, "it is 66 rad; turn degrees into radians"),
    ("alone acc gyr", {"tilt_range": 45.0}, ParameterError, "it is 45 rad; turn degrees into radians"),
    ("alone acc gyr", {"tilt_range": -0.1}, ParameterError, "tilt_range must be from 0"),
    ("alone", {"shape": "sphere"}, ParameterError, "Shape.SPHERE.* but it is 'sphere'"),
    ("gyr", {"gyr_gain_sd": 2.0}, ParameterError, "divide percents by 100"),
    ("alone level", {"mag": NOTHING}, CaptureRefusedError, "too-few: 0 samples"),
    ("acc", {"mag": NOTHING, "acc": NOTHING}, CaptureRefusedError, "too-few: 0 samples"),
    ("gyr", {"t": [], "mag": NOTHING, "gyr": NOTHING}, CaptureRefusedError, "too-few: 0 samples"),
])  # fmt: skip
def test_what_does_not_match_or_is_out_of_its_range_is_refused(ways, options, error, text):
    for way in ways.split():
        with pytest.raises(error, match=text):
            FITS[way](**options)


def test_lists_are_taken():
    rng = np.random.default_rng(2)
    unit, q_nb = unit_of(rng), attitudes(rng, 100)
    mag, acc = field(rng, unit, q_nb), force(rng, q_nb)
    assert fit_mag(mag.tolist(), acc=acc.tolist()).calibration.bias == pytest.approx(fit_mag(mag).calibration.bias)
    assert len(fit_mag_acc(mag.tolist(), acc.tolist(), strength=STRENGTH).measured) == 100
    course = np.linspace(0.0, 6.0, 50)
    circle = np.column_stack((25.0 * np.cos(course), 25.0 * np.sin(course), 43.0 + 0.0 * course))
    circle += 0.2 * rng.normal(size=circle.shape)
    assert len(fit_mag_level(circle.tolist(), acc=ACC[:50].tolist()).measured) == 50
    t, q_nb, true = trajectory(rng, duration=30.0)
    with_gyr = fit_mag_gyr(t.tolist(), field(rng, unit, q_nb).tolist(), rates(rng, true).tolist())
    assert len(with_gyr.measured) == len(t)


@pytest.mark.parametrize("value", [np.zeros(3), np.ones(3), np.full(3, 0.1), FIELD_N])
def test_a_constant_field_is_no_motion(value):
    constant = np.tile(value, (COUNT, 1))
    for way, options in (("alone", {}), ("alone", {"acc": ACC}), ("acc", {})):
        assert reason_kinds(FITS[way], constant, **options) == ["no-motion"]
    assert reason_kinds(FITS["level"], constant)
