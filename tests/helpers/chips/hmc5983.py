"""HMC5983 on I²C: gain changes one sample late, channels that overflow one by one, outputs that lock.

Sources: DS-5883L, DS-5883 and i2cdevlib for the lock, DS-5983p for the self-test.
"""

import math
from collections.abc import Mapping
from typing import Final

import numpy as np

from plumbob.core.units import gauss
from plumbob.protocols import catalog
from plumbob.protocols.encode import encode
from plumbob.protocols.unpack import counts_for
from tests.helpers.chips.bank import Bank, Held
from tests.helpers.chips.registers import register_bytes

SELF_TEST: Final = {"mag.x": gauss(1.16), "mag.y": gauss(1.16), "mag.z": gauss(1.08)}
"""What the bias of the self-test adds up to, µT; the field outside is left out, as in the sheet's figures."""

_CRA, _CRB, _MODE, _DATA, _STATUS, _TEMP = 0x00, 0x01, 0x02, 0x03, 0x09, 0x31
_SIX: Final = frozenset(range(_DATA, _DATA + 6))
_SINGLE, _IDLE = 1, 3
_READY, _LOCKED = 1, 2


class Hmc5983:
    """Emulated HMC5983.

    RDY is set by a sample and cleared once all six bytes are read, which is an assumption; so is that the temperature
    is measured with every sample.
    """

    def __init__(self) -> None:
        self._loaded = catalog.load("hmc5983")
        self.form = self._loaded.bind()
        self._bank = Bank(self.form)
        self._held = Held()
        self._seen: set[int] = set()

    def sample(self, values: Mapping[str, float], t_ns: int) -> None:
        """Feel ``mag.x``, ``mag.y``, ``mag.z`` (µT) and ``temp_c`` (°C); `t_ns` matters to no register."""
        felt = dict(self._held.feel(values))
        mode = self._bank[_MODE] & 3
        if mode > _SINGLE:
            return
        if "temp_c" in felt:
            self._bank.put(_TEMP, register_bytes(self.form, "TEMP", felt.pop("temp_c")))
        if self._bank[_CRA] & 3 != 3 and not self._seen:
            self._bank.put(_DATA, self._measured(felt))
            self._bank.put(_STATUS, bytes([_READY]))
        self.form = self._loaded.bind({"gain": list(self._loaded.options["gain"].choices)[self._bank[_CRB] >> 5]})
        if mode == _SINGLE:
            self._bank.put(_MODE, bytes([self._bank[_MODE] | _IDLE]))

    def _measured(self, felt: Mapping[str, float]) -> bytes:
        bias = self._bank[_CRA] & 3
        if bias:
            felt = {name: value if bias == 1 else -value for name, value in SELF_TEST.items()}
        told = {}
        for one in self.form.message().fields:
            value = felt.get(one.name, 0.0)
            beyond = bool(counts_for(one, np.array([value]))[1][0])
            told[one.name] = [math.nan if beyond else value]
        return encode(self.form, told).tobytes()

    def read(self, register: int, count: int = 1) -> bytes:
        """Read bytes; the address goes up by itself."""
        found = bytearray()
        for address in range(register, register + count):
            found.append(self._bank[address % 256])
            if address in _SIX:
                self._saw(address)
        return bytes(found)

    def _saw(self, address: int) -> None:
        """Lock the outputs until all six bytes have been read."""
        self._seen.add(address)
        if self._seen == _SIX:
            self._seen.clear()
            self._bank.put(_STATUS, b"\0")
        else:
            self._bank.put(_STATUS, bytes([self._bank[_STATUS] | _LOCKED]))

    def write(self, register: int, data: bytes) -> None:
        """Write bytes; the address goes up by itself."""
        for address, byte in enumerate(data, register):
            if address not in (_CRA, _CRB, _MODE):
                continue
            self._bank.put(address, bytes([byte]))
            if address == _MODE:
                self._seen.clear()
                self._bank.put(_STATUS, bytes([self._bank[_STATUS] & ~_LOCKED]))
