"""Bare triples in counts give back the bias and the matrix that they were made with."""

import json
import re

import numpy as np
import pytest
from scipy.optimize import least_squares

import plumbob
from plumbob.calibration.fit import CaptureRefusedError
from plumbob.core.constants import G0
from plumbob.core.errors import DecodeError, ParameterError, ShapeError
from tests.helpers.io_samples import refused
from tests.helpers.real_data import DATA, needs

BIAS = np.array([-918.0, 2193.0, 371.0])
SOFT = np.array([[1.05, -0.02, 0.01], [-0.02, 0.97, -0.015], [0.01, -0.015, 0.99]])  # symmetric: what calibration gives


def directions(count, seed=4):
    vectors = np.random.default_rng(seed).normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def readings(count=400, size=1900.0, noise=3.0):
    noises = np.random.default_rng(5).normal(0.0, noise, (count, 3))
    return np.rint(size * directions(count) @ np.linalg.inv(SOFT) + BIAS + noises)


def independent(raw):
    """Bias of nine parameters by SciPy's least squares of the lengths."""
    middle, size = raw.mean(axis=0), raw.std()
    points = (raw - middle) / size

    def lengths(p):
        shape = np.array([[p[3], p[6], p[7]], [p[6], p[4], p[8]], [p[7], p[8], p[5]]])
        return np.linalg.norm((points - p[:3]) @ shape, axis=1) - 1.0

    start = np.r_[np.zeros(3), np.full(3, 1.0 / np.linalg.norm(points, axis=1).mean()), np.zeros(3)]
    return middle + size * least_squares(lengths, start, xtol=1e-12, ftol=1e-12, gtol=1e-12).x[:3]


FORMS = ["{0},{1},{2}\n", "{0}\t{1}\t{2}\r\n", "Raw:1,2,8192,0,1,2,{0},{1},{2}\r\n"]  # Magneto's two, MotionCal's


def captured(seed):
    """Bias and readings of about ten thousand counts, of sensors, magnets and soft iron of all kinds."""
    rng = np.random.default_rng([9, seed])
    soft = np.eye(3) + 0.06 * rng.standard_normal((3, 3))
    bias = rng.uniform(-12000.0, 12000.0, 3)
    noise = rng.normal(0.0, 30.0, (300, 3))
    return bias, np.rint(10000.0 * directions(300, seed) @ (0.5 * (soft + soft.T)) + bias + noise)


@pytest.mark.parametrize("seed", range(6))
def test_captures_agree_with_an_independent_fit(tmp_path, seed):
    bias, raw = captured(seed)
    path = tmp_path / "mag.txt"
    path.write_text("".join(FORMS[seed % 3].format(*row) for row in raw.astype(int)))
    fitted = plumbob.calibrate_counts(path)
    assert fitted.bias == pytest.approx(independent(raw), abs=3.0)
    assert (np.abs(fitted.bias - bias) < 4.0 * fitted.bias_sd).all()  # of 18 figures one in 16 000 lies beyond
    assert fitted.residual_sd == pytest.approx(30.0, rel=0.2)
    assert (fitted.counts_per_g, fitted.unit) == (None, "counts")
    assert fitted.summary()["counts"]["bias"] == fitted.bias.tolist()


@needs("../cases")
@pytest.mark.parametrize("name", ["mag_raw.csv", "motioncal.txt"])
def test_public_captures_agree_with_an_independent_fit(name):
    path = DATA.parent / "cases" / "10-magnetometer-counts-alone" / name
    raw = np.loadtxt(path.with_name("mag_raw.csv"), delimiter=",")
    assert plumbob.calibrate_counts(path).bias == pytest.approx(independent(raw), abs=3.0 / 10000.0 * 3500.0)


def test_the_strength_of_the_field_gives_the_matrix_its_unit():
    fitted, unscaled = (plumbob.calibrate_counts(readings(), strength=strength) for strength in ("48 uT", None))
    corrected = (readings() - fitted.bias) @ fitted.matrix
    assert np.linalg.norm(corrected, axis=1).mean() == pytest.approx(48.0, rel=1e-3)
    assert (fitted.unit, unscaled.unit) == ("µT", "counts")
    assert np.linalg.det(unscaled.matrix) == pytest.approx(1.0)
    assert unscaled.matrix == pytest.approx(SOFT / np.cbrt(np.linalg.det(SOFT)), abs=2e-3)


def value(lines, name):
    return float(re.search(rf"{name} (\S+)", lines).group(1))


