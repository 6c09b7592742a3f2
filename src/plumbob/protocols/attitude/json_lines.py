"""One JSON object in a line: everything that is known of an attitude, with units in the names; null is not known."""

import json
from datetime import UTC, datetime
from typing import Any

from plumbob.core import flags
from plumbob.core.units import to_deg, to_dps
from plumbob.protocols.attitude import AttitudeSample
from plumbob.rotations import North


def line(a: AttitudeSample) -> bytes:
    """The line, with its end.

    ``q_nb`` is forward-right-down body to NED, wxyz; ``roll_deg`` is positive with port up, ``pitch_deg`` with the bow
    up; ``heading_deg`` counts clockwise from ``north``, and ``sigma_deg`` are standard deviations.
    """
    free = a.north is North.FREE or bool(a.flags & flags.HEADING_FREE)
    heading = None if a.angles is None else round(float(to_deg(a.angles[2])), 6) % 360.0
    fields: dict[str, Any] = {
        "t_s": a.elapsed_ns / 1e9,
        "utc": utc_text(a) if a.utc else None,
        "roll_deg": rounded(a.roll_deg),
        "pitch_deg": rounded(a.pitch_deg),
        "heading_deg": heading,
        "north": str(North.FREE if free else a.north),
        "declination_deg": None if a.declination is None else rounded(float(to_deg(a.declination))),
        "q_nb": None if a.q_nb is None else list(a.q_nb),
        "frame": "NED",
        "body": "FRD",
        "rate_dps": None if a.rates_b is None else [rounded(float(to_dps(rate))) for rate in a.rates_b],
        "acc_m_s2": None if a.acc_b is None else [rounded(value) for value in a.acc_b],
        "sigma_deg": dict(zip(("roll", "pitch", "heading"), map(_degrees, a.sigma), strict=True)),
        "reliable": a.reliable,
        "flags": list(flags.names(a.flags)),
    }
    return (json.dumps(fields, allow_nan=False, separators=(",", ":")) + "\n").encode()


def rounded(value: float | None) -> float | None:
    """To six places, without a negative zero."""
    return None if value is None else round(value, 6) + 0.0


def _degrees(value: float | None) -> float | None:
    return None if value is None else rounded(float(to_deg(value)))


def utc_text(a: AttitudeSample) -> str:
    """UTC in ISO 8601 with all nanoseconds."""
    seconds, ns = divmod(a.t_ns, 1_000_000_000)
    return f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%dT%H:%M:%S}.{ns:09d}Z"
