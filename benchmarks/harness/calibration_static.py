"""The buoy paper's static test [Yu2018] on many simulated units, and captures that must be refused.

Units: hard iron up to 80 mG on each axis, scale of the magnetometer wrong by up to 12 %, offsets of the accelerometer
up to 50, 50 and 80 mg, its scale wrong by up to 3 %, all evenly distributed. Where c is told, the soft iron has
symmetric off-diagonal entries up to c. One reading of the field scatters by 2 mG and has steps of 0.73 mG, one of the
specific force scatters by 1 mg. The field has 500 mG and a dip of 50°. Each capture has one reading per region; one
that is refused is made again, as a user would. The test turns the unit on a table that is tilted by 20°, in 36 steps of
10°, with one reading each, against a reference that is itself wrong by up to 0.8° in yaw and 0.2° in pitch and roll, as
the paper's.
"""

import math
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import numpy as np

from benchmarks.harness.bar import Bar
from benchmarks.harness.calibration_world import NOISE, STEP, Attitudes, field_n, force_b, in_body, posed, reading
from benchmarks.harness.section import Section
from plumbob.calibration.acc.poses import fit_accel
from plumbob.calibration.ellipsoid.ellipsoid_fit import Shape
from plumbob.calibration.fit import CaptureRefusedError
from plumbob.calibration.mag.alone import fit_mag
from plumbob.core.check import Floats
from plumbob.core.units import deg, g, to_deg, to_si
from plumbob.data import ImuData
from plumbob.data.cards import TriadCalibration
from plumbob.evaluation.metrics import wrap
from plumbob.filters import Filter
from plumbob.rotations import Frame, euler_zyx_from_quat
from plumbob.simulation import TriadErrors, scenario

DIP: Final = deg(50.0)
HARD_IRON: Final = to_si(80.0, "mgauss")
SCALE: Final = 0.12
FORCE_OFFSET: Final = g(np.array([0.05, 0.05, 0.08]))
FORCE_SCALE: Final = 0.03
FORCE_NOISE: Final = g(1e-3)
REFERENCE: Final = deg(np.array([0.8, 0.2, 0.2]))
"""Largest errors of the reference in yaw, pitch and roll, rad [Yu2018]."""

YAW, YAW_WORST, LEVEL = 2.5, 5.0, 1.0
"""Limits of the largest errors: of yaw without and with soft iron across the axes, and of pitch and roll, °."""

_COLUMNS: Final = (
    "yaw before, °",
    "yaw after, °",
    "95 %, °",
    "roll, pitch, °",
    "≤ 2.5°, %",
    "≤ 5°, %",
    "all ≤ 5°, %",
    "1st refused, %",
)
_LIMITS: Final = (2.5, 5.0)
_SHARE: Final = 95.0
_CAPTURES: Final = 5  # that a user makes until one is accepted
_RATE: Final = 10.0  # of the captures that are refused, Hz


class Unit(NamedTuple):
    """Errors of the two triads of a unit."""

    acc: TriadErrors
    mag: TriadErrors


class Row(NamedTuple):
    """One way to capture and to fit.

    Attributes
    ----------
    capture : str
        Of `CAPTURES`.
    c : float
        Largest off-diagonal entry of the soft iron.
    shape : Shape or None
        Of the magnetometer's fit; None chooses.
    """

    capture: str
    c: float = 0.0
    shape: Shape | None = None


CAPTURES: Final[dict[str, Attitudes]] = {
    "3 bands of pitch × 6 of yaw": posed("bands"),
    "3 bands of roll × 6 of yaw": posed("bands", along_roll="on"),
    "6 faces + 12 edges": posed("faces", edges="on", wobble=deg(5.0)),
}
_FACES: Final = "6 faces + 12 edges"
ROWS: Final = (
    *(Row(capture) for capture in CAPTURES),
    *(Row(_FACES, 0.0, shape) for shape in (Shape.AXES, Shape.ELLIPSOID)),
    *(Row(_FACES, c, shape) for c in (0.02, 0.05, 0.1) for shape in (None, Shape.AXES, Shape.ELLIPSOID)),
)
_SHAPES: Final = {None: "chosen", Shape.AXES: "6 parameters", Shape.ELLIPSOID: "9 parameters"}

