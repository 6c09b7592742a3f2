"""The buoy paper's static test [Yu2018] on many simulated modules, by its fit and by Plumbob's.

A module has hard iron up to 80 mG on each axis and a scale of the field wrong by up to 12 %; offsets of the
accelerometer up to 50, 50 and 80 mg and a scale wrong by up to 3 %; all evenly distributed. The soft iron has symmetric
off-diagonal entries up to c. One reading of the field scatters by 2 mG, one of the specific force by 1 mg. The field
has 500 mG and a dip of 50°. A capture has one reading in each of 18 regions. The test turns the module on a table that
is tilted by 20°, in 36 steps of 10°, with one reading at each, beside a reference that is itself wrong by up to 0.8° in
yaw and 0.2° in pitch and roll, as the paper's. These modules are simulated directly: no bytes.
"""

import math
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import numpy as np

from plumbob.calibration.acc import fit_accel
from plumbob.calibration.ellipsoid_fit import Shape, fit_axes, mean_radius
from plumbob.calibration.fit import CaptureRefusedError
from plumbob.calibration.mag.ellipsoid import fit_mag
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.units import deg, g, to_deg, to_si
from plumbob.data import ImuData
from plumbob.data.cards import TriadCalibration
from plumbob.filters import Filter
from plumbob.rotations import Frame, euler_zyx_from_quat, quat_conjugate, quat_rotate, wrap
from plumbob.simulation import TriadErrors, earth_field, scenario
from plumbob.simulation.captures import PoseScenario
from plumbob.simulation.errors import measure

STRENGTH: Final = to_si(500.0, "mgauss")
"""Of the field, µT."""
STEP: Final = to_si(0.73, "mgauss")
"""Of the magnetometer's scale at ±0.88 Ga, µT."""
WIDE_STEP: Final = to_si(1000.0 / 230.0, "mgauss")
"""Of its scale at ±8.1 Ga, µT."""
NOISE: Final = to_si(2.0, "mgauss")
"""Scatter of one reading of the magnetometer, µT."""
DIP: Final = deg(50.0)
HARD_IRON: Final = to_si(80.0, "mgauss")
SCALE: Final = 0.12
FORCE_OFFSET: Final = g(np.array([0.05, 0.05, 0.08]))
FORCE_SCALE: Final = 0.03
FORCE_NOISE: Final = g(1e-3)
REFERENCE: Final = deg(np.array([0.8, 0.2, 0.2]))
"""Largest errors of the reference in yaw, pitch and roll, rad [Yu2018]."""

Attitudes = Callable[[np.random.Generator], Floats]
"""Draws attitudes (N, 4)."""

_RETRIES: Final = 5  # captures that a user makes until one is accepted
_RATE: Final = 10.0  # of the captures that are refused, Hz


def field_n(dip: float) -> Floats:
    """Field in NED, (3,), µT."""
    return earth_field(Frame.NED, strength=STRENGTH, dip=dip, declination=0.0)


def in_body(q_nb: Floats, vector_n: Floats) -> Floats:
    """Vector of the navigation frame (3,) seen at attitudes (N, 4), (N, 3)."""
    return quat_rotate(quat_conjugate(q_nb), vector_n)


def force_b(q_nb: Floats) -> Floats:
    """Specific force at rest at attitudes (N, 4), (N, 3), m/s²."""
    return in_body(q_nb, G0 * Frame.NED.up)


def reading(errors: TriadErrors, truth_b: Floats, *, triad: str, rng: np.random.Generator) -> Floats:
    """What a triad with these errors reads of true vectors (N, 3)."""
    warm, no_force = np.full(len(truth_b), errors.temp_ref_c), np.zeros((len(truth_b), 3))
    seed = int(rng.integers(2**32))
    return measure(errors, truth_b, triad=triad, seed=seed, rate=1.0, temp_c=warm, force_b=no_force).values


def posed(name: str, **parameters: float | str) -> Attitudes:
    """Attitudes of a scenario of poses."""
    plan = scenario(name, **parameters)
    if not isinstance(plan, PoseScenario):
        raise TypeError(f"{name} has no poses.")
    return plan.attitudes


class Linear(NamedTuple):
    """Calibration of a triad: ``matrix @ (reading − bias)``; as `TriadCalibration`, which refuses impossible gains."""

    matrix: Floats
    bias: Floats


Pair = tuple[Linear | TriadCalibration, Linear | TriadCalibration]
"""Calibrations of accelerometer and magnetometer."""
Fit = Callable[[Floats, Floats], Pair | None]
"""Calibrates both by their readings (N, 3) in N attitudes; None where the paper's fit gives no ellipsoid."""


def paper_fit(vectors: Floats, size: float | None) -> Linear | None:
    """Calibration by the paper's six parameters [Yu2018] (8) to (14), without a look at what it was given.

    `vectors` (N, 3): readings in N attitudes; `size`: length of what was measured, None keeps the sensor's own scale.
    """
    fit = fit_axes(vectors)
    return fit and Linear((size or mean_radius(fit.shape)) * fit.shape, fit.centre)


