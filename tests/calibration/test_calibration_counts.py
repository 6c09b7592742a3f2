"""Bare triples in counts give back the bias and the matrix that they were made with."""

import numpy as np
import pytest

import plumbob
from plumbob.calibration.fit import CaptureRefusedError
from plumbob.core.errors import DecodeError, ShapeError
from tests.helpers.io_samples import refused

BIAS = np.array([-918.0, 2193.0, 371.0])
SOFT = np.array([[1.05, -0.02, 0.01], [-0.02, 0.97, -0.015], [0.01, -0.015, 0.99]])  # symmetric: what calibration gives


def directions(count, seed=4):
    vectors = np.random.default_rng(seed).normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def readings(count=400, size=1900.0, noise=3.0):
    noises = np.random.default_rng(5).normal(0.0, noise, (count, 3))
    return np.rint(size * directions(count) @ np.linalg.inv(SOFT) + BIAS + noises)


def test_a_magnetometer_alone_in_counts():
    found = plumbob.calibrate_counts(readings())
    assert found.bias == pytest.approx(BIAS, abs=2.0)
    assert found.matrix / np.cbrt(np.linalg.det(found.matrix)) == pytest.approx(
        SOFT / np.cbrt(np.linalg.det(SOFT)), abs=2e-3
    )
    assert found.residual_sd == pytest.approx(3.0, rel=0.2)
    assert found.counts_per_g is None
    assert found.summary()["counts"]["bias"] == found.bias.tolist()


@pytest.mark.parametrize("form", ["{0},{1},{2}\n", "Raw:1,2,8192,0,1,2,{0},{1},{2}\r\n", "{0} {1} {2}\n"])
def test_files_of_triples(tmp_path, form):
    raw = readings()
    path = tmp_path / "mag.txt"
    path.write_text("".join(form.format(*row) for row in raw.astype(int)))
    assert plumbob.calibrate_counts(path).bias.tolist() == plumbob.calibrate_counts(raw).bias.tolist()
    path.write_text("".join(f"{k},{row[0]},{row[1]},{row[2]}\n" for k, row in enumerate(raw)))
    refused(plumbob.calibrate_counts, path, match="4 columns of numbers, and no names", error=DecodeError)
    path.write_text("i,mx,my,mz\n" + "".join(f"{k},{row[0]},{row[1]},{row[2]}\n" for k, row in enumerate(raw)))
    assert plumbob.calibrate_counts(path).bias.tolist() == plumbob.calibrate_counts(raw).bias.tolist()


@pytest.mark.parametrize("poses", [6, 18, 40])
def test_one_averaged_row_a_pose_gives_the_counts_of_1_g(poses):
    scale, bias = np.array([2040.0, 2060.0, 2100.0]), np.array([30.0, -50.0, 80.0])
    up = np.vstack([np.eye(3), -np.eye(3), directions(poses)])[:poses]
    found = plumbob.calibrate_counts(up * scale + bias, "acc")
    assert (found.counts_per_g, found.bias) == (pytest.approx(scale, rel=1e-6), pytest.approx(bias, abs=1e-3))
    assert np.linalg.norm((up * scale) @ found.matrix, axis=1) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize(("raw", "sensor", "error", "match"), [
    (np.ones((50, 3)), "mag", CaptureRefusedError, "all readings are the same"),
    (readings() * [1.0, 1.0, 0.0] + [0.0, 0.0, 5.0], "mag", CaptureRefusedError, None),
    (np.eye(3), "acc", CaptureRefusedError, "3 poses"),
    (np.eye(3), "gyr", ShapeError, "mag, acc"),
])  # fmt: skip
def test_what_does_not_determine_it_is_refused(raw, sensor, error, match):
    with pytest.raises(error, match=match):
        plumbob.calibrate_counts(raw, sensor)
