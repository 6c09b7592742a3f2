"""The live page in a real browser on real servers: what it shows, and what its buttons do."""

import contextlib
import json
import os
import re
import signal
import subprocess
import time
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest

import plumbob
from plumbob.core.units import to_deg
from plumbob.data.cards import CalibrationCard
from plumbob.rotations import euler_zyx_from_quat
from tests.helpers import PATIENCE, beside, until
from tests.helpers.browser import viewed
from tests.helpers.commandline import PLUMBOB, ok
from tests.helpers.feeding import Body, hello, request, serving

AXE = Path(__file__).parents[2] / "web" / "node_modules" / "axe-core" / "axe.min.js"
WIDE = {"width": 1440, "height": 900}
TALL = {"width": 1440, "height": 4200}  # all panels are in sight; those that are not draw nothing


@contextlib.contextmanager
def opened(chromium, view, *, query="", **options):
    """The page of a view, with what it asked for and complained of."""
    context = chromium.new_context(**{"viewport": WIDE, **options})
    context.set_default_timeout(1000.0 * PATIENCE)
    page = context.new_page()
    page.asked, page.wrong = [], []
    page.on("request", lambda request: page.asked.append(request.url))
    page.on("websocket", lambda socket: page.asked.append(socket.url))
    page.on("pageerror", lambda error: page.wrong.append(str(error)))
    page.on("console", lambda said: page.wrong.append(said.text) if said.type == "error" else None)
    page.goto(view.url)
    if query:
        page.goto(urlsplit(view.url)._replace(query=query).geturl())
    page.wait_for_selector('html[data-connection="connected"]')
    try:
        yield page
    finally:
        context.close()


def unfolded(page):
    for folder in page.query_selector_all('.fold[aria-expanded="false"]'):
        folder.click()


def number(text):
    return float(re.sub(r"[^\d.]", "", text.replace("−", "")) or "nan") * (-1 if "−" in text else 1)


def shown(page, selector):
    return page.text_content(selector) or ""


@pytest.fixture(scope="module")
def buoy(tmp_path_factory):
    """The emulated buoy, with further estimators beside its own."""
    folder = tmp_path_factory.mktemp("view")
    with viewed("--emulate", "buoy", "--also", "mahony,vqf", folder=folder) as view:
        view.folder = folder
        yield view


@pytest.fixture(scope="module")
def sea(tmp_path_factory):
    """A recording of 40 s of the buoy's line, estimated as it came."""
    folder = tmp_path_factory.mktemp("sea")
    ok("emulate", "buoy", "--seed", "3", "--duration", "40s", "--write", folder / "sea.bin")
    ok("record", "--from", folder / "sea.bin", "--format", "buoy", "--filter", "mekf", "--frame", "NED",
       "--out", folder / "sea.mcap")  # fmt: skip
    return folder / "sea.mcap"


def test_every_panel_moves_and_nothing_but_this_machine_is_asked(chromium, buoy):
    with opened(chromium, buoy, viewport=TALL) as page:
        unfolded(page)
        page.wait_for_selector(".panel-scene canvas", state="visible")
        drawn = ("attitude", "instruments", "scene", "charts", "link", "channels", "allan", "terminal")
        until(
            lambda: page.evaluate(
                "document.querySelectorAll('.panel-terminal .body').item(0).textContent.length > 200"
            ),
            "it does not show",
        )

        def looks():
            return {name: page.locator(f".panel-{name} .body").screenshot() for name in drawn}

        before = looks()
        waiting = set(drawn)
        end = time.monotonic() + PATIENCE
        while waiting and time.monotonic() < end:
            now = {name: page.locator(f".panel-{name} .body").screenshot() for name in waiting}
            waiting = {name for name in waiting if now[name] == before[name]}
        assert not waiting
        hosts = {urlsplit(url).hostname for url in page.asked if not url.startswith(("data:", "blob:"))}
        assert hosts == {"127.0.0.1"}
        assert page.wrong == []


def printed(value, digits):
    return "–" if value is None else f"{round(value, digits) + 0.0:.{digits}f}".replace("-", "−")


