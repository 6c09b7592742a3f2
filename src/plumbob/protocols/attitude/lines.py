"""Lines of text that say an attitude: NMEA 0183 sentences, TSS1 and JSON.

NMEA 0183: HDT, HDG, HDM, PASHR, XDR and ROT. ``$`` talker and formatter, fields with commas, ``*`` and the exclusive or
of what stands between, CR LF; talker HE is a gyrocompass, HC a magnetic compass, II integrated instruments, TI a rate-
of-turn indicator. Empty fields are null fields: not known, or not to be used [NMEA 0183, as in
gpsd.gitlab.io/gpsd/NMEA.html].

* HDT: heading, T. HDM: heading, M. HDG: magnetic heading, deviation, E/W, variation, E/W; the deviation is null:
  what a calibration has removed is no longer in the heading.
* ROT: degrees in a minute, negative to port, A or V.
* XDR: A, value, D, name, for PITCH and ROLL, as OpenCPN and pypilot read them: bow up and starboard down are positive.
* PASHR: hhmmss.sss, true heading, T, roll, pitch, heave, standard deviations of roll, pitch and heading, quality, and
  whether the attitude has converged [NovAtel, OEM7, log PASHR]. NovAtel's quality is that of its GNSS; here 1 is an
  attitude to be used and 0 is not. The heave is null: it is not estimated.

TSS1, the line of motion sensors for echo sounders: 27 characters, no checksum.
``:XXAAAASMHHHHQMRRRRSMPPPP`` CR LF: XX horizontal acceleration in steps of 3.83 cm/s², AAAA vertical acceleration in
steps of 0.0625 cm/s², both hexadecimal; heave in cm; Q the status; roll and pitch in 0.01° to ±99.99°, positive with
port up and with the bow up [docs.novatel.com/OEM7/Content/SPAN_Logs/TSS1.htm;
support.norwegian-subsea.no/apidocumentation/tss1]. The status is a letter: U unaided, H with a heading, G and F with
GNSS; upper case is settled, lower case is settling [currents.soest.hawaii.edu, UHDAS, MAHRS diagnostics].

The heave is not estimated: its digits are 0, and the letter is `u`, which no echo sounder takes for a settled heave. An
attitude that is not reliable has no line at all, because a line has no other place to say so.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from typing import Any, Final

from plumbob.core import flags
from plumbob.core.errors import FrameError, unknown_name
from plumbob.core.text import sentence_checksum
from plumbob.core.units import to_deg, to_dps
from plumbob.protocols.attitude import AttitudeSample, sent_by
from plumbob.rotations import North


def sentence(body: str) -> bytes:
    """A sentence with its checksum and its end: ``$body*hh`` CR LF."""
    return f"${body}*{sentence_checksum(body)}\r\n".encode("ascii")


def number(value: float | None, places: int, sign: str = "") -> str:
    """Decimal text without a negative zero; empty where the value is not known."""
    return "" if value is None else f"{round(value, places) + 0.0:{sign}.{places}f}"


def circle(value: float | None, places: int = 2) -> str:
    """Text of a heading, ° from 0 to below 360: what would round to 360 is 0."""
    return "" if value is None else number(round(value, places) % 360.0, places)


def _heading(a: AttitudeSample, north: North) -> str:
    return circle(a.heading_deg(north)) if a.reliable else ""


def hdt(a: AttitudeSample) -> bytes:
    """True heading."""
    return sentence(f"HEHDT,{_heading(a, North.TRUE)},T")


def hdm(a: AttitudeSample) -> bytes:
    """Magnetic heading."""
    return sentence(f"HCHDM,{_heading(a, North.MAGNETIC)},M")


def hdg(a: AttitudeSample) -> bytes:
    """Magnetic heading and variation."""
    east = None if a.declination is None else float(to_deg(a.declination))
    variation = "," if east is None else f"{number(abs(east), 2)},{'W' if east < 0.0 else 'E'}"
    return sentence(f"HCHDG,{_heading(a, North.MAGNETIC)},,,{variation}")


def rot(a: AttitudeSample) -> bytes:
    """Rate of turn."""
    rate = a.turn_rate
    per_minute = None if rate is None else 60.0 * float(to_deg(rate))
    return sentence(f"TIROT,{number(per_minute, 2)},{'A' if a.reliable and rate is not None else 'V'}")


def xdr(a: AttitudeSample) -> bytes:
    """Pitch and roll."""
    pitch, roll = (a.pitch_deg, a.roll_deg) if a.reliable else (None, None)
    return sentence(f"IIXDR,A,{number(pitch, 2)},D,PITCH,A,{number(roll, 2)},D,ROLL")


def pashr(a: AttitudeSample) -> bytes:
    """Attitude with standard deviations and quality."""
    heading = circle(a.heading_deg(North.TRUE))
    roll, pitch, yaw = (None if sd is None else min(float(to_deg(sd)), 99.999) for sd in a.sigma)
    sd = f"{number(roll, 3)},{number(pitch, 3)},{number(yaw if heading else None, 3)}"
    good = int(a.reliable)
    angles = f"{number(a.roll_deg, 2, '+')},{number(a.pitch_deg, 2, '+')}"
    return sentence(f"PASHR,{clock(a)},{heading},T,{angles},,{sd},{good},{good}")


def clock(a: AttitudeSample) -> str:
    """Time of day in UTC, hhmmss.sss, cut to the millisecond; empty where UTC is not known."""
    if not a.utc:
        return ""
    seconds, ns = divmod(a.t_ns, 1_000_000_000)
    return f"{datetime.fromtimestamp(seconds, UTC):%H%M%S}.{ns // 1_000_000:03d}"


SENTENCES: Final[Mapping[str, Callable[[AttitudeSample], bytes]]] = {
    "HDT": hdt, "HDG": hdg, "HDM": hdm, "PASHR": pashr, "XDR": xdr, "ROT": rot,
}  # fmt: skip
"""Sentences by the names of their formatters."""
_NORTH: Final = {"HDT": North.TRUE, "HDG": North.MAGNETIC, "HDM": North.MAGNETIC}


def sentences_for(requested: Sequence[str], north: North, declination: float | None) -> tuple[str, ...]:
    """Names of the sentences to send; without any, all that the heading allows."""
    if not requested:
        return tuple(name for name in SENTENCES if name != "HDM" and _allowed(name, north, declination))
    names = tuple(dict.fromkeys(name.strip().upper() for name in requested))
    for name in names:
        if name not in SENTENCES:
            raise unknown_name("sentence to send", name, SENTENCES)
        if _allowed(name, north, declination):
            continue
        if north is North.FREE:
            raise FrameError(
                f"{name} needs a heading, but the heading of this attitude counts from an arbitrary zero. Estimate "
                "with a magnetometer, or leave the sentence out: PASHR, XDR and ROT need no heading."
            )
        raise FrameError(
            f"{name} needs a {_NORTH[name]} heading, but the heading counts from {north} north and the declination is "
            "not known. Give it with declination (--declination)."
        )
    return names


def _allowed(name: str, north: North, declination: float | None) -> bool:
    return name not in _NORTH or sent_by(north, declination, _NORTH[name])


def json_line(a: AttitudeSample) -> bytes:
    """The json_line, with its end.

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
        "sigma_deg": dict(zip(("roll", "pitch", "heading"), map(_rounded_deg, a.sigma), strict=True)),
        "reliable": a.reliable,
        "flags": list(flags.names(a.flags)),
    }
    return (json.dumps(fields, allow_nan=False, separators=(",", ":")) + "\n").encode()


