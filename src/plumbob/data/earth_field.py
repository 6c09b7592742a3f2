"""The Earth's magnetic field by place and date, of the World Magnetic Model [WMM2025]."""

import calendar
import datetime
import math
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.errors import MissingExtraError, ParameterError
from plumbob.core.findings import Finding, warning
from plumbob.core.units import deg, to_deg
from plumbob.data.imu import BLOCK, ImuData, median, norms

HIGHEST, LOWEST = 850e3, -1e3  # Heights above the ellipsoid between which the model holds, m


class EarthField(NamedTuple):
    """Field at a place."""

    strength: float  # strength, µT
    dip: float  # angle below the horizon, rad
    declination: float  # angle of magnetic north from true north, east positive, rad
    model: str  # name of the model, and the day that it was asked for

    @property
    def description(self) -> str:
        """The field in words."""
        return (
            f"{self.strength:.2f} uT, dip {to_deg(self.dip):.2f} deg, declination {to_deg(self.declination):.2f} deg, "
            f"by {self.model}"
        )


def earth_field_at(latitude: float, longitude: float, height: float, date: str) -> EarthField:
    """Field at a place (WGS 84, rad, m, north and east positive) and day (ISO 8601); the model is of that day."""
    _require_place(latitude, longitude, height)
    year = _decimal_year(date)
    try:
        from pygeomag import GeoMag
    except ImportError as error:
        raise MissingExtraError(
            'the field of a place needs pygeomag: pip install "plumbob[geomag]", or give the strength itself.'
        ) from error
    try:
        model = GeoMag(base_year=int(year))
        field = model.calculate(to_deg(latitude), to_deg(longitude), height / 1e3, year)  # [WMM2025]
        name = f"{model.model} of {model.release_date} for {date}"
    except ValueError as error:
        raise ParameterError(f"no World Magnetic Model is installed for {date}: {error}. Update pygeomag.") from error
    return EarthField(field.f / 1e3, deg(field.i), deg(field.d), name)


def located(imu: ImuData, place: str, *, date: str | None = None) -> tuple[ImuData, EarthField]:
    """Recording with the declination of its place, and the field there: its headings can then be true.

    The place is ``LAT,LON[,HEIGHT]`` in degrees and metres; the date, ISO 8601, counts where the recording does not
    know it.
    """
    field = earth_field_at(*parse_place(place), iso_day(imu.meta.t0_ns) if date is None else date)
    meta = replace(imu.meta, declination=field.declination)
    return imu.each(lambda part: part.corrected(meta=meta)), field


UNLIKE: Final = 0.5  # part by which the measured field may differ: iron of a unit and of rooms, no more


def unlike(imu: ImuData, field: EarthField) -> Finding | None:
    """Say what the magnetometer measures along and across the vertical, where the field of the place is another."""
    if not {"acc", "mag"} <= set(imu.triads):
        return None

    def measured(part: ImuData) -> Floats:
        acc, mag = part.usable("acc"), part.usable("mag")
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.stack([-np.sum(acc * mag, axis=1) / norms(acc), norms(mag)])

    parts = [measured(part) for part in imu.only("acc", "mag").chunks(BLOCK)]
    vertical, strength = map(median, np.concatenate(parts, axis=1))
    if not math.isfinite(vertical):
        return None
    level = math.sqrt(max(strength**2 - vertical**2, 0.0))
    true = field.strength * math.cos(field.dip), field.strength * math.sin(field.dip)
    if math.hypot(level - true[0], vertical - true[1]) < UNLIKE * field.strength:
        return None
    return warning("place.field", level=level, vertical=vertical, place_level=true[0], place_vertical=true[1])


def iso_day(t0_ns: int) -> str:
    """Day, ISO 8601, of a time in ns since 1970; 0 says that it is not known."""
    if t0_ns == 0:
        raise ParameterError(
            "the recording does not say when it was made, and the Earth's field changes from year to year; give the "
            "day as YYYY-MM-DD: --date, or 'date' beside 'place'."
        )
    return datetime.datetime.fromtimestamp(t0_ns // 10**9, datetime.UTC).date().isoformat()


def parse_place(text: str) -> tuple[float, float, float]:
    """Latitude and longitude, rad, and height, m, of ``LAT,LON[,HEIGHT]`` in degrees and metres."""
    try:
        latitude, longitude, *rest = (float(part) for part in text.split(","))
        (height,) = rest or (0.0,)
    except ValueError as error:
        raise ParameterError(
            f"a place must be LAT,LON[,HEIGHT] in degrees and metres, north and east positive, but got '{text}'."
        ) from error
    place = deg(latitude), deg(longitude), height
    _require_place(*place)
    return place


def _require_place(latitude: float, longitude: float, height: float) -> None:
    if not (abs(latitude) <= math.pi / 2 and abs(longitude) <= math.pi and LOWEST <= height <= HIGHEST):
        raise ParameterError(
            f"the World Magnetic Model does not cover latitude {to_deg(latitude):g}°, longitude "
            f"{to_deg(longitude):g}°, height {height:g} m; they go to ±90°, ±180°, and from −1 to 850 km."
        )


def _decimal_year(text: str) -> float:
    try:
        day = datetime.date.fromisoformat(text)
    except ValueError as error:
        raise ParameterError(f"a day must be YYYY-MM-DD, but got '{text}'.") from error
    return day.year + (day.timetuple().tm_yday - 1) / (366 if calendar.isleap(day.year) else 365)
