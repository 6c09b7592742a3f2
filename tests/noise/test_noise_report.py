"""Reports of noise: digits, what is read off a curve, the text, the dictionary, the page, its pictures; comparisons."""

import json
import math
import re
import sys
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy.signal import lfilter

import plumbob
from plumbob.core.errors import MissingExtraError, ParameterError, ShapeError
from plumbob.core.text import measured, number
from plumbob.core.units import Quantity, from_si, to_si
from plumbob.noise import Curve, findings
from plumbob.noise.compare import differences
from plumbob.noise.findings import Candidate, Coefficient, Estimates, Mask, Sinusoid
from plumbob.noise.terms import DATASHEET, SHEETS
from plumbob.reporting import noise as report
from plumbob.simulation.presets import preset
from tests.helpers.page_battery import HOSTILE, Outline, PageBattery

PER_HOUR = math.degrees(1.0) * 3600.0  # °/h in a rad/s


@pytest.mark.parametrize(("value", "lo", "hi", "text"), [
    (1.2345, 1.2, 1.27, "1.234 ± 0.036"),  # sides 0.0345 and 0.0355 are alike: the larger counts
    (1.0, 0.9904, 1.0104, "1.000 ± 0.010"),  # the larger, 0.0104, says how many digits: 0.0096 would ask for more
    (1.0, 0.99995, 1.00005, "1.000000 ± 0.000050"),  # the value says whether a power of ten is written
    (57.03, 54.6, 60.1, "57.0 +3.1 -2.4"),
    (10.0, 9.95, 11.5, "10.000 +1.500 -0.050"),  # no side is rounded to nothing
    (0.0126, 0.01248, 0.01272, "0.01260 ± 0.00012"),
    (12345.0, 12000.0, 12700.0, "12340 ± 360"),
    (1.0, 0.9004, 1.0996, "1.00 ± 0.10"),  # 0.0996 has two digits as 0.10
    (3.2e-6, 3.1e-6, 3.3e-6, "(3.20 ± 0.10)e-6"),
    (2e7, 1.9e7, 2.2e7, "(2.00 +0.20 -0.10)e7"),
    (-3.0, -3.1, -2.9, "-3.00 ± 0.10"),
    (0.0, 0.0, 1.0, "0.0 +1.0 -0.0"),
    (0.5, math.nan, math.nan, "0.500"),
    (0.5, 0.5, 0.5, "0.500"),
    (0.5, 0.4, math.inf, "0.500"),
])  # fmt: skip
def test_a_value_has_the_digits_that_its_uncertainty_gives(value, lo, hi, text):
    assert measured(value, lo, hi) == text


def test_bare_numbers_lengths_of_time_and_coefficients():
    bare = [(0.0, 3), (123456.0, 3), (0.000123, 3), (0.05, 2), (1.5e-7, 2), (math.nan, 3)]
    assert [number(*args) for args in bare] == ["0", "123000", "0.000123", "0.050", "1.5e-7", "-"]
    seconds = (0.0, 3.0, 119.0, 200.0, 7200.0, 4.4e6)
    assert list(map(findings.length, seconds)) == ["0 s", "3.0 s", "120 s", "3.3 min", "2.0 h", "1200 h"]
    names = [report.noise_name(alpha) for alpha in (2.0, 0.0, -1.0, -2.0, -7.0)]
    assert names == ["quantization", "white", "flicker", "random walk", "f^-7"]
    white = Coefficient(*(to_si(v, "deg/rth") for v in (0.3, 0.299, 0.301)))
    hidden = Coefficient(0.0, upper=to_si(3.2, "deg/h"), observable=False, hours=12.3)
    nothing = Coefficient(0.0, observable=False)
    assert [findings.coefficient(c, "deg/h") for c in (hidden, nothing)] == ["< 3.2", "not observable"]
    assert report.verdict(white, "deg/rth") == "0.3000 ± 0.0010 °/√h"
    longer = "to show half of it takes a record of"
    assert report.verdict(hidden, "deg/h") == f"not observable; < 3.2 °/h (95 %); {longer} 12 h"
    assert report.verdict(nothing, "deg/h") == f"not observable; {longer} more than a year"


def curve(dev, half, n=None):
    dev, half = np.array(dev, dtype=float), np.array(half, dtype=float)
    n = 2 ** np.arange(dev.size) if n is None else np.asarray(n)
    return Curve("oadev", 0.5, 4 * int(n[-1]), n, dev, 0 * dev, 10 + 0 * dev, dev - half, dev + half)


