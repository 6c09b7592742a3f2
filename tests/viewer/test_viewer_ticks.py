"""What clients get: numbers to the bit, envelopes that hide nothing, history, events, and the newest where they lag."""

import asyncio
import json
import signal
import time
from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from websockets.sync.client import connect

from plumbob.core.flags import GYR_CLIPPED
from plumbob.viewer.charts import RowHistory, Rows, Thinner, envelope
from plumbob.viewer.hub import Client, Hub, NewestItems
from plumbob.viewer.messages import Attitude, Hello, Link, State
from plumbob.viewer.pipe import PipeMessage
from tests.helpers import examples
from tests.helpers.feeding import COLUMNS, Asking, Body, asked, column, hello, parsed, request, serving

BODY = Body(100.0)


def fed(served, line, stop=0):
    """A client that has got rows up to one; never the newest row of a test before, which a server says at once."""
    asking = Asking(line)
    served.play(BODY, 0, stop)
    if stop:
        asking.state(lambda one: one["t"] == (stop - 1) / 100.0)
    return asking


def test_rows_are_the_samples_to_the_last_bit(tmp_path):
    with asked(folder=tmp_path) as (served, asking):
        assert asking.next()["type"] == "hello"
        served.play(BODY, 0, 300, size=7, wall=0.005)
        asking.state(lambda one: one["t"] == 2.99)
        t, flags, values = asking.rows()
        truth = BODY.rows(0, 300)
        np.testing.assert_array_equal(t, truth["t"])
        np.testing.assert_array_equal(flags, truth["flags"])
        np.testing.assert_array_equal(values, truth["values"].T.astype(np.float32))
        # no number is said for what is not finite
        served.feed.say("reset")
        batch = BODY.batch(0, 4)
        batch.arrays["values"][:, 3:6] = np.nan, np.inf, -np.inf
        served.feed.write(batch)
        assert asking.state(lambda one: one["t"] == 0.03)["values"][3:6] == [None] * 3


def test_hello_and_state_are_what_the_contract_says_and_come_without_samples_too(served):
    with connect(served.socket_url()) as line:
        asking = fed(served, line, 50)
        state = asking.ticks()[-1].state
        (told,) = asking.texts("hello")
    assert set(told) == {one.name for one in fields(Hello)}
    assert told["device"] == "B-7" and told["control"] is False
    assert json.loads(request(served, path="/api/hello")[2]) == told
    truth = BODY.rows(49, 1)
    assert set(state) == {one.name for one in fields(State)}
    assert set(state["link"]) == {one.name for one in fields(Link)}
    assert set(state["attitudes"]["mekf"]) == {one.name for one in fields(Attitude)}
    assert state["t"] == truth["t"][0]
    assert state["values"] == truth["values"][0].tolist()
    own = state["attitudes"]["mekf"]
    assert own["q_nb"] == BODY.attitude(np.array([49.0]))[0].tolist()
    # The feeder's angles come of the same formula over a larger array, whose last bits may differ.
    np.testing.assert_allclose([own["roll"], own["pitch"], own["yaw"]], truth["values"][0, :3], rtol=0, atol=1e-12)
    assert json.loads(request(served, path="/api/state")[2])["values"] == state["values"]
    with connect(served.socket_url()) as line:
        asking = fed(served, line, 10)
        first = asking.ticks()[-1]
        later = [asking.tick() for _ in range(4)]
    ages = [one.state["link"]["age"] for one in (first, *later)]
    assert ages == sorted(ages) and ages[-1] - ages[0] > 0.6
    assert len({one.state["link"]["latency"] for one in later}) == 1


def test_a_new_client_gets_the_last_minute_in_parts_and_then_goes_on(tmp_path):
    with serving(folder=tmp_path) as served:
        served.feed.say("hello", hello())
        served.play(BODY, 0, 9000, size=50)
        with connect(served.socket_url()) as first:
            Asking(first).state(lambda one: one["t"] == 89.99)
        with connect(served.socket_url(), max_size=None) as line:
            asking = Asking(line)
            asking.state()
            served.play(BODY, 9000, 9100)
            asking.state(lambda one: one["t"] == 90.99)
    assert len([one for one in asking.ticks() if one.kind == 2]) > 2
    t, _, values = asking.rows()
    np.testing.assert_array_equal(t, np.arange(3000 - 1, 9100)[1 - (t[0] < 30.0) :] / 100.0)
    np.testing.assert_array_equal(values, BODY.rows(round(100 * t[0]), len(t))["values"].T.astype(np.float32))


