"""NMEA 0183 sentences of an attitude: HDT, HDG, HDM, PASHR, XDR and ROT.

``$`` talker and formatter, fields with commas, ``*`` and the exclusive or of what stands between, CR LF; talker HE is a
gyrocompass, HC a magnetic compass, II integrated instruments, TI a rate-of-turn indicator. Empty fields are null
fields: not known, or not to be used [NMEA 0183, as in gpsd.gitlab.io/gpsd/NMEA.html].

* HDT: heading, T. HDM: heading, M. HDG: magnetic heading, deviation, E/W, variation, E/W; the deviation is null:
  what a calibration has removed is no longer in the heading.
* ROT: degrees in a minute, negative to port, A or V.
* XDR: A, value, D, name, for PITCH and ROLL, as OpenCPN and pypilot read them: bow up and starboard down are positive.
* PASHR: hhmmss.sss, true heading, T, roll, pitch, heave, standard deviations of roll, pitch and heading, quality, and
  whether the attitude has converged [NovAtel, OEM7, log PASHR]. NovAtel's quality is that of its GNSS; here 1 is an
  attitude to be used and 0 is not. The heave is null: it is not estimated.
"""

from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from typing import Final

from plumbob.core.errors import FrameError, ParameterError
from plumbob.core.text import sentence_checksum
from plumbob.core.units import to_deg
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
    variation = "," if a.declination is None else _east(float(to_deg(a.declination)))
    return sentence(f"HCHDG,{_heading(a, North.MAGNETIC)},,,{variation}")


def _east(value: float) -> str:
    return f"{number(abs(value), 2)},{'W' if value < 0.0 else 'E'}"


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
    """Names of the sentences to send; without any, all that the heading allows.

    Raises
    ------
    ParameterError
        If there is no such sentence.
    FrameError
        If a heading was asked for that counts from another zero.
    """
    if not requested:
        return tuple(name for name in SENTENCES if name != "HDM" and _allowed(name, north, declination))
    names = tuple(dict.fromkeys(name.strip().upper() for name in requested))
    for name in names:
        if name not in SENTENCES:
            raise ParameterError(f"{name} is not a sentence that can be sent; known are {', '.join(SENTENCES)}.")
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
