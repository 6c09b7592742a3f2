"""Kalibr's file, read as a simple list of lines."""

import math
import re
from dataclasses import replace

import pytest

from plumbob.core.errors import ParameterError, ShapeError, UnitError
from plumbob.core.units import Quantity
from plumbob.noise.card import kalibr_yaml
from plumbob.noise.findings import Coefficient, Estimates

# YAML 1.1 takes a number with exponent for a number only if it has a point and a signed exponent (yaml.org/type/float)
FLOAT = re.compile(r"[-+]?[0-9]+\.[0-9]*([eE][-+][0-9]+)?")


def read(text):
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    return dict(line.split(": ") for line in lines)


def with_walk(analysis, **fields):
    terms = {**analysis.terms, "K": Coefficient(**fields)}
    return replace(analysis, likelihood=Estimates("likelihood", terms))


def test_it_holds_the_numbers_that_kalibr_reads_in_si(analyses):
    values = read(kalibr_yaml(analyses, rostopic="/imu0"))
    assert list(values) == [
        "accelerometer_noise_density", "accelerometer_random_walk", "gyroscope_noise_density",
        "gyroscope_random_walk", "rostopic", "update_rate",
    ]  # fmt: skip
    assert values.pop("rostopic") == "/imu0"
    assert all(FLOAT.fullmatch(v) for v in values.values())
    # planted in x, and 1.1 and 0.9 of it in y and z, whose quadratic mean is √(3.02/3); seven digits are written
    expected = {
        "accelerometer_noise_density": 300e-6 * 9.80665,
        "accelerometer_random_walk": 2e-6 * 9.80665,
        "gyroscope_noise_density": math.radians(0.3) / 60.0,
        "gyroscope_random_walk": math.radians(20.0) / 3600.0 / 60.0,
    }
    assert float(values.pop("update_rate")) == 100.0
    for name, value in expected.items():
        assert math.isclose(float(values[name]), value * math.sqrt(3.02 / 3.0), rel_tol=5e-7)


def test_comments_tell_each_axis_with_its_interval_and_the_source(analyses):
    text = kalibr_yaml(analyses, rostopic="/imu0", source="static µ.parquet\nrostopic: /evil")
    assert "#   N x: 0.3000 +/- 0.0012 deg/rth" in text
    assert "#   K z: 1.80 +/- 0.63 ug/s/rtHz" in text
    assert "# static ?.parquet rostopic: /evil" in text
    assert text.isascii()
    assert "quadratic mean" in text


def test_a_limit_stands_for_what_is_not_observable(analyses):
    hidden = with_walk(analyses[2], value=1e-9, upper=4e-6, observable=False, hours=7.0)
    text = kalibr_yaml([*analyses[:2], hidden, *analyses[3:]], rostopic="/imu0")
    squares = [analyses[0].terms["K"].value ** 2, analyses[1].terms["K"].value ** 2, 4e-6**2]
    assert math.isclose(float(read(text)["gyroscope_random_walk"]), math.sqrt(sum(squares) / 3.0), rel_tol=5e-7)
    assert "#   K z: < 50 deg/h/rth, not observable: the limit of 95 % is taken" in text  # 4e-6 rad/s²/√Hz is 49.5


@pytest.mark.parametrize("fields", [{"value": 0.0, "observable": False, "hours": 7.0}, {"value": 0.0}])
def test_a_number_that_kalibr_would_refuse_is_refused_here(analyses, fields):
    nothing = with_walk(analyses[0], **fields)
    with pytest.raises(ParameterError, match="K of gyr x has neither a value nor a limit"):
        kalibr_yaml([nothing, *analyses[1:]], rostopic="/imu0")


def test_what_kalibr_cannot_take_is_refused(analyses):
    with pytest.raises(ShapeError, match="needs gyr and acc, but the record has only gyr"):
        kalibr_yaml(analyses[:3], rostopic="/imu0")
    bare = [replace(a, quantity=Quantity.RATIO) for a in analyses[:3]]
    with pytest.raises(UnitError, match="gyr is in '1', but Kalibr takes rad/s"):
        kalibr_yaml([*bare, *analyses[3:]], rostopic="/imu0")
    slow = [replace(a, curve=replace(a.curve, dt=0.02)) for a in analyses[3:]]
    with pytest.raises(ParameterError, match="rates 50 Hz and 100 Hz"):
        kalibr_yaml([*analyses[:3], *slow], rostopic="/imu0")
    for topic in ("", "/imu 0", "imu: 1", "/imu#", "9"):
        with pytest.raises(ParameterError, match="rostopic must be a name of ROS"):
            kalibr_yaml(analyses, rostopic=topic)
