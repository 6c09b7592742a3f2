"""Encoders of an attitude, read back by parsers that are not ours."""

import json
import math
from io import BytesIO
from typing import Any

import numpy as np
import pynmea2
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pynmeagps import NMEAReader

from plumbob import AttitudeTrack, Frame, ImuData, North, flags, units
from plumbob.core.errors import FrameError, ParameterError
from plumbob.protocols.attitude import AttitudeSample, BodyAxes, attitudes, lines
from plumbob.protocols.attitude.mavlink import Mavlink
from plumbob.protocols.attitude.ros2 import Imus
from plumbob.rotations import change_frame, quat_conjugate, quat_from_euler_zyx, quat_multiply, quat_rotate
from tests.helpers import examples

NOON = 1_700_000_000_123_456_789  # 2023-11-14T22:13:20.123456789Z
HALF_TURN = np.array([0.0, 1.0, 0.0, 0.0])  # about x: forward-right-down to forward-left-up, and back


def track(heading: float, pitch: float, roll: float, **more: Any) -> AttitudeTrack:
    """One attitude of forward-right-down axes in NED, °."""
    q = quat_from_euler_zyx(units.deg(np.array([[heading, pitch, roll]])))
    return AttitudeTrack(**{"t": [0.0], "q_nb": q, "frame": Frame.NED, "north": North.TRUE} | more)


def one(found: AttitudeTrack, **more: Any) -> AttitudeSample:
    return next(attitudes(found, [0], **{"t0_ns": NOON, "utc": True} | more))


def fields(sentence: bytes) -> list[str]:
    assert (sentence.endswith(b"\r\n") and len(sentence) <= 82 + 2) or sentence.startswith(b"$PASHR")
    return sentence.decode().partition("*")[0].split(",")


# Closed forms: the angles that were put in; 359.997 and more is 0 with two decimals.
@pytest.mark.parametrize(
    ("heading", "expected"),
    [(0.0, 0.0), (90.0, 90.0), (180.0, 180.0), (359.99, 359.99), (359.996, 0.0), (359.994, 359.99), (-0.001, 0.0)],
)
def test_heading_goes_around(heading: float, expected: float) -> None:
    sentence = lines.hdt(one(track(heading, 0.0, 0.0)))
    assert float(pynmea2.parse(sentence.decode(), check=True).heading) == expected
    assert NMEAReader.parse(sentence).headingT == expected
    assert "-" not in sentence.decode() and "360" not in sentence.decode()


@pytest.mark.parametrize(("pitch", "roll"), [(0.0, 0.0), (89.9, 10.0), (-89.9, -10.0), (5.25, 180.0), (-3.0, -179.99)])
def test_pitch_and_roll_of_xdr_and_pashr(pitch: float, roll: float) -> None:
    a = one(track(200.0, pitch, roll))
    xdr = NMEAReader.parse(lines.xdr(a))
    assert (xdr.tdrid_01, xdr.tdrid_02) == ("PITCH", "ROLL")
    assert xdr.data_01 == pytest.approx(pitch, abs=0.0051) and abs(xdr.data_02) == pytest.approx(abs(roll), abs=0.0051)
    pashr: Any = pynmea2.parse(lines.pashr(a).decode(), check=True)
    assert pashr.pitch == pytest.approx(pitch, abs=0.0051) and abs(pashr.roll) == pytest.approx(abs(roll), abs=0.0051)
    assert abs(roll) == 180.0 or math.copysign(1.0, pashr.roll) == math.copysign(1.0, roll)
    assert pashr.true_heading == pytest.approx(200.0, abs=0.0051)
    assert pashr.timestamp.isoformat() == "22:13:20.123000+00:00"
    other = NMEAReader.parse(lines.pashr(a))
    assert float(other.pitch) == pashr.pitch and float(other.roll) == pashr.roll


