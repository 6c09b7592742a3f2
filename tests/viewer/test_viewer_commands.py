"""What clients may ask for, and who answers: strict commands, and what is done by the view or by the session."""

import json
import time
from typing import get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from websockets.sync.client import connect

from plumbob.rotations import quat_from_rotvec, quat_multiply
from plumbob.viewer.commands import RefusedError, parse_command
from plumbob.viewer.messages import Command, Verb
from tests.helpers import beside, examples
from tests.helpers.commandline import table_of
from tests.helpers.feeding import Asking, Body, asked, hello, request

BODY = Body(100.0)
OPTIONS = {"control": True}
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=30),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=12,
)
ANY_COMMAND = st.fixed_dictionaries(
    {},
    optional={
        "id": JSON | st.integers(0, 9), "verb": JSON | st.sampled_from(get_args(Verb)), "name": JSON, "text": JSON,
        "value": JSON | st.floats(), "other": JSON,
    },
)  # fmt: skip


@given(ANY_COMMAND | JSON)
def test_what_is_not_a_command_is_refused_and_what_is_one_is_read_as_it_stands(content):
    text = json.dumps(content)
    try:
        command = parse_command(text)
    except RefusedError as why:
        assert str(why)
        return
    assert isinstance(command, Command) and command.verb in get_args(Verb)
    assert {name: value for name, value in content.items() if value is not None} == {
        name: value
        for name, value in (("id", command.id), ("verb", command.verb), ("name", command.name), ("text", command.text),
                            ("value", command.value))
        if name in content and value is not None
    }  # fmt: skip


@given(st.binary(max_size=200) | st.text(max_size=200))
@examples(0.5)
def test_bytes_of_any_kind_are_no_command(data):
    with pytest.raises(RefusedError):
        parse_command(data)


REFUSED = [
    *table_of(beside(__file__, "refused_commands.txt")),
    (json.dumps({"id": 1, "verb": "record", "name": "a" * 65}), "at most 64"),
    (json.dumps({"id": 1, "verb": "mark", "text": "a" * 201}), "at most 200"),
    ("[" * 100000, "not JSON"),
    ("1" * 5000, "not JSON"),
]


@pytest.mark.parametrize(("text", "why"), REFUSED)
def test_a_refusal_says_what_is_wrong(text, why):
    with pytest.raises(RefusedError, match=why):
        parse_command(text)


@examples(0.3)
@given(ANY_COMMAND)
def test_a_server_answers_every_command_that_is_none_and_goes_on(served, content):
    with connect(served.socket_url()) as line:
        try:
            parse_command(json.dumps(content))
        except RefusedError as why:
            line.send(json.dumps(content))
            found = Asking(line).answer(why.id)
            assert not found["ok"] and found["text"] == str(why)


def test_a_command_goes_to_the_session_and_its_answer_to_who_gave_it_alone(served):
    with connect(served.socket_url()) as one, connect(served.socket_url()) as other:
        first, second = Asking(one), Asking(other)
        numbers = first.send("mark", text="here"), second.send("record", name="run-1")
        asked = [served.feed.wait("command").content for _ in range(2)]
        told = {content["verb"]: content for content in asked}
        assert (told["mark"]["text"], told["record"]["name"]) == ("here", "run-1")
        assert told["mark"]["id"] == numbers[0] and told["record"]["id"] == numbers[1]
        for content in reversed(asked):
            told = {"ok": content["verb"] == "mark", "text": f"answer to {content['verb']}"}
            served.feed.say("answer", {"client": content["client"], "id": content["id"], **told})
        assert first.answer(numbers[0]) == {"type": "answer", "id": 1, "ok": True, "text": "answer to mark"}
        assert second.answer(numbers[1]) == {"type": "answer", "id": 1, "ok": False, "text": "answer to record"}
        event = second.text(lambda found: found["type"] == "event")
        assert (event["kind"], event["text"]) == ("command", "mark here: answer to mark")
        assert [len(client.texts("answer")) for client in (first, second)] == [1, 1]