DIP = curve([8, 4, 3, 5, 2], [0.1, 0.1, 0.2, 0.5, 2.0])


def test_the_floor_of_a_curve_and_coefficients_at_the_places_of_the_standard(plain):
    """A scattered last point is no minimum; the mask does not matter, and points without an interval do."""

    def lowest(c, **changes):
        return findings.lowest(replace(plain[0], curve=c, **changes))

    assert (*lowest(DIP)[:4], lowest(DIP).risen) == (2.0, 3.0, 2.8, 3.2, True)
    assert not lowest(curve([8, 4, 2, 1], [0.1] * 4)).risen
    assert not lowest(curve([8, 4, 2, 2.1], [0.1, 0.1, 0.1, 0.5])).risen
    assert lowest(curve([2, 4, 3, 1], [0.1, 0.1, 0.1, np.inf]), mask=Mask(2)).dev == 2.0
    terms = {k: Coefficient(2.0) for k in "QNBKR"} | {"Q": Coefficient(2.0, observable=False)}
    a = replace(plain[0], curve=DIP, likelihood=Estimates("likelihood", terms))
    assert list(findings.shown(a)) == ["N", "B", "K", "R"]
    # at its place, a line is as high as its coefficient; the flat of B is √(2 ln 2 / π) = 0.664 of it [Riley2008]
    flat = 2.0 * math.sqrt(2.0 * math.log(2.0) / math.pi)
    assert [p.letter for p in findings.points(a)] == ["N", "B", "K", "R"]
    assert [p.tau for p in findings.points(a)] == [1.0, 2.0, 3.0, math.sqrt(2.0)]
    assert [p.dev for p in findings.points(a)] == pytest.approx([2.0, flat, 2.0, 2.0])
    without = replace(plain[0], curve=curve([4, 3], [np.inf, np.inf]))
    assert [p.letter for p in findings.points(without)] == ["N", "K"]  # without a least deviation B has no place


def test_long_curves_are_cut_to_some_rows_spread_over_all():
    n = np.arange(1, 50_001)
    use = report.thinned_rows(curve(np.ones(n.size), np.ones(n.size), n=n), 40)
    assert use.size <= 40 and (use[0], use[-1]) == (0, n.size - 1)
    assert np.diff(np.log(n[use])).max() <= math.log(2.0)
    assert np.array_equal(report.thinned_rows(curve([1, 2, 3], [1, 1, 1]), 40), [0, 1, 2])


def test_axes_of_one_name_are_a_triad(analyses, bare):
    parts = findings.triads([*analyses, bare])
    assert [(t.name, "".join(t.channels)) for t in parts] == [("gyr", "xyz"), ("acc", "xyz"), ("column", "")]
    titles = [part.title for part in report.datasheet([*analyses, bare]).parts]
    assert titles == ["Gyroscope", "Accelerometer", "column"]
    assert parts[1].channels["y"] is analyses[4]
    mixed = [analyses[0], replace(analyses[1], quantity=Quantity.ACCELERATION)]
    for given, text in (
        ([], "at least one analysis"),
        ([analyses[0], analyses[0]], "two analyses are named 'gyr x'"),
        (mixed, "the axes of 'gyr' measure m/s2, rad/s"),
    ):
        with pytest.raises(ShapeError, match=text):
            report.datasheet(given)


def row(table, label):
    return next(line for line in table.splitlines() if line.startswith(label))


def with_term(a, letter, term):
    return replace(a, likelihood=Estimates("likelihood", {**a.terms, letter: term}))


