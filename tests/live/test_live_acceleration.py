"""Acceleration without gravity in the axes of the Earth: closed form, and the spread of perturbed attitudes."""

import numpy as np
import pyarrow.csv
import pytest

from plumbob import AttitudeTrack, ImuData, ImuMeta, earth_acceleration
from plumbob.cli.main import main
from plumbob.core.constants import G0
from plumbob.core.errors import ClockError, ShapeError
from plumbob.data.cards import NoiseCard, TriadNoise
from plumbob.files import read, write
from plumbob.rotations import Frame, quat_conjugate, quat_from_rotvec, quat_multiply, quat_rotate

T = np.arange(400) / 100.0


def moved(frame, q_nb=None):
    """A body that turns and swings by sin along all axes; samples of ideal sensors, attitudes, and the acceleration."""
    frame = Frame.parse(frame)
    acc_n = np.outer(np.sin(2.0 * np.pi * T), [1.0, -2.0, 0.5])
    q_nb = quat_from_rotvec(np.outer(T, [0.3, -0.2, 0.5])) if q_nb is None else q_nb
    force_b = quat_rotate(quat_conjugate(q_nb), acc_n + G0 * np.asarray(frame.up))
    rate = np.tile([0.3, -0.2, 0.5], (T.size, 1))  # about a fixed axis, so it is the same in body axes
    imu = ImuData(t=T, gyr=rate, acc=force_b, meta=ImuMeta(frame=frame, calibration="ideal", rate_nominal=100.0))
    return imu, AttitudeTrack(t=T, q_nb=q_nb, frame=frame, north="true", cov_b=np.zeros((T.size, 3, 3))), acc_n


@pytest.mark.parametrize("frame", ["ENU", "NED", "NWU"])
def test_what_was_put_in_comes_out_along_the_axes_of_the_frame(frame):
    imu, track, acc_n = moved(frame)
    found = earth_acceleration(imu, track)
    assert found.acc_n == pytest.approx(acc_n, abs=1e-13)
    assert found.sd_n == pytest.approx(0.0, abs=1e-13)  # an ideal unit and attitude
    word = {"ENU": "east", "NED": "north", "NWU": "north"}[frame]
    assert list(found.columns())[:2] == ["t [s]", f"acc_{word} [m/s2]"]


def test_the_deviation_is_the_spread_of_attitudes_and_samples_of_that_covariance():
    imu, track, acc_n = moved("ENU")
    rng, at, count = np.random.default_rng(5), 130, 40_000
    root = np.array([[0.02, 0.0, 0.0], [0.005, 0.01, 0.0], [0.0, -0.01, 0.03]])  # rad
    card = NoiseCard("u", "made", acc=TriadNoise([0.01, 0.02, 0.03], np.zeros(3), np.zeros(3)))
    cov = np.broadcast_to(root @ root.T, (T.size, 3, 3))
    claimed = earth_acceleration(imu, AttitudeTrack(T, track.q_nb, "ENU", "true", cov_b=cov), noise=card).sd_n[at]
    turned = quat_multiply(track.q_nb[at], quat_from_rotvec(rng.normal(size=(count, 3)) @ root.T))
    noise = rng.normal(size=(count, 3)) * [0.1, 0.2, 0.3]  # N √rate, rate 100 Hz
    spread = (quat_rotate(turned, imu.acc[at] + noise) - [0.0, 0.0, G0] - acc_n[at]).std(axis=0)
    assert claimed == pytest.approx(spread, rel=0.02)  # 1/√(2 · 40 000) is 0.35 %; the rest is of second order


def test_run_writes_it_and_what_does_not_fit_is_refused(tmp_path):
    imu, track, _ = moved("ENU")
    write(tmp_path / "a.parquet", imu)
    words = ["run", str(tmp_path / "a.parquet"), "--filter", "mekf", "--out", str(tmp_path / "track.parquet")]
    assert main([*words, "--acceleration", str(tmp_path / "acc.csv")]) == 0
    table = pyarrow.csv.read_csv(tmp_path / "acc.csv")
    columns = earth_acceleration(imu, read(tmp_path / "track.parquet").track).columns()
    assert table.column_names == list(columns)
    assert table.column_names[3:5] == ["acc_up [m/s2]", "acc_east_sd [m/s2]"]
    assert all(np.array_equal(table[name].to_numpy(), values) for name, values in columns.items())
    with pytest.raises(ClockError, match="different times"):
        earth_acceleration(imu[1:], track)
    with pytest.raises(ShapeError, match="no accelerometer"):
        earth_acceleration(ImuData(t=T, gyr=imu.gyr), track)