REFUSED: Final[dict[str, tuple[str, dict[str, float | str]]]] = {
    "level ring": ("level-ring", {"name": "levelring"}),
    "cone, the unit tilted by 15°": ("cone", {"name": "cone"}),
    "cone, the table tilted by 15°": ("cone", {"name": "cone", "table": "on"}),
}
"""Captures to refuse: the kind of reason that is right, and the scenario."""


class Turn(NamedTuple):
    """Largest errors of one unit on the table: yaw before; yaw, and pitch or roll, after, rad; captures refused."""

    before: float
    yaw: float
    level: float
    refused: int


def measure_static(seeds: Sequence[int], progress: Callable[[int], None] | None = None) -> Section:
    """Calibrate a unit per seed and turn it on the table, in each of `ROWS`.

    Parameters
    ----------
    seeds : sequence of int
        One unit each.
    progress : callable, optional
        Called with 1 after each row.
    """
    rows, bars = {}, []
    for row in ROWS:
        name = f"{row.capture}, c = {row.c:g}, {_SHAPES[row.shape]}"
        rows[name] = figures = _figures([_turn(row, seed) for seed in seeds])
        bars += _bars(row, name, figures)
        if progress:
            progress(1)
    title = f"Static test at a tilt of 20°, {len(seeds)} units; medians of the largest of 36 errors"
    return Section(title, _COLUMNS, rows, tuple(bars))


def measure_refusals(seeds: Sequence[int], progress: Callable[[int], None] | None = None) -> Section:
    """Offer captures that calibrate nothing, one of each kind per seed; arguments as in `measure_static`."""
    rows, bars = {}, []
    for name, (right, parameters) in REFUSED.items():
        told = Counter(_offered(parameters, seed) for seed in seeds)
        share = 100.0 * told[right] / len(seeds)
        wrong = ", ".join(f"{kind} {count}" for kind, count in told.items() if kind != right) or "none"
        rows[name] = (share, wrong)
        bars.append(Bar(f"{name}: refused as {right}, %", share, 100.0, 100.0))
        if progress:
            progress(1)
    return Section(f"Captures to refuse, {len(seeds)} units", ("rightly refused, %", "otherwise"), rows, tuple(bars))


def draw_unit(c: float, rng: np.random.Generator) -> Unit:
    """Unit whose soft iron has off-diagonal entries up to c."""
    soft_iron = np.eye(3)
    soft_iron[np.triu_indices(3, 1)] = rng.uniform(-c, c, 3)
    mag = TriadErrors(
        soft_iron=soft_iron + np.triu(soft_iron, 1).T,
        scale=rng.uniform(-SCALE, SCALE, 3),
        hard_iron=rng.uniform(-HARD_IRON, HARD_IRON, 3),
        white_sd=np.full(3, NOISE),
        lsb=np.full(3, STEP),
    )
    acc = TriadErrors(
        bias=FORCE_OFFSET * rng.uniform(-1.0, 1.0, 3),
        scale=rng.uniform(-FORCE_SCALE, FORCE_SCALE, 3),
        white_sd=np.full(3, FORCE_NOISE),
    )
    return Unit(acc, mag)


def _read(unit: Unit, q_nb: Floats, rng: np.random.Generator) -> tuple[Floats, Floats]:
    acc = reading(unit.acc, force_b(q_nb), triad="acc", rng=rng)
    return acc, reading(unit.mag, in_body(q_nb, field_n(DIP)), triad="mag", rng=rng)