def test_axes_stand_side_by_side_with_intervals_in_the_units_beside_them(analyses, bare):
    table = report.datasheet(analyses).text()
    for label, letter in (("N white noise [°/√h]", "N"), ("B bias instability [°/h]", "B")):
        cells = [findings.coefficient(a.terms[letter], DATASHEET[a.quantity][letter]) for a in analyses[:3]]
        assert row(table, label).split("]")[1].split() == " ".join(cells).split()
    assert "300.0 ± 1.2" in row(table, "N white noise [µg/√Hz]")  # planted in the fixture
    assert "< 0.045" in row(table, "Q quantization [arcsec]")
    floor = measured(*(from_si(v, "deg/h") for v in findings.lowest(analyses[0])[1:4]))
    assert floor in row(table, "floor of the curve [°/h]")
    assert number(from_si(analyses[5].sd, "ug"), 4) in table.split("Accelerometer")[1]
    flat = " ".join(table.split())
    assert flat.count("R is not observable: to show half of the limit takes a record of 12 h") == 2  # once a triad
    for part in (
        "record 3.3 min at 100 Hz, 20000 samples",
        "- x: sinusoid of 9.00 ± 0.40 °/h at 12.50000 ± 0.00040 Hz",
        "standard deviation 5.0 +1.5 -1.0 °/h, correlation time 90 +50 -30 s",
        "averaging times below 0.0800 s, above 6.25 Hz: the device filters its output",
        "x: values are multiples of 31.50 °/h",
        "x: the first minute drifts",
    ):
        assert part in flat
    hours = zip(analyses[:3], (5.7, 2.0, 5.7), strict=True)
    table = report.datasheet([with_term(a, "R", replace(a.terms["R"], hours=h)) for a, h in hours]).text()
    assert "takes a record of 5.7 h (x), 2.0 h (y), 5.7 h (z)" in " ".join(table.split())
    odd = replace(bare, step=1.0, sinusoids=(Sinusoid(0.5, 0.02, 12.5, 0.0004, 0.01),))
    table = " ".join(report.datasheet([odd]).text("curve").split())
    assert all(part in table for part in ("[1/√Hz]", "multiples of 1.000, whose", "sinusoid of 0.500 ± 0.020 at"))
    a = analyses[1]
    for share, words in ((0.04, ""), (0.3, ", whose rounding (step²/12 · Δt) is 30 % of N²")):
        step = math.sqrt(12.0 * share / a.curve.dt) * a.terms["N"].value  # step²/12 · Δt = share · N²
        table = " ".join(report.datasheet([replace(a, step=step)]).text().split())
        assert f"values are multiples of {number(from_si(step, 'deg/h'), 4)} °/h{words}" in table
        assert ("rounding" in table) == bool(words)


def test_methods_models_and_the_curve_on_demand(analyses, bare):
    assert "by method" not in report.datasheet(analyses).text()
    table = report.datasheet(analyses[:1]).text("methods")
    assert row(table, "K [°/h/√h]").split()[2:] == ["-", "24.0", "20.0", "±", "7.0"]
    assert row(table, "N B  ").split() == ["N", "B", "34.2"]  # −1200.25 + 1234.5, and the other is chosen
    assert row(table, "N B K").split() == ["N", "B", "K", "0.0", "chosen"]
    a = analyses[3]
    last = report.datasheet([a]).text("curve").splitlines()[-1].split()
    expected = [number(float(a.curve.tau[-1]))]
    expected += [number(from_si(float(v[-1]), "ug"), 4) for v in (a.curve.dev, a.curve.lo, a.curve.hi)]
    expected += [number(float(a.curve.edf[-1])), number(100.0 * float(a.curve.ieee[-1]))]
    assert last == [*expected, *report.noise_name(float(a.curve.alpha[-1])).split()]
    for details in ((), ("methods", "curve")):
        assert max(map(len, report.datasheet(analyses).text(*details).splitlines())) <= 80
        assert not re.search(r"\b(nan|inf)\b", report.datasheet([*analyses, bare]).text(*details))