def by_paper(acc: Floats, mag: Floats) -> Pair | None:
    """Both triads by the paper's fit."""
    force, field = paper_fit(acc, G0), paper_fit(mag, None)
    return None if force is None or field is None else (force, field)


def mag_alone(acc: Floats, mag: Floats) -> Pair | None:
    """The magnetometer by the paper's fit, and the accelerometer as it is."""
    field = paper_fit(mag, None)
    return field and (Linear(np.eye(3), np.zeros(3)), field)


def by_choice(acc: Floats, mag: Floats) -> Pair:
    """Both triads by the smallest shape that the capture does not contradict; the capture is judged."""
    return fit_accel(acc).calibration, fit_mag(mag, acc=acc).calibration


def by_ellipsoid(acc: Floats, mag: Floats) -> Pair:
    """The magnetometer by the general ellipsoid of nine parameters."""
    return fit_accel(acc).calibration, fit_mag(mag, shape=Shape.ELLIPSOID, acc=acc).calibration


CAPTURES: Final[dict[str, Attitudes]] = {
    "pitch": posed("bands"),
    "roll": posed("bands", along_roll="on"),
    "faces": posed("faces", edges="on", wobble=deg(5.0)),
}
"""Three bands of pitch, or of roll, by six sectors of heading; and six faces with twelve edges."""


class CaptureRow(NamedTuple):
    """A capture, a fit, and the test.

    `capture`: of `CAPTURES`; `fit`: what calibrates; `c`: largest off-diagonal entry of the soft iron; `tilt`: of
    the table, rad; `step`: of the magnetometer's scale, µT.
    """

    capture: str = "faces"
    fit: Fit = by_paper
    c: float = 0.0
    tilt: float = deg(20.0)
    step: float = STEP


class ModuleStatistics(NamedTuple):
    """What a row gives over its modules: largest of 36 errors, deg, and shares of the modules.

    `before`, `yaw`, `level`: medians: of the yaw before and after, and of the larger one of pitch and roll after;
    `yaw95`, `level95`: what 95 % of the modules keep; `within`: share whose yaw keeps 2.5°; `yaw5`, `all5`: share
    whose yaw, and whose three angles, keep 5°, as the paper claims; `failed`: share whose first capture gave no
    calibration.
    """

    before: float
    yaw: float
    level: float
    yaw95: float
    level95: float
    within: float
    yaw5: float
    all5: float
    failed: float


class ModuleErrors(NamedTuple):
    """Errors of the two triads of a module."""

    acc: TriadErrors
    mag: TriadErrors


def draw_unit(c: float, rng: np.random.Generator, step: float = STEP) -> ModuleErrors:
    """Module whose soft iron has off-diagonal entries up to c, and whose magnetometer has steps of `step`, µT."""
    soft_iron = np.eye(3)
    soft_iron[np.triu_indices(3, 1)] = rng.uniform(-c, c, 3)
    mag = TriadErrors(
        soft_iron=soft_iron + np.triu(soft_iron, 1).T,
        scale=rng.uniform(-SCALE, SCALE, 3),
        hard_iron=rng.uniform(-HARD_IRON, HARD_IRON, 3),
        white_sd=np.full(3, NOISE),
        lsb=np.full(3, step),
    )
    acc = TriadErrors(
        bias=FORCE_OFFSET * rng.uniform(-1.0, 1.0, 3),
        scale=rng.uniform(-FORCE_SCALE, FORCE_SCALE, 3),
        white_sd=np.full(3, FORCE_NOISE),
    )
    return ModuleErrors(acc, mag)


def measure_ring(row: CaptureRow, seeds: Sequence[int]) -> ModuleStatistics:
    """Calibrate a module per seed and turn it on the table."""
    turns = [_turn(row, seed) for seed in seeds]
    before, yaw, level = to_deg(np.array([turn[:3] for turn in turns])).T
    return ModuleStatistics(
        before=float(np.median(before)),
        yaw=float(np.median(yaw)),
        level=float(np.median(level)),
        yaw95=float(np.quantile(yaw, 0.95, method="higher")),
        level95=float(np.quantile(level, 0.95, method="higher")),
        within=float(np.mean(yaw <= 2.5)),
        yaw5=float(np.mean(yaw <= 5.0)),
        all5=float(np.mean(np.maximum(yaw, level) <= 5.0)),
        failed=float(np.mean([turn[3] > 0 for turn in turns])),
    )


def applied(card: Linear | TriadCalibration, vectors: Floats) -> Floats:
    """Vectors (N, 3), calibrated."""
    return np.asarray((vectors - card.bias) @ card.matrix.T)


