"""The host's side of an ADIS16350 or ADIS16355: its commands, its poll, and which register each reply is from.

All facts DS-1635x; the order of the poll is ours, for the chip has no burst.
"""

from typing import Final

import numpy as np

from plumbob.core.errors import ParameterError
from plumbob.protocols.format import Format
from tests.helpers.chips.registers import Answers, paired, transfers

POLLED: Final = (0x04, 0x06, 0x08, 0x0A, 0x0C, 0x0E, 0x10, 0x12, 0x02, 0x16)
"""Registers in the order of the catalogue's frame."""


def read_command(address: int) -> bytes:
    """Ask for the 16 bits of a register, at its even address."""
    return bytes([_address(address), 0])


def write_command(address: int, value: int) -> bytes:
    """Write one byte: the lower at the even address, the upper at the odd one."""
    if not 0 <= value <= 0xFF:
        raise ParameterError(f"value must have 8 bits, but it is {value}; a register takes two writes.")
    return bytes([0x80 | _address(address), value])


def poll_commands() -> bytes:
    """Commands of one poll: ten reads, and one more whose reply is the tenth word.

    The frame of the catalogue is what comes in, without its first word.
    """
    return b"".join(read_command(address) for address in (*POLLED, POLLED[0]))


def register_readings(form: Format, commands: bytes, replies: bytes) -> Answers:
    """Registers that were read: a reply comes one transfer after its command and does not carry the address.

    Parameters
    ----------
    form : Format
        The catalogue's, with its range settled.
    commands, replies : bytes
        What went out and came in, 2 bytes for each transfer.

    Raises
    ------
    DecodeError
        If they are not whole transfers, equally many.
    """
    sent, words = transfers(commands, replies, 2)
    return paired(form, np.where(sent >> 15, -1, sent >> 8 & 0x3F), words)


def _address(address: int) -> int:
    if not 0 <= address <= 0x3F:
        raise ParameterError(f"address must have six bits, but it is {address}.")
    return address