def test_the_dictionary_is_strict_json_with_both_units_of_every_number(analyses, bare):
    said = findings.numbers([*analyses, bare])
    assert json.loads(json.dumps(said, allow_nan=False)) == said
    assert list(said) == [a.name for a in [*analyses, bare]]
    assert said["column"]["mean"] == {"1": bare.mean}
    a, gyr = analyses[0], said["gyr x"]
    n, q = gyr["coefficients"]["N"], said["acc z"]["coefficients"]["Q"]
    assert n["name"] == "white noise"
    # 0.3 °/√h is 0.3/60 °/s/√Hz, that is 8.7266e-5 rad/s/√Hz
    assert math.isclose(n["value"]["rad/s/rtHz"], math.radians(0.3 / 60.0), rel_tol=1e-12)
    assert (n["value"]["deg/rth"], n["hi"]["deg/rth"]) == pytest.approx((0.3, 0.3 * 1.004), rel=1e-12)
    assert set(q["upper"]) == {"m/s", "mm/s"} and (q["observable"], q["hours"]) == (False, None)
    assert math.isclose(q["upper"]["m/s"], 1e-3 * q["upper"]["mm/s"], rel_tol=1e-12)
    assert (gyr["samples"], gyr["duration_s"], gyr["dt_s"]) == (20_000, 200.0, 0.01)
    assert list(gyr["methods"]) == ["lines", "least squares", "likelihood"]
    assert gyr["methods"]["lines"]["N"]["lo"] == {"rad/s/rtHz": None, "deg/rth": None}  # the method gives none
    assert math.isclose(gyr["sinusoids"][0]["amplitude"]["deg/h"], 9.0)
    assert gyr["sinusoids"][0]["frequency_hz"] == 12.5
    assert math.isclose(gyr["gauss_markov"]["time"]["value"]["s"], 90.0)
    assert gyr["mask"] == {"n": 8, "frequency_hz": 6.25, "reason": "the device filters its output"}
    assert gyr["candidates"][0] == {"terms": "N B K", "bic": -1234.5, "chosen": True}
    assert [note["text"] for note in gyr["notes"]] == list(map(str, a.notes))
    curve = gyr["curve"]
    assert np.array_equal(curve["dev"]["rad/s"], a.curve.dev)
    assert np.allclose(curve["hi"]["deg/h"], PER_HOUR * a.curve.hi, rtol=1e-12, atol=0.0)
    assert np.array_equal(curve["tau_s"], a.curve.tau) and curve["alpha"] == a.curve.alpha.tolist()
    assert np.array_equal(curve["ieee952_relative_error"], a.curve.ieee)
    assert gyr["minimum"]["dev"]["rad/s"] in a.curve.dev


@pytest.fixture(scope="module")
def text(analyses, bare):
    mask, candidates = Mask(2, 1.0, HOSTILE), (Candidate(HOSTILE, 1.0, True),)
    hostile = replace(bare, name=HOSTILE, notes=(HOSTILE,), mask=mask, candidates=candidates)
    hostile = replace(hostile, lines=Estimates(HOSTILE, {}))
    made = report.datasheet([*analyses[:3], hostile], facts=[("device", HOSTILE), (HOSTILE, "x")])
    return made.page()


class TestPage(PageBattery):
    pass


def cells_of(page):
    """Rows of the curve's table as numbers: averaging time, deviation and its interval, degrees of freedom."""
    table = page.split("<summary>oadev")[1]
    rows = re.findall(r"<tr><th scope='row'>(.+?)</th>" + "<td>(.+?)</td>" * 4, table)
    return np.array(rows, dtype=float).T


def test_odd_curves_have_a_page_with_their_numbers_and_the_same_each_time(plain):
    few = plain[0].curve
    nothing = Estimates("likelihood", {k: Coefficient(0.0, observable=False) for k in "QNBKR"})
    for keep, changes in (
        (slice(0, 1), {}),
        (slice(0, 2), {"mask": Mask(10**9)}),
        (slice(-1, None), {"likelihood": nothing}),
    ):
        columns = (getattr(few, f)[keep] for f in ("n", "dev", "alpha", "edf", "lo", "hi"))
        short = Curve(few.kind, few.dt, few.count, *columns)
        wanted = [short.tau, *(PER_HOUR * v for v in (short.dev, short.lo, short.hi)), short.edf]
        wanted = [column for column in wanted if np.isfinite(column).all()]
        sheet = report.datasheet([replace(plain[0], curve=short, **changes)])
        page = sheet.page()
        assert page == sheet.page()
        Outline(page)
        for cells, exact in zip(cells_of(page), wanted, strict=True):
            assert cells == pytest.approx(exact, rel=5e-3)  # three digits, four of deviations


