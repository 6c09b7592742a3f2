"""TSS1, the line of motion sensors for echo sounders: 27 characters, no checksum.

``:XXAAAASMHHHHQMRRRRSMPPPP`` CR LF: XX horizontal acceleration in steps of 3.83 cm/s², AAAA vertical acceleration in
steps of 0.0625 cm/s², both hexadecimal; heave in cm; Q the status; roll and pitch in 0.01° to ±99.99°, positive with
port up and with the bow up [docs.novatel.com/OEM7/Content/SPAN_Logs/TSS1.htm;
support.norwegian-subsea.no/apidocumentation/tss1]. The status is a letter: U unaided, H with a heading, G and F with
GNSS; upper case is settled, lower case is settling [currents.soest.hawaii.edu, UHDAS, MAHRS diagnostics].

The heave is not estimated: its digits are 0, and the letter is `u`, which no echo sounder takes for a settled heave. An
attitude that is not reliable has no line at all, because a line has no other place to say so.
"""

from typing import Final

from plumbob.core import flags
from plumbob.protocols.attitude import AttitudeSample
from plumbob.rotations import North

_HORIZONTAL: Final = 0.0383
_VERTICAL: Final = 0.000625
_CENTI: Final = 100.0


def line(a: AttitudeSample, heave: float | None = None) -> bytes | None:
    """The line; None where the attitude is not known or roll is beyond ±99.99°.

    Parameters
    ----------
    a : AttitudeSample
        The attitude; one that is not reliable has a line only beside a heave.
    heave : float, optional
        m, up is positive, where somebody has estimated it; then upper case says that the attitude is reliable.
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