@pytest.mark.parametrize(("angles", "axis", "sign"), [((0.0, 0.0, 10.0), 1, 1.0), ((0.0, 10.0, 0.0), 0, -1.0)])
def test_signs_are_those_of_ships(angles: Any, axis: int, sign: float) -> None:
    """A starboard side that points down is a positive roll, a bow that points up a positive pitch."""
    found = track(*angles)
    assert quat_rotate(found.q_nb[0], np.eye(3)[axis])[2] * sign > 0.1  # z of NED grows downwards
    a = one(found)
    assert (a.roll_deg, a.pitch_deg) == pytest.approx((angles[2], angles[1]))


def same_body(q_frd: Any) -> list[tuple[AttitudeTrack, BodyAxes]]:
    """The same physical attitude of a forward-right-down body in NED, in all frames and both axes."""
    found = []
    for frame in Frame:
        q = change_frame(q_frd, to=frame, from_=Frame.NED)
        for body in BodyAxes:
            turned = quat_multiply(q, HALF_TURN) if body is BodyAxes.FLU else q
            found.append((AttitudeTrack(t=[0.0], q_nb=turned[None], frame=frame, north=North.TRUE), body))
    return found


@examples(0.6)
@given(st.floats(0.0, 359.98), st.floats(-89.0, 89.0), st.floats(-179.0, 179.0))
def test_frames_and_axes_give_the_same_sentence(heading: float, pitch: float, roll: float) -> None:
    angles = units.deg(np.array([round(heading, 2) + 0.001, round(pitch, 2) + 0.001, round(roll, 2) + 0.001]))
    found = [one(t, body=body) for t, body in same_body(quat_from_euler_zyx(angles))]
    for make in (lines.hdt, lines.xdr, lines.pashr, lines.tss1):
        assert len({make(a) for a in found}) == 1, make


@pytest.mark.parametrize("frame", Frame)
def test_default_axes_go_with_the_frame(frame: Frame) -> None:
    q = quat_from_euler_zyx(units.deg(np.array([30.0, 4.0, -7.0])))
    turned = q if frame is Frame.NED else quat_multiply(q, HALF_TURN)
    q_nb = change_frame(turned, to=frame, from_=Frame.NED)[None]
    a = one(AttitudeTrack(t=[0.0], q_nb=q_nb, frame=frame, north=North.TRUE))
    assert (a.pitch_deg, a.roll_deg) == pytest.approx((4.0, -7.0))


def test_magnetic_and_true_headings() -> None:
    east = float(units.deg(3.5))
    magnetic = track(10.0, 0.0, 0.0, north=North.MAGNETIC)
    a = one(magnetic, declination=east)
    hdg = NMEAReader.parse(lines.hdg(a))
    assert (hdg.headingM, hdg.variation, hdg.variationEW, hdg.deviation) == (10.0, 3.5, "E", "")
    assert NMEAReader.parse(lines.hdt(a)).headingT == 13.5
    west = NMEAReader.parse(lines.hdg(one(track(10.0, 0.0, 0.0), declination=-float(units.deg(12.0)))))
    assert (west.headingM, west.variation, west.variationEW) == (22.0, 12.0, "W")
    assert fields(lines.hdt(one(magnetic))) == ["$HEHDT", "", "T"]
    assert fields(lines.pashr(one(magnetic)))[2:4] == ["", "T"]
    assert pynmea2.parse(lines.hdm(a).decode()).heading == 10


@pytest.mark.parametrize(("names", "north", "declination", "sent"), [
    ((), North.FREE, None, ("PASHR", "XDR", "ROT")),
    ((), North.TRUE, None, ("HDT", "PASHR", "XDR", "ROT")),
    ((), North.MAGNETIC, None, ("HDG", "PASHR", "XDR", "ROT")),
    (["HDT"], North.FREE, 0.1, (FrameError, "arbitrary zero")),
    (["HDT"], North.MAGNETIC, None, (FrameError, "declination")),
    (["GGA"], North.TRUE, None, (ParameterError, "known: HDT")),
])  # fmt: skip
def test_sentences_go_with_what_headings_count_from(names: Any, north: North, declination: Any, sent: Any) -> None:
    if isinstance(sent[0], str):
        assert lines.sentences_for(names, north, declination) == sent
        return
    with pytest.raises(sent[0], match=sent[1]):
        lines.sentences_for(names, north, declination)


