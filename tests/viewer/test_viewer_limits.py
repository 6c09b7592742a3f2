"""What one client can do to the others, and to the server: bombs, floods, and who is slow to ask or to listen."""

import base64
import json
import os
import socket
import struct
import time
from contextlib import ExitStack
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from tests.helpers.feeding import Asking, Body, hello, parsed, raw_request, request, serving

BODY = Body(1000.0)
OPTIONS = {"control": True, "clients": 40}
HASTE = 1.0  # s, for which a server waits that is not given the 5 s of one in use


@pytest.fixture(scope="module")
def hasty(tmp_path_factory):
    with serving(**OPTIONS, folder=tmp_path_factory.mktemp("hasty"), patience=HASTE) as server:
        server.feed.say("hello", hello())
        yield server


def memory(served):
    pages = int(Path(f"/proc/{served.process.pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def opened(served, *, room=None):
    """WebSocket over a bare socket: no library reads ahead of the test."""
    line = socket.socket()
    if room is not None:
        line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, room)
    line.settimeout(20.0)
    line.connect(("127.0.0.1", served.port))
    key = base64.b64encode(b"0123456789abcdef").decode()
    line.sendall(
        f"GET /ws?token={served.token} HTTP/1.1\r\nHost: {served.host}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        f"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {key}\r\n"
        "Sec-WebSocket-Extensions: permessage-deflate; client_max_window_bits\r\n\r\n".encode()
    )
    head = b""
    while b"\r\n\r\n" not in head:
        head += line.recv(1)
    return line, head


def frames(line):
    """Opcodes and contents of the frames that come until the line ends."""

    def exactly(count):
        found = b""
        while len(found) < count:
            part = line.recv(count - len(found))
            if not part:
                raise EOFError
            found += part
        return found

    try:
        while True:
            first, size = exactly(2)
            if size == 126:
                (size,) = struct.unpack(">H", exactly(2))
            elif size == 127:
                (size,) = struct.unpack(">Q", exactly(8))
            yield first & 15, exactly(size)
    except (EOFError, ConnectionResetError):
        return


def is_served(served):
    """In time: a request that is not answered at all ends after 20 s."""
    assert request(served, path="/api/hello")[0] == 200


@pytest.mark.parametrize(("message", "code"), [
    ("x" * (65 << 10), 1009),
    (b"x" * (1 << 20), 1009),
    (("x" * 1000 for _ in range(100)), 1009),  # of many pieces
    (b"\x00", 1003),  # bytes are no command
], ids=["text", "bytes", "pieces", "no command"])  # fmt: skip
def test_a_message_over_64_kib_and_one_of_bytes_close_their_connection(served, message, code):
    with connect(served.socket_url()) as line, pytest.raises(ConnectionClosed) as why:
        line.send(message)
        while True:
            line.recv(timeout=20.0)
    assert why.value.rcvd.code == code
    is_served(served)


def test_a_compressed_bomb_is_a_fault_of_the_protocol_and_a_flood_of_commands_is_answered_in_part(served):
    line, head = opened(served)
    assert b"101 " in head and b"sec-websocket-extensions" not in head.lower()
    with line:
        line.sendall(b"\xc1\x84\0\0\0\0bomb")  # reserved bit 1: compressed
        codes = [struct.unpack(">H", content[:2])[0] for opcode, content in frames(line) if opcode == 8]
    assert codes == [1002]
    is_served(served)
    with connect(served.socket_url()) as line:
        asking = Asking(line)
        for _ in range(200):
            asking.send("mark", text="x")
        asking.until(lambda one: len(asking.texts("answer")) == 192)
        assert {one["text"] for one in asking.texts("answer")} == {"Too many commands wait for their answers."}
        is_served(served)


@pytest.mark.parametrize(
    "bomb", [b"X: " + b"a" * (32 << 10) + b"\r\n", b"".join(b"X-%d: a\r\n" % k for k in range(5000)), b"X" * (32 << 10)]
)
def test_headers_beyond_16_kib_are_refused(served, bomb):
    token = f"Authorization: Bearer {served.token}\r\nHost: {served.host}\r\n".encode()
    before = memory(served)
    for path in (b"/api/hello", b"/ws"):
        status, _, body = raw_request(served, b"GET " + path + b" HTTP/1.1\r\n" + token + bomb + b"\r\n")
        assert status in (0, 400, 431) and b"B-7" not in body
    assert memory(served) - before < 5.0
    is_served(served)


def test_a_body_without_end_is_cut(served):
    before = memory(served)
    for chunked in (False, True):
        size = "Transfer-Encoding: chunked" if chunked else "Content-Length: 1000000000"
        head = (
            f"POST /api/command HTTP/1.1\r\nHost: {served.host}\r\nAuthorization: Bearer {served.token}\r\n"
            f"Content-Type: application/json\r\n{size}\r\n\r\n"
        )
        piece = b" " * 4096
        sent, begin = 0, time.monotonic()
        with socket.create_connection(("127.0.0.1", served.port), timeout=20.0) as line:
            line.sendall(head.encode())
            try:
                while sent < 200 << 20 and time.monotonic() - begin < 20.0:
                    line.sendall(b"1000\r\n" + piece + b"\r\n" if chunked else piece)
                    sent += len(piece)
            except (ConnectionError, TimeoutError):
                pass
        assert sent < 200 << 20
    assert memory(served) - before < 5.0
    told = {"Content-Type": "application/json", "Origin": f"http://{served.host}"}
    status, _, body = request(served, "POST", "/api/command", headers=told, body=b" " * (65 << 10))
    assert status == 413 and "at most" in json.loads(body)["text"]
    is_served(served)


def test_who_drips_a_request_is_cut_in_time_and_others_are_served_meanwhile(hasty):
    served, begin = hasty, time.monotonic()
    head = f"GET / HTTP/1.1\r\nHost: {served.host}\r\n".encode()
    with ExitStack() as held:
        lines = [held.enter_context(socket.create_connection(("127.0.0.1", served.port))) for _ in range(100)]
        for k, line in enumerate(lines):
            line.sendall(head[: 10 + k % 20] if k % 2 else b"")
        cut = 0
        while time.monotonic() - begin < 7.0 + HASTE and cut < len(lines):
            is_served(served)
            cut = 0
            for line in lines:
                line.settimeout(0.001)
                try:
                    line.sendall(b"X")
                    cut += line.recv(1) == b""
                except TimeoutError:
                    pass
                except OSError:
                    cut += 1
            time.sleep(0.2)
        assert cut == len(lines)
        assert time.monotonic() - begin < 3.0 + HASTE


def test_clients_beyond_the_limit_are_refused_with_words(tmp_path):
    with serving(folder=tmp_path) as served, ExitStack() as held:
        served.feed.say("hello", hello())
        for _ in range(8):
            held.enter_context(connect(served.socket_url()))
        with connect(served.socket_url()) as line, pytest.raises(ConnectionClosed) as why:
            line.recv(timeout=20.0)
        assert why.value.rcvd.code == 1013
        assert why.value.rcvd.reason == "8 clients of your address are connected; raise it with --clients."
        held.close()
        deadline = time.monotonic() + 10.0
        while time.monotonic() < deadline:
            with connect(served.socket_url()) as line:
                try:
                    assert json.loads(line.recv(timeout=20.0))["type"] == "hello"
                    break
                except ConnectionClosed:
                    time.sleep(0.05)
        else:
            raise AssertionError("no place was given back")


class Feeding:
    """Feeds wide rows, and reads what a client gets that keeps up."""

    def __init__(self, served, line, body, count, size):
        self._served, self._line, self._body, self._count, self._size = served, line, body, count, size
        self.first, self.heard, self.ticks, self.late = 0, 0, [], []

    def step(self):
        """Feed a batch, and read a tick."""
        batch = self._body.batch(self.first, self._size)
        values = np.resize(batch.arrays["values"], (self._size, self._count))
        absent = np.full((self._size, 10), np.nan)  # without an Allan deviation, whose memory comes and goes
        self._served.feed.write(batch._replace(arrays={**batch.arrays, "values": values, "sensed": absent}))
        self.first += self._size
        while isinstance(message := self._line.recv(timeout=20.0), str) or not parsed(message).t.size:
            pass
        self.ticks.append(parsed(message))
        self.heard += len(message)
        if self.ticks[-1].kind == 1:
            self.late.append(time.time() - self.ticks[-1].state["sent"])
        time.sleep(0.005)


def test_clients_that_never_read_cost_little_are_dropped_and_told_while_others_miss_nothing(tmp_path):
    many = [{**hello()["columns"][0], "key": f"c.{k}"} for k in range(200)]
    with serving(folder=tmp_path, patience=HASTE) as served, ExitStack() as held:
        served.feed.say("hello", hello(rate=1000.0, columns=many))
        feeding = Feeding(served, held.enter_context(connect(served.socket_url(), max_size=None)), BODY, 200, 40)
        begin = time.monotonic()
        while time.monotonic() - begin < 1.0:
            feeding.step()
        before = most = memory(served)
        silent = [held.enter_context(opened(served, room=4096)[0]) for _ in range(7)]
        start, filled = feeding.heard, 0.0
        while time.monotonic() - begin < 120.0 and (filled == 0.0 or time.monotonic() - filled < 2.0):
            feeding.step()
            most = max(most, memory(served))
            if feeding.heard - start > 1 << 20:  # more than what waits for a client that does not read
                filled = filled or time.monotonic()
        heard = [list(frames(one)) for one in silent]
    for opcodes in heard:
        assert opcodes[-1][0] == 8
        code, reason = struct.unpack(">H", opcodes[-1][1][:2])[0], opcodes[-1][1][2:].decode()
        assert (code, reason) == (1013, "Too slow: nothing could be sent for 5 s. Connect again.")
        # It got what fits into its own buffer and the server's, a part of what the other one got.
        assert sum(len(content) for _, content in opcodes) < 1 << 20
    assert most - before < 7.0
    assert all(b.t[0] - a.t[-1] < 0.035 for a, b in pairwise(feeding.ticks))
    assert sorted(feeding.late)[len(feeding.late) // 2] < 0.1


def test_who_reads_slowly_gets_the_newest_and_is_not_dropped(tmp_path):
    many = [{**hello()["columns"][0], "key": f"c.{k}"} for k in range(400)]
    with serving(folder=tmp_path) as served:
        served.feed.say("hello", hello(rate=100.0, columns=many))
        with connect(served.socket_url(), max_size=None) as line:
            feeding = Feeding(served, line, Body(100.0), 400, 8)
            slow, _ = opened(served, room=32 << 10)
            found = frames(slow)
            last, begin = None, time.monotonic()
            with slow:
                while time.monotonic() - begin < 60.0:
                    now = time.monotonic()
                    while time.monotonic() - now < 0.08:  # of some 50 ticks a second, 12
                        feeding.step()
                    while not (tick := _next_tick(slow, found)).t.size:
                        pass
                    if last is not None and tick.t[0] - last > 0.1:
                        break
                    last = tick.t[-1]
                else:
                    raise AssertionError("it got every tick, however late")
                # What lay in the buffers is read on; then it is no farther behind than the buffers are long.
                for _ in range(25):
                    feeding.step()
                    tick = _next_tick(slow, found)
                assert time.time() - tick.state["sent"] < 5.0
        is_served(served)


def _next_tick(line, found):
    """Next tick or part of the history among frames; pings are answered."""
    for opcode, content in found:
        assert opcode in (1, 2, 9)
        if opcode == 9:
            line.sendall(bytes([0x8A, 0x80 | len(content), 0, 0, 0, 0]) + content)
        if opcode == 2:
            return parsed(content)
    raise AssertionError("it was dropped")


def test_who_asks_for_the_page_and_does_not_read_it_is_let_go(hasty):
    served, line = hasty, socket.socket()
    line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
    line.connect(("127.0.0.1", served.port))
    one = f"GET /api/state HTTP/1.1\r\nHost: {served.host}\r\nAuthorization: Bearer {served.token}\r\n\r\n".encode()
    line.settimeout(0.5)
    begin = time.monotonic()
    with line:
        while time.monotonic() - begin < 15.0:
            try:
                line.sendall(100 * one)
            except TimeoutError:
                continue
            except ConnectionError:
                break
        else:
            raise AssertionError("it was never cut")
    is_served(served)
