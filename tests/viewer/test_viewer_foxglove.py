"""The Foxglove WebSocket protocol, parsed by what its specification says: docs/spec.md of foxglove/ws-protocol."""

import json
import struct

import numpy as np
import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from plumbob.live.rows import row_schema
from plumbob.rotations import quat_from_xyzw, quat_rotate
from plumbob.viewer import foxglove
from tests.helpers.feeding import COLUMNS, Body, column, hello, serving

BODY = Body(100.0)


class Studio:
    def __init__(self, served, protocols=("foxglove.websocket.v1",)):
        self._connecting = connect(served.socket_url("/foxglove"), subprotocols=protocols, max_size=None)

    def __enter__(self):
        self.line = self._connecting.__enter__()
        self.info, self.advertised = self.text(), self.text()
        self.channels = {one["topic"]: one for one in self.advertised["channels"]}
        return self

    def __exit__(self, *why):
        self._connecting.__exit__(*why)

    def text(self):
        message = self.line.recv(timeout=20.0)
        assert isinstance(message, str)
        return json.loads(message)

    def say(self, **content):
        self.line.send(json.dumps(content))

    def subscribe(self, number, topic):
        self.say(op="subscribe", subscriptions=[{"id": number, "channelId": self.channels[topic]["id"]}])
        # There is no answer to a subscription; the one to a wrong message shows that the right one was read.
        self.say(op="nonsense")
        while self.text()["op"] != "status":
            pass

    def data(self, count):
        """Messages: subscription, time stamp, content."""
        found = []
        while len(found) < count:
            message = self.line.recv(timeout=20.0)
            if isinstance(message, bytes):
                opcode, number, stamp = struct.unpack_from("<BIQ", message)
                assert opcode == 1
                found.append((number, stamp, json.loads(message[13:])))
        return found


def test_the_greeting_is_that_of_the_protocol_whose_first_known_name_is_agreed_on(served):
    with Studio(served) as studio:
        assert studio.line.subprotocol == "foxglove.websocket.v1"
        assert studio.info["op"] == "serverInfo" and studio.info["capabilities"] == []
        assert studio.info["name"].startswith("Plumbob ") and studio.info["sessionId"]
        assert studio.advertised["op"] == "advertise"
        assert set(studio.channels) == {"/imu", "/attitude", "/tf", "/events", "/angles"}
        for one in studio.channels.values():
            assert set(one) == {"id", "topic", "encoding", "schemaName", "schema", "schemaEncoding"}
            assert (one["encoding"], one["schemaEncoding"]) == ("json", "jsonschema")
            assert json.loads(one["schema"])["type"] == "object"
        assert studio.channels["/tf"]["schemaName"] == "foxglove.FrameTransform"
        assert studio.channels["/events"]["schemaName"] == "foxglove.Log"
        assert studio.channels["/imu"]["schema"] == row_schema("imu")[1].data.decode()
        assert studio.channels["/attitude"]["schema"] == row_schema("attitude")[1].data.decode()
    for protocols in (["foxglove.sdk.v1"], ["other", "foxglove.sdk.v1", "foxglove.websocket.v1"]):
        with Studio(served, protocols) as studio:
            assert studio.line.subprotocol == "foxglove.sdk.v1"
    for protocols in (None, ["rosbridge"]):
        with pytest.raises(InvalidStatus) as why, connect(served.socket_url("/foxglove"), subprotocols=protocols):
            pass
        assert why.value.response.status_code == 400
        assert b"foxglove.websocket.v1" in why.value.response.body


def test_every_sample_comes_at_its_full_rate_with_every_number_exact_and_events_are_log_messages(served):
    with Studio(served) as studio:
        studio.subscribe(70, "/imu")
        served.play(BODY, 0, 200, size=7)
        found = studio.data(200)
    truth = BODY.rows(0, 200)
    assert {number for number, _, _ in found} == {70}
    # UTC: time 0 is at `started_utc`, 1.7e9 s, and rows are 10 ms apart.
    assert [stamp for _, stamp, _ in found] == [1_700_000_000_000_000_000 + 10_000_000 * k for k in range(200)]
    for k, (_, _, row) in enumerate(found):
        assert set(row) == {"t_ns", "gyr", "acc", "mag", "temp_c", "flags"}
        assert [*row["gyr"], *row["acc"], *row["mag"], row["temp_c"]] == truth["sensed"][k].tolist()
    stamps = np.diff([row["t_ns"] for _, _, row in found[:7]])
    assert np.all(stamps == 10_000_000)
    with Studio(served) as studio:
        studio.subscribe(9, "/events")
        served.feed.say("event", {"t": 3.0, "kind": "gap", "text": "12 samples are missing"})
        ((number, stamp, row),) = studio.data(1)
    assert (number, stamp) == (9, 1_700_000_003_000_000_000)  # time 0 is at `started_utc`
    assert row["timestamp"] == {"sec": 1_700_000_003, "nsec": 0}
    assert (row["level"], row["name"], row["message"]) == (3, "gap", "12 samples are missing")  # 3: a warning


