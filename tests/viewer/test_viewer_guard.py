"""Who is let in: the address, the token, the host, the origin, and that no path of a client reaches the disk."""

import socket
from pathlib import Path

import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from tests.helpers.feeding import raw_request, request, serving

ROUTES = ("/", "/icon.svg", "/assets/index.js", "/api/hello", "/api/state", "/api/command", "/nothing", "/%2e%2e/etc")
KEY = (
    "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
    "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA=="
)


def upgrade(served, head, path="/ws"):
    """Status of a WebSocket handshake with these headers."""
    data = f"GET {path} HTTP/1.1\r\n{KEY}\r\n{head}\r\n\r\n".encode()
    with socket.create_connection(("127.0.0.1", served.port), timeout=20.0) as line:
        line.sendall(data)
        found = line.recv(4096).decode("latin-1")
    return int(found.split(" ")[1]) if found else 0


def listeners(pid):
    """Addresses at which a process listens, by what the system says of its sockets."""
    own = {str(path.readlink()) for path in Path(f"/proc/{pid}/fd").iterdir()}
    found = set()
    for name in ("tcp", "tcp6"):
        table = Path(f"/proc/{pid}/net/{name}").read_text()
        rows = [line.split() for line in table.splitlines()[1:]]
        found |= {row[1].split(":")[0] for row in rows if row[3] == "0A" and f"socket:[{row[9]}]" in own}
    return found


@pytest.mark.parametrize("route", ROUTES)
def test_every_route_asks_for_the_token(served, route):
    near = [served.token[:-1], served.token + "x", served.token.swapcase(), served.token[:-1] + "é", ""]
    for method in ("GET", "POST", "PUT", "HEAD", "OPTIONS"):
        assert request(served, method, route, token=None)[0] == 401
    for token in near:
        assert request(served, path=route, token=None, headers={"Authorization": f"Bearer {token}"})[0] == 401
    assert request(served, path=route, token=None, headers={"Authorization": f"Basic {served.token}"})[0] == 401
    assert request(served, path=f"{route}?token={served.token[:-1]}", token=None)[0] == 401
    assert request(served, path=f"{route}?token={served.token}&token=x", token=None)[0] == 401
    assert request(served, path=route, token=None, headers={"Cookie": f"plumbob-1={served.token}"})[0] == 401


@pytest.mark.parametrize("path", ["/ws", "/foxglove", "/nothing"])
def test_a_websocket_asks_for_the_token(served, path):
    own = f"Host: {served.host}\r\nOrigin: http://{served.host}"
    assert (upgrade(served, own, path), upgrade(served, own, f"{path}?token={served.token[:-1]}")) == (401, 401)
    assert upgrade(served, f"{own}\r\nCookie: plumbob-{served.port}={served.token[:-1]}", path) == 401


def test_the_link_gives_a_cookie_that_scripts_cannot_read_and_the_token_is_nowhere_else(served):
    status, headers, body = request(served, path=f"/?token={served.token}", token=None)
    assert (status, headers["location"], body) == (303, "/", b"")
    value, *flags = headers["set-cookie"].split("; ")
    assert value == f"plumbob-{served.port}={served.token}"
    assert set(flags) == {"Path=/", "HttpOnly", "SameSite=Strict"}
    # the page and websockets alone
    assert request(served, path=f"/api/state?token={served.token}", token=None)[0] == 401
    others = f'json={{"a": "b"}}; broken; plumbob-{served.port}=old; {value}'
    assert request(served, path="/api/hello", token=None, headers={"Cookie": others})[0] == 200
    for route in ROUTES:
        status, headers, body = request(served, path=route)
        assert served.token not in f"{status} {headers}" and served.token.encode() not in body
    with pytest.raises(InvalidStatus) as why, connect(f"ws://{served.host}/ws?token=wrong"):
        pass
    assert (why.value.response.status_code, b"Use the link" in why.value.response.body) == (401, True)


