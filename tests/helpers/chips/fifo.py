"""What lies in the FIFO of an MPU-6000 or MPU-3050: the format that its register FIFO_EN makes of the burst."""

from dataclasses import replace
from typing import Final

from plumbob.core.errors import ParameterError
from plumbob.protocols.field import Field
from plumbob.protocols.format import Format, Message

FOOTER: Final = 0x01
"""Bit of the MPU-3050's FIFO_EN that adds two bytes after each sample (K-3050)."""

SOURCES: Final = {
    "mpu6000": {0x80: "temp_c", 0x40: "gyr.x", 0x20: "gyr.y", 0x10: "gyr.z", 0x08: "acc"},
    "mpu3050": {0x80: "temp_c", 0x40: "gyr.x", 0x20: "gyr.y", 0x10: "gyr.z"},
}
"""Fields or triads by the bits of FIFO_EN (DS-6050; K-3050)."""


def fifo_format(form: Format, fifo_en: int, *, later: bool = False) -> Format:
    """Format of one sample in the FIFO: fields that are on, in ascending order of registers.

    Parameters
    ----------
    form : Format
        MPU-6000 or MPU-3050.
    fifo_en : int
        Register FIFO_EN.
    later : bool
        Whether it is a read after the first, of an MPU-3050 with the footer on: it begins with the footer of the
        sample before, because the FIFO must not be read empty.

    Raises
    ------
    ParameterError
        If the device has no FIFO here, or the register names nothing, or a source that the burst does not have.
    """
    if form.name not in SOURCES:
        raise ParameterError(f"{form.name} has no FIFO in the catalogue; those that have are {', '.join(SOURCES)}.")
    footer = form.name == "mpu3050" and bool(fifo_en & FOOTER)
    sources = SOURCES[form.name]
    names = {name for bit, name in sources.items() if fifo_en & bit}
    rest = fifo_en & ~sum(sources) & ~(FOOTER if footer else 0)
    if rest or not names:
        known = ", ".join(f"{bit:02X} ({name})" for bit, name in sources.items())
        known += " and 01 (footer)" if form.name == "mpu3050" else ""
        raise ParameterError(f"FIFO_EN of {form.name} must be made of {known}, but it is {fifo_en:02X}.")
    head = [Field("footer", 0, "u16", 2, role="status")] if footer and later else []
    return _laid_out(form, head, [f for f in form.message().fields if f.name in names or f.triad in names])


def _laid_out(form: Format, head: list[Field], kept: list[Field]) -> Format:
    """Fields without gaps, behind those of the head."""
    at = sum(f.size for f in head)
    fields = list(head)
    for one in kept:
        fields.append(replace(one, at=at))
        at += one.size
    message = Message(form.name, at, tuple(fields), "one sample in the FIFO")
    return replace(form, framing=replace(form.framing, length=at), messages=(message,))