def rounded(value: float | None) -> float | None:
    """To six places, without a negative zero."""
    return None if value is None else round(value, 6) + 0.0


def _rounded_deg(value: float | None) -> float | None:
    return None if value is None else rounded(float(to_deg(value)))


def utc_text(a: AttitudeSample) -> str:
    """UTC in ISO 8601 with all nanoseconds."""
    seconds, ns = divmod(a.t_ns, 1_000_000_000)
    return f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%dT%H:%M:%S}.{ns:09d}Z"


_HORIZONTAL: Final = 0.0383
_VERTICAL: Final = 0.000625
_CENTI: Final = 100.0


def tss1(a: AttitudeSample, heave: float | None = None) -> bytes | None:
    """The tss1; None where the attitude is not known or roll is beyond ±99.99°, or not reliable without a heave.

    `heave`: m, up, where somebody has estimated it; then upper case says that the attitude is reliable.
    """
    roll, pitch = a.roll_deg, a.pitch_deg
    if roll is None or pitch is None or (heave is None and not a.reliable):
        return None
    if abs(round(_CENTI * roll)) > 9999:
        return None
    horizontal, vertical = a.acceleration() or (0.0, 0.0)
    xx = min(round(horizontal / _HORIZONTAL), 0xFF)
    aaaa = max(-0x8000, min(round(vertical / _VERTICAL), 0x7FFF)) & 0xFFFF
    up = 0 if heave is None else max(-9999, min(round(_CENTI * heave), 9999))
    text = f":{xx:02X}{aaaa:04X} {_signed(up)}{_status(a, heave)}{_signed(round(_CENTI * roll))} "
    return f"{text}{_signed(round(_CENTI * pitch))}\r\n".encode("ascii")


def _signed(value: int) -> str:
    return f"{'-' if value < 0 else ' '}{abs(value):04d}"


def _status(a: AttitudeSample, heave: float | None) -> str:
    if heave is None:
        return "u"
    letter = "U" if a.north is North.FREE or a.flags & flags.HEADING_FREE else "H"
    return letter if a.reliable else letter.lower()
