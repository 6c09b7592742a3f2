"""The host's side of an ADXRS453: the bits of its faults, and its command (DS-453)."""

from enum import IntFlag


class Fault(IntFlag):
    """Bits of the column ``faults``."""

    CHK = 1
    CST = 2
    PWR = 4
    POR = 8
    NVM = 16
    Q = 32
    PLL = 64


def sensor_command(*, check: bool = False) -> bytes:
    """Ask for the rate, of sequence number 0; `check` starts the self-test, which sets every fault."""
    word = 1 << 29 | int(check) << 1
    return (word | (1 - word.bit_count() % 2)).to_bytes(4, "big")  # an odd number of ones