def test_a_session_that_does_not_answer_is_not_waited_for_for_ever(tmp_path):
    begin = time.monotonic()
    with asked(commands=True, folder=tmp_path, patience=1.0) as (_, asking):
        found = asking.ask("stop")
    assert not found["ok"] and "not answered within 1 s" in found["text"]
    assert time.monotonic() - begin > 0.9


def test_programs_give_commands_by_post(served):
    told = {"Content-Type": "application/json"}
    status, _, body = request(served, "POST", "/api/command", headers=told, body=b'{"id": 7, "verb": "untare"}')
    assert status == 200
    assert json.loads(body)["ok"] and json.loads(body)["id"] == 7
    status, _, body = request(served, "POST", "/api/command", headers=told, body=b'{"id": 7, "verb": "untar"}')
    assert status == 400 and not json.loads(body)["ok"]
    assert request(served, "POST", "/api/command", headers={"Content-Type": "text/plain"}, body=b"{}")[0] == 415
    status, _, body = request(served, "POST", "/api/command", headers=told, body=b'{"id": 7, "verb": "calibrate-end"}')
    assert status == 409 and json.loads(body)["text"] == "Nothing is being calibrated."


def batch_at(k, q_nb):
    return BODY.batch(k, 1, attitudes={"mekf": {"q_nb": q_nb.tolist(), "sd": None}})


def test_after_a_tare_angles_turn_the_body_from_where_it_was(tmp_path):
    start = quat_from_rotvec(np.array([0.4, -0.7, 2.0]))
    with asked(commands=True, folder=tmp_path) as (served, asking):
        assert asking.ask("tare") == {"type": "answer", "id": 1, "ok": False,
                                      "text": "There is no attitude to count from yet. Wait for one."}  # fmt: skip
        served.feed.write(batch_at(0, start))
        assert not asking.state(lambda one: one["t"] == 0.0)["tared"] and asking.ask("tare")["ok"]
        for k, (axis, turned) in enumerate([("x", 30.0), ("y", -20.0), ("z", 150.0)], start=1):
            turn = np.zeros(3)
            turn["xyz".index(axis)] = np.radians(turned)
            served.feed.write(batch_at(k, quat_multiply(start, quat_from_rotvec(turn))))
            state = asking.state(lambda one, t=k / 100.0: one["t"] == t)
            own = state["attitudes"]["mekf"]
            expected = {"roll": 0.0, "pitch": 0.0, "yaw": 0.0} | {{"x": "roll", "y": "pitch", "z": "yaw"}[axis]: turned}
            assert state["tared"]
            assert {name: own[name] for name in expected} == pytest.approx(expected, abs=1e-9)
        assert asking.ask("untare")["ok"]
        served.feed.write(batch_at(4, start))
        state = asking.state(lambda one: one["t"] == 0.04)
        assert not state["tared"] and state["attitudes"]["mekf"]["yaw"] != pytest.approx(0.0, abs=1.0)


def test_without_control_no_command_is_taken_and_yaw_is_a_heading_from_0_to_360_in_ned_from_a_north(tmp_path):
    west = quat_from_rotvec(np.array([0.0, 0.0, -np.pi / 2.0]))
    with asked(folder=tmp_path, control=True) as (served, asking):
        told = {"Content-Type": "application/json"}
        assert request(served, "POST", "/api/command", headers=told, body=b'{"id": 1, "verb": "tare"}')[0] == 403
        refusal = asking.ask("record")
        assert not refusal["ok"] and "--control" in refusal["text"]
        assert asking.texts("hello")[0]["control"] is False
        for k, (frame, north, yaw) in enumerate(
            [("NED", "magnetic", 270.0), ("NED", "free", -90.0), ("ENU", "true", -90.0)]
        ):
            served.feed.say("hello", hello(frame=frame, north=north))
            served.feed.write(batch_at(k, west))
            state = asking.state(lambda one, t=k / 100.0: one["t"] == t)
            assert state["attitudes"]["mekf"]["yaw"] == pytest.approx(yaw, abs=1e-9)
            assert not state["tared"]
