"""Programs as files, each read back by a reader that is not ours."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from plumbob.arm import JointTrack, Program, export, taught
from plumbob.core.errors import ParameterError
from plumbob.data.chain import Limits
from tests.helpers.arm_samples import pick_and_place


@pytest.fixture(scope="module")
def program() -> Program:
    """2.5 s and names that need quotes; its smallest numbers have powers of ten."""
    made = taught(pick_and_place([[0.0, 1e-5], [0.3, 0.4]], rest=0.5, move=1.5), Limits(jerk=50.0), rate=125.0)
    assert 0.0 < np.abs(made.angles[made.angles != 0.0]).min() < 1e-4
    return Program(
        made.t, made.angles, ("elbow: left", 'wrist "1"'), made.velocities, made.accelerations, made.recorded
    )  # fmt: skip


def same_trajectory(found, program: Program) -> None:
    assert found["joint_names"] == list(program.names)
    assert len(found["points"]) == len(program)
    for key, values in (
        ("positions", program.angles),
        ("velocities", program.velocities),
        ("accelerations", program.accelerations),
    ):
        np.testing.assert_array_equal([point[key] for point in found["points"]], values, err_msg=key)
    times = [point["time_from_start"] for point in found["points"]]
    assert all(isinstance(time["sec"], int) and 0 <= time["nanosec"] < 10**9 for time in times)
    np.testing.assert_allclose([time["sec"] + 1e-9 * time["nanosec"] for time in times], program.t, atol=1e-9)


@pytest.mark.parametrize(("suffix", "reader"), [("yaml", yaml.safe_load), ("json", json.loads)])
def test_text_is_read_by_readers_of_others(program: Program, tmp_path: Path, suffix: str, reader) -> None:
    same_trajectory(reader(export(program, tmp_path / f"p.{suffix}").read_text()), program)


def test_mcap_is_read_as_ros_2(program: Program, tmp_path: Path) -> None:
    file = export(program, tmp_path / "p.mcap")
    with file.open("rb") as stream:
        found = list(make_reader(stream, decoder_factories=[DecoderFactory()]).iter_decoded_messages())
    (whole,) = [one for one in found if one.channel.topic == "joint_trajectory"]
    assert whole.schema.name == "trajectory_msgs/msg/JointTrajectory"
    message = whole.decoded_message
    assert message.joint_names == list(program.names)
    np.testing.assert_array_equal([point.positions for point in message.points], program.angles)
    np.testing.assert_array_equal([point.velocities for point in message.points], program.velocities)
    np.testing.assert_array_equal([point.accelerations for point in message.points], program.accelerations)
    times = [point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec for point in message.points]
    np.testing.assert_allclose(times, program.t, atol=1e-9)
    states = [one for one in found if one.channel.topic == "joint_states"]
    assert {one.schema.name for one in states} == {"sensor_msgs/msg/JointState"}
    np.testing.assert_array_equal([one.decoded_message.position for one in states], program.angles)
    np.testing.assert_allclose([1e-9 * one.message.log_time for one in states], program.t, atol=1e-9)


@pytest.mark.parametrize(("unit", "factor"), [("rad", 1.0), ("deg", 180.0 / np.pi)])
def test_csv_is_read_by_csv_and_by_us(program: Program, tmp_path: Path, unit: str, factor: float) -> None:
    file = export(program, tmp_path / "p.csv", unit=unit)
    with file.open(newline="") as stream:
        head, *rows = csv.reader(stream)
    assert head == ["t [s]", "recorded [s]", f"elbow: left [{unit}]", f'wrist "1" [{unit}]']
    np.testing.assert_allclose(np.array(rows, dtype=float)[:, 2:], program.angles * factor, rtol=1e-15)
    np.testing.assert_allclose(JointTrack.load(file).angles, program.angles, rtol=1e-15)
    again = Program.load(file)
    np.testing.assert_array_equal(again.recorded, program.recorded)
    # Central differences of a motion whose third derivative is at most 50 rad/s³: 50 · 0.008² / 6, of the ends
    # 50 · 0.008² / 2 (Taylor).
    np.testing.assert_allclose(again.velocities, program.velocities, atol=50 * 0.008**2)


@pytest.mark.parametrize(
    ("name", "more", "match"),
    [("p.bag", {}, r"\.bag"), ("p.json", {"unit": "deg"}, "in radians"), ("p.parquet", {}, "exists already")],
)
def test_what_cannot_be_written_is_refused(program: Program, tmp_path: Path, name: str, more, match: str) -> None:
    export(program, tmp_path / "p.parquet")
    with pytest.raises(ParameterError, match=match):
        export(program, tmp_path / name, **more)