def test_free_heading_and_unknown_attitude_are_no_numbers_and_negative_zero_is_zero() -> None:
    free = one(track(77.0, 0.0, 0.0, north=North.FREE), declination=0.1)
    lost = one(track(77.0, 0.0, 0.0, flags=np.array([flags.HEADING_FREE], dtype=np.uint32)), declination=0.1)
    sentences = [make(a) for a in (free, lost) for make in lines.SENTENCES.values()]
    assert sum(b"77.00" in sentence for sentence in sentences) == 0
    a = one(track(0.0, 0.0, 0.0, q_nb=np.full((1, 4), np.nan)))
    for name, make in lines.SENTENCES.items():
        assert (
            not any(c.isdigit() for c in make(a).decode().partition("*")[0].replace("221320.123", ""))
            or name == "PASHR"
        )
        assert b"nan" not in make(a).lower()
    assert fields(lines.pashr(a))[2:] == ["", "T", "", "", "", "", "", "", "0", "0"]
    assert lines.tss1(a) is None and lines.tss1(a, heave=0.0) is None
    told = json.loads(lines.json_line(a))
    assert told["roll_deg"] is None and told["q_nb"] is None and told["heading_deg"] is None
    a = one(track(-0.0, -0.001, -0.001))
    assert lines.xdr(a).startswith(b"$IIXDR,A,0.00,D,PITCH,A,0.00,D,ROLL*") and b"+0.00,+0.00" in lines.pashr(a)
    assert lines.tss1(a) == b":000000  0000u 0000  0000\r\n"


@pytest.mark.parametrize("flag", [flags.NOT_CONVERGED, flags.GAP, flags.TIME_FAULT, flags.GYR_HELD])
def test_what_is_not_reliable_says_so(flag: int) -> None:
    a = one(track(77.0, 5.0, 6.0, flags=np.array([flag], dtype=np.uint32)), declination=0.0)
    assert fields(lines.hdt(a)) == ["$HEHDT", "", "T"] and fields(lines.hdm(a)) == ["$HCHDM", "", "M"]
    assert fields(lines.xdr(a)) == ["$IIXDR", "A", "", "D", "PITCH", "A", "", "D", "ROLL"]
    assert fields(lines.pashr(a))[-2:] == ["0", "0"] and fields(lines.pashr(one(track(77.0, 5.0, 6.0))))[-2:] == [
        "1",
        "1",
    ]
    assert fields(lines.rot(a))[-1] == "V"
    assert lines.tss1(a) is None and lines.tss1(a, heave=0.5)[13:14] == b"h"  # type: ignore[index]
    told = json.loads(lines.json_line(a))
    assert told["flags"] == list(flags.names(flag)) and told["reliable"] is False


def test_standard_deviations_json_has_everything_and_tss1_no_line_beyond_its_range() -> None:
    sd = units.deg(np.array([0.5, 0.25, 2.0]))
    found = track(40.0, 0.0, 0.0, cov_b=np.diag(sd**2)[None])
    pashr: Any = pynmea2.parse(lines.pashr(one(found)).decode())
    assert (pashr.roll_accuracy, pashr.pitch_accuracy, pashr.heading_accuracy) == (0.5, 0.25, 2.0)
    assert json.loads(lines.json_line(one(found)))["sigma_deg"] == {"roll": 0.5, "pitch": 0.25, "heading": 2.0}
    told = json.loads(lines.json_line(one(track(359.9999999, 2.0, 3.0))))
    assert told["utc"] == "2023-11-14T22:13:20.123456789Z" and told["heading_deg"] == 0.0
    assert (told["roll_deg"], told["pitch_deg"], told["north"], told["reliable"]) == (3.0, 2.0, "true", True)
    assert json.loads(lines.json_line(one(track(0, 0, 0), utc=False)))["utc"] is None
    assert lines.tss1(one(track(0.0, 0.0, 120.0))) is None
    assert lines.tss1(one(track(0.0, 0.0, 99.99)))[14:19] == b" 9999"  # type: ignore[index]


def turning(rate_dps: float) -> AttitudeTrack:
    t = np.arange(5) * 0.1
    yaw = units.deg(rate_dps * t)
    return AttitudeTrack(
        t=t, q_nb=quat_from_euler_zyx(np.stack([yaw, 0 * yaw, 0 * yaw + 0.3], axis=1)), frame=Frame.NED,
        north=North.TRUE,
    )  # fmt: skip


