"""ADIS16355 on SPI: words one frame late, ND that a read clears, EA that follows STATUS, counts that follow the range.

All facts DS-1635x.
"""

from collections.abc import Mapping
from typing import Final, Literal

from plumbob.core.errors import ShapeError
from plumbob.protocols import catalog
from tests.helpers.chips.bank import Bank, Held
from tests.helpers.chips.registers import register_bytes

START_NS: Final = 150_000_000
"""From power-up until it measures, ns."""

SLEEP_NS: Final = 500_000_000
"""One count of SLP_CNT, ns."""

OUTPUTS: Final = {
    0x02: "supply_v", 0x04: "gyr.x", 0x06: "gyr.y", 0x08: "gyr.z", 0x0A: "acc.x", 0x0C: "acc.y", 0x0E: "acc.z",
    0x10: "temp_c", 0x12: "temp_y_c", 0x14: "temp_z_c", 0x16: "aux_v",
}  # fmt: skip
_SENS, _SLEEP, _STATUS, _COMMAND = 0x38, 0x3A, 0x3C, 0x3E
_RANGES: Final = {4: "300 deg/s", 2: "150 deg/s", 1: "75 deg/s"}
_NEW, _ERROR, _RESET = 0x8000, 0x4000, 0x80


class Adis16355:
    """Emulated ADIS16355.

    Parameters
    ----------
    clears : {'register', 'all'}
        Whether a read clears ND of its own register or of all; the sheet does not say.
    t_ns : int
        Time of power-up, ns.
    """

    def __init__(self, clears: Literal["register", "all"] = "register", t_ns: int = 0) -> None:
        self._loaded = catalog.load("adis16355")
        self.form = self._loaded.bind()
        self.alarms = 0
        """Bits of STATUS that hold now."""
        self._clears = clears
        self._bank = Bank(self.form, 2)
        self._held = Held()
        self._new: set[int] = set()
        self._ready_ns = t_ns + START_NS
        self._t_ns = t_ns
        self._reply = b"\0\0"

    def sample(self, values: Mapping[str, float], t_ns: int) -> None:
        """Feel ``gyr.x`` … (rad/s), ``acc.x`` … (m/s²), ``temp_c`` (°C, for all three), ``supply_v``, ``aux_v``."""
        self._t_ns = t_ns
        felt = {"temp_c": 25.0, "supply_v": 5.0, **self._held.feel(values)}
        if t_ns < self._ready_ns:
            return
        for address, name in OUTPUTS.items():
            like = felt["temp_c"] if name.startswith("temp") else 0.0
            self._bank.put(address, register_bytes(self.form, address, felt.get(name, like)))
        self._new = set(OUTPUTS)

    def transfer(self, data: bytes) -> bytes:
        """Frames of 2 bytes, one behind the other; what comes back answers the frame before each."""
        if len(data) % 2:
            raise ShapeError(f"an ADIS16355 transfers frames of 2 bytes, but {len(data)} bytes came.")
        return b"".join(self._frame(data[i], data[i + 1]) for i in range(0, len(data), 2))

    def _frame(self, first: int, second: int) -> bytes:
        reply = self._reply
        address = first & 0x3F
        if first & 0x80:
            self._write(address, second)
            self._reply = b"\0\0"
        else:
            self._reply = self._read(address & ~1)
        return reply

    def _read(self, address: int) -> bytes:
        if address == _STATUS:
            return self.alarms.to_bytes(2, "big")
        word = int.from_bytes(self._bank.take(address, 2), "big")
        if address in OUTPUTS:
            word |= (_NEW if address in self._new else 0) | (_ERROR if self.alarms else 0)
            self._new -= {address} if self._clears == "register" else set(OUTPUTS)
        return word.to_bytes(2, "big")

    def _write(self, address: int, byte: int) -> None:
        if address < 0x1A or address & ~1 == _STATUS:
            return
        if address == _COMMAND:
            self._command(byte)
            return
        self._bank.put(address ^ 1, bytes([byte]))  # words are kept with the upper byte first
        if address == _SENS + 1 and byte in _RANGES:
            self.form = self._loaded.bind({"gyr_range": _RANGES[byte]})
        if address == _SLEEP:
            self._ready_ns = max(self._ready_ns, self._t_ns + byte * SLEEP_NS)

    def _command(self, byte: int) -> None:
        if byte & _RESET:
            self._bank.reset()
            self._new.clear()
            self.form = self._loaded.bind()
            self._ready_ns = self._t_ns + START_NS
