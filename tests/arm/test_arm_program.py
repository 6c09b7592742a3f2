"""Programs of a taught arm, exported, and figures of it."""

import csv
import json
import re
from base64 import b64encode
from functools import partial
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from plumbob.arm import JointTrack, Program, export, taught
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.data.chain import Chain, Joint, Limits, Segment
from plumbob.reporting.arm import arm_report, stick_figure
from plumbob.reporting.report import Report
from tests.helpers import examples
from tests.helpers.arm_samples import arm, eased, pick_and_place, scipy_hand

POSITIVE = ("rate", "smooth", "still", "dwell")
WIDE = Limits(-10.0, 10.0, 1e3, 1e5, 1e7)


@st.composite
def motions(draw):
    """Sums of sines, some of them held for a while, with noise, on a line of times with holes."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    joints, rate = draw(st.integers(1, 4)), draw(st.sampled_from((50.0, 100.0, 333.0)))
    t = np.arange(0.0, draw(st.floats(2.0, 8.0)), 1.0 / rate)
    held = np.maximum(0.0, np.sin(t * rng.uniform(0.3, 2.0) + rng.uniform(0, 6)))
    phase = np.cumsum(held) / rate
    angles = sum(
        rng.normal(0.0, 0.6, joints) * np.sin(np.outer(phase, rng.uniform(0.2, 12.0, joints))) for _ in range(4)
    )
    angles = angles + rng.normal(0.0, draw(st.sampled_from((0.0, 1e-3, 2e-2))), angles.shape)
    angles[rng.random(t.size) < draw(st.sampled_from((0.0, 0.05)))] = np.nan
    return JointTrack(t, tuple(f"j{i}" for i in range(joints)), angles)


size = st.one_of(st.just(np.inf), st.floats(0.05, 50.0))
limits = st.builds(Limits, st.floats(-2.0, -0.1), st.floats(0.1, 2.0), size, size, size)


@examples(0.6)
@given(motions(), limits, st.sampled_from((50.0, 100.0, 125.0, 1000.0)))
def test_limits_are_kept_by_differences_of_samples(track, bounds, rate):
    program = taught(track, bounds, rate=rate)
    for order, top in enumerate(bounds[2:], 1):
        most = np.abs(np.diff(program.angles, order, axis=0)).max() * rate**order
        assert most <= top, (order, most, top)
    assert program.angles.min() >= bounds.low and program.angles.max() <= bounds.high
    assert np.abs(program.velocities).max() <= bounds.velocity
    assert np.abs(program.accelerations).max() <= bounds.acceleration and np.isfinite(program.angles).all()
    np.testing.assert_allclose(np.diff(program.t), 1.0 / rate, rtol=1e-6)


@examples(0.4)
@given(motions(), size, size, size)
def test_stops_and_ends_are_kept(track, velocity, acceleration, jerk):
    program = taught(track, Limits(-10.0, 10.0, velocity, acceleration, jerk))
    for stop in program.stops:
        inside = (program.t >= stop.start) & (program.t <= stop.end)
        assert (program.angles[inside] == np.array(stop.angles)).all()
        assert (program.velocities[inside] == 0.0).all() and (program.accelerations[inside] == 0.0).all()
        assert stop.end - stop.start >= 0.3 - 1e-9
    known = np.flatnonzero(np.isfinite(track.angles).all(axis=1))
    for row, end, outer in ((0, known[0], 0.0), (-1, known[-1], program.t[-1])):
        at_stop = [stop for stop in program.stops if stop.start <= outer <= stop.end + 1.0 / program.rate]
        wanted = [stop.angles for stop in at_stop] or [tuple(track.angles[end])]
        wanted.append(tuple(track.angles[end]))  # where a motion of less than a sample follows the stop
        assert tuple(program.angles[row]) in wanted


def test_stops_are_those_of_the_recording_and_a_slow_motion_is_none():
    """Poses within the noise of their median: 100 samples of 0.1° give 0.0125° (1.25 σ/√n), four times that here."""
    poses = np.radians([[0, 10], [40, -20], [40, 30], [-10, 0]])
    program = taught(pick_and_place(poses, noise=np.radians(0.1)), WIDE)
    assert len(program.stops) == len(poses)
    for k, (stop, pose) in enumerate(zip(program.stops, poses, strict=True)):
        np.testing.assert_allclose(stop.angles, pose, atol=np.radians(0.05))
        # 20° in 2 s with rest at both ends leave the pose by half a degree within 0.3 s of their start.
        assert abs(stop.recorded - 3.0 * k) < 0.35 and 1.0 <= stop.end - stop.start < 1.7
    assert program.slowed == pytest.approx(1.0, abs=0.01)
    assert max(one.rms for one in program.deviations.values()) < np.radians(0.2)
    t = np.arange(0.0, 10.0, 0.01)
    slow = np.where(t < 2.0, 0.0, np.where(t < 8.0, (t - 2.0) * np.radians(2.0), np.radians(12.0)))  # 2 °/s
    program = taught(JointTrack(t, ("a",), slow[:, np.newaxis]), WIDE)
    assert [round(np.degrees(stop.angles[0])) for stop in program.stops] == [0, 12]


def test_only_what_is_too_fast_is_slowed_along_the_same_path():
    """A flick of 0.5 s in 20 s of slow motion: as a whole it would take three times as long."""
    t = np.arange(0.0, 20.0, 0.01)
    angles = 0.5 * np.sin(0.5 * t) + 0.5 * eased((t - 10.0) / 0.5)  # the flick's top speed is 1.875 · 0.5 / 0.5 rad/s
    program = taught(JointTrack(t, ("a",), angles[:, np.newaxis]), Limits(velocity=0.6, acceleration=20.0, jerk=400.0))
    assert program.used(Limits(velocity=0.6))["velocity"] <= 1.0 and program.t[-1] < 24.0
    recorded = np.interp(program.t, t, angles)
    np.testing.assert_allclose(program.angles[:700, 0], recorded[:700], atol=0.03)  # 7 s before it: as recorded
    track = pick_and_place(np.radians([[0, 10, 0], [40, -20, 5], [40, 30, -60], [-10, 0, 0]]))
    quick = taught(track, WIDE, rate=500.0)
    slow = taught(track, Limits(-10, 10, 0.3, 0.6, 2.0), rate=500.0)
    assert slow.t[-1] > 1.5 * quick.t[-1]
    nearest = [np.abs(quick.angles - pose).max(axis=1).min() for pose in slow.angles[::50]]
    # Between two samples of the quick one lie 0.65 rad/s · 2 ms at most.
    assert max(nearest) < 1.3e-3


def test_smoothing_removes_what_is_faster_than_its_knots():
    """A tremor of 8 Hz is removed, a motion of 0.3 Hz stays: within 2 % and 1 % of their amplitudes."""
    t = np.arange(0.0, 20.0, 0.01)
    slow, tremor = np.sin(2 * np.pi * 0.3 * t), 0.05 * np.sin(2 * np.pi * 8.0 * t)
    program = taught(JointTrack(t, ("a",), (slow + tremor)[:, np.newaxis]), Limits(), smooth=0.2)
    inner = slice(200, -200)
    left = program.angles[inner, 0] - slow[inner]
    assert np.abs(left).max() < 0.01 and abs(np.mean(left * tremor[inner])) / np.mean(tremor[inner] ** 2) < 0.02


def test_poses_beyond_the_range_are_brought_inside_turns_unwrapped_and_limits_by_name():
    program = taught(pick_and_place(np.radians([[0.0], [50.0]])), Limits(low=-1.0, high=np.radians(45.0)))
    assert program.stops[1].angles == (np.radians(45.0),)
    assert "5.00° beyond the range of j0" in str(program.notes[0])
    assert program.deviations["j0"].max == pytest.approx(np.radians(5.0), abs=1e-6)
    t = np.arange(0.0, 6.0, 0.01)
    turned = 4.0 * eased((t - 1.0) / 4.0)
    wrapped = (turned + np.pi) % (2.0 * np.pi) - np.pi
    program = taught(JointTrack(t, ("a",), wrapped[:, np.newaxis]), Limits(velocity=3.0))
    assert program.angles[-1, 0] - program.angles[0, 0] == pytest.approx(4.0, abs=1e-9)
    chain = Chain(
        "arm",
        (Segment("base"), Segment("upper"), Segment("lower")),
        (
            Joint("j1", "base", "upper", axes=((0, 0, 1.0),), limits=(Limits(velocity=0.2),)),
            Joint("j0", "upper", "lower", axes=((0, 0, 1.0),)),
        ),
    )
    program = taught(pick_and_place([[0.0, 0.0], [1.0, 1.0]]), chain)
    assert 0.99 < program.used(chain)["velocity"] <= 1.0
    with pytest.raises(ParameterError, match="no angle k; its angles are j1, j0"):
        taught(JointTrack(np.arange(20.0), ("k",), np.zeros((20, 1))), chain)


ONE = pick_and_place([[0.0], [1.0]])
NO_NUMBER = ([0.0, 1.0, 2.0], [[0.0], [np.nan], [0.0]], ("a",), np.zeros((3, 1)), np.zeros((3, 1)))


@pytest.mark.parametrize(("make", "error", "match"), [
    *((partial(taught, ONE, **{name: 0.0}), ParameterError, f"{name} must be above 0") for name in POSITIVE),
    (partial(taught, ONE[:5]), ShapeError, "8 samples"),
    (partial(taught, ONE, [Limits(), Limits()]), ParameterError, "1 angle need"),
    (partial(Program, *NO_NUMBER), ShapeError, "finite"),
])  # fmt: skip
def test_what_cannot_be_taught_is_refused(make, error, match):
    with pytest.raises(error, match=match):
        make()


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


def test_urscript_follows_the_program_at_its_rate_and_is_for_six_joints(program: Program, tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="robots of 6 joints, but the program has 2: elbow: left"):
        export(program, tmp_path / "p.script")
    names, wide = ("a", "b", "c", "d", "e", "f\nhalt"), [np.tile(of, 3) for of in
                   (program.angles, program.velocities, program.accelerations)]  # fmt: skip
    six = Program(program.t, wide[0], names, wide[1], wide[2], program.recorded)
    lines = export(six, tmp_path / "p.script").read_text().splitlines()
    assert (lines[0], lines[-3:]) == ("def taught():", ["  stopj(2.0)", "end", "taught()"])
    rows = [
        re.fullmatch(r"  servoj\((\[.*\]), t=([\d.]+), lookahead_time=0\.1, gain=300\)", line) for line in lines[3:-3]
    ]
    np.testing.assert_allclose([json.loads(row[1]) for row in rows], six.angles, atol=5e-7)
    np.testing.assert_allclose([float(row[2]) for row in rows], 1.0 / 125.0)
    assert lines[2].startswith("  movej(") and "halt" not in lines[3]


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


def data_of(page: str) -> dict:
    return json.loads(re.search(r"<script type='application/json'>(.*?)</script>", page, re.DOTALL)[1])


def test_the_stick_figure_is_where_scipy_says() -> None:
    chain = arm()
    angles = np.random.default_rng(2).uniform(-2.0, 2.0, (40, 6))
    scene = stick_figure(chain, np.arange(40) / 10.0, angles)
    found = data_of(Report("a", scenes=[scene]).page())
    assert found["names"] == ["base", "upper", "lower", "hand", "tip"] and found["trail"] == 4
    assert found["lines"] == [[0, 1], [1, 2], [2, 3], [3, 4]]
    assert found["t"] == [round(k / 10.0, 3) for k in range(40)]
    np.testing.assert_allclose(found["points"][4], [scipy_hand(row) for row in angles], atol=0.6e-4)
    name, values = found["values"][3]
    assert name == "elbow"
    np.testing.assert_allclose(values, np.degrees(angles[:, 3]), atol=0.051)


def test_a_long_motion_has_a_bounded_page_and_unknown_places_are_left_out() -> None:
    chain = arm()
    angles = np.zeros((200_000, 6))
    angles[100_000:, 3] = np.nan
    found = data_of(Report("a", scenes=[stick_figure(chain, np.arange(200_000) / 100.0, angles)]).page())
    assert len(found["t"]) <= 1500 and found["t"][0] == 0.0 and found["t"][-1] == 1999.99
    assert found["points"][4][-1] == [None] * 3 and found["points"][1][-1] is not None


def test_only_the_one_script_may_run_and_names_cannot_leave_their_place() -> None:
    bad = "</script><script>alert(1)</script>"
    chain = Chain(bad, (Segment("base"), Segment(bad)), (Joint("j", "base", bad, axes=((0, 0, 1.0),)),))
    page = Report(bad, scenes=[stick_figure(chain, np.arange(3.0), np.zeros((3, 1)))]).page()
    assert "<script>alert" not in page
    assert "<script" not in Report("a").page() and "script-src" not in Report("a").page()
    (script,) = re.findall(r"<script>(.*?)</script>", page, re.DOTALL)
    digest = b64encode(sha256(script.encode()).digest()).decode()
    (policy,) = re.findall(r'http-equiv="Content-Security-Policy" content="([^"]*)"', page)
    assert policy.startswith("default-src 'none'; style-src 'unsafe-inline'; ")
    assert re.findall("script-src [^;]*", policy) == [f"script-src 'sha256-{digest}'"]
    assert data_of(page)["names"] == ["base", bad]
    assert not re.search(r"(?:src|href)=|https?://(?!www\.w3\.org)", page)


def test_a_report_has_angles_hand_and_program() -> None:
    chain = arm()
    clean = pick_and_place(np.random.default_rng(4).uniform(-0.9, 0.9, (2, 6)), rest=0.6, move=1.4)
    angles = clean.angles + np.radians(2.0)
    track = JointTrack(clean.t, chain.angles, angles, sd=np.full_like(angles, 0.01))
    truth = JointTrack(clean.t, chain.angles, clean.angles)
    report = arm_report(chain, track, program=taught(track, chain), truth=truth, facts=[("take", "7")])
    rows = {row[0]: row for row in report.tables[0].rows}
    assert rows["elbow"][3:] == ["0.57", "2.00", "2.00"]  # 0.01 rad, and an error of 2° everywhere
    assert len(data_of(report.page())["shadow"]) == 5
    with pytest.raises(ParameterError, match="the angles of arm are"):
        arm_report(chain, JointTrack([0.0], ("a",), [[0.0]]))
    with pytest.raises(ShapeError, match="truth must have the times"):
        arm_report(chain, track, truth=truth[1:])
