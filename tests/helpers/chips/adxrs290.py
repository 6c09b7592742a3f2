"""ADXRS290 on SPI: 100 ms to start, a high-pass that removes a constant rate, 12 bits of temperature (K-290)."""

import math
from collections.abc import Mapping
from typing import Final

from plumbob.protocols import catalog
from tests.helpers.chips.bank import Bank, Held

START_NS: Final = 100_000_000
"""From standby to measurement, ns."""

_DATA, _POWER, _FILTER, _READY = 0x08, 0x10, 0x11, 0x12
_HIGH_PASS: Final = (0.0, 0.011, 0.022, 0.044, 0.087, 0.175, 0.35, 0.7, 1.4, 2.8, 11.3)
"""Corners by FILTER bits 7:4, Hz; codes beyond are taken for none, which is not in any source."""


class Adxrs290:
    """Emulated ADXRS290; its outputs stay as they were in standby and while it starts, which is an assumption.

    Parameters
    ----------
    t_ns : int
        Time of power-up, ns.
    """

    def __init__(self, t_ns: int = 0) -> None:
        self.form = catalog.load("adxrs290").bind()
        self._bank = Bank(self.form)
        self._held = Held()
        self._t_ns = t_ns
        self._since: int | None = None
        self._unread = False
        self._passed: dict[str, tuple[float, float]] = {}

    @property
    def sync(self) -> bool:
        """Level of the SYNC pin: whether there are data that nobody has read."""
        return self._bank[_READY] & 3 == 1 and self._unread

    def sample(self, values: Mapping[str, float], t_ns: int) -> None:
        """Feel ``gyr.x``, ``gyr.y`` (rad/s) and ``temp_c`` (°C)."""
        dt = 1e-9 * (t_ns - self._t_ns)
        self._t_ns = t_ns
        if self._since is None or t_ns - self._since < START_NS:
            return
        felt = {name: self._high_pass(name, v, dt) if name != "temp_c" else v for name, v in values.items()}
        self._held.feel(felt)
        data = self._held.encoded(self.form)
        self._bank.put(_DATA, data if self._bank[_POWER] & 1 else data[:4])
        self._unread = True

    def _high_pass(self, name: str, rate: float, dt: float) -> float:
        corner = dict(enumerate(_HIGH_PASS)).get(self._bank[_FILTER] >> 4, 0.0)
        if not corner or math.isnan(rate):
            return rate
        before, passed = self._passed.get(name, (0.0, 0.0))
        passed = math.exp(-2.0 * math.pi * corner * dt) * (passed + rate - before)
        self._passed[name] = rate, passed
        return passed

    def transfer(self, data: bytes) -> bytes:
        """One transfer: the first byte is the command, bit 7 reads, and the address goes up by itself."""
        if not data:
            return b""
        address, count = data[0] & 0x7F, len(data) - 1
        if not data[0] & 0x80:
            for i, byte in enumerate(data[1:]):
                self._write(address + i, byte)
            return bytes(len(data))
        if address < _DATA + 6 and address + count > _DATA:
            self._unread = False
        return b"\0" + self._bank.take(address, count)

    def _write(self, address: int, byte: int) -> None:
        if address not in (_POWER, _FILTER, _READY):
            return
        if address == _POWER and not byte & 2:
            self._since = None
        elif address == _POWER and self._since is None:
            self._since = self._t_ns
        self._bank.put(address, bytes([byte]))