def test_rows_of_a_fast_stream_are_an_envelope_of_all_samples(tmp_path):
    fast = Body(1000.0)
    with asked(folder=tmp_path, rate=1000.0) as (served, asking):
        for first in range(0, 2000, 16):
            batch = fast.batch(first, 16)
            batch.arrays["flags"][3] = GYR_CLIPPED if first == 800 else 0
            served.feed.write(batch)
            time.sleep(0.004)
        asking.tick(lambda one: one.t.size > 0 and one.t[-1] == 1.999)
    t, flags, values = asking.rows()
    truth = fast.rows(0, 2000)
    assert t.size <= 2 * 121 and np.all(np.diff(t) > 0.0)
    grouped = np.floor(truth["t"] * 60.0)
    for group in np.unique(grouped)[:-1]:
        among = truth["values"][grouped == group].astype(np.float32)
        shown = values[:, np.floor(t * 60.0) == group]
        np.testing.assert_array_equal(shown.min(axis=1), among.min(axis=0))
        np.testing.assert_array_equal(shown.max(axis=1), among.max(axis=0))
        rises = among.argmax(axis=0) > among.argmin(axis=0)
        np.testing.assert_array_equal(shown[:, 1] >= shown[:, 0], rises | (shown[:, 1] == shown[:, 0]))
    assert np.flatnonzero(flags & GYR_CLIPPED).size == 2
    assert np.all(np.floor(t[(flags & GYR_CLIPPED) != 0] * 60.0) == np.floor(0.803 * 60.0))


@examples(0.5)
@given(st.lists(st.lists(st.sampled_from([np.nan, -1.0, 0.0, 2.0, 7.5]), min_size=2, max_size=2), max_size=12))
def test_an_envelope_has_each_columns_extremes_in_their_order(found):
    values = np.array(found).reshape(-1, 2)
    count = len(values)
    rows = Rows(np.arange(float(count)), np.arange(count, dtype=np.uint32), values)
    less = envelope(rows)
    if count <= 2:
        np.testing.assert_array_equal(less.values, values)
        return
    assert less.t.tolist() == [0.0, count - 1.0]
    assert less.flags.tolist() == [int(np.bitwise_or.reduce(rows.flags))] * 2
    for shown, every in zip(less.values.T, values.T, strict=True):
        known = every[np.isfinite(every)]
        if not known.size:
            assert np.isnan(shown).all()
            continue
        assert {shown.min(), shown.max()} == {known.min(), known.max()}
        low, high = np.flatnonzero(every == known.min())[0], np.flatnonzero(every == known.max())[0]
        assert shown[0] == (known.min() if low <= high else known.max())


@examples(0.3)
@given(st.lists(st.integers(1, 60), min_size=1, max_size=12))
def test_rows_do_not_depend_on_how_the_stream_was_cut(sizes):
    count = sum(sizes)
    values = np.sin(np.arange(count, dtype=np.float64))[:, np.newaxis] * np.arange(1.0, 4.0)
    whole = Rows(np.arange(count) / 1000.0, np.arange(count, dtype=np.uint32), values)
    one, many = Thinner(3), Thinner(3)
    expected = one.take(whole, rate=1000.0).joined(one.rest())
    found, at = Rows.none(3), 0
    for size in sizes:
        found = found.joined(many.take(whole.some(at, at + size), rate=1000.0))
        at += size
    found = found.joined(many.rest())
    for a, b in zip(found, expected, strict=True):
        np.testing.assert_array_equal(a, b)


def test_a_slow_stream_is_not_thinned_its_history_is_kept_where_columns_change_and_a_ring_keeps_the_newest():
    thinner = Thinner(1)
    rows = Rows(np.arange(10000) / 100.0, np.zeros(10000, dtype=np.uint32), np.zeros((10000, 1)))
    assert thinner.take(rows, rate=100.0) is rows and thinner.take(rows, rate=1000.0, speed=0.1) is rows
    assert len(Thinner(1).take(rows, rate=100.0, speed=10.0).t) <= 120 * 10.0 + 2
    history = RowHistory(["a", "b"])
    history.add(Rows(np.array([1.0, 2.0]), np.array([1, 2], dtype=np.uint32), np.array([[1.0, 10.0], [2.0, 20.0]])))
    found = parsed(history.with_columns(["b", "c"]).chunk(0, 3)[0])
    assert (found.kind, found.epoch, found.state) == (2, 3, {})
    assert found.t.tolist() == [1.0, 2.0] and found.flags.tolist() == [1, 2]
    assert found.values[0].tolist() == [10.0, 20.0] and np.isnan(found.values[1]).all()
    ring = NewestItems(3)
    for k in range(5):
        ring.add(k)
    assert (ring.first, ring.end, [ring[k] for k in range(2, 5)]) == (2, 5, [2, 3, 4])


def test_other_columns_are_followed_by_their_history_and_when_time_begins_again_it_is_empty(tmp_path):
    more = [*COLUMNS, column("vqf.roll", "attitude", "°")]
    with serving(folder=tmp_path) as served, connect(served.socket_url()) as line:
        served.feed.say("hello", hello())
        asking = fed(served, line, 100)
        assert asking.ticks()[-1].epoch == 0
        served.feed.say("hello", hello(north="magnetic"))
        asking.text(lambda one: one.get("north") == "magnetic")
        assert asking.tick().kind == 1
        served.feed.say("hello", hello(columns=more))
        asking.text(lambda one: len(one.get("columns", ())) == len(more))
        again = asking.next()
        assert again.kind == 2 and len(again.values) == len(more)
        np.testing.assert_array_equal(again.values[:-1], BODY.rows(0, 100)["values"].T.astype(np.float32))
        assert np.isnan(again.values[-1]).all()
        served.feed.say("hello", hello())
        served.feed.say("reset")
        served.play(BODY, 0, 10)
        first = asking.tick(lambda one: one.epoch == 1 and one.t.size)
        assert first.t[0] == 0.0 and first.state["epoch"] == 1
        with connect(served.socket_url()) as other:
            history = Asking(other).tick()
        assert history.kind == 2 and history.t[0] == 0.0 and history.t.size == 10


