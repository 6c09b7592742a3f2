"""The fin paper's report: its percentages recomputed, and the same rule for our own record."""

import math
from dataclasses import replace

import pytest

from plumbob.core.errors import ShapeError
from plumbob.core.text import measured
from plumbob.core.units import from_si, to_si
from plumbob.noise.findings import Coefficient, Estimates
from plumbob.papers.fin_table import DURATION, TABLE, averaging_time, fin_report, percent_error

# Recomputed by hand from [Ou2017] (7) and its Table 1: percentage, implied averaging time, and the least and the
# greatest time that rounding of the printed error leaves.
RECOMPUTED = {
    ("Q", "453z"): ("6.262", "1.712", "1.6865", "1.737"), ("Q", "290y"): ("62.88", "97.15", None, None),
    ("Q", "290x"): ("64.80", "100.4", None, None), ("N", "453z"): ("4.779", "1.000", None, None),
    ("N", "290y"): ("4.778", "1.000", None, None), ("N", "290x"): ("4.763", "0.994", "0.989", "0.998"),
    ("B", "453z"): ("6.2991", "1.7321", "1.7316", "1.7326"), ("B", "290y"): ("5.841", "1.491", "1.481", "1.501"),
    ("B", "290x"): ("8.524", "3.151", "3.119", "3.183"),
}  # fmt: skip


def agrees(value, printed):
    """Whether a value rounds to what is printed; a hair is allowed for halves."""
    return printed is None or abs(value - float(printed)) <= 0.5001 * 10.0 ** -len(printed.partition(".")[2])


def test_the_papers_example_is_6_299_percent_and_every_percentage_of_the_table_is_recomputed():
    assert DURATION == 220.0
    assert f"{100.0 * percent_error(math.sqrt(3.0), DURATION):.3f}" == "6.299"  # [Ou2017] step 8
    assert math.isclose(averaging_time(percent_error(2.5, 220.0)), 2.5)
    # what the remarks claim: √3 s gives 0.0079 and 0.0083, 1 s gives 0.2277, 3 s gives 0.0946
    at = {tau: percent_error(tau, DURATION) for tau in (1.0, math.sqrt(3.0), 3.0)}
    claims = 0.125 * at[math.sqrt(3.0)], 0.132 * at[math.sqrt(3.0)], 4.766 * at[1.0], 1.138 * at[3.0]
    assert [f"{value:.4f}" for value in claims] == ["0.0079", "0.0083", "0.2277", "0.0946"]
    assert {(e.letter, e.axis) for e in TABLE} == set(RECOMPUTED)
    for entry in TABLE:
        made = (100.0 * entry.relative, *entry.tau)
        assert all(map(agrees, made, RECOMPUTED[entry.letter, entry.axis])), entry


@pytest.fixture
def gyro(plain):
    """Lines that read Q, N and B, in a record as long as the paper's: N = 110 000 at 500 Hz."""
    terms = {"Q": Coefficient(to_si(4.4, "arcsec")), "N": Coefficient(to_si(0.9, "deg/rth")), "B": Coefficient(2e-4)}
    return [replace(a, lines=Estimates("lines", terms), curve=replace(a.curve, count=110_000, dt=0.002)) for a in plain]


def test_our_own_record_is_read_as_the_paper_reads_which_is_reprinted(gyro, analyses, plain):
    report = fin_report(gyro).text()
    own = report[: report.index("As printed")]
    assert (own.count("6.299 % 1.732 s"), own.count("4.778 % 1 s")) == (3, 3)
    assert own.count("4.40 ± 0.28") == 3  # 6.299 % of 4.4
    assert own.count("54.0 ± 2.6") == 3  # 0.9 °/√h is 54 °/h at 1 s, and 4.778 % of it 2.58
    likelihood = gyro[0].terms["N"]
    assert measured(*(from_si(v, "deg/h") for v in (likelihood.value, likelihood.lo, likelihood.hi))) in own
    report = fin_report(gyro)
    flat = " ".join(report.text().split())
    for entry in TABLE:
        assert f"{entry.axis} {entry.value} ± {entry.error} {100.0 * entry.relative:.3f} %" in flat
        assert entry.remark in flat
    assert max(map(len, report.text().splitlines())) <= 80
    assert fin_report([*analyses[3:], *gyro]).text() == report.text()
    with pytest.raises(ShapeError, match="about a gyroscope, but no channel is in rad/s"):
        fin_report(analyses[3:])
    # a term without a line, and a record too short, are dashes
    assert fin_report(plain).text().splitlines()[4].split() == ["Q", "[arcsec]", "-", "-", "-"]
    short = [replace(a, curve=replace(a.curve, count=150)) for a in plain]
    assert fin_report(short).text().splitlines()[5].split()[-3:] == ["-", "-", "-"]