def symmetric(lines, diagonal, off):
    xx, yy, zz, xy, xz, yz = (value(lines, each) for each in (*diagonal, *off))
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def test_what_is_pasted_corrects_as_the_other_program_does():
    """ArduPilot adds its offsets, in milligauss, and PX4 takes its, in gauss, away; both keep a symmetric matrix."""
    raw = readings()
    fitted = plumbob.calibrate_counts(raw, scale="0.025 uT")
    wanted = (raw - fitted.bias) @ fitted.matrix * 0.025
    lines = fitted.lines("ardupilot")
    offsets = np.array([value(lines, f"COMPASS_OFS_{axis}") for axis in "XYZ"])
    names = [[f"COMPASS_{kind}_{axis}" for axis in "XYZ"] for kind in ("DIA", "ODI")]
    assert (raw * 0.25 + offsets) @ symmetric(lines, *names) / 10.0 == pytest.approx(wanted, abs=1e-3)
    lines = fitted.lines("px4")
    offsets = np.array([value(lines, f"CAL_MAG0_{axis}OFF") for axis in "XYZ"])
    names = [[f"CAL_MAG0_{axis}{kind}" for axis in "XYZ"] for kind in ("SCALE", "ODIAG")]
    assert (raw * 2.5e-4 - offsets) @ symmetric(lines, *names) * 100.0 == pytest.approx(wanted, abs=1e-3)
    for form, count in (("c", 1.0), ("arduino", 1.0), ("magneto", 1.0), ("motioncal", 0.025)):
        text = fitted.lines(form).partition("field and offset in uT, one count is 0.025 uT")[2] or fitted.lines(form)
        numbers = np.array(
            re.findall(r"-?\d+\.\d+(?:e-\d+)?", re.sub(r"(//|#|/\*).*\n|.*\*/\n", "", text)), dtype=float
        )
        bias, matrix = numbers[:3], numbers[3:12].reshape(3, 3)
        assert (raw * count - bias) @ matrix * (0.025 / count) == pytest.approx(wanted, abs=1e-3)
    assert json.loads(fitted.lines("json")) == fitted.summary()
    offset = re.search(r"set mag_calibration = (.*)\n", fitted.lines("betaflight"))[1].split(",")
    assert np.array(offset, dtype=int).tolist() == np.rint(fitted.bias).tolist()
    refused(plumbob.calibrate_counts(raw).lines, "px4", match="what one count is", error=ParameterError)
    refused(fitted.lines, "excel", match="ardupilot", error=ShapeError)
    up = np.vstack([np.eye(3), -np.eye(3), directions(12)])
    fitted = plumbob.calibrate_counts(up * [2040.0, 2060.0, 2100.0] + [30.0, -50.0, 80.0], "acc", scale="0.488 mg")
    assert "set acc_calibration = 30,-50,80,1\nsave" in fitted.lines("betaflight")
    for form, names in (("ardupilot", "INS_ACC{1}_{0}"), ("px4", "CAL_ACC0_{0}{1}")):
        lines, kinds = fitted.lines(form), ("OFFS", "SCAL") if form == "ardupilot" else ("OFF", "SCALE")
        offset, scale = (np.array([value(lines, names.format(axis, kind)) for axis in "XYZ"]) for kind in kinds)
        assert offset == pytest.approx(np.array([30.0, -50.0, 80.0]) * 0.488e-3 * G0, abs=1e-5)
        assert scale == pytest.approx(1.0 / np.array([2040.0, 2060.0, 2100.0]) / 0.488e-3, rel=1e-5)


def test_columns_are_named_or_alone(tmp_path):
    raw = readings()
    path = tmp_path / "mag.txt"
    path.write_text("".join(f"{k},{row[0]},{row[1]},{row[2]}\n" for k, row in enumerate(raw)))
    refused(plumbob.calibrate_counts, path, match="4 columns of numbers, and no names", error=DecodeError)
    path.write_text("i,mx,my,mz\n" + "".join(f"{k},{row[0]},{row[1]},{row[2]}\n" for k, row in enumerate(raw)))
    assert plumbob.calibrate_counts(path).bias.tolist() == plumbob.calibrate_counts(raw).bias.tolist()


