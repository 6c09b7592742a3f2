"""What is said about the data of a recording."""

import numpy as np
import pytest
from io_samples import make_imu

from plumbob.data import ImuMeta
from plumbob.io.findings import EARTH_FIELD, TOPICS, findings, provenance

META = ImuMeta(calibration="card", unit_check=False)


def lines(topic, **changes):
    return [line for line in findings(make_imu(**({"meta": META} | changes))) if line.startswith(topic)]


def test_nothing_is_said_of_a_clean_recording():
    assert findings(make_imu(meta=META)) == ()


def test_uncalibrated():
    assert lines("calibration: ", meta=ImuMeta()) != []


@pytest.mark.parametrize("size", [0.5, 21.0, 68.0, 900.0])
def test_magnetic_field_beyond_the_earths(size):
    mag = np.tile([0.0, 0.0, size], (12, 1))
    assert f"{size:.4g} µT" in lines("magnetic field: ", mag=mag)[0]


@pytest.mark.parametrize("size", [22.5, 49.0, 66.5])
def test_magnetic_field_of_the_earth(size):
    assert lines("magnetic field: ", mag=np.tile([0.0, size, 0.0], (12, 1))) == []


def test_magnetic_field_of_absurd_size_is_no_warning_of_numpy():
    assert "inf" in lines("magnetic field: ", mag=np.full((12, 3), 1e300))[0]


def test_clipped_and_invalid_samples_are_counted():
    gyr = np.zeros((12, 3))
    gyr[[2, 5, 7], 1] = -10.0
    gyr[9, 0] = np.inf
    meta = ImuMeta(calibration="card", unit_check=False, gyr_range=10.0)
    assert lines("clipped: ", gyr=gyr, meta=meta) == ["clipped: gyr is at the end of the range in 3 of 12 samples"]
    assert lines("invalid: ", gyr=gyr, meta=meta) == ["invalid: gyr is infinite or impossible in 1 of 12 samples"]


def test_gaps_are_counted():
    t = np.arange(12) * 0.01
    t[6:] += 0.5
    assert lines("gaps: ", t=t) == ["gaps: samples are missing before 1 of 12; the longest step is 0.51 s"]


def test_provenance_keeps_order_and_drops_findings_and_repetitions():
    assert provenance(["b", *(f"{topic}x" for topic in TOPICS), "a", "b"]) == ("b", "a")


def test_earth_field_is_that_of_igrf():
    # IGRF-13: total intensity from 22 µT (South Atlantic anomaly) to 67 µT (near the southern magnetic pole).
    assert EARTH_FIELD == (22.0, 67.0)