def test_a_curve_of_every_averaging_factor_makes_a_small_page_and_none_without_matplotlib(tmp_path, plain, monkeypatch):
    n = np.arange(1, 100_001)
    dev = 1e-3 / np.sqrt(n)
    dev[43_456] *= 40.0
    long = replace(plain[0], curve=Curve("oadev", 0.01, 200_000, n, dev, 0.0 * dev, 2e5 / n, dev * 0.9, dev * 1.1))
    path = report.datasheet([long]).write_html(tmp_path / "page.html")
    assert 10_000 < path.stat().st_size < 300_000
    listed = re.search(r"(\d+) of 100000 averaging times", path.read_text(encoding="utf-8"))
    assert 30 < int(listed[1]) <= 40
    drawn = np.concatenate([line.get_ydata() for line in drawing(channel_figure, long).get_lines()])
    assert PER_HOUR * dev[43_456] == pytest.approx(drawn[np.argmin(np.abs(drawn - PER_HOUR * dev[43_456]))])
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    for call in (report.datasheet(plain).page, lambda: report.datasheet(plain).plot(tmp_path / "x.png")):
        with pytest.raises(MissingExtraError, match=r'pip install "plumbob\[plot\]"'):
            call()


def channel_figure(channel):
    return report.allan_figure({"": {"": channel}})


def drawing(picture, what):
    """Axes on which a figure of the page was drawn."""
    drawn = Figure()
    picture(what).draw(drawn)
    return drawn.axes[0]


def lines(ax, marker):
    return [line for line in ax.get_lines() if line.get_marker() == marker]


def shaded_to(ax):
    """Ends of masks."""
    shades = [c for c in ax.collections if c.get_transform() != ax.transData and c.get_zorder() == 0]
    return [path.vertices[:, 0].max() for shade in shades for path in shade.get_paths()]


def test_coefficients_are_marked_at_their_places_with_their_values(analyses):
    """N at 1 s, B at the least deviation as 0.664 of it, K at 3 s, in °/h; 0.3 °/√h, 12 °/h and 20 °/h/√h are planted,
    for y 1.1 times as much."""
    a = analyses[1]
    ax = drawing(channel_figure, a)
    marks = [(line.get_xdata()[0], line.get_ydata()[0]) for line in lines(ax, "D")]
    n, b, k = (from_si(a.terms[letter].value, "deg/h") for letter in "NBK")
    assert [tau for tau, _ in marks] == [1.0, findings.lowest(a).tau, 3.0]
    assert [dev for _, dev in marks] == pytest.approx([n, math.sqrt(2 * math.log(2) / math.pi) * b, k])
    assert [(text.get_text(), text.xy) for text in ax.texts] == list(
        zip(("N 0.330 °/√h", "B 13.2 °/h", "K 22.0 °/h/√h"), marks, strict=True)
    )
    hidden = {letter: replace(c, observable=False) for letter, c in a.terms.items()}
    assert not drawing(channel_figure, replace(a, likelihood=Estimates("likelihood", hidden))).texts


def crossed(ax, channels):
    """Texts of a picture that lie over a curve, its interval or a model, or over another text."""
    boxes = {text.get_text(): text.get_window_extent() for text in ax.texts}
    tau = np.geomspace(*ax.get_xlim(), 4000)
    found = []
    for words, box in boxes.items():
        for a in channels:
            known = (tau >= a.curve.tau[0]) & (tau <= a.curve.tau[-1])
            ends = [np.interp(np.log(tau[known]), np.log(a.curve.tau), np.where(np.isfinite(end), end, a.curve.dev))
                    for end in (a.curve.lo, a.curve.hi)]  # fmt: skip
            for x, low, high in ((tau[known], *ends), (tau, a.model(tau), a.model(tau))):
                pixels = [ax.transData.transform(np.stack((x, from_si(y, "deg/h")), axis=-1)) for y in (low, high)]
                below, above = pixels[0][:, 1], pixels[1][:, 1]
                inside = (pixels[0][:, 0] > box.x0) & (pixels[0][:, 0] < box.x1)
                found += [words] * bool((inside & (above > box.y0) & (below < box.y1)).any())
        found += [words for other, place in boxes.items() if other != words and place.overlaps(box)]
    return found


