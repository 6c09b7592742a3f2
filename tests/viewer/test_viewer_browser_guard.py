"""The built page in a real browser: what the guard asks for, a browser gives, and the policy lets the page run."""

import json

from tests.helpers.feeding import Body, hello, request, serving

LISTEN = """async () => {
    const line = new WebSocket(location.origin.replace("http", "ws") + "/ws");
    line.binaryType = "arraybuffer";
    const seen = [];
    await new Promise((done, fail) => {
        line.onmessage = (event) => { seen.push(event.data); if (seen.length === 3) done(); };
        line.onclose = (event) => fail(new Error(`closed ${event.code}`));
    });
    line.close();
    return [seen[0], seen[1].byteLength, seen[2].byteLength];
}"""


def test_a_browser_comes_in_by_the_link_and_the_page_runs_under_its_policy(chromium, tmp_path):
    with serving("--control", folder=tmp_path) as served:
        served.feed.say("hello", hello())
        served.play(Body(), 0, 100)
        page = chromium.new_context().new_page()
        faults = []
        page.on("console", lambda line: faults.append(line.text) if line.type == "error" else None)
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.goto(f"http://{served.host}/?token={served.token}")
        assert page.url == f"http://{served.host}/"
        page.wait_for_function("document.querySelector('#page').childNodes.length > 0")
        greeting, *sizes = page.evaluate(LISTEN)
        assert json.loads(greeting)["device"] == "B-7" and min(sizes) >= 24
        assert page.evaluate("document.cookie") == ""
        command = """async () => (await fetch("/api/command", {method: "POST", body: '{"id": 4, "verb": "untare"}',
            headers: {"Content-Type": "application/json"}})).json()"""
        assert page.evaluate(command)["ok"]
        assert faults == []


def test_a_page_of_another_port_of_this_machine_gets_nothing(chromium, tmp_path):
    (tmp_path / "one").mkdir()
    (tmp_path / "other").mkdir()
    with serving(folder=tmp_path / "one") as served, serving("--control", folder=tmp_path / "other") as other:
        other.feed.say("hello", hello())
        other.play(Body(), 0, 100)
        context = chromium.new_context()
        page = context.new_page()
        page.goto(f"http://{other.host}/?token={other.token}")  # the browser has the cookie of the other one
        page.goto(f"http://{served.host}/?token={served.token}")
        page.set_content("<p></p>")
        tried = """async (host) => {
            const line = new WebSocket(`ws://${host}/ws`);
            return new Promise((done) => {
                line.onopen = () => done("open");
                line.onerror = () => done("refused");
            });
        }"""
        # Under a policy that lets it try: that of this server's own page would not.
        free = context.new_page()
        free.goto("about:blank")
        for one in (page, free):
            assert one.evaluate(tried, other.host) == "refused"
        post = """async (host) => {
            try {
                return (await fetch(`http://${host}/api/command`, {method: "POST", mode: "no-cors",
                    credentials: "include", body: '{"id": 1, "verb": "tare"}'})).type;
            } catch { return "refused"; }
        }"""
        free.evaluate(post, other.host)
        state = json.loads(request(other, path="/api/state")[2])
        assert state["t"] == 0.99 and state["tared"] is False
