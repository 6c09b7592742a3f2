"""Rate table of many random gyroscopes: how near the fit comes with 12 and with 21 parameters, and what it claims.

The setting is that of the figures that the bars stand for: three axes, ±50, ±100 and ±200 °/s, every mounting tilted by
0.1° in a random direction. They do not state the noise of a plateau's mean; 0.015 °/s is what their scale factors
(40 ppm with one mounting per axis, 29 ppm with two) and their bias (0.0022 °/s) fit. Ten seconds of 0.005 °/s/√Hz, the
sheet of an MPU-6000, are 0.0016 °/s and stand beside.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Final

import numpy as np

from benchmarks.harness.bar import Bar
from benchmarks.harness.section import Section
from plumbob.calibration.gyr.table import fit_table
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.units import deg, dps, g, to_deg, to_dps
from plumbob.data.cards import TriadCalibration

NOISE: Final = float(dps(0.015))
"""Standard deviation of a plateau's mean that the bars' figures fit, rad/s."""

LONG_NOISE: Final = float(dps(0.005 / np.sqrt(10.0)))
"""That of ten seconds of an MPU-6000, rad/s."""

_RATES = dps(np.array([0.0, 50.0, -50.0, 100.0, -100.0, 200.0, -200.0]))
_TILT = float(deg(0.1))
_BIAS, _SCALE, _MISALIGNMENT = float(dps(1.0)), 0.01, float(deg(0.5))
_COUPLING = float(dps(0.05) / g(1.0))
_TRIADS = np.eye(3)
_COLUMNS: Final = ("scale, ppm", "misalignment, °", "bias, °/s", "g-sensitivity, °/s/g", "within 1 sd, %")
_LIMITS: Final = {"scale, ppm": 40.0, "bias, °/s": 0.003, "g-sensitivity, °/s/g": 0.006, "within 1 sd, %": 78.0}
_LEAST: Final = {"within 1 sd, %": 60.0}
_BARRED: Final = "21 parameters, both ends up, 0.015 °/s"

SESSIONS: Final[Mapping[str, tuple[Floats, str, float]]] = {
    "12 parameters, one end up, 0.015 °/s": (_TRIADS, "12", NOISE),
    _BARRED: (np.vstack((_TRIADS, -_TRIADS)), "21", NOISE),
    "model chosen, both ends up, 0.015 °/s": (np.vstack((_TRIADS, -_TRIADS)), "auto", NOISE),
    "model chosen, both ends up, 0.0016 °/s": (np.vstack((_TRIADS, -_TRIADS)), "auto", LONG_NOISE),
}
"""By name: faces that are up, (F, 3), the model, and the noise of a plateau's mean, rad/s."""


def measure_table(seeds: Sequence[int], progress: Callable[[int], None] | None = None) -> Section:
    """Calibrate random gyroscopes, one for each seed, in each of `SESSIONS`.

    Parameters
    ----------
    seeds : sequence of int
        One unit each.
    progress : callable, optional
        Called with 1 after each session.
    """
    rows = {}
    for name, session in SESSIONS.items():
        rows[name] = _figures([_trial(*session, np.random.default_rng(seed)) for seed in seeds])
        if progress:
            progress(1)
    figures = dict(zip(_COLUMNS, rows[_BARRED], strict=True))
    bars = tuple(
        Bar(f"rate table: {column}", figures[column], _LEAST.get(column, 0.0), high) for column, high in _LIMITS.items()
    )
    title = f"Rate table, {len(seeds)} units, medians; ±50, ±100, ±200 °/s, 0.1° of tilt per mounting"
    return Section(title, _COLUMNS, rows, bars)


def _figures(trials: Sequence[Sequence[float]]) -> tuple[float, ...]:
    """Medians of the errors, each the root mean square over axes or entries, and the mean share within one sd."""
    errors = np.array(trials)
    scale, misalignment, bias, coupling = np.median(errors[:, :4], axis=0).tolist()
    covered = 100.0 * float(errors[:, 4].mean())
    return 1e6 * scale, to_deg(misalignment), to_dps(bias), to_dps(coupling) * g(1.0), covered


def _trial(faces: Floats, model: str, noise: float, rng: np.random.Generator) -> list[float]:
    """Draw a gyroscope, take it through a session, fit it; errors of the four kinds, and the share within one sd."""
    across = ~np.eye(3, dtype=np.bool_)
    response = np.eye(3) + np.where(across, rng.normal(0.0, _MISALIGNMENT, (3, 3)), rng.normal(0.0, _SCALE, (3, 3)))
    bias, coupling = rng.normal(0.0, _BIAS, 3), rng.normal(0.0, _COUPLING, (3, 3))
    axis = np.array([_tilted(face, rng) for face in faces])
    force = np.repeat(G0 * axis, _RATES.size, axis=0)
    true = np.repeat(axis, _RATES.size, axis=0) * np.tile(_RATES, len(faces))[:, np.newaxis]
    nominal = np.repeat(faces, _RATES.size, axis=0) * np.tile(_RATES, len(faces))[:, np.newaxis]
    measured = bias + true @ response.T + force @ coupling.T + rng.normal(0.0, noise, true.shape)
    found = fit_table(nominal, measured, force=force, model=model, mounting=_TILT / np.sqrt(2.0)).calibration
    off = np.linalg.inv(found.matrix) - response
    kinds = (np.diag(off), off[across], found.bias - bias, found.g_sensitivity - coupling)
    return [*(float(np.sqrt(np.mean(kind**2))) for kind in kinds), _covered(found, bias, response)]


def _tilted(face: Floats, rng: np.random.Generator) -> Floats:
    """Axis of the table in the axes of a unit that sits on it tilted by 0.1° in a random direction."""
    towards = rng.uniform(0.0, 2.0 * np.pi)
    ahead = np.roll(face, 1)
    return np.asarray(
        np.cos(_TILT) * face + np.sin(_TILT) * (np.cos(towards) * ahead + np.sin(towards) * np.cross(face, ahead))
    )


def _covered(found: TriadCalibration, bias: Floats, response: Floats) -> float:
    assert found.bias_sd is not None and found.matrix_sd is not None
    within = (
        np.abs(found.bias - bias) <= found.bias_sd,
        np.abs(found.matrix - np.linalg.inv(response)) <= found.matrix_sd,
    )
    return float(np.mean(np.concatenate([part.ravel() for part in within])))