def test_slow_tumbling_stands_for_poses():
    """A hand pushes by 0.03 g, as noise that lasts: what a sketch logs without time, and no gyroscope beside."""
    rng = np.random.default_rng(7)
    around, up = np.arange(4000.0) / 13.0, np.sin(np.arange(4000.0) / 97.0)
    course = np.column_stack((np.cos(around), np.sin(around), up / np.sqrt(1.0 - 0.99 * up * up)))
    push = np.apply_along_axis(np.convolve, 0, rng.normal(0.0, 0.01, (4009, 3)), np.ones(10), "valid")
    raw = np.rint(4096.0 * (course / np.linalg.norm(course, axis=1)[:, None] + push) @ SOFT + [120.0, -80.0, 40.0])
    fitted = plumbob.calibrate_counts(raw, "acc")
    assert (np.abs(fitted.bias - [120.0, -80.0, 40.0]) < 3.0 * fitted.bias_sd).all()
    assert fitted.matrix * 4096.0 == pytest.approx(np.linalg.inv(SOFT), abs=0.01)


def test_nine_parameters_of_poses_by_row():
    """18 averaged rows with half a count of rounding of 4096: the matrix to 1e-3, the bias to 1e-3 of 1 g."""
    up = np.vstack([np.eye(3), -np.eye(3), directions(12)])
    fitted = plumbob.calibrate_counts(np.rint(4096.0 * up @ SOFT + [120.0, -80.0, 40.0]), "acc")
    assert fitted.matrix * 4096.0 == pytest.approx(np.linalg.inv(SOFT), abs=1e-3)
    assert fitted.bias == pytest.approx([120.0, -80.0, 40.0], abs=4.0)


@pytest.mark.parametrize("poses", [6, 18, 40])
def test_one_averaged_row_a_pose_gives_the_counts_of_1_g(poses):
    scale, bias = np.array([2040.0, 2060.0, 2100.0]), np.array([30.0, -50.0, 80.0])
    up = np.vstack([np.eye(3), -np.eye(3), directions(poses)])[:poses]
    fitted = plumbob.calibrate_counts(up * scale + bias, "acc")
    assert (fitted.counts_per_g, fitted.bias) == (pytest.approx(scale, rel=1e-6), pytest.approx(bias, abs=1e-3))
    assert np.linalg.norm((up * scale) @ fitted.matrix, axis=1) == pytest.approx(1.0, abs=1e-6)


FLAT = np.column_stack((np.cos(np.arange(300.0)), np.sin(np.arange(300.0)), np.zeros(300)))
NOISE = np.random.default_rng(6).normal(0.0, 4.0, (300, 3))


@pytest.mark.parametrize(("raw", "options", "error", "match"), [
    (np.ones((50, 3)), {}, CaptureRefusedError, "all readings are the same"),
    (300.0 + NOISE, {}, CaptureRefusedError, "as the noise of one pose does"),
    (300.0 + NOISE, {"sensor": "acc"}, CaptureRefusedError, "as the noise of one pose does"),
    (900.0 * FLAT + NOISE, {}, CaptureRefusedError, "on one circle about the z axis"),
    (900.0 * FLAT + NOISE, {"sensor": "acc"}, CaptureRefusedError, r"no pose had \+z, −z up"),
    (readings() * [1.0, 1.0, 0.0] + [0.0, 0.0, 5.0], {}, CaptureRefusedError, "z of the magnetometer always reads 5 "),
    (readings(300) * [1.0, 1.0, 0.0] + NOISE, {}, CaptureRefusedError, "an axis does not answer"),
    (np.clip(20.0 * readings(), -32768, 32767), {}, CaptureRefusedError, "at the end of the range"),
    (readings(), {"scale": "1 uT"}, CaptureRefusedError, "Check the unit"),
    (readings(), {"sensor": "acc", "scale": "1 mg"}, CaptureRefusedError, "times gravity"),
    (np.eye(3), {"sensor": "acc"}, CaptureRefusedError, "3 poses"),
    (np.eye(3), {"sensor": "gyr"}, ShapeError, "mag, acc"),
])  # fmt: skip
def test_what_does_not_determine_it_is_refused(raw, options, error, match):
    with pytest.raises(error, match=match):
        plumbob.calibrate_counts(raw, **options)


def test_few_readings_at_the_end_of_the_range_are_left_out():
    bias, raw = np.array([3200.0, 0.0, 0.0]), directions(600) * 30000.0
    fitted = plumbob.calibrate_counts(np.clip(np.rint(raw + bias), -32768, 32767))
    assert fitted.quality.samples < 600
    assert fitted.bias == pytest.approx(bias, abs=0.5)
