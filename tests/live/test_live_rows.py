"""Rows of a recording: JSON that reads back to the same bits, with null for what is not a number."""

import json

import hypothesis.strategies as st
import numpy as np
from hypothesis import given
from hypothesis.extra.numpy import arrays

from plumbob import AttitudeTrack, Frame, ImuData, North, flags
from plumbob.live.rows import attitude_rows, imu_rows

T_NS = [5, 10, 2**61]


def same(told, values):
    return all(a == b or (a is None and not np.isfinite(b)) for a, b in zip(told, values, strict=True))


@given(arrays(np.float64, (3, 3), elements=st.floats(allow_nan=True, allow_infinity=True)))
def test_every_number_of_a_sample_reads_back(gyr):
    gyr[0, 0] = 0.1  # a recording needs a number
    meta = ImuData(t=[0.0], gyr=[[0.0, 0.0, 0.0]]).meta
    imu = ImuData.live(np.array([0, 1, 2]), {"gyr": gyr}, flags=np.arange(3, dtype=np.uint32), meta=meta)
    for row, t, values in zip(imu_rows(T_NS, imu), T_NS, gyr, strict=True):
        told = json.loads(row)
        assert told["t_ns"] == t
        assert told["acc"] is told["mag"] is told["temp_c"] is None
        assert same(told["gyr"], values)


def test_a_sensor_that_is_not_there_is_absent_in_every_row():
    meta = ImuData(t=[0.0], gyr=[[0.0, 0.0, 0.0]]).meta
    imu = ImuData.live(np.array([0, 1]), {"gyr": np.zeros((2, 3))}, flags=np.zeros(2, dtype=np.uint32), meta=meta)
    assert (imu.flags == flags.ACC_ABSENT | flags.MAG_ABSENT).all()


@given(arrays(np.float64, (3, 4), elements=st.floats(-1, 1)))
def test_every_number_of_an_attitude_reads_back(q_nb):
    track = AttitudeTrack.trusted(t=np.arange(3.0), q_nb=q_nb, frame=Frame.ENU, north=North.TRUE)
    for row, values in zip(attitude_rows(T_NS, track), q_nb, strict=True):
        told = json.loads(row)
        assert told["q_nb"] == values.tolist()
        assert (told["bias_b"], told["flags"]) == (None, 0)