@pytest.mark.parametrize("count", [1, 3, 6])
@pytest.mark.parametrize("width", [7.5, 85.0 / 25.4])
def test_no_text_of_a_picture_crosses_a_curve_a_band_a_model_or_another(plain, count, width):
    """Sensors whose curves lie apart and cross: each is larger than the first by a factor, and its walk by another."""
    channels = {}
    for i in range(count):
        a, size = plain[i % 3], 1.5**i
        curve = replace(a.curve, dev=size * a.curve.dev, lo=size * a.curve.lo, hi=size * a.curve.hi)
        terms = {k: replace(c, value=size * c.value) for k, c in a.terms.items()}
        likely = {"N": terms["N"].value, "B": terms["B"].value, "K": 0.5**i * terms["K"].value}
        likelihood = Estimates("likelihood", terms)
        channels[f"unit {i}"] = replace(a, curve=curve, likelihood=likelihood, most_likely=likely)
    drawn = Figure(figsize=(width, 3.3), layout="constrained")
    figure = report.allan_figure({"x": channels})
    figure.draw(drawn)
    (ax,) = drawn.axes
    assert not crossed(ax, channels.values())
    assert len({line.get_color() for line in lines(ax, "D")}) == count  # a colour for each sensor
    words = {text.get_text().split()[0] for text in ax.texts}
    assert words == {"N", "B", "K"} if count == 1 else words  # more of them may find no room, and stand in the key
    keys = [name for name, _, dash in figure.key if dash == "solid"][:count]
    for (name, a), key in zip(channels.items(), keys, strict=True):
        assert key.startswith(f"{name} x: N {number(from_si(a.terms['N'].value, 'deg/rth'))}, B ")


def test_several_axes_are_panels_with_the_same_scales(plain):
    drawn = Figure(figsize=(7.5, 6.0), layout="constrained")
    report.allan_figure({axis: {"a": plain[i], "b": plain[2 - i]} for i, axis in enumerate("xyz")}).draw(drawn)
    assert [ax.get_ylabel() for ax in drawn.axes] == ["x [°/h]", "y [°/h]", "z [°/h]"]
    assert len({(ax.get_xlim(), ax.get_ylim()) for ax in drawn.axes}) == 1
    assert len({ax.get_position().x0 for ax in drawn.axes}) == 1
    assert [ax.get_xlabel() for ax in drawn.axes] == ["", "", "averaging time [s]"]


def test_curve_model_terms_and_mask_are_in_the_unit_of_the_axis_and_a_triad_has_those_of_its_axes(analyses):
    a = analyses[4]
    ax = drawing(channel_figure, a)
    assert ax.get_ylabel() == "Allan deviation [µg]"
    (curve, pale), (model, *terms) = lines(ax, "."), lines(ax, "")
    assert np.allclose(curve.get_ydata(), from_si(a.curve.dev[: len(curve.get_xdata())], "ug"))
    assert curve.get_xdata()[-1] == pytest.approx(pale.get_xdata()[0])  # what scatters is pale
    assert pale.get_xdata()[-1] == pytest.approx(a.curve.tau[-1])
    assert np.allclose(model.get_ydata(), from_si(a.model(model.get_xdata()), "ug"))
    slopes = [np.diff(np.log(line.get_ydata()))[0] / np.diff(np.log(line.get_xdata()))[0] for line in terms]
    assert slopes == pytest.approx([-0.5, 0.0, 0.5], abs=1e-9)  # of N, B and K
    low, high = ax.get_ylim()
    assert low < curve.get_ydata().min() and curve.get_ydata().max() < high
    sure = replace(a, curve=replace(a.curve, edf=np.full(a.curve.n.size, 99.0)))
    assert len(lines(drawing(channel_figure, sure), ".")) == 1
    assert [shaded_to(drawing(channel_figure, x)) for x in analyses[:2]] == [[pytest.approx(8 * 0.01)], []]
    gyr, _ = findings.triads(analyses)
    ax = drawing(report.allan_figure, {"": gyr.channels})
    first = [line for line in lines(ax, ".") if line.get_alpha() == 1.0]
    assert len({line.get_color() for line in first}) == 3
    for line, a in zip(first, gyr.channels.values(), strict=True):
        assert line.get_ydata()[0] == pytest.approx(from_si(a.curve.dev[0], "deg/h"))
    assert shaded_to(ax) == [pytest.approx(max(a.mask.n * a.curve.dt for a in gyr.channels.values()))]


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    """White noise of 0.1 °/s at 10 Hz, as much of another unit, 1.2 times as much, and the first filtered over 1 s."""
    folder, rng = tmp_path_factory.mktemp("units"), np.random.default_rng(0)
    raw, equal, noisier = 0.1 * rng.standard_normal(20_000), 0.1 * rng.standard_normal(20_000), 0.12
    keep = np.exp(-0.1)
    smooth = lfilter([1.0 - keep], [1.0, -keep], raw)
    records = (raw, equal, noisier * rng.standard_normal(20_000), smooth)
    for name, values in zip("abcd", records, strict=True):
        np.save(folder / f"{name}.npy", values)
    return plumbob.allan(*(folder / f"{name}.npy" for name in "abcd"), rate=10.0, scale="1 deg/s")