def test_attitudes_and_angles_are_those_of_the_sessions_own_estimator_until_who_asked_unsubscribes(served):
    with Studio(served) as studio:
        studio.subscribe(1, "/attitude")
        studio.subscribe(2, "/angles")
        served.play(BODY, 300, 310)
        found = studio.data(20)
    attitudes = [row for number, _, row in found if number == 1]
    angles = [row for number, _, row in found if number == 2]
    truth = BODY.attitude(np.arange(300.0, 310.0))
    for row, q in zip(attitudes, truth, strict=True):
        assert np.abs(np.dot(row["q_nb"], q)) == pytest.approx(1.0, abs=1e-14)  # of its sign nothing hangs
        assert row["bias_b"] is None
    values = BODY.rows(300, 10)["values"]
    assert [[row["roll"], row["pitch"], row["yaw"]] for row in angles] == values[:, :3].tolist()
    with Studio(served) as studio:
        studio.subscribe(3, "/imu")
        served.play(BODY, 400, 410)
        studio.data(10)
        studio.say(op="unsubscribe", subscriptionIds=[3, 4])
        studio.say(op="nonsense")
        assert studio.text()["op"] == "status"
        served.play(BODY, 410, 420)
        studio.subscribe(4, "/angles")
        served.play(BODY, 420, 421)
        ((number, _, _),) = studio.data(1)
        assert number == 4


def test_a_transform_turns_a_vector_of_the_body_into_the_navigation_frame(tmp_path):
    more = [*COLUMNS, *(column(f"vqf.{name}", "attitude", "°") for name in ("roll", "pitch", "yaw"))]
    estimators = [*hello()["estimators"], {"name": "vqf", "title": "VQF", "primary": False, "claims": False}]
    with serving(folder=tmp_path) as served, Studio(served) as studio:
        served.feed.say("hello", hello(columns=more, estimators=estimators))
        studio.subscribe(5, "/tf")
        batch = BODY.batch(0, 3)
        values = np.column_stack((batch.arrays["values"], np.tile([0.0, 0.0, 90.0], (3, 1))))
        served.feed.write(batch._replace(arrays={**batch.arrays, "values": values}))
        found = [row for _, _, row in studio.data(6)]
        served.feed.say("hello", hello(frame="NED"))
        served.play(BODY, 3, 4)
        ned = {row["child_frame_id"]: row for _, _, row in studio.data(2)}
    assert {(row["parent_frame_id"], row["child_frame_id"]) for row in found} == {
        ("navigation (ENU)", "body"), ("navigation (ENU)", "body (vqf)"),
    }  # fmt: skip
    ahead = np.array([1.0, 0.0, 0.0])
    for row in found:
        q = quat_from_xyzw([row["rotation"][name] for name in "xyzw"])
        assert row["translation"] == {"x": 0.0, "y": 0.0, "z": 0.0}
        k = round((row["timestamp"]["sec"] + 1e-9 * row["timestamp"]["nsec"] - 1.7e9) * 100.0)
        if row["child_frame_id"] == "body":
            np.testing.assert_allclose(
                quat_rotate(q, ahead), quat_rotate(BODY.attitude(np.array([k]))[0], ahead), atol=1e-12
            )
        else:  # 90° about up: ahead is then along y, which is North in ENU
            np.testing.assert_allclose(quat_rotate(q, ahead), [0.0, 1.0, 0.0], atol=1e-12)
    row = ned["navigation (NED)"]  # where viewers draw down
    q = quat_from_xyzw([row["rotation"][name] for name in "xyzw"])
    assert row["parent_frame_id"] == "world (ENU)"
    np.testing.assert_allclose(quat_rotate(q, [0.0, 0.0, 1.0]), [0.0, 0.0, -1.0], atol=1e-15)  # down
    np.testing.assert_allclose(quat_rotate(q, ahead), [0.0, 1.0, 0.0], atol=1e-15)  # North
    assert ned["body"]["parent_frame_id"] == "navigation (NED)"


@pytest.mark.parametrize(
    "message",
    [
        '{"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 99}]}',
        '{"op": "subscribe", "subscriptions": [{"id": -1, "channelId": 1}]}',
        '{"op": "subscribe", "subscriptions": [{"id": 1, "channelId": true}]}',
        '{"op": "subscribe", "subscriptions": [{"id": [1], "channelId": 1}]}',
        '{"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 1}, {"id": 2, "channelId": 1}]}',
        '{"op": "subscribe"}', '{"op": "unsubscribe", "subscriptionIds": [[]]}', '{"op": "getParameters"}',
        '{"op": "advertise", "channels": []}', "[]", "1", "not JSON", "[" * 50000, b"\x01\0\0\0\0{}", b"",
    ],
)  # fmt: skip
def test_what_it_does_not_do_is_said_in_a_status(served, message):
    with Studio(served) as studio:
        studio.line.send(message)
        found = studio.text()
        assert found["op"] == "status" and found["level"] in (1, 2) and found["message"]


def test_who_is_too_slow_loses_the_oldest_and_is_told():
    viewer = foxglove.Viewer()
    viewer.take('{"op": "subscribe", "subscriptions": [{"id": 8, "channelId": 1}]}')
    viewer.put(1, [(k, str(k).encode()) for k in range(foxglove.QUEUE + 100)])
    assert json.loads(viewer.next()) == {"op": "status", "level": 1,
                                         "message": "You are too slow: 100 messages left out."}  # fmt: skip
    got = []
    while (message := viewer.next()) is not None:
        got.append(int(message[13:]))
    assert got == list(range(100, foxglove.QUEUE + 100))
