"""The host's side of an ADXRS453: its commands, and which register each reply is from (all facts DS-453)."""

from enum import IntFlag

import numpy as np

from plumbob.core.errors import ParameterError
from plumbob.protocols import catalog
from plumbob.protocols.decode import decode
from tests.helpers.chips.registers import Answers, paired, transfers


class Fault(IntFlag):
    """Bits of the column ``faults``."""

    CHK = 1
    CST = 2
    PWR = 4
    POR = 8
    NVM = 16
    Q = 32
    PLL = 64


def sensor_command(sq: int = 0, *, check: bool = False) -> bytes:
    """Ask for the rate.

    Parameters
    ----------
    sq : int
        Sequence number 0 to 7, which the reply repeats.
    check : bool
        Whether the self-test shall run, which sets every fault.

    Raises
    ------
    ParameterError
        If the number is out of range.
    """
    if not 0 <= sq <= 7:
        raise ParameterError(f"sq must be from 0 to 7, but it is {sq}.")
    return _odd((sq & 3) << 30 | 1 << 29 | (sq >> 2) << 28 | int(check) << 1)


def read_command(address: int) -> bytes:
    """Ask for the 16 bits of a register; the address has nine bits."""
    return _odd(0b100 << 29 | _address(address) << 17)


def write_command(address: int, value: int) -> bytes:
    """Write 16 bits into a register."""
    if not 0 <= value <= 0xFFFF:
        raise ParameterError(f"value must have 16 bits, but it is {value}.")
    return _odd(0b010 << 29 | _address(address) << 17 | value << 1)


def register_readings(commands: bytes, replies: bytes) -> Answers:
    """Registers that were read: a reply comes one transfer after its command and does not carry the address.

    Parameters
    ----------
    commands, replies : bytes
        What went out and came in, 4 bytes for each transfer.

    Raises
    ------
    DecodeError
        If they are not whole transfers, equally many.
    """
    sent, _ = transfers(commands, replies, 4)
    words = np.full(sent.size, -1, dtype=np.int64)
    found = decode(replies, catalog.load("adxrs453"))[0].get("read")
    if found is not None:
        words[found.start // 4] = found.columns["data"].astype(np.int64)
    asked = np.where(sent >> 29 == 0b100, sent >> 17 & 0x1FF, -1)
    return paired(catalog.load("adxrs453"), asked, words)


def _address(address: int) -> int:
    if not 0 <= address <= 0x1FF:
        raise ParameterError(f"address must have nine bits, but it is {address}.")
    return address


def _odd(word: int) -> bytes:
    """Set bit 0 so that the number of ones is odd."""
    return (word | (1 - word.bit_count() % 2)).to_bytes(4, "big")
