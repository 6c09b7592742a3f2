"""The report of the fin paper [Ou2017]: its Table 1 for three gyroscope axes, honest intervals, and its own figures.

The paper reads Q at τ = √3 s, "R" at 1 s and B on the flat of an Allan plot, and gives each the percent error
1/√(2(N/n − 1)) of that averaging time (7). Its only consistent units are seconds of arc, °/h at 1 s, and °/h. Its "R"
is called a random walk of the rate, but is white noise of the rate, N = R/60 in °/√h.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from plumbob.core import text
from plumbob.core.errors import ShapeError
from plumbob.core.units import Quantity, from_si
from plumbob.noise.findings import Analysis, Triad, coefficient, lowest, triads
from plumbob.noise.terms import TERMS
from plumbob.reporting.content import Table
from plumbob.reporting.report import Report

DURATION = 110_000 / 500.0  # of the paper's record, s

_UNITS = {"Q": "arcsec", "N": "deg/h", "B": "deg/h"}
_NAMES = {"Q": "Q [arcsec]", "N": '"R" = N [°/h at 1 s]', "B": "B [°/h]"}
_MISPRINTS = (
    'Q is printed in °, "R" in °/√h and B in °/√h. As printed, Q would be a deviation of 93 °/s at one sample; seconds '
    "of arc, °/h at 1 s and °/h are the only units that fit together.",
    '"R" is named a random walk of the angular rate. It is read on the slope −1/2 and is white noise of the rate, a '
    "random walk of the angle: N = R/60 is 0.079, 0.108 and 0.251 °/√h for 290x, 290y and 453z.",
    "B is the height of the flat. Bias instability is that divided by 0.664, and so it is above for this record.",
    'B of 453z, 57 °/h, lies above its "R", 15 °/h: that line meets the flat at 0.07 s, and its value at 1 s is not '
    "the curve's.",
    "The percent error is a formula for one deviation of disjoint averages, whatever the noise; it is neither the "
    "error of a coefficient nor that of an overlapping deviation.",
)


class Printed(NamedTuple):
    """An entry of the paper's table as it is printed, and what is to be said about it."""

    letter: str
    axis: str
    value: str
    error: str
    remark: str

    @property
    def relative(self) -> float:
        """Error as a share of the value."""
        return float(self.error) / float(self.value)

    @property
    def tau(self) -> tuple[float, float, float]:
        """Averaging time that the share implies, with the least and the greatest that the error's last digit allows."""
        half = 0.5 * 10.0 ** -len(self.error.partition(".")[2])
        shares = (self.relative, *((float(self.error) + side) / float(self.value) for side in (-half, half)))
        return (averaging_time(shares[0]), averaging_time(shares[1]), averaging_time(shares[2]))


TABLE = (
    Printed("Q", "290x", "0.125", "0.081", "ten times too large, and still off: √3 s gives 0.0079"),
    Printed("Q", "290y", "0.132", "0.083", "ten times too large: 0.0083 is √3 s"),
    Printed("Q", "453z", "0.107", "0.0067", "√3 s"),
    Printed("N", "290x", "4.766", "0.227", "1 s; cut off, not rounded: 0.2277"),
    Printed("N", "290y", "6.509", "0.311", "1 s"),
    Printed("N", "453z", "15.066", "0.720", "1 s"),
    Printed("B", "290x", "1.138", "0.097", "√10 s or π s, not 3 s, which gives 0.0946"),
    Printed("B", "290y", "2.585", "0.151", "1.5 s"),
    Printed("B", "453z", "57.056", "3.594", "√3 s, as for Q"),
)
"""Table 1 of the paper."""


def percent_error(tau: float, duration: float) -> float:
    """Share 1/√(2(N/n − 1)) of a deviation at the averaging time tau, s, of a record of `duration`, s [Ou2017] (7)."""
    return 1.0 / math.sqrt(2.0 * (duration / tau - 1.0))  # [Ou2017] (7)


def averaging_time(share: float, duration: float = DURATION) -> float:
    """Averaging time, s, at which `percent_error` is such a share."""
    return duration / (1.0 + 0.5 / share**2)


def fin_report(analyses: Sequence[Analysis]) -> Report:
    """The report of the axes of a gyroscope, which must be among the analyses; others are not looked at."""
    triad = next((triad for triad in triads(analyses) if triad.first.quantity is Quantity.RATE), None)
    if triad is None:
        raise ShapeError("the fin paper's report is about a gyroscope, but no channel is in rad/s.")
    head = ("", "axis", "printed", "±/value", "implied T [s]", "remark")
    tables = [
        Table("This record", ["", *triad.channels], _own_rows(triad)),
        Table("As printed, and its errors recomputed for 110000 samples at 500 Hz", head, _printed_rows(), words=(5,)),
    ]
    return Report("Table 1 of Ou et al. 2017", tables=tables, remarks=_MISPRINTS)


def _own_rows(triad: Triad) -> list[list[str]]:
    """Each coefficient as the paper makes it, the averaging time and percentage behind its ±, and the likelihood's."""
    rows = []
    for letter, name in _NAMES.items():
        channels = triad.channels.values()
        rows.append([name, *(_line(a, letter) for a in channels)])
        rows.append(["  its ± at T", *(_behind(a, letter) for a in channels)])
        rows.append(["  likelihood", *(_likelihood(a, letter) for a in channels)])
    return rows


def _line(a: Analysis, letter: str) -> str:
    c, tau = a.lines.terms.get(letter), _read_at(a, letter)
    if c is None or tau is None:
        return "-"
    value, share = from_si(c.value, _UNITS[letter]), percent_error(tau, a.duration)
    return text.measured(value, value * (1.0 - share), value * (1.0 + share))


def _behind(a: Analysis, letter: str) -> str:
    tau = _read_at(a, letter)
    return "-" if tau is None else f"{100.0 * percent_error(tau, a.duration):.3f} % {tau:.4g} s"


def _likelihood(a: Analysis, letter: str) -> str:
    c = a.terms.get(letter)
    return "-" if c is None else coefficient(c, _UNITS[letter])


def _read_at(a: Analysis, letter: str) -> float | None:
    """Averaging time at which the paper reads a coefficient; None where the record is too short."""
    least = lowest(a)
    tau = TERMS[letter].read_at or (least.tau if least else math.inf)
    return tau if tau < a.duration else None


def _printed_rows() -> list[list[str]]:
    rows = []
    for entry in TABLE:
        tau, low, high = entry.tau
        name = '"R"' if entry.letter == "N" else entry.letter
        span = f"{text.number(tau, 4)} ({text.number(low, 4)} to {text.number(high, 4)})"
        number = f"{entry.value} ± {entry.error}"
        rows.append([name, entry.axis, number, f"{100.0 * entry.relative:.3f} %", span, entry.remark])
    return rows
