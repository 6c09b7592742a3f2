"""MPU-3050 on I²C: FIFO of 512 bytes that is read with 8, then with 10 bytes, because of its footer (K-3050)."""

from typing import Final

from plumbob.protocols import catalog
from tests.helpers.chips.fifo import FOOTER, SOURCES
from tests.helpers.chips.invensense import Invensense

START_NS: Final = 100_000_000
"""Longest time after power-up until it measures, ns."""

SETTLE_NS: Final = 50_000_000
"""Time after a change of range or filter, ns; the outputs stay until then, which is an assumption."""

FOOTER_BYTES: Final = b"\x00\x00"
"""What the footer holds is in no source."""

_FIFO_EN, _DLPF_FS, _USR_CTRL = 0x12, 0x16, 0x3D
_FIFO_ON, _FIFO_RESET = 0x40, 0x02


class Mpu3050(Invensense):
    """Emulated MPU-3050.

    It is awake after power-up, and an empty FIFO repeats its last byte as in the MPU-6000: both are assumptions.

    Parameters
    ----------
    t_ns : int
        Time of power-up, ns.
    """

    DATA = 0x1B
    FIFO_COUNT = 0x3A
    FIFO_BYTE = 0x3C
    INT_STATUS = 0x1A
    POWER = 0x3E
    OVERFLOW = 0x80

    def __init__(self, t_ns: int = 0) -> None:
        super().__init__(catalog.load("mpu3050"), {}, 512, t_ns)
        self._ready_ns = t_ns + START_NS

    def _to_fifo(self) -> bytes:
        if not self._bank[_USR_CTRL] & _FIFO_ON:
            return b""
        enabled = self._bank[_FIFO_EN]
        names = {name for bit, name in SOURCES["mpu3050"].items() if enabled & bit}
        parts = [self._bank.take(self.DATA + f.at, f.size) for f in self.form.message().fields if f.name in names]
        return b"".join(parts) + (FOOTER_BYTES if enabled & FOOTER else b"")

    def _wrote(self, register: int, byte: int) -> None:
        if register == self.POWER and byte & self.RESET:
            self._bank.reset()
            self._fifo.clear()
            self._ready_ns = self._t_ns + START_NS
        elif register == _USR_CTRL and byte & _FIFO_RESET:
            self._fifo.clear()
            self._bank.put(register, bytes([byte & ~_FIFO_RESET]))
        elif register == _DLPF_FS:
            self._ready_ns = max(self._ready_ns, self._t_ns + SETTLE_NS)
        if register in (self.POWER, _DLPF_FS):
            self._set_range("gyr_range", self._bank[_DLPF_FS] >> 3)
