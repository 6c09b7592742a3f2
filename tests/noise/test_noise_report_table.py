"""The text: every number comes from the analysis, in the unit that stands beside it."""

import math
import re
from dataclasses import replace

import pytest

from plumbob.core.text import measured, number
from plumbob.core.units import from_si, to_si
from plumbob.noise.findings import Coefficient, Estimates, Sinusoid
from plumbob.noise.report import coefficient, datasheet, lowest, noise_name
from plumbob.noise.terms import DATASHEET


def text(analyses, *details):
    return datasheet(analyses).text(*details)


def row(table, label):
    return next(line for line in table.splitlines() if line.startswith(label))


def test_axes_stand_side_by_side_with_intervals(analyses):
    table = text(analyses)
    assert "record      3.3 min at 100 Hz, 20000 samples" in table
    gyr, acc = analyses[:3], analyses[3:]
    for of, label, letter in ((gyr, "N white noise [°/√h]", "N"), (gyr, "B bias instability [°/h]", "B")):
        cells = [coefficient(a.terms[letter], DATASHEET[a.quantity][letter]) for a in of]
        assert row(table, label).split("]")[1].split() == " ".join(cells).split()
    assert "300.0 ± 1.2" in row(table, "N white noise [µg/√Hz]")  # planted in the fixture
    assert f"{number(from_si(acc[2].sd, 'ug'), 4)}" in table.split("Accelerometer")[1]


def test_another_coefficient_is_another_number(analyses):
    changed = Coefficient(*(to_si(v, "deg/rth") for v in (0.777, 0.775, 0.779)))
    a = replace(analyses[0], likelihood=Estimates("likelihood", {**analyses[0].terms, "N": changed}))
    assert "0.7770 ± 0.0020" in text([a])
    assert "0.3000" not in text([a])


def test_what_is_not_observable_is_said_once_for_axes_that_agree(analyses):
    table = " ".join(text(analyses[:3]).split())
    assert "< 0.045" in row(text(analyses[:3]), "Q quantization [arcsec]")
    assert table.count("R is not observable: to show half of the limit takes a record of 12 h") == 1
    assert "- x: sinusoid of 9.00 ± 0.40 °/h at 12.50000 ± 0.00040 Hz, or folded from another frequency: k ×" in table
    assert "x: Gauss-Markov process: standard deviation 5.0 +1.5 -1.0 °/h, correlation time 90 +50 -30 s" in table
    assert "x: masked: averaging times below 0.0800 s, above 6.25 Hz: the device filters its output" in table
    assert "x: values are multiples of 31.50 °/h" in table
    assert "x: the first minute drifts" in table


def test_lengths_that_differ_stand_by_axis(analyses):
    def takes(a, hours):
        terms = {**a.terms, "R": replace(a.terms["R"], hours=hours)}
        return replace(a, likelihood=Estimates("likelihood", terms))

    gyr = [takes(a, hours) for a, hours in zip(analyses[:3], (5.7, 2.0, 5.7), strict=True)]
    assert "takes a record of 5.7 h (x), 2.0 h (y), 5.7 h (z)" in " ".join(text(gyr).split())


@pytest.mark.parametrize(("share", "told"), [(0.04, ""), (0.3, ", whose rounding (step²/12 · Δt) is 30 % of N²")])
def test_coarse_steps_are_told_as_a_share_of_the_white_noise(analyses, share, told):
    a = analyses[1]
    step = math.sqrt(12.0 * share / a.curve.dt) * a.terms["N"].value  # step²/12 · Δt = share · N²
    table = " ".join(text([replace(a, step=step)]).split())
    assert f"values are multiples of {number(from_si(step, 'deg/h'), 4)} °/h{told}" in table
    assert ("rounding" in table) == bool(told)


def test_the_floor_is_no_least_value(analyses):
    table = text(analyses[:1])
    assert measured(*(from_si(v, "deg/h") for v in lowest(analyses[0])[1:4])) in row(table, "floor of the curve [°/h]")
    assert "which need not be its least value" in " ".join(table.split())
    assert "least deviation" not in table


def test_methods_and_models_on_demand(analyses):
    assert "by method" not in text(analyses)
    table = text(analyses[:1], "methods")
    assert "\nCoefficients by method\n" in table
    head = table.split("Coefficients by method\n")[1].splitlines()[0]
    assert re.split(r"\s{2,}", head.strip()) == ["lines", "least squares", "likelihood"]
    assert row(table, "K [°/h/√h]").split()[2:] == ["-", "24.0", "20.0", "±", "7.0"]
    assert row(table, "N B  ").split() == ["N", "B", "34.2"]  # −1200.25 + 1234.5, and the other is chosen
    assert row(table, "N B K").split() == ["N", "B", "K", "0.0", "chosen"]


def test_the_curve_on_demand(analyses):
    a = analyses[3]
    table = text([a], "curve")
    assert re.search(r"\noadev \[µg\], 68\.3 % interval, \d+ of \d+ averaging times\nτ \[s\]", table)
    last = table.splitlines()[-1].split()
    expected = [number(float(a.curve.tau[-1]))]
    expected += [number(from_si(float(v[-1]), "ug"), 4) for v in (a.curve.dev, a.curve.lo, a.curve.hi)]
    expected += [number(float(a.curve.edf[-1])), number(100.0 * float(a.curve.ieee[-1]))]
    assert last == [*expected, *noise_name(float(a.curve.alpha[-1])).split()]


def test_columns_grow_with_a_long_interval_and_stay_apart(bare):
    lines = text([bare], "methods").splitlines()
    head, b = (next(line for line in lines if line.lstrip().startswith(start)) for start in ("lines", "B [1]"))
    assert b.endswith(" 0.0200 +0.0018 -0.0014  0.0200 +0.0018 -0.0014")
    assert len(head) == len(b)


@pytest.mark.parametrize("details", [(), ("methods", "curve")])
def test_no_line_is_too_wide_and_nothing_is_nan(analyses, bare, details):
    lines = text([*analyses, bare], *details).splitlines()
    assert max(len(line) for line in text(analyses, *details).splitlines()) <= 80
    assert not re.search(r"\b(nan|inf)\b", "\n".join(lines))


def test_bare_numbers_have_bare_units(bare):
    table = text([bare])
    assert "record      3.0 s at 100 Hz, 300 samples" in table
    assert "N white noise [1/√Hz]" in table
    assert "B bias instability [1]" in table
    sinusoid = Sinusoid(0.5, 0.02, 12.5, 0.0004, 0.01)
    told = " ".join(text([replace(bare, step=1.0, sinusoids=(sinusoid,))], "curve").split())
    assert "values are multiples of 1.000, whose" in told
    assert "sinusoid of 0.500 ± 0.020 at" in told
    assert "oadev, 68.3 % interval" in told
