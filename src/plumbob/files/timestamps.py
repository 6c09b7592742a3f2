"""Dates and clock times in text, by ISO 8601: ``2024-05-01T12:30:05.120+08:00``.

As loggers write it: a blank for the T, slashes for the hyphens, one digit for two, a comma in the fraction, a clock
time without a date. The year comes first; a date that begins with the day or the month could be read in two ways.
"""

import re
from collections.abc import Sequence
from datetime import date
from functools import cache
from typing import Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.errors import DecodeError, excerpt

FORM: Final = "ISO 8601"
_DAY_NS: Final = 86_400 * 10**9
_EPOCH: Final = date(1970, 1, 1).toordinal()
_DATE: Final = r"(\d{4})([-/])(\d{1,2})\2(\d{1,2})"
_CLOCK: Final = r"(\d{1,2}):(\d\d):(\d\d)(?:[.,](\d+))?"
_ZONE: Final = r"(Z|UTC|[+-]\d\d(?::?\d\d)?)"
_STAMP: Final = re.compile(rf"(?:{_DATE}(?:T| +))?{_CLOCK} *{_ZONE}?", re.IGNORECASE)
_CLOCKLIKE: Final = re.compile(r"\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}([T ].*)?|.*\d{1,2}:\d\d:\d\d.*")


def is_clocklike(cell: str) -> bool:
    """Tell whether a cell is a date or a clock time in some form, readable here or not."""
    return _CLOCKLIKE.fullmatch(cell.strip()) is not None


def is_stamp(cell: str) -> bool:
    """Tell whether a cell is a clock time, with a date or without, that can be read here."""
    return _STAMP.fullmatch(cell.strip()) is not None


def has_zone(cell: str) -> bool:
    """Tell whether a time that can be read here names its zone."""
    match = _STAMP.fullmatch(cell.strip())
    return match is not None and match[9] is not None


def zone_ns(text: str) -> int:
    """What a zone is ahead of UTC, ns, from ``"UTC"``, ``"Z"`` or ``"+08:00"``.

    Raises
    ------
    DecodeError
        If it is none of these.
    """
    if not re.fullmatch(_ZONE, text.strip(), re.IGNORECASE):
        raise DecodeError(f"{excerpt(text)} is not a zone; write 'UTC' or what the clock is ahead of it, as '+08:00'.")
    return _ahead(text.strip())


class StampError(DecodeError):
    """A cell that cannot be read; `row` counts from 0."""

    def __init__(self, what: str, row: int = 0) -> None:
        super().__init__(what)
        self.row = row


def seconds_of(columns: Sequence[Sequence[str]], zone: int | None) -> tuple[Floats, int]:
    """Time since the first row, s, by one column of stamps or by two of dates and clock times, and the start.

    The start is in ns since 1970 (UTC), or 0 where that is not known. Errors as in `stamps_ns`.
    """
    times, absolute = stamps_ns([" ".join(cells) for cells in zip(*columns, strict=True)], zone)
    return np.array([ns - times[0] for ns in times]) / 1e9, times[0] if absolute else 0


def stamps_ns(cells: Sequence[str], zone: int | None) -> tuple[list[int], bool]:
    """Time of each cell, ns.

    Parameters
    ----------
    cells : sequence of str
        Dates with clock times, or clock times alone.
    zone : int or None
        What the clock is ahead of UTC, ns, where the cells do not say so.

    Returns
    -------
    times : list of int
        Since 1970 (UTC) where that is known, or since some midnight of the clock, ns.
    absolute : bool
        Whether they count from 1970.

    Raises
    ------
    StampError
        If a cell is not a clock time, or some have a date or a zone and others do not.
    """
    times: list[int] = []
    first: tuple[bool, bool] | None = None
    for row, cell in enumerate(cells):
        ns, has = _parsed(row, cell)
        first = first or has
        if has != first:
            raise StampError(f"{excerpt(cell)} has a date or a zone and the first time has none, or the reverse.", row)
        times.append(ns)
    dated, zoned = first or (False, False)
    if zoned and zone is not None:
        raise StampError(f"{excerpt(cells[0])} names its zone itself; remove time.zone.", 0)
    absolute = dated and (zoned or zone is not None)
    return [ns - (zone or 0) for ns in times], absolute


def _parsed(row: int, cell: str) -> tuple[int, tuple[bool, bool]]:
    match = _STAMP.fullmatch(cell.strip())
    if match is None:
        raise StampError(f"{excerpt(cell)} is not a time in the form of {FORM}, as 2024-05-01T12:30:05.120Z.", row)
    year, _, month, day, hour, minute, second, fraction, zone = match.groups()
    try:
        days = _days(year, month, day) if year else 0
    except ValueError:
        raise StampError(f"{excerpt(cell)} has no such day.", row) from None
    if int(hour) > 23 or int(minute) > 59 or int(second) > 59:
        raise StampError(f"{excerpt(cell)} has no such hour, minute or second.", row)
    seconds = int(hour) * 3600 + int(minute) * 60 + int(second)
    ns = days * _DAY_NS + seconds * 10**9 + (int(f"{fraction:0<9.9}") if fraction else 0)
    return ns - (_ahead(zone) if zone else 0), (year is not None, zone is not None)


@cache
def _days(year: str, month: str, day: str) -> int:
    return date(int(year), int(month), int(day)).toordinal() - _EPOCH


@cache
def _ahead(zone: str) -> int:
    if zone.upper() in {"Z", "UTC"}:
        return 0
    digits = zone[1:].replace(":", "")
    minutes = int(digits[:2]) * 60 + int(digits[2:] or 0)
    return (-minutes if zone[0] == "-" else minutes) * 60 * 10**9