def sought(view, goal):
    """State of the server when a recording that stands still has gone to a time."""
    ok("control", view.url, "seek", goal)

    def there():
        state = view.get("/api/state")
        return state if state["t"] is not None and abs(state["t"] - goal) < 0.011 else None

    return until(there, "it did not get there")


def test_numbers_are_those_of_the_server_to_the_printed_digit(chromium, sea, tmp_path):
    """A recording that stands still: the page, the server's state and the recording's own attitude say the same."""
    track = plumbob.replay(sea).track
    with viewed(sea, folder=tmp_path) as view, opened(chromium, view) as page:
        hello = view.get("/api/hello")
        digits = {column["key"]: column["digits"] for column in hello["columns"]}
        ok("control", view.url, "pause")
        for goal in (12.34, 33.0, 5.55):
            state = sought(view, goal)
            k = int(np.searchsorted(track.t, goal + 1e-9, side="right")) - 1
            assert state["t"] == pytest.approx(track.t[k], abs=1e-9)
            yaw, pitch, roll = to_deg(euler_zyx_from_quat(track.q_nb[k]))
            own = state["attitudes"]["mekf"]
            assert [own["roll"], own["pitch"]] == pytest.approx([roll, pitch], abs=1e-9)
            assert (own["yaw"] - yaw + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=1e-9)
            angles = [printed(own[name], digits[f"mekf.{name}"]) for name in ("roll", "pitch", "yaw")]
            values = [
                printed(value, column["digits"])
                for column, value in zip(hello["columns"], state["values"], strict=True)
                if column["chart"] not in ("attitude", "error")
            ]
            raw = [printed(value, c["digits"]) for c, value in zip(hello["raw"], state["raw"], strict=True)]
            wanted = [angles, sorted(values), sorted(raw)]
            count = len(values)

            def on_the_page(count=count):
                big = page.locator(".panel-attitude .big .value").all_text_contents()
                cells = page.locator(".panel-channels .value").all_text_contents()
                return [big, sorted(cells[:count]), sorted(cells[count:])]

            until(
                lambda wanted=wanted: on_the_page() == wanted, lambda wanted=wanted: f"{on_the_page()} is not {wanted}"
            )


def test_record_stop_replay_and_seek_by_the_page_alone(chromium, buoy, tmp_path):
    with opened(chromium, buoy) as page:
        panel = page.locator(".panel-controls")
        panel.get_by_label("Name").fill("trip")
        panel.get_by_role("button", name="Record", exact=True).click()
        page.wait_for_selector('header .recording[data-on="true"]')
        panel.get_by_label("Mark", exact=True).fill("wave <b>1</b>")
        panel.get_by_role("button", name="Mark", exact=True).click()
        until(
            lambda: page.evaluate("document.querySelector('.panel-events').textContent.includes('wave <b>1</b>')"),
            "it does not show",
        )
        started = buoy.get("/api/state")["t"]
        until(lambda: buoy.get("/api/state")["t"] > started + 3.0, "the stream stands still")
        panel.get_by_role("button", name="Stop", exact=True).click()
        page.wait_for_selector('header .recording[data-on="false"]')
    (made,) = buoy.folder.glob("trip*.mcap")
    assert plumbob.verify(made).whole and plumbob.replay(made, check=True).comparison.equal
    with viewed(made, folder=tmp_path) as view, opened(chromium, view) as page:
        player = page.locator(".panel-playback")
        pause = player.get_by_role("button", name="Pause", exact=True)

        def paused():
            """It plays when it opens, and may have come to its end before the page is there."""
            pause.evaluate_all("all => all.forEach(button => button.click())")
            return not view.get("/api/state")["playback"]["playing"]

        until(paused, "it plays on")
        player.get_by_role("button", name="Play", exact=True).wait_for()
        slider = player.locator('input[type="range"]')
        slider.fill("1.5")
        state = until(
            lambda: abs((now := view.get("/api/state"))["playback"]["position"] - 1.5) < 0.02 and now, "no seek"
        )
        assert not state["playback"]["playing"]
        player.get_by_role("button", name="Play", exact=True).click()
        until(lambda: view.get("/api/state")["playback"]["position"] > 2.0, "it does not play")


