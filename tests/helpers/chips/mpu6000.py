"""MPU-6000 and MPU-6050 on I²C: asleep after power-up, FIFO of 1024 bytes without marks (DS-6050, ArduPilot)."""

from plumbob.protocols import catalog
from tests.helpers.chips.fifo import SOURCES
from tests.helpers.chips.invensense import Invensense

_GYRO_CONFIG, _ACCEL_CONFIG, _FIFO_EN, _USER_CTRL = 0x1B, 0x1C, 0x23, 0x6A
_FIFO_ON, _FIFO_RESET = 0x40, 0x04


class Mpu6000(Invensense):
    """Emulated MPU-6000.

    Parameters
    ----------
    silicon : str
        Choice of the catalogue's option: revisions C4 and C5 have half the accelerometer sensitivity.
    t_ns : int
        Time of power-up, ns.
    """

    DATA = 0x3B
    FIFO_COUNT = 0x72
    FIFO_BYTE = 0x74
    INT_STATUS = 0x3A
    POWER = 0x6B
    OVERFLOW = 0x10

    def __init__(self, silicon: str = "later", t_ns: int = 0) -> None:
        super().__init__(catalog.load("mpu6000"), {"silicon": silicon}, 1024, t_ns)

    def _to_fifo(self) -> bytes:
        if not self._bank[_USER_CTRL] & _FIFO_ON:
            return b""
        names = {name for bit, name in SOURCES["mpu6000"].items() if self._bank[_FIFO_EN] & bit}
        return b"".join(
            self._bank.take(self.DATA + one.at, one.size)
            for one in self.form.message().fields
            if one.name in names or one.triad in names
        )

    def _wrote(self, register: int, byte: int) -> None:
        if register == self.POWER and byte & self.RESET:
            self._bank.reset()
            self._fifo.clear()
        elif register == _USER_CTRL and byte & _FIFO_RESET:
            self._fifo.clear()
            self._bank.put(register, bytes([byte & ~_FIFO_RESET]))
        if register in (self.POWER, _GYRO_CONFIG, _ACCEL_CONFIG):
            self._set_range("gyr_range", self._bank[_GYRO_CONFIG] >> 3)
            self._set_range("acc_range", self._bank[_ACCEL_CONFIG] >> 3)
