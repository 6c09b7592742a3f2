"""Acquisition: serial lines, sockets, Linux IIO and SPI, each behind one `Source`, with honest time.

A source is made, opened and read; once it is open nothing that happens to the line raises::

    with SerialSource("/dev/ttyUSB0", 115200) as source:
        while running:
            for item in source.read(0.1):  # Received or Event, oldest first
                ...

A source belongs to one thread at a time.
"""

from typing import TYPE_CHECKING

from plumbob.core.lazy import lazily

if TYPE_CHECKING:
    from plumbob.acquisition.iio import IioPollSource, IioSource
    from plumbob.acquisition.iio_layout import IioChannel, IioLayout
    from plumbob.acquisition.polled import Schedule, Task
    from plumbob.acquisition.serial_line import SerialSource
    from plumbob.acquisition.sockets import TcpSource, UdpSource
    from plumbob.acquisition.spi_bus import SpiBus, SpiSource
    from plumbob.acquisition.transport import BackOff

__getattr__, __dir__ = lazily(
    __name__,
    {
        "BackOff": "transport",
        "IioChannel": "iio_layout",
        "IioLayout": "iio_layout",
        "IioPollSource": "iio",
        "IioSource": "iio",
        "Schedule": "polled",
        "SerialSource": "serial_line",
        "SpiBus": "spi_bus",
        "SpiSource": "spi_bus",
        "Task": "polled",
        "TcpSource": "sockets",
        "UdpSource": "sockets",
    },
)

__all__ = [
    "BackOff",
    "IioChannel",
    "IioLayout",
    "IioPollSource",
    "IioSource",
    "Schedule",
    "SerialSource",
    "SpiBus",
    "SpiSource",
    "Task",
    "TcpSource",
    "UdpSource",
]
