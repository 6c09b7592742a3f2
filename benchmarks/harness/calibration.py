"""Calibrations of many simulated units: what is reached, what was predicted, and what is refused."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

from benchmarks.harness.bar import Bar, bar_lines
from benchmarks.harness.calibration_accel import CARES, measure_accel
from benchmarks.harness.calibration_accel import ROWS as POSITIONS
from benchmarks.harness.calibration_mag import CASES, measure_mag
from benchmarks.harness.calibration_stops import FINS, measure_stops
from benchmarks.harness.calibration_table import SESSIONS, measure_table
from benchmarks.harness.calibration_temperature import OTHERS, SOAKS, measure_drift, measure_temperature
from benchmarks.harness.section import Section
from plumbob.core import check

Progress = Callable[[int], None]


class Part(NamedTuple):
    """One section of the benchmark.

    Attributes
    ----------
    measure : callable
        From seeds and a progress to a `Section`.
    steps : int
        How often it calls the progress with 1.
    """

    measure: Callable[[Sequence[int], Progress | None], Section]
    steps: int


PARTS: Final[Mapping[str, Part]] = {
    "mag": Part(measure_mag, len(CASES)),
    "accel": Part(measure_accel, len(CARES) * len(POSITIONS)),
    "table": Part(measure_table, len(SESSIONS)),
    "stops": Part(measure_stops, 1 + len(FINS)),
    "temperature": Part(measure_temperature, len(SOAKS)),
    "drift": Part(measure_drift, len(OTHERS)),
}
"""Every section by name."""


@dataclass(frozen=True, slots=True)
class CalibrationTest:
    """Result: sections by name."""

    seeds: int
    sections: Mapping[str, Section]

    @property
    def bars(self) -> tuple[Bar, ...]:
        """Bars of all sections."""
        return tuple(bar for section in self.sections.values() for bar in section.bars)

    def summary(self) -> dict[str, Any]:
        """Ready for JSON."""
        return {"seeds": self.seeds, **{name: section.summary() for name, section in self.sections.items()}}

    def text(self) -> str:
        """Tables, and how the bars are kept."""
        lines = [line for section in self.sections.values() for line in (*section.lines(), "")]
        return "\n".join([*lines, *bar_lines(self.bars)])


def measure_calibration(
    seeds: Sequence[int], names: Collection[str] = (), progress: Progress | None = None
) -> CalibrationTest:
    """Run sections with every seed.

    Parameters
    ----------
    seeds : sequence of int
        One unit each.
    names : collection of str
        Of `PARTS`; all where it is empty.
    progress : callable, optional
        Called with 1 after each step.

    Raises
    ------
    ShapeError
        If a name is unknown.
    """
    wanted = [check.one_of("section", name, tuple(PARTS)) for name in names or PARTS]
    return CalibrationTest(len(seeds), {name: PARTS[name].measure(seeds, progress) for name in wanted})
