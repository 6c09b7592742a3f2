"""The page of a recording: self-contained, safe, every sample in it, drawn by a browser that has no network."""

import json
import re
from base64 import b64decode, b64encode
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest

import plumbob
from plumbob.core.errors import MissingExtraError, ParameterError
from plumbob.core.resources import asset
from plumbob.core.units import to_deg
from plumbob.overview import streaming_stats
from plumbob.reporting.content import said
from tests.helpers.browser import CHROMIUM, browser
from tests.helpers.labels import labels

SIM = {"frame": "NED", "sensors": "mpu6000+hmc5983", "unit": "calibrated"}
HOSTILE = '</script><script>document.title="taken"</script><img src=x onerror=alert(1)>'


@pytest.fixture(scope="module", autouse=True)
def built():
    try:
        asset("report.js")
    except MissingExtraError:
        pytest.skip("the pages are not built: run 'make page', which needs Node 20 or newer")


@pytest.fixture(scope="module")
def imu():
    """Forty seconds with a gap of 2 s and a slow magnetometer, of a device with a name that is a script."""
    made = plumbob.simulate("buoy", duration=40.0, seed=2, **SIM).imu
    t = made.t.copy()
    t[1500:] += 2.0
    meta = replace(made.meta, device=HOSTILE, t0_ns=1_800_000_000_000_000_000)
    slow = np.where(np.arange(t.size)[:, np.newaxis] % 5, np.nan, made.mag)
    return replace(made, t=t, mag=slow, meta=meta)


@pytest.fixture(scope="module")
def overview(imu):
    return plumbob.report(plumbob.Recording(imu=imu, name=HOSTILE), filter="mekf", burst="10 s")


@pytest.fixture(scope="module")
def page(overview):
    return overview.page()


def data_of(page):
    return json.loads(re.search(r'<script type="application/json" id="report-data">(.*?)</script>', page, re.S)[1])


def block(page, name):
    return b64decode(re.search(rf'id="{name}">([^<]*)</script>', page)[1])


def values(page, name, subject=0):
    """A channel as the page's script unpacks it."""
    channel = data_of(page)["subjects"][subject]["channels"][name]
    codes = np.frombuffer(block(page, channel["block"]), dtype="<i2")
    return np.where(codes == -32768, np.nan, channel["low"] + channel["step"] * codes), channel["step"]


def test_one_script_may_run_nothing_is_fetched_and_names_are_text(page):
    scripts = re.findall(r"<script>(.*?)</script>", page, re.S)
    assert len(scripts) == 1
    digest = b64encode(sha256(scripts[0].encode()).digest()).decode()
    policy = re.search(r'http-equiv="Content-Security-Policy" content="([^"]*)"', page)[1]
    assert policy.startswith("default-src 'none'")
    assert f"script-src 'sha256-{digest}'" in policy and "unsafe-eval" not in policy
    outside = re.sub(r"<script.*?</script>", "", page, flags=re.S)
    assert not [tag for tag in re.findall(r"<[a-z][^>]*>", outside) if re.search(r"\b(src|href)\s*=", tag)]
    assert not re.search(r"@import|url\(", outside)
    assert HOSTILE not in page
    assert "&lt;img src=x onerror" in page


def test_every_sample_is_in_it(page, imu):
    """Within half a step of its channel, which the range of the channel divides in 65 534."""
    found, step = values(page, "gyr_y")
    known = np.delete(found, 1500)  # the gap
    assert np.isnan(found[1500])
    assert step == pytest.approx(np.ptp(to_deg(imu.gyr[:, 1])) / 65534, rel=1e-4)
    assert np.max(np.abs(known - to_deg(imu.gyr[:, 1]))) <= 0.51 * step + 1e-5  # and a float32
    subject = data_of(page)["subjects"][0]
    times = np.frombuffer(block(page, subject["t"]["block"]), dtype="<f8")
    assert np.array_equal(np.delete(times, 1500), imu.t)
    assert subject["breaks"] == [1500]
    assert subject["epoch"] == 1.8e9
    holds = [subject["channels"][name]["hold"] for name in ("gyr_y", "mag_y")]
    assert holds == pytest.approx([0.05, 0.25])  # five steps of its own


def test_a_long_recording_says_how_many_samples_a_pair_is_and_several_stand_beside_each_other(imu, monkeypatch):
    monkeypatch.setattr("plumbob.reporting.overview.WHOLE", 1000)
    monkeypatch.setattr(streaming_stats, "BUCKETS", 100)
    page = plumbob.report(imu, filter="mekf").page()
    assert "each pair of points is the smallest and the largest of 40 samples" in page
    found, step = values(page, "acc_z")
    assert np.nanmax(found) == pytest.approx(imu.acc[:, 2].max(), abs=step)
    assert np.nanmin(found) == pytest.approx(imu.acc[:, 2].min(), abs=step)
    two = plumbob.report([imu, imu[:2000]], filter="mekf")
    page = two.page()
    assert len(data_of(page)["subjects"]) == 2
    assert len(two.report().tables[0].rows) == 2


def test_every_label_has_its_chinese_word(overview):
    symbols = r"Hz|rms|SHA-256|UTC|T[zp]|\[[^\]]*\]|\|\w+\||gyr|Escape|µT|" + re.escape(HOSTILE)
    found = labels(overview.report())
    meanings = {row[3] for table in overview.report().tables if table.title == "Gaps and flags" for row in table.rows}
    left = {one: said(one, "zh") for one in found - meanings}
    assert not {k: v for k, v in left.items() if re.search("[A-Za-z]{2,}", re.sub(symbols, "", v))}


