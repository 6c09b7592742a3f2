"""Registers and FIFO of an emulated chip."""

import math
from collections.abc import Mapping
from typing import Final

from plumbob.protocols.encode import encode
from plumbob.protocols.format import Format

_ADDRESSES: Final = 256


class Bank:
    """Bytes of a chip's registers, with the catalogue's values after power-up; 0 where it names none."""

    def __init__(self, form: Format, width: int = 1) -> None:
        self.form = form
        self.width = width
        self.bytes = bytearray(_ADDRESSES)
        self.reset()

    def reset(self) -> None:
        """Values after power-up."""
        self.bytes[:] = bytes(_ADDRESSES)
        for register in self.form.registers:
            if register.reset is not None:
                self.put(register.address, register.reset.to_bytes(self.width, "big"))

    def put(self, address: int, data: bytes) -> None:
        """Store bytes from an address on."""
        self.bytes[address : address + len(data)] = data

    def take(self, address: int, count: int) -> bytes:
        """Bytes from an address on; the address wraps."""
        return bytes(self.bytes[(address + i) % _ADDRESSES] for i in range(count))

    def __getitem__(self, address: int) -> int:
        return self.bytes[address]


class Fifo:
    """First in, first out, of limited size: the oldest bytes go where it is full, wherever samples begin."""

    def __init__(self, size: int) -> None:
        self.size = size
        self._bytes = bytearray()
        self._last = 0

    def __len__(self) -> int:
        return len(self._bytes)

    def push(self, data: bytes) -> bool:
        """Append bytes; return whether older ones had to go."""
        self._bytes += data
        lost = max(0, len(self._bytes) - self.size)
        del self._bytes[:lost]
        return lost > 0

    def take(self) -> int:
        """Oldest byte; the last one again where there is none."""
        if self._bytes:
            self._last = self._bytes.pop(0)
        return self._last

    def clear(self) -> None:
        """Forget everything."""
        self._bytes.clear()


class Held:
    """What a chip feels: the last value of each field, for one that is missing repeats."""

    def __init__(self) -> None:
        self._values: dict[str, float] = {}

    def feel(self, values: Mapping[str, float]) -> dict[str, float]:
        """Take new values, and return all; NaN and what is left out stay as they were."""
        self._values.update({name: value for name, value in values.items() if not math.isnan(value)})
        return self._values

    def encoded(self, form: Format) -> bytes:
        """Frame of the catalogue with these values."""
        return encode(form, {name: [value] for name, value in self._values.items()}).tobytes() if self._values else b""
