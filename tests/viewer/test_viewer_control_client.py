"""plumbob control: what it sends, and what it makes of what comes back."""

import json
import threading
from contextlib import contextmanager, nullcontext
from http.server import BaseHTTPRequestHandler, HTTPServer
from typing import get_args

import pytest

from plumbob.core.errors import DecodeError, LineError, ParameterError
from plumbob.viewer.commands import VERBS, control, verb_value
from plumbob.viewer.messages import Verb
from tests.helpers.commandline import call


@contextmanager
def answering(status, body, kept=None):
    """Server that answers every command so; gives its address."""

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self):
            size = int(self.headers["Content-Length"])
            if kept is not None:
                kept.append((self.path, dict(self.headers), json.loads(self.rfile.read(size))))
            self.send_response(status)
            if status == 302:
                self.send_header("Location", "http://127.0.0.1:1/")
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_):
            pass

    with HTTPServer(("127.0.0.1", 0), Handler) as server:
        threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
        try:
            yield f"http://127.0.0.1:{server.server_port}/?token=secret"
        finally:
            server.shutdown()


def answer(ok, text):
    return json.dumps({"type": "answer", "id": 1, "ok": ok, "text": text}).encode()


def test_a_command_is_posted_with_the_token_in_a_header_and_the_verb_prints_its_answer():
    kept = []
    with answering(200, answer(True, "marked: a"), kept) as url:
        assert control(url, "mark", "a") == "marked: a"
    ((path, headers, body),) = kept
    assert path == "/api/command"
    assert (headers["Authorization"], headers["Content-Type"]) == ("Bearer secret", "application/json")
    assert body == {"id": 1, "verb": "mark", "text": "a"}
    with answering(200, answer(True, "it is at 3.000 s")) as url:
        done = call("control", url, "seek", "3")
    assert (done.returncode, done.stdout) == (0, "it is at 3.000 s\n")
    with answering(200, answer(False, "no.")) as url:
        done = call("control", url, "seek", "3")
    assert (done.returncode, done.stderr) == (1, "plumbob control: the view refused: no.\n")


NO_TOKEN = [
    "", "http://127.0.0.1:8770/", "127.0.0.1:8770/?token=a", "file:///x?token=a", "http://127.0.0.1:http/?token=a",
    "http://127.0.0.1:99999/?token=a", "http://[::1/?token=a", "http://:8770/?token=a",
]  # fmt: skip


@pytest.mark.parametrize(("status", "body", "error", "says"), [
    (200, answer(False, "it is not so."), ParameterError, "the view refused: it is not so"),
    (400, answer(False, "a name is long."), ParameterError, "the view refused: a name"),
    (403, answer(False, "This view takes no commands."), ParameterError, "takes no commands"),
    (401, b"", LineError, "does not accept the token"),
    (500, b"oops", LineError, "status 500"),
    (302, b"", LineError, "status 302"),
    (200, b"<html>", DecodeError, "not a view"),
    (200, b"{}", DecodeError, "not a view"),
    (0, "http://127.0.0.1:1/?token=secret", LineError, "no view answers at"),
    *((0, url, ParameterError, "as plumbob view prints it") for url in NO_TOKEN),
])  # fmt: skip
def test_what_is_refused_is_an_error_in_words(status, body, error, says):
    there = nullcontext(body) if status == 0 else answering(status, body)
    with there as url, pytest.raises(error, match=says) as raised:
        control(url, "stop")
    assert "secret" not in str(raised.value)


def test_every_verb_has_its_argument():
    assert verb_value("record", "a") == {"name": "a"}
    assert verb_value("mark", "a b") == {"text": "a b"}
    assert verb_value("seek", "3.5") == {"value": 3.5}
    assert verb_value("stop", None) == {}
    assert verb_value("calibrate", "mag") == {"name": "mag"}
    assert set(VERBS) == set(get_args(Verb))
    for verb, argument in (("stop", "a"), ("seek", "x"), ("speed", "nan"), ("seek", "inf"), ("nothing", None)):
        with pytest.raises(ParameterError, match=r"takes no argument|needs a number, but got|has no command"):
            verb_value(verb, argument)