def test_the_grade_is_that_of_info_with_what_it_lost_points_for(imu, tmp_path):
    bare = replace(imu, meta=replace(imu.meta, calibration=None, device="x"))
    file = plumbob.write(tmp_path / "a.parquet", bare)
    made, own = plumbob.report(file, filter="mekf"), plumbob.info(file).grade
    (shown,) = (one["grade"] for one in made.summary()["recordings"])
    for criterion in (*shown["criteria"], *(judged := own.summary())["criteria"]):
        del criterion["rule"]  # `info` also examines axes and delays
    assert shown == judged
    (table,) = (one for one in made.report().tables if one.title.startswith("Grade: "))
    assert table.title == f"Grade: {own.points:g} of 100, {own.word}"
    lost = {one.name: one for one in own.criteria if one.lost}
    assert {"gaps", "calibration"} <= set(lost) == {row[0].split()[0] for row in table.rows}
    assert [float(row[1]) for row in table.rows] == sorted(float(f"{one.lost:.3g}") for one in lost.values())[::-1]
    gaps = next(row[3] for row in table.rows if row[0] == "gaps")
    assert gaps == f"{lost['gaps'].measured}; {lost['gaps'].advice}"
    cells = [str(cell) for one in made.report().tables for row in one.rows for cell in row]
    assert any(cell.startswith(f"longest step {np.diff(imu.t).max():.6g} s") for cell in cells)


def test_a_browser_draws_it_and_zooms(page, tmp_path):
    """All plots are drawn, nothing is asked of the network, nothing fails, and the name did not run."""
    file = tmp_path / "page.html"
    file.write_text(page, encoding="utf-8")
    with browser() as chromium:
        tab = chromium.new_page(viewport={"width": 390, "height": 844})
        said_, asked = [], []
        tab.on("console", lambda message: said_.append(message.text))
        tab.on("pageerror", lambda error: said_.append(str(error)))
        tab.on("request", lambda request: asked.append(request.url))
        tab.goto(file.as_uri())
        tab.wait_for_selector("html[data-drawn]", state="attached")
        assert tab.title().startswith("Attitude report")
        figures = tab.locator("figure[data-chart]").count()
        assert tab.locator("figure[data-chart] canvas").count() == figures > 8
        assert tab.evaluate("() => document.documentElement.scrollWidth <= innerWidth")
        before = pixels(tab, 3)
        tab.locator("figure[data-chart] .plot").first.focus()
        tab.keyboard.press("+")
        assert pixels(tab, 3) != before
        tab.keyboard.press("Escape")
        assert pixels(tab, 3) == before
        assert dragged(tab, 0.25, 0.5) == pytest.approx((10.5, 21.0), abs=0.3)  # of 42 s
        tab.locator("button[data-reset]").click()
        assert shown(tab) == pytest.approx((0.0, 41.99))
    assert said_ == []
    assert asked == [file.as_uri()]


def dragged(tab, begin, end):
    """What all plots show after a drag over the second one, from and to these shares of its width."""
    plot = tab.locator("figure[data-chart] .u-over").nth(1)
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    tab.mouse.move(box["x"] + begin * box["width"], box["y"] + 20)
    tab.mouse.down()
    tab.mouse.move(box["x"] + end * box["width"], box["y"] + 30, steps=4)
    tab.mouse.up()
    return shown(tab)


def shown(tab):
    """Begin and end of what the plots show; all the same."""
    (found,) = set(tab.eval_on_selector_all("[data-shown]", "all => all.map(one => one.dataset.shown)"))
    return tuple(map(float, found.split()))


def pixels(tab, number):
    tab.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    return tab.evaluate(f"() => document.querySelectorAll('figure[data-chart] canvas')[{number}].toDataURL()")


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed")
def test_a_browser_prints_it(overview, tmp_path):
    path = overview.write_pdf(tmp_path / "page.pdf")
    raw = path.read_bytes()
    assert raw.startswith(b"%PDF-") and len(raw) > 20_000
    assert [one.name for one in tmp_path.iterdir()] == ["page.pdf"]
    with pytest.raises(ParameterError, match="exists already"):
        overview.write_pdf(path)


def test_without_a_browser_a_pdf_is_refused_in_plain_words(overview, tmp_path, monkeypatch):
    monkeypatch.setattr("plumbob.reporting.page.BROWSERS", ("a-browser-that-is-not-there",))
    with pytest.raises(MissingExtraError, match="a PDF is printed by Chromium or Chrome, and neither is installed"):
        overview.write_pdf(tmp_path / "page.pdf")
    assert list(tmp_path.iterdir()) == []


def test_figures_are_pictures_of_their_own(imu, tmp_path):
    pytest.importorskip("matplotlib")
    for what in ("angles", "spectrum", "rose", "flags", "bursts"):
        written = plumbob.plot(imu, tmp_path / f"{what}.svg", what=what, filter="mekf", begin=5.0, end="30 s")
        assert Path(written).stat().st_size > 5000
    for what, how, why in (
        ("roses", "mekf", "figure must be one of .* but it is 'roses'"),
        ("rose", "none", "has nothing to draw for"),
    ):
        with pytest.raises(plumbob.PlumbobError, match=why):
            plumbob.plot(imu, tmp_path / "a.svg", what=what, filter=how)


def test_the_width_of_a_picture_is_that_which_was_asked_for(imu, tmp_path):
    """85 mm are 240.9 points."""
    pytest.importorskip("matplotlib")
    plumbob.plot(imu, tmp_path / "a.svg", what="rates", filter="none", width="85 mm")
    head = re.search(r'<svg[^>]* width="([\d.]+)pt"', (tmp_path / "a.svg").read_text(encoding="utf-8"))
    assert float(head[1]) == pytest.approx(85.0 / 25.4 * 72.0, abs=0.1)