def largest(acc: Floats, mag: Floats, truth: Floats, wrong: Floats | float = 0.0) -> tuple[float, float, float]:
    """Largest errors of yaw, pitch and roll by tilt and compass, against a reference that is wrong by `wrong`, rad.

    `acc`, `mag` (N, 3): specific force and field, of any size; `truth` (N, 4): true attitudes, NED.
    """
    looks = ImuData(t=np.arange(float(len(acc))), acc=acc, mag=mag)
    shown = Filter("tilt_compass", frame=Frame.NED).process(looks).q_nb
    errors = np.abs(wrap(euler_zyx_from_quat(shown) - euler_zyx_from_quat(truth) - wrong))
    yaw, pitch, roll = errors.max(axis=0).tolist()
    return yaw, pitch, roll


def table_poses(tilt: float = deg(20.0)) -> Floats:
    """Attitudes (36, 4) of the table's rests, NED."""
    table = scenario("table36", tilt=tilt)
    motion = table.motion(np.random.default_rng(0), table.duration)
    return motion.truth(np.asarray(1.5 + 4.0 * np.arange(36.0))).q_nb


def read_both(unit: ModuleErrors, q_nb: Floats, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Readings (N, 3) of specific force and field at attitudes (N, 4)."""
    acc = reading(unit.acc, force_b(q_nb), triad="acc", rng=rng)
    return acc, reading(unit.mag, in_body(q_nb, field_n(DIP)), triad="mag", rng=rng)


def _turn(row: CaptureRow, seed: int) -> tuple[float, float, float, int]:
    """Largest errors: yaw before; yaw, and pitch or roll, after, rad; and captures that gave no calibration."""
    rng = np.random.default_rng(seed)
    unit = draw_unit(row.c, rng, row.step)
    cards, failed = None, 0
    while cards is None and failed < _RETRIES:
        acc, mag = read_both(unit, CAPTURES[row.capture](rng), rng)
        try:
            cards = row.fit(acc, mag)
        except CaptureRefusedError:
            cards = None
        failed += cards is None
    truth = table_poses(row.tilt)
    wrong = REFERENCE * rng.uniform(-1.0, 1.0, (len(truth), 3))
    shown = read_both(unit, truth, rng)
    before = largest(*shown, truth, wrong)
    if cards is None:
        return before[0], math.inf, math.inf, failed
    acc, mag = (applied(card, vectors) for card, vectors in zip(cards, shown, strict=True))
    after = largest(acc, mag, truth, wrong)
    return before[0], after[0], max(after[1:]), failed


DEGENERATE: Final[dict[str, tuple[str, dict[str, float | str]]]] = {
    "ring": ("level-ring", {"name": "levelring"}),
    "unit": ("cone", {"name": "cone"}),
    "table": ("cone", {"name": "cone", "table": "on"}),
}
"""Captures that calibrate nothing: why, and the scenario; a level ring, and cones of a tilted unit or table."""


class Refused(NamedTuple):
    """What becomes of a capture that calibrates nothing, over its modules.

    `rightly`: share that Plumbob refuses, with the right reason; `failed`: share in which the paper's fit gives no
    ellipsoid, of eighteen readings; `yaw`: median largest error of yaw by the paper's fit where it gives one, deg;
    NaN where it never does.
    """

    rightly: float
    failed: float
    yaw: float


def measure_degenerate(name: str, seeds: Sequence[int]) -> Refused:
    """Offer a capture of `DEGENERATE` to Plumbob and to the paper's fit, once for each seed."""
    right, parameters = DEGENERATE[name]
    rightly, yaws = 0, []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        unit = draw_unit(0.0, rng)
        plan = scenario(**parameters)  # type: ignore[arg-type]
        t = np.arange(round(plan.duration * _RATE)) / _RATE
        acc, mag = read_both(unit, plan.motion(rng, plan.duration).truth(t).q_nb, rng)
        try:
            fit_mag(mag, acc=acc)
        except CaptureRefusedError as refused:
            rightly += refused.reasons[0].kind == right
        some = slice(0, None, len(t) // 36)  # of two turns, eighteen readings in each
        yaws.append(_paper_yaw(unit, acc[some][:18], mag[some][:18], rng))
    errors = [yaw for yaw in yaws if yaw is not None]
    count = len(seeds)
    return Refused(rightly / count, 1.0 - len(errors) / count, float(np.median(errors)) if errors else math.nan)


def _paper_yaw(unit: ModuleErrors, acc: Floats, mag: Floats, rng: np.random.Generator) -> float | None:
    """Largest error of yaw on the table by the paper's fit, deg; None where there is none."""
    cards = by_paper(acc, mag)
    if cards is None:
        return None
    truth = table_poses()
    shown = read_both(unit, truth, rng)
    acc, mag = (applied(card, vectors) for card, vectors in zip(cards, shown, strict=True))
    return float(to_deg(largest(acc, mag, truth)[0]))