@pytest.mark.parametrize(
    "host",
    [
        "evil.example:{port}", "EVIL.example", "localhost.:{port}", "127.0.0.1.:{port}", "127.0.0.1:1", "127.0.0.1",
        "127.0.0.1.evil.example:{port}", "evil.example#127.0.0.1:{port}", "me@127.0.0.1:{port}", "[::2]:{port}",
        "[::1]:1", "0.0.0.0:{port}", "127.1:{port}", "127.0.0.1:{port}:{port}", "127.0.0.1:{port}, evil.example",
        "2130706433:{port}", "",
    ],
)  # fmt: skip
def test_a_request_that_names_another_host_is_refused(served, host):
    told = host.format(port=served.port)
    lines = f"Host: {told}\r\nAuthorization: Bearer {served.token}\r\nConnection: close"
    status, _, body = raw_request(served, f"GET /api/hello HTTP/1.1\r\n{lines}\r\n\r\n".encode())
    assert status in (400, 421) and b"B-7" not in body
    assert upgrade(served, f"Host: {told}", f"/ws?token={served.token}") in (400, 421)


def test_a_request_names_this_machine_once_by_each_of_its_names(served):
    token = f"Authorization: Bearer {served.token}\r\nConnection: close\r\n\r\n"
    two = f"Host: {served.host}\r\nHost: evil.example\r\n"
    for version, host in (("1.1", ""), ("1.0", ""), ("1.1", two)):
        assert raw_request(served, f"GET /api/hello HTTP/{version}\r\n{host}{token}".encode())[0] in (400, 421)
    for host in ("localhost", "LocalHost", "127.0.0.1", "[::1]"):
        assert request(served, path="/api/hello", host=f"{host}:{served.port}")[0] == 200


def foreign(served):
    own = f"http://{served.host}"
    return ["null", "http://evil.example", f"{own}.evil.example", f"{own}0", own[:-1], f"http://a.{served.host}",
            f"https://{served.host}", "http://127.0.0.1", "file://", f"{own}/", ""]  # fmt: skip


def test_pages_of_another_origin_are_refused_and_a_cookie_without_one_changes_nothing(served):
    cookie = f"Cookie: plumbob-{served.port}={served.token}"
    for origin in foreign(served):
        head = f"Host: {served.host}\r\n{cookie}\r\nOrigin: {origin}"
        assert upgrade(served, head) == 403, origin
        assert upgrade(served, f"Host: {served.host}\r\nOrigin: {origin}", f"/ws?token={served.token}") == 403, origin
        assert request(served, "POST", "/api/command", headers={"Origin": origin}, body=b"{}")[0] == 403
        assert request(served, path="/api/hello", headers={"Origin": origin})[0] == 403
    assert upgrade(served, f"Host: {served.host}\r\n{cookie}") == 403
    assert upgrade(served, f"Host: {served.host}\r\n{cookie}\r\nOrigin: http://{served.host}") == 101
    assert upgrade(served, f"Host: {served.host}", f"/ws?token={served.token}") == 101
    assert upgrade(served, f"Host: {served.host}\r\nAuthorization: Bearer {served.token}") == 101
    told = {"Cookie": f"plumbob-{served.port}={served.token}", "Content-Type": "application/json"}
    assert request(served, "POST", "/api/command", token=None, headers=told, body=b"{}")[0] == 403


@pytest.mark.parametrize("site", ["cross-site", "same-site", "nonsense"])
def test_what_a_browser_says_comes_from_elsewhere_is_refused(served, site):
    told = {"Sec-Fetch-Site": site, "Sec-Fetch-Mode": "no-cors", "Sec-Fetch-Dest": "image"}
    assert request(served, path="/icon.svg", headers=told)[0] == 403
    assert request(served, "POST", "/api/command", headers=told, body=b"{}")[0] == 403
    told = {"Sec-Fetch-Site": site, "Sec-Fetch-Mode": "navigate", "Sec-Fetch-Dest": "document"}
    assert request(served, path="/api/state", headers=told)[0] == 403
    assert request(served, path="/", headers=told)[0] in (200, 503)  # a link leads here; its page reads nothing of it
    assert request(served, path="/", headers=told | {"Sec-Fetch-Dest": "iframe"})[0] == 403


@pytest.mark.parametrize("route", ["/api/command", "/api/hello", "/", "/ws"])
def test_nothing_but_the_commands_takes_another_method_than_get(served, route):
    for method in ("PUT", "DELETE", "PATCH", "OPTIONS", "TRACE"):
        assert request(served, method, route)[0] == 405
    if route != "/api/command":
        assert request(served, "POST", route)[0] == 405
    else:
        assert request(served, "GET", route)[0] == 405


