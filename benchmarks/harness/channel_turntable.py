"""The paper's second test: a turntable that speeds up evenly and then holds its rate, scored against its true rate."""

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from benchmarks.harness.channel_records import STEP, Contender, at_rest, contenders, on_turntable
from plumbob.calibration.gyr.drift import GyroDrift
from plumbob.core.check import Floats
from plumbob.core.units import deg, dps, to_deg, to_dps

BIAS = dps(1.5)
"""Turn-on bias of the unit, rad/s: what the paper's compensation takes off."""
SCALES = (0.0, 0.01)
"""Errors of the gain with which the test is run."""
SLOPE = deg(0.6)
"""Angular acceleration while it speeds up, rad/s²."""
SPIN_UP = 1000
"""Samples until the rate is held, 100 s."""
SETTLED = 600
"""Samples after which a filter's lag is measured, on the rest of the ramp."""

_OTHER_SEEDS = 1_000_000  # the stretch at rest that gives the bias has noise of its own


@dataclass(frozen=True, slots=True)
class OnTurntable:
    """Errors of one channel on the turntable, over all seeds.

    Attributes
    ----------
    name : str
        Of the filter; "measured" is the raw rate, "bias removed" what every filter gets.
    ramp_rms, hold_rms : float
        Root mean square while it speeds up, and while it holds, rad/s.
    ramp_mean, hold_mean : float
        Mean error, rad/s; negative where the filter is behind.
    angle : float
        Largest error of the integrated angle while it speeds up, mean over the seeds, rad.
    lag : float
        How far it stays behind what it is given, late on the ramp, rad/s.
    lag_theory : float
        The same in theory, once it has settled.
    """

    name: str
    ramp_rms: float
    hold_rms: float
    ramp_mean: float
    hold_mean: float
    angle: float
    lag: float
    lag_theory: float

    def as_dict(self) -> dict[str, Any]:
        """Ready for JSON, in degrees."""
        degrees = {
            f"{name}_dps": to_dps(value) for name, value in asdict(self).items() if name not in {"name", "angle"}
        }
        return {"name": self.name, **degrees, "angle_deg": to_deg(self.angle)}


def measure_turntable(
    seeds: Sequence[int], scale: float, progress: Callable[[int], None] | None = None
) -> tuple[OnTurntable, ...]:
    """Run the test on the turntable with each seed.

    Parameters
    ----------
    seeds : sequence of int
        One run each.
    scale : float
        Error of the gain.
    progress : callable, optional
        Called with 1 after each seed.
    """
    competing = list(contenders())
    runs = []
    for seed in seeds:
        runs.append(_one_run(seed, scale, competing))
        if progress:
            progress(1)
    mean = np.mean(runs, axis=0)
    names = ["measured", "bias removed", *(c.name for c in competing)]
    lags = [0.0, 0.0, *(SLOPE * STEP * c.lag for c in competing)]
    return tuple(_result(name, row, lag) for name, row, lag in zip(names, mean, lags, strict=True))


def _one_run(seed: int, scale: float, competing: Sequence[Contender]) -> Floats:
    """Figures (m, 6) of the raw rate, of the compensated one, and of every filter after it."""
    rest = at_rest(seed + _OTHER_SEEDS, SPIN_UP * STEP, bias=BIAS)
    run = on_turntable(seed, scale=scale, bias=BIAS)
    given = GyroDrift().at_rest(rest.measured).compensate(run.measured)[:, 2:]
    true, measured = run.true[:, 2:], run.measured[:, 2:]
    after = [given, *(c.smooth(run.t, given) for c in competing)]
    return np.array([_figures(measured, true, measured), *(_figures(rate, true, given) for rate in after)])


def _figures(rate: Floats, true: Floats, given: Floats) -> Floats:
    ramp, hold = (rate - true)[:SPIN_UP], (rate - true)[SPIN_UP:]
    angle = np.abs(STEP * np.cumsum(ramp)).max()
    lag = np.mean((given - rate)[SETTLED:SPIN_UP])
    return np.array([np.mean(ramp**2), np.mean(hold**2), ramp.mean(), hold.mean(), angle, lag])


def _result(name: str, row: Floats, lag: float) -> OnTurntable:
    ramp_square, hold_square, ramp_mean, hold_mean, angle, measured_lag = row.tolist()
    return OnTurntable(
        name=name,
        ramp_rms=math.sqrt(ramp_square),
        hold_rms=math.sqrt(hold_square),
        ramp_mean=ramp_mean,
        hold_mean=hold_mean,
        angle=angle,
        lag=measured_lag,
        lag_theory=lag,
    )
