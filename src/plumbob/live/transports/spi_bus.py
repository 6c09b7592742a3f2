"""Chips on an SPI bus, polled through spidev."""

from collections.abc import Callable, Sequence
from typing import Protocol, Unpack

from plumbob.core.errors import MissingExtraError, ParameterError
from plumbob.live.transports.polled import Polled
from plumbob.live.transports.transport import NoLine, Pace


class SpiBus(Protocol):
    """An open SPI device, real or emulated."""

    def transfer(self, data: bytes) -> bytes:
        """Clock bytes out and as many in, with chip select low from the first to the last."""

    def close(self) -> None:
        """Let go."""


class SpiDev:
    """``/dev/spidev<bus>.<device>``; the driver takes the next lower clock to `hz` that it has."""

    def __init__(self, bus: int, device: int, *, mode: int, hz: int) -> None:
        try:
            import spidev
        except ImportError as error:
            raise MissingExtraError(
                "An SPI bus needs spidev, which is not installed: pip install 'plumbob[spi]' (Linux)."
            ) from error
        self._spi = spidev.SpiDev()
        self._spi.open(bus, device)
        self._spi.mode, self._spi.max_speed_hz = mode, hz

    def transfer(self, data: bytes) -> bytes:
        """Clock bytes out and as many in, with chip select low from the first to the last."""
        return bytes(self._spi.xfer2(list(data)))

    def close(self) -> None:
        """Let go."""
        self._spi.close()


class SpiSource(Polled):
    """Replies of a chip, one `Received` for each poll.

    Each command of `exchange` is a transfer of its own, with chip select released after it; the replies are joined,
    none is left out. A chip that answers one transfer late, as the ADXRS453 does, answers command k with reply k + 1:
    the first reply after opening belongs to no command, and what the last one asked for comes with the next poll, a
    period old. For fresh values, give the command twice. The first `skip` bytes of the replies are left out. `start`,
    commands and times to wait, s, wakes the chip up at each opening; its replies are reported with it. `open_bus` puts
    an emulated chip in place of spidev.

    A wire that is pulled off the bus shows as zeros or ones, which is for the decoder to see.
    """

    def __init__(
        self, bus: int, device: int, exchange: Sequence[bytes], rate: float, *, mode: int, hz: int, skip: int = 0,
        start: Sequence[bytes | float] = (), open_bus: Callable[[], SpiBus] | None = None, **pace: Unpack[Pace],
    ) -> None:  # fmt: skip
        super().__init__(f"spi {bus}.{device}", rate, **pace)
        if mode not in {0, 1, 2, 3} or hz <= 0:
            raise ParameterError(f"SPI has modes 0 to 3 and a clock above 0 Hz, but got mode={mode}, hz={hz}.")
        if not (exchange and all(exchange)):
            raise ParameterError(
                f"A poll of {self._name} needs at least one command, and none empty, but got {exchange}."
            )
        self._number, self._mode, self._hz = (bus, device), mode, hz
        self._exchange, self._skip, self._start, self._open_bus = exchange, skip, start, open_bus or self._spidev
        self._bus: SpiBus | None = None

    def _spidev(self) -> SpiBus:
        return SpiDev(*self._number, mode=self._mode, hz=self._hz)

    def _connect(self) -> str:
        path = "/dev/spidev{}.{}".format(*self._number)
        try:
            self._bus = self._open_bus()
        except FileNotFoundError as error:
            raise NoLine("absent", f"There is no {path}; is SPI enabled (on a Pi: dtparam=spi=on)?") from error
        except PermissionError as error:
            raise NoLine("denied", f"No permission to open {path}; add yourself to the group spi.") from error
        replies = ""
        for step in self._start:
            if isinstance(step, bytes):
                replies += f" {self._bus.transfer(step).hex()}"
            else:
                self._sleep(step)
        said = f", start answered{replies}" if self._start else ""
        return f"{self._name} (mode {self._mode}, {self._hz} Hz{said})"

    def _ask(self) -> bytes:
        assert self._bus is not None
        return b"".join(map(self._bus.transfer, self._exchange))[self._skip :]

    def _let_go(self) -> None:
        bus, self._bus = self._bus, None
        if bus is not None:
            bus.close()