def test_a_slower_sensor_keeps_its_last_value_for_a_second_and_a_storm_of_events_is_cut(tmp_path):
    with asked(folder=tmp_path) as (served, asking):
        for first in range(0, 300, 10):
            batch = BODY.batch(first, 10)
            batch.arrays["values"][:, 9:12] = np.nan  # the magnetometer
            if first == 0:
                batch.arrays["values"][5, 9:12] = 1.0, 2.0, 3.0
            served.feed.write(batch)
            state = asking.state(lambda one, t=(first + 9) / 100.0: one["t"] == t)
            expected = [1.0, 2.0, 3.0] if first < 100 else [None] * 3
            assert state["values"][9:12] == expected, first
    with asked(folder=tmp_path) as (served, asking):
        for k in range(2000):
            served.feed.say("event", {"t": None, "kind": "gap", "text": f"gap {k}"})
        asking.text(lambda one: "left out here" in one.get("text", ""))
    events = asking.texts("event")
    assert events[0]["text"] == "gap 0" and len(events) < 300
    assert [one["id"] for one in events] == list(range(len(events)))


def test_events_queue_and_who_was_away_gets_what_was_missed(tmp_path):
    with serving(folder=tmp_path) as served:
        served.feed.say("hello", hello())
        with connect(served.socket_url()) as line:
            asking = Asking(line)
            for k in range(40):
                served.feed.say("event", {"t": 1.0 * k, "kind": "mark", "text": f"mark {k}"})
            asking.text(lambda one: one.get("id") == 39)
        events = [(one["id"], one["t"], one["text"]) for one in asking.texts("event")]
        assert events == [(k, 1.0 * k, f"mark {k}") for k in range(40)]
        for k in range(40, 60):
            served.feed.say("event", {"t": None, "kind": "mark", "text": f"mark {k}"})
        with connect(served.socket_url(since=39)) as line:
            asking = Asking(line)
            asking.text(lambda one: one.get("id") == 59)
        assert [one["id"] for one in asking.texts("event")] == list(range(40, 60))
        for since in (59, 10**9, "x", "-1", "٣"):
            with connect(served.socket_url(since=since)) as line:
                asking = Asking(line)
                asking.state()
            assert len(asking.texts("event")) == (0 if since == 59 else 60)


def test_who_lags_gets_the_newest_tick_and_every_event():
    def all_of(client):
        return list(iter(client.next, None))

    async def ticked(hub, k):
        """Take ten rows, and wait for their tick."""
        before = hub.ticks.end
        hub.take(BODY.batch(10 * k, 10))
        while hub.ticks.end == before:
            await asyncio.sleep(0.001)

    async def main():
        hub = Hub()
        hub.take(PipeMessage("hello", hello()))
        client = Client(hub)
        hub.clients.add(client)
        assert len(all_of(client)) == 2  # hello and history
        for k in range(40):
            await ticked(hub, k)
            hub.tell("mark", f"{k}")
        got = all_of(client)
        assert [json.loads(one)["text"] for one in got if isinstance(one, str)] == [str(k) for k in range(40)]
        assert [parsed(one).state["t"] for one in got if isinstance(one, bytes)] == [3.99]
        await ticked(hub, 40)
        await ticked(hub, 41)
        assert [parsed(client.next()).t[0] for _ in range(2)] == [4.0, 4.1]  # who is two behind misses none
        assert client.next() is None
        slow = BODY.rows(420, 10)["values"]  # a sensor that is slower: its newest number stays until it is a second old
        slow[7:, 6:9] = np.nan
        hub.take(PipeMessage("batch", BODY.fields(429), BODY.rows(420, 10) | {"values": slow}))
        np.testing.assert_array_equal(hub.state()["values"], np.r_[slow[9, :6], slow[6, 6:9], slow[9, 9:]])

    asyncio.run(main())


@pytest.mark.parametrize("how", ["SIGTERM", "SIGINT", "close", "end"])
def test_it_ends_within_two_seconds_with_clients_that_read_and_one_that_does_not(tmp_path, how):
    with serving(folder=tmp_path) as served:
        served.feed.say("hello", hello())
        with connect(served.socket_url()) as line, connect(served.socket_url()):
            fed(served, line, 100)
            begin = time.monotonic()
            if how == "close":
                served.feed.hang_up()
            elif how == "end":
                served.feed.say("end")
            else:
                served.process.send_signal(getattr(signal, how))
            assert served.process.wait(20.0) == 0
            assert time.monotonic() - begin < 2.0 + 3.0  # 3 s for a host that is busy