def _turn(row: Row, seed: int) -> Turn:
    rng = np.random.default_rng(seed)
    unit = draw_unit(row.c, rng)
    cards, refused = _calibrated(row, unit, rng)
    table = scenario("table36")
    truth = table.motion(rng, table.duration).truth(np.asarray(1.5 + 4.0 * np.arange(36.0))).q_nb
    wrong = REFERENCE * rng.uniform(-1.0, 1.0, (len(truth), 3))
    shown = _read(unit, truth, rng)
    before = _largest(*shown, truth, wrong)
    if cards is None:
        return Turn(before[0], math.inf, math.inf, refused)
    acc, mag = (_applied(card, vectors) for card, vectors in zip(cards, shown, strict=True))
    after = _largest(acc, mag, truth, wrong)
    return Turn(before[0], after[0], max(after[1:]), refused)


def _calibrated(
    row: Row, unit: Unit, rng: np.random.Generator
) -> tuple[tuple[TriadCalibration, TriadCalibration] | None, int]:
    """Calibrations of both triads, and how many captures were refused before; None where all were."""
    for refused in range(_CAPTURES):
        acc, mag = _read(unit, CAPTURES[row.capture](rng), rng)
        try:
            return (fit_accel(acc).calibration, fit_mag(mag, shape=row.shape, acc=acc).calibration), refused
        except CaptureRefusedError:
            continue
    return None, _CAPTURES


def _applied(card: TriadCalibration, vectors: Floats) -> Floats:
    return np.asarray((vectors - card.bias) @ card.matrix.T)


def _largest(acc: Floats, mag: Floats, truth: Floats, wrong: Floats) -> tuple[float, float, float]:
    """Largest errors of yaw, pitch and roll by tilt and compass, against a reference that is wrong, rad."""
    looks = ImuData(t=np.arange(float(len(acc))), acc=acc, mag=mag)
    shown = Filter("tilt_compass", frame=Frame.NED).process(looks).q_nb
    errors = np.abs(wrap(euler_zyx_from_quat(shown) - euler_zyx_from_quat(truth) - wrong))
    yaw, pitch, roll = errors.max(axis=0).tolist()
    return yaw, pitch, roll


def _offered(parameters: dict[str, float | str], seed: int) -> str:
    """What becomes of a capture: the kind of the first reason, or the grade."""
    rng = np.random.default_rng(seed)
    unit = draw_unit(0.0, rng)
    plan = scenario(**parameters)  # type: ignore[arg-type]
    t = np.arange(round(plan.duration * _RATE)) / _RATE
    acc, mag = _read(unit, plan.motion(rng, plan.duration).truth(t).q_nb, rng)
    try:
        fit = fit_mag(mag, acc=acc).calibration
    except CaptureRefusedError as refused:
        return refused.reasons[0].kind
    return f"accepted as {fit.quality and fit.quality.grade}"


def _figures(turns: Sequence[Turn]) -> tuple[float, ...]:
    before, yaw, level = to_deg(np.array([turn[:3] for turn in turns])).T
    worst = np.maximum(yaw, level)
    return (
        float(np.median(before)),
        float(np.median(yaw)),
        float(np.quantile(yaw, 0.01 * _SHARE, method="higher")),
        float(np.median(level)),
        *(100.0 * float(np.mean(yaw <= limit)) for limit in _LIMITS),
        100.0 * float(np.mean(worst <= _LIMITS[1])),
        100.0 * float(np.mean([turn.refused > 0 for turn in turns])),
    )


def _bars(row: Row, name: str, figures: tuple[float, ...]) -> list[Bar]:
    """Limits for what a user gets, not for shapes that were forced."""
    if row.shape is not None:
        return []
    told = dict(zip(_COLUMNS, figures, strict=True))
    bars = []
    if row.c == 0.0:
        bars.append(Bar(f"{name}: yaw ≤ {YAW:g}°, %", told["≤ 2.5°, %"], _SHARE, 100.0))
    if row.c == max(r.c for r in ROWS):
        bars.append(Bar(f"{name}: yaw ≤ {YAW_WORST:g}°, %", told["≤ 5°, %"], _SHARE, 100.0))
    if row.capture == _FACES:
        bars.append(Bar(f"{name}: roll, pitch, °", told["roll, pitch, °"], 0.0, LEVEL))
    return bars