def test_a_guided_calibration_ends_in_a_card(chromium, tmp_path):
    """The buoy turned by hand, five times as fast as a hand would: its magnetometer, by the page's buttons alone."""
    link = tmp_path / "port"
    rig = [*PLUMBOB, "emulate", "buoy", "--scenario", "poses", "--set", "move=2s", "--speed", "5", "--link", link]
    with subprocess.Popen([*map(str, rig)], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as emulated:
        try:
            assert emulated.stdout.readline()
            line = ("--port", link, "--format", "buoy", "--time", "count", "--frame", "NED", "--device", "unit 7")
            with viewed(*line, folder=tmp_path) as view, opened(chromium, view, viewport=TALL) as page:
                unfolded(page)
                panel = page.locator(".panel-guide")
                panel.get_by_role("button", name="Magnetometer").click()
                panel.get_by_role("button", name="Start").click()
                panel.get_by_role("button", name="Finish").wait_for()
                seen = panel.locator("dd").first
                until(
                    lambda: number(seen.text_content().partition("/")[0]) >= 15, lambda: f"seen {seen.text_content()}"
                )
                until(lambda: view.get("/api/state")["guide"] == "mag", "no guide runs")
                panel.get_by_role("button", name="Finish").click()
                card = panel.locator("code")
                card.wait_for(timeout=60_000)
                made = tmp_path / Path(card.text_content()).name
        finally:
            emulated.terminate()
    found = CalibrationCard.load(made)
    assert (found.device, set(found.parts)) == ("unit 7", {"mag"})


def test_the_page_finds_its_server_again_and_doubles_nothing(chromium, buoy):
    with opened(chromium, buoy) as page:
        until(
            lambda: page.evaluate("Number(document.querySelector('.panel-link dd').textContent.length) > 0"),
            "it does not show",
        )
        os.kill(buoy.server, signal.SIGKILL)
        page.wait_for_selector('html:not([data-connection="connected"])')
        page.wait_for_selector('html[data-connection="connected"]')
        page.wait_for_selector('html:not([data-stale="true"])')
        before = buoy.get("/api/state")["link"]["samples"]
        until(lambda: buoy.get("/api/state")["link"]["samples"] > before, "nothing comes any more")
        value = page.locator(".panel-attitude .big .value").first
        first = value.text_content()
        until(lambda: value.text_content() != first, "the page stands still")


HOSTILE = "<img src=x onerror=document.title=1>"


def test_names_of_devices_are_text(chromium, tmp_path):
    ok("emulate", "buoy", "--duration", "5s", "--write", tmp_path / "a.bin")
    ok("record", "--from", tmp_path / "a.bin", "--format", "buoy", "--filter", "mekf", "--frame", "NED",
       "--device", HOSTILE, "--out", tmp_path / "a.mcap")  # fmt: skip
    with viewed(tmp_path / "a.mcap", folder=tmp_path) as view, opened(chromium, view) as page:
        assert HOSTILE in shown(page, "header.page")
        assert page.locator("header.page img").count() == 0
        assert page.title() != "1"
        assert page.wrong == []


PHONE = {"width": 390, "height": 844}


@pytest.mark.parametrize(("look", "size"), [("theme=light", WIDE), ("theme=dark&lang=zh", PHONE), ("theme=sun", PHONE)])
def test_axe_has_no_serious_finding_and_nothing_is_wider_than_the_screen(chromium, buoy, look, size):
    if not AXE.is_file():
        pytest.skip("axe-core is not installed; 'make page' does it")
    with opened(chromium, buoy, query=look, viewport=size) as page:
        unfolded(page)
        assert page.evaluate("document.documentElement.scrollWidth") <= size["width"]
        page.evaluate(AXE.read_text(encoding="utf-8"))
        found = page.evaluate("axe.run({resultTypes: ['violations']})")
        serious = [
            (one["id"], one["help"], [node["html"][:120] for node in one["nodes"]][:5])
            for one in found["violations"]
            if one["impact"] in ("serious", "critical")
        ]
        assert serious == []


LISTEN = beside(__file__, "listen.js")


def test_a_browser_comes_in_by_the_link_and_the_page_runs_under_its_policy(chromium, tmp_path):
    with serving(control=True, folder=tmp_path) as served:
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
    with serving(folder=tmp_path / "one") as served, serving(control=True, folder=tmp_path / "other") as other:
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