PATHS = [
    "/assets/../index.html", "/assets/../../serve.py", "/../../../../etc/passwd", "/assets/%2e%2e/%2e%2e/serve.py",
    "/assets/..%2f..%2fserve.py", "/assets/..%5c..%5cserve.py", "/assets/%00", "/assets/index.html%00.js",
    "/assets//etc/passwd", "/proc/self/environ", "/assets/link", "/view/index.html", "/assetsx/a", "/index.html",
    "/assets/", "/assets", "//etc/passwd", "/.git/config", "/api/hello/",
    "/api", "/api/", "/ws", "/foxglove", "/docs", "/openapi.json", "/file:///etc/passwd",
]  # fmt: skip


@pytest.mark.parametrize("path", PATHS)
def test_no_path_leads_to_a_file_that_is_not_in_the_table(served, path):
    status, _, body = request(served, path=path)
    assert status in (400, 404)
    assert b"root:" not in body and b"import" not in body and served.token.encode() not in body


def test_a_link_in_the_folder_of_the_page_is_not_served(tmp_path, monkeypatch):
    from plumbob.viewer import serve

    folder = tmp_path / "view"
    (folder / "assets").mkdir(parents=True)
    (folder / "index.html").write_text("page")
    (folder / "assets" / "a.js").write_text("script")
    (tmp_path / "secret").write_text("secret")
    (folder / "assets" / "link.js").symlink_to(tmp_path / "secret")
    (tmp_path / "viewers").mkdir()
    (tmp_path / "viewers" / "b.js").write_text("beside")
    monkeypatch.setattr(serve, "asset", lambda name: tmp_path / name)
    assert serve.files() == {
        "/": (b"page", "text/html; charset=utf-8"),
        "/assets/a.js": (b"script", "text/javascript; charset=utf-8"),
    }


def test_every_answer_forbids_what_a_page_must_not_do(served):
    for status, headers, _ in (request(served), request(served, token=None), request(served, path="/x", host="evil")):
        assert status in (200, 401, 421, 503)
        policy = headers["content-security-policy"]
        assert "default-src 'self'" in policy and "frame-ancestors 'none'" in policy and "unsafe" not in policy
        assert (headers["x-content-type-options"], headers["referrer-policy"]) == ("nosniff", "no-referrer")
        assert headers["cache-control"] == "no-store"
        assert "server" not in headers
    assert f"connect-src 'self' ws://{served.host};" in request(served)[1]["content-security-policy"]
    assert "script-src" not in request(served, host="x; script-src *")[1]["content-security-policy"]


def test_an_origin_that_was_named_may_open_a_websocket_with_the_token_in_its_address_and_do_no_more(tmp_path):
    with serving(allow_origin=["https://app.foxglove.dev"], folder=tmp_path) as served:
        head = f"Host: {served.host}\r\nOrigin: https://app.foxglove.dev\r\nSec-Fetch-Site: cross-site"
        assert upgrade(served, head, f"/ws?token={served.token}") == 101
        assert upgrade(served, f"{head}\r\nCookie: plumbob-{served.port}={served.token}") == 403
        told = {"Origin": "https://app.foxglove.dev"}
        assert request(served, path="/api/hello", headers=told)[0] == 403
        assert request(served, "POST", "/api/command", headers=told, body=b"{}")[0] == 403


@pytest.mark.parametrize(("how", "says"), [
    ({"token": "short"}, "PLUMBOB_VIEW_TOKEN must hold a token"),
    ({"token": "with spaces in it, but long enough"}, "PLUMBOB_VIEW_TOKEN must hold a token"),
    # 192.0.2.1 is of TEST-NET-1 (RFC 5737), which no machine has.
    ({"host": "192.0.2.1"}, "cannot listen at 192.0.2.1"),
])  # fmt: skip
def test_a_short_token_and_an_address_of_another_machine_are_refused_at_the_start(tmp_path, how, says):
    with pytest.raises(AssertionError), serving(folder=tmp_path, **how):
        pass
    assert says in (tmp_path / "server.log").read_text()


def test_it_listens_at_this_machines_own_addresses_alone_unless_every_address_is_asked_for(tmp_path, served):
    # 127.0.0.1 and ::1 as the kernel prints them, in the order of this machine's bytes.
    own = listeners(served.process.pid)
    assert own <= {"0100007F", "00000000000000000000000001000000"} and "0100007F" in own
    with serving(folder=tmp_path, host="0.0.0.0") as every:
        assert (listeners(every.process.pid), request(every, path="/api/hello")[0]) == ({"00000000"}, 200)
        assert request(every, path="/api/hello", host=f"{socket.gethostname()}:{every.port}")[0] == 200
        assert request(every, path="/api/hello", host=f"evil.example:{every.port}")[0] == 421
