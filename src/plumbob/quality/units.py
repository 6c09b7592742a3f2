"""Which unit a triad is in, by the size of gravity, of the Earth's field, and of the turning that they show."""

import math
from dataclasses import dataclass
from typing import Final

from plumbob.core.constants import G0
from plumbob.core.units import QUANTITY_BY_TRIAD, to_si

UNITS: Final = {
    "gyr": ("rad/s", "deg/s", "rpm", "mrad/s", "mdeg/s"),
    "acc": ("m/s2", "g", "mg", "cm/s2"),
    "mag": ("uT", "nT", "mgauss", "gauss", "mT", "T"),
}
"""Units in use, by triad; that of SI as it is used inside comes first."""
_USUAL: Final = {"gyr": 1.0, "acc": G0, "mag": 40.0}  # [Alken2021]: the Earth's field has 22 to 67 µT
_SPREAD: Final = {"gyr": 0.2, "acc": 0.06, "mag": 0.35}
"""Standard deviation of the logarithm of the size in the right unit: gain and bias of gravity (MPU-6000: ±3 %, ±50 mg,
PS-MPU-6000A, 6.2), pushes, places on the Earth."""
_NONE_FITS: Final = 3.5


@dataclass(frozen=True)
class UnitOdds:
    """The unit that fits best."""

    unit: str | None  # its name; None where no unit in use fits
    factor: float  # what the values as declared have to be multiplied by
    log_odds: float  # against the next unit
    next: str
    declared_odds: float  # of the declared unit, against the best


def unit_odds(name: str, size: float, sd: float, declared: str) -> UnitOdds:
    """Odds of the units of a triad.

    Parameters
    ----------
    name : {"gyr", "acc", "mag"}
        Which triad.
    size : float
        With the declared unit: of gravity, m/s²; of the field, µT; of the turning that the rates say over that which
        the other sensors show.
    sd : float
        Standard deviation of its logarithm.
    declared : str
        The unit that the values were taken for.
    """
    kind = QUANTITY_BY_TRIAD[name]
    scale = float(to_si(1.0, declared, kind))
    spread = math.hypot(_SPREAD[name], sd)
    candidates = tuple(dict.fromkeys((declared, *UNITS[name])))
    away = {unit: math.log(size * float(to_si(1.0, unit, kind)) / scale / _USUAL[name]) / spread for unit in candidates}
    best, second, *_ = sorted(away, key=lambda unit: abs(away[unit]))
    odds = 0.5 * (away[second] ** 2 - away[best] ** 2)
    against = 0.5 * (away[best] ** 2 - away[declared] ** 2)
    if abs(away[best]) > _NONE_FITS:
        return UnitOdds(None, _USUAL[name] / size, 0.0, best, against)
    return UnitOdds(best, float(to_si(1.0, best, kind)) / scale, odds, second, against)