def test_rate_of_turn_and_rates_of_the_gyroscope_without_its_bias() -> None:
    """6 °/s to starboard are 360 ° in a minute; the first attitude of a track alone has no rate."""
    first, *_, last = attitudes(turning(6.0), range(5), t0_ns=NOON, utc=True)
    rot = NMEAReader.parse(lines.rot(last))
    assert (rot.rot, rot.valid) == (360.0, "A")
    assert fields(lines.rot(first)) == ["$TIROT", "", "V"]
    port = [*attitudes(turning(-6.0), range(5), t0_ns=NOON, utc=True)][-1]
    assert NMEAReader.parse(lines.rot(port)).rot == -360.0
    found = AttitudeTrack(t=[0.0], q_nb=[[1, 0, 0, 0]], frame=Frame.NED, north=North.TRUE, bias_b=[[0.0, 0.0, 0.01]])
    imu = ImuData(t=[0.0], gyr=[[0.0, 0.0, 0.11]], acc=[[0.0, 0.0, -9.8]])
    a = one(found, imu=imu)
    assert a.turn_rate == pytest.approx(0.1)


@pytest.mark.parametrize(("north", "up", "heave", "line"), [
    # 3.83 and 0.0625 cm/s² a count: 1 m/s² to the north is 26 counts, 0.5 m/s² up 800
    (1.0, 0.5, None, b":1A0320  0000u-0125  0307\r\n"),
    (1.0, 0.5, -0.42, b":1A0320 -0042H-0125  0307\r\n"),
    (0.0, -0.5, 0.0, b":00FCE0  0000H-0125  0307\r\n"),
    (20.0, 25.0, 120.0, b":FF7FFF  9999H-0125  0307\r\n"),
    (20.0, -25.0, -120.0, b":FF8000 -9999H-0125  0307\r\n"),
])  # fmt: skip
def test_tss1_says_accelerations_heave_and_angles(north: float, up: float, heave: Any, line: bytes) -> None:
    found = track(0.0, 3.07, -1.25)
    force = quat_rotate(quat_conjugate(found.q_nb), np.array([[north, 0.0, -9.80665 - up]]))
    a = one(found, imu=ImuData(t=[0.0], gyr=[[0, 0, 0]], acc=force))
    assert lines.tss1(a, heave) == line


def mavlink_of(data: bytes) -> list[Any]:
    from pymavlink.dialects.v20 import common

    return common.MAVLink(None).parse_buffer(data) or []


def test_mavlink_is_read_by_pymavlink_withholds_what_is_not_reliable_and_has_true_yaws() -> None:
    coder = Mavlink()
    rows = list(attitudes(turning(10.0), range(5), t0_ns=NOON, utc=True))
    messages = [m for a in rows for m in mavlink_of(coder.encode(a) or b"")]
    assert [m.get_type() for m in messages[:3]] == ["HEARTBEAT", "ATTITUDE", "ATTITUDE_QUATERNION"]
    assert [m.get_seq() for m in messages] == list(range(len(messages)))
    attitude, quaternion = messages[-2:]
    assert (attitude.time_boot_ms, attitude.roll) == (400, pytest.approx(0.3, abs=1e-6))
    assert attitude.yaw == pytest.approx(float(units.deg(4.0)), abs=1e-6)
    q = np.array([quaternion.q1, quaternion.q2, quaternion.q3, quaternion.q4])
    assert q == pytest.approx(turning(10.0).q_nb[4], abs=1e-6)
    down = np.array([attitude.rollspeed, attitude.pitchspeed, attitude.yawspeed])
    assert down == pytest.approx(float(units.deg(10.0)) * np.array([0, math.sin(0.3), math.cos(0.3)]), abs=1e-6)
    words = np.array([flags.NOT_CONVERGED], dtype=np.uint32)
    messages = mavlink_of(Mavlink().encode(one(track(1.0, 2.0, 3.0, flags=words))) or b"")
    assert [m.get_type() for m in messages] == ["HEARTBEAT"] and messages[0].system_status == 2  # CALIBRATING
    magnetic = AttitudeTrack(t=turning(0.0).t, q_nb=turning(0.0).q_nb, frame=Frame.NED, north=North.MAGNETIC)
    a = [*attitudes(magnetic, range(5), t0_ns=0, utc=False, declination=0.25)][-1]
    _, attitude, quaternion = mavlink_of(Mavlink().encode(a) or b"")
    assert attitude.yaw == pytest.approx(0.25, abs=1e-6)
    q = quat_from_euler_zyx(np.array([0.25, 0.0, 0.3]))
    assert [quaternion.q1, quaternion.q2, quaternion.q3, quaternion.q4] == pytest.approx(q, abs=1e-6)