def test_records_beside_each_other_have_one_table_with_what_differs_from_the_first(compared, tmp_path):
    """White noise 1.2 times as large is known to 0.7 %: 20 standard deviations; an equal one is not marked."""
    made = compared.report()
    rows = {row[0]: row for row in made.parts[0].tables[0].rows}
    head = made.parts[0].tables[0].head
    column = head.index("N [°/√h]")
    assert list(rows) == ["a", "b", "c", "d"]
    assert [rows[name][column].endswith(" *") for name in "abc"] == [False, False, True]
    assert rows["a"][column] == findings.coefficient(compared.analyses[0].terms["N"], "deg/rth")
    text = " ".join(made.text().split())
    factor = re.search(r"c differs from a: N by a factor of (\S+) ± (\S+)", text)
    assert float(factor[1]) == pytest.approx(1.2, abs=3.0 * float(factor[2]))
    assert float(factor[2]) == pytest.approx(0.01, rel=0.3)  # √2 of 1/√20000 times 1.2, of the variance half
    assert "b differs" not in text
    assert "d: between the two lies a filter of first order with a time constant of 1" in text
    (change,) = compared.beside[2].changes.values()
    keep = math.exp(-0.1)  # of white noise after a first-order filter, half the mean square of the differences
    assert change.ratio[0] == pytest.approx((1.0 - keep) / math.sqrt(1.0 + keep), rel=0.01)
    said = compared.summary()
    assert json.loads(json.dumps(said, allow_nan=False)) == said and list(said) == ["a", "b", "c", "d"]
    assert said["d"]["changes"]["d"]["bent_below_s"] == pytest.approx(10.0, rel=0.1)
    assert made.plot(tmp_path / "x.pdf", width="85mm").read_bytes()[:4] == b"%PDF"
    for call in (compared.card, lambda: compared.lines("ros")):
        with pytest.raises(ParameterError, match="one unit, but there are 4 records"):
            call()


def test_chance_marks_a_table_of_equal_sensors_in_at_most_one_of_twenty_cases(plain):
    """Intervals that hold the truth as often as they say: estimates are drawn from them; 3 letters, 5 others."""
    rng, marked, trials, spread = np.random.default_rng(3), 0, 2000, {"N": 0.01, "B": 0.1, "K": 0.2}
    for _ in range(trials):
        channels = []
        for _ in range(6):
            drawn = {k: 1.0 + sd * rng.standard_normal() for k, sd in spread.items()}
            terms = {k: Coefficient(value, value - spread[k], value + spread[k]) for k, value in drawn.items()}
            channels.append(replace(plain[0], likelihood=Estimates("likelihood", terms)))
        marked += any(differences(channels[0], other, among=15) for other in channels[1:])
    assert 0.01 < marked / trials < 0.05 + 3.0 * math.sqrt(0.05 * 0.95 / trials)


def test_white_noise_that_no_part_has_is_named(plain):
    """ICM-20948: 0.015 °/s/√Hz or 0.9 °/√h, 17 is 19 times that; ADIS16505: 0.13 °/√h; MPU-6000: 0.3."""

    def remarks(value):
        white = Coefficient(*(to_si(value * f, "deg/rth") for f in (1.0, 0.99, 1.01)))
        loud = [with_term(a, "N", white) for a in plain]
        return " ".join(report.datasheet(loud).text().split())

    assert "N of 0.300 °/√h is plausible: that of 0.300 °/√h (MPU-6000)" in remarks(0.3)
    assert "warning: N is 19 times that of the noisiest MEMS part" in remarks(17.0)
    assert "warning: N is 0.0077 times that of the quietest MEMS part" in remarks(0.001)
    for quantity, sheets in SHEETS.items():
        for part, value in sheets:
            triad = {"rad/s": "gyr", "m/s2": "acc"}[quantity.value]
            figure = preset(part.lower().replace("-", "")).triads[triad].figures["noise_density"]
            factor = {"deg/s per rtHz": 60.0, "deg per rth": 1.0, "mg per rtHz": 1000.0}[figure.unit]
            assert value == pytest.approx(factor * figure.value, rel=0.01)  # two digits are kept
