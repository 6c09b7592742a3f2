"""ADXRS453 on SPI: replies one frame late, faults that stay until read, the self-test of its start (DS-453)."""

from collections.abc import Mapping
from typing import Final

from plumbob.core.errors import ShapeError
from plumbob.protocols import catalog
from plumbob.protocols.encode import encode
from tests.helpers.chips.bank import Bank, Held
from tests.helpers.chips.registers import register_bytes, register_of
from tests.helpers.chips.words_adxrs453 import Fault

START_NS: Final = 100_000_000
"""From power-up until the rate is valid, ns."""

DECAY_NS: Final = 50_000_000
"""Until the faults of the self-test are gone after its end, ns."""

FIRST_REPLY: Final = bytes.fromhex("00000001")
_ALL: Final = Fault(0x7F)
_INVALID, _VALID, _TESTED = 0, 1, 2


class Adxrs453:
    """Emulated ADXRS453.

    Rate and status are latched with the command and shifted out with the next. A command of wrong parity is refused
    with the bit SPI, one that is none or names an unknown register with RE.

    Parameters
    ----------
    t_ns : int
        Time of power-up, ns.
    """

    def __init__(self, t_ns: int = 0) -> None:
        self.form = catalog.load("adxrs453").bind()
        self.faults = Fault(0)
        """Conditions that hold now."""
        self.supply = 0
        """Bits FAIL, AMP, OV, UV of FAULT1 that hold now, as a number up to 15."""
        self._bank = Bank(self.form, 2)
        self._held = Held()
        self._values: dict[str, float] = {"gyr.z": 0.0}
        self._power_ns = self._t_ns = t_ns
        self._latched = Fault(0)
        self._tested = False
        self._test_until: float = -1.0
        self._reply = FIRST_REPLY

    def sample(self, values: Mapping[str, float], t_ns: int) -> None:
        """Feel ``gyr.z`` (rad/s) and ``temp_c`` (°C)."""
        self._t_ns = t_ns
        self._values = {"gyr.z": 0.0, **self._held.feel(values)}

    def transfer(self, data: bytes) -> bytes:
        """Frames of 4 bytes, one behind the other; what comes back answers the frame before each."""
        if len(data) % 4:
            raise ShapeError(f"an ADXRS453 transfers frames of 4 bytes, but {len(data)} bytes came.")
        return b"".join(self._frame(data[i : i + 4]) for i in range(0, len(data), 4))

    def _frame(self, data: bytes) -> bytes:
        command, reply = int.from_bytes(data, "big"), self._reply
        kind = command >> 29
        if command.bit_count() % 2 == 0:
            self._reply = self._refused("spi")
        elif kind & 1:
            self._reply = self._rate(command)
        elif kind == 0b100:
            self._reply = self._read(command >> 17 & 0x1FF)
        elif kind == 0b010:
            self._reply = self._encoded("write", data=command >> 1 & 0xFFFF)
        else:
            self._reply = self._refused("re")
        return reply

    def _rate(self, command: int) -> bytes:
        check = bool(command & 2)
        if check:
            self._test_until = float("inf")
        elif self._test_until == float("inf"):
            self._test_until = self._t_ns + DECAY_NS
        tested, faults = self._told()
        status = _TESTED if tested else _VALID
        if not tested and (faults & Fault.PLL or self._t_ns - self._power_ns < START_NS):
            status = _INVALID
        sq = (command >> 28 & 1) << 2 | command >> 30
        columns: dict[str, list[float]] = {
            "gyr.z": [self._values["gyr.z"]],
            "st": [status],
            "sq": [sq],
            "faults": [int(faults)],
        }
        return encode(self.form, columns, message="sensor").tobytes()

    def _told(self) -> tuple[bool, Fault]:
        """Self-test and faults that are told now; what holds no more is then forgotten."""
        testing = self._t_ns < self._test_until
        holds = _ALL if testing else self.faults
        told = (self._tested or testing), self._latched | holds
        self._tested, self._latched = testing, holds
        return told

    def _read(self, address: int) -> bytes:
        if not any(r.address == address & ~1 and r.name != "DNC" for r in self.form.registers):
            return self._refused("re")
        return self._encoded("read", data=int.from_bytes(self._word(address & ~1), "big"))

    def _word(self, address: int) -> bytes:
        name = register_of(self.form, address).name
        if name == "RATE":
            return register_bytes(self.form, name, min(max(self._values["gyr.z"], -self._most), self._most))
        if name == "TEM":
            return register_bytes(self.form, name, self._values.get("temp_c", 25.0))
        if name == "FAULT":
            return (self.supply << 8 | int(self._told()[1]) << 1).to_bytes(2, "big")
        return self._bank.take(address, 2)

    @property
    def _most(self) -> float:
        one = self.form.message("sensor").fields[0]
        return (one.clip or one.limits)[1] * one.scale

    def _refused(self, why: str) -> bytes:
        return self._encoded("error", **{why: 1, "faults": int(self._latched | self.faults)})

    def _encoded(self, message: str, **counts: int) -> bytes:
        return encode(self.form, {name: [count] for name, count in counts.items()}, message=message).tobytes()
