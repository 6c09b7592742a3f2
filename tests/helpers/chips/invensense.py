"""What MPU-6000 and MPU-3050 share: registers on I²C, sleep, reset, and a FIFO that loses its place."""

from abc import ABC, abstractmethod
from collections.abc import Mapping

from plumbob.protocols.format import Format
from tests.helpers.chips.bank import Bank, Fifo, Held


class Invensense(ABC):
    """Chip of this maker; a subclass names its addresses.

    Parameters
    ----------
    form : Format
        Burst of the catalogue, its options not settled.
    choices : mapping of str to str
        What its options are after power-up, where it is not their default.
    fifo : int
        Bytes of the FIFO.
    t_ns : int
        Time of power-up, ns.
    """

    DATA: int
    FIFO_COUNT: int
    FIFO_BYTE: int
    INT_STATUS: int
    POWER: int
    READY = 0x01
    OVERFLOW: int
    SLEEP = 0x40
    RESET = 0x80

    def __init__(self, form: Format, choices: Mapping[str, str], fifo: int, t_ns: int) -> None:
        self._loaded = form
        self._choices = dict(choices)
        self.form = form.bind(self._choices)
        self._bank = Bank(form)
        self._fifo = Fifo(fifo)
        self._held = Held()
        self._t_ns = t_ns
        self._ready_ns = t_ns

    def sample(self, values: Mapping[str, float], t_ns: int) -> None:
        """Feel ``gyr.x`` and the others (rad/s), ``temp_c`` (°C), and where it has them ``acc.x`` … (m/s²)."""
        self._t_ns = t_ns
        self._held.feel(values)
        if self._bank[self.POWER] & self.SLEEP or t_ns < self._ready_ns:
            return
        self._bank.put(self.DATA, self._held.encoded(self.form))
        self._raise(self.READY)
        sample = self._to_fifo()
        if sample and self._fifo.push(sample):
            self._raise(self.OVERFLOW)

    def read(self, register: int, count: int = 1) -> bytes:
        """Read bytes; the address goes up by itself, but stays at the FIFO's byte."""
        found = bytearray()
        for _ in range(count):
            found.append(self._byte(register))
            register += register != self.FIFO_BYTE
        return bytes(found)

    def write(self, register: int, data: bytes) -> None:
        """Write bytes; the address goes up by itself."""
        for i, byte in enumerate(data):
            self._bank.put(register + i, bytes([byte]))
            self._wrote(register + i, byte)

    def _byte(self, register: int) -> int:
        if register == self.FIFO_BYTE:
            return self._fifo.take()
        if register in (self.FIFO_COUNT, self.FIFO_COUNT + 1):
            return len(self._fifo) >> (8 if register == self.FIFO_COUNT else 0) & 0xFF
        value = self._bank[register % 256]
        if register == self.INT_STATUS:
            self._bank.put(register, b"\0")
        return value

    def _raise(self, bit: int) -> None:
        self._bank.put(self.INT_STATUS, bytes([self._bank[self.INT_STATUS] | bit]))

    def _set_range(self, option: str, code: int) -> None:
        """Settle an option by the two bits of its code in a register."""
        self._choices[option] = list(self._loaded.options[option].choices)[code & 3]
        self.form = self._loaded.bind(self._choices)

    @abstractmethod
    def _to_fifo(self) -> bytes:
        """What a sample leaves in the FIFO; nothing where it is off."""

    @abstractmethod
    def _wrote(self, register: int, byte: int) -> None:
        """Act on what was written."""