def test_ros2_is_read_by_rosbags(tmp_path: Any) -> None:
    from rosbags.highlevel import AnyReader

    words = np.array([0, 0, 0, 0, flags.NOT_CONVERGED], dtype=np.uint32)
    found = AttitudeTrack(
        t=turning(10.0).t, q_nb=turning(10.0).q_nb, frame=Frame.NED, north=North.TRUE, flags=words,
        cov_b=np.tile(np.diag([1e-4, 2e-4, 3e-4]), (5, 1, 1)),
    )  # fmt: skip
    coder, out = Imus(), BytesIO()
    imu = ImuData(t=found.t, gyr=np.tile([0.1, 0.2, 0.3], (5, 1)), acc=np.tile([1.0, 2.0, -9.8], (5, 1)))
    for a in attitudes(found, range(5), t0_ns=NOON, utc=True, imu=imu):
        out.write(coder.encode(a))
    out.write(coder.finish())
    path = tmp_path / "imu.mcap"
    path.write_bytes(out.getvalue())
    from rosbags.typesys import Stores, get_typestore

    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        messages = [reader.deserialize(raw, c.msgtype) for c, _, raw in reader.messages()]
    assert len(messages) == 5
    first: Any = messages[0]
    assert first.header.stamp.sec * 10**9 + first.header.stamp.nanosec == NOON and first.header.frame_id == "imu_link"
    # a level forward-left-up body that heads north has x along y of ENU, a quarter turn about up; then it is rolled
    q = quat_multiply(quat_from_euler_zyx(np.array([math.pi / 2, 0, 0])), quat_from_euler_zyx(np.array([0, 0, 0.3])))
    o = first.orientation
    assert abs(np.dot([o.w, o.x, o.y, o.z], q)) == pytest.approx(1.0, abs=1e-12)
    # about the axes of ENU: forward is north, and starboard and down are turned by the roll
    cov, s, c = first.orientation_covariance.reshape(3, 3), math.sin(0.3), math.cos(0.3)
    expected = [2e-4 * c * c + 3e-4 * s * s, 1e-4, 2e-4 * s * s + 3e-4 * c * c]
    assert np.diag(cov) == pytest.approx(expected)
    force = first.linear_acceleration
    assert (force.x, force.y, force.z) == (1.0, -2.0, 9.8)
    rate = first.angular_velocity
    assert (rate.x, rate.y, rate.z) == (0.1, -0.2, -0.3)
    last: Any = messages[-1]
    assert last.orientation_covariance[0] == -1.0 and last.orientation.w == 1.0


@examples(0.6)
@given(st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4).filter(lambda q: sum(x * x for x in q) > 0.01))
def test_any_attitude_is_read_back(q: list[float]) -> None:
    unit = np.array(q) / np.linalg.norm(q)
    a = one(AttitudeTrack(t=[0.0], q_nb=unit[None], frame=Frame.NED, north=North.TRUE))
    pashr: Any = pynmea2.parse(lines.pashr(a).decode(), check=True)
    back = quat_from_euler_zyx(units.deg(np.array([pashr.true_heading, pashr.pitch, pashr.roll])))
    assert abs(float(np.dot(back, unit))) > math.cos(float(units.deg(0.02)))
    assert 0.0 <= pashr.true_heading < 360.0
    assert NMEAReader.parse(lines.hdt(a)).headingT == pashr.true_heading
