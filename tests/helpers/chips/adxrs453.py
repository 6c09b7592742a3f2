"""ADXRS453 on SPI: replies one frame late, faults that stay until read, the self-test of its start (DS-453)."""

from enum import IntFlag

from plumbob.protocols.encode import encode
from plumbob.protocols.format_toml import find_format

START_NS = 100_000_000  # from power-up until the rate is valid
DECAY_NS = 50_000_000  # until the faults of the self-test are gone after its end
INVALID, VALID, TESTED = 0, 1, 2


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


class Adxrs453:
    """Rate and status are latched with a command and shifted out with the next."""

    def __init__(self, t_ns=0):
        self.form = find_format("adxrs453").bind()
        self.faults = Fault(0)  # conditions that hold now
        self.rate, self.power_ns, self.t_ns = 0.0, t_ns, t_ns
        self.latched, self.tested, self.test_until = Fault(0), False, -1.0
        self.reply = bytes.fromhex("00000001")  # the first of all

    def sample(self, values, t_ns):
        """Feel ``gyr.z`` (rad/s)."""
        self.rate, self.t_ns = values["gyr.z"], t_ns

    def transfer(self, data):
        """One frame of 4 bytes, which asks for the rate; what comes back answers the frame before."""
        if int.from_bytes(data, "big") & 2:
            self.test_until = float("inf")
        elif self.test_until == float("inf"):
            self.test_until = self.t_ns + DECAY_NS
        testing = self.t_ns < self.test_until
        holds = Fault(0x7F) if testing else self.faults
        tested, faults = self.tested or testing, self.latched | holds  # what holds no more is told once more
        self.tested, self.latched = testing, holds
        invalid = faults & Fault.PLL or self.t_ns - self.power_ns < START_NS
        status = TESTED if tested else INVALID if invalid else VALID
        columns = {"gyr.z": [self.rate], "st": [status], "sq": [0], "faults": [int(faults)]}
        answer, self.reply = self.reply, encode(self.form, columns, message="sensor").tobytes()
        return answer
