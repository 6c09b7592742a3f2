"""Serial ports by path, by pattern or by USB identity, resolved anew whenever a line is opened."""

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Protocol

from plumbob.acquire.opened import NoLine
from plumbob.errors import ParameterError

_USB = re.compile(r"auto:([0-9a-fA-F]{4}):([0-9a-fA-F]{4})(?::(.+))?")


class PortInfo(Protocol):
    """What is known of a serial port; pyserial's ``ListPortInfo`` is one."""

    @property
    def device(self) -> str:
        """Path."""
        ...

    @property
    def description(self) -> str:
        """For people."""
        ...

    @property
    def vid(self) -> Any:
        """USB vendor, or None."""
        ...

    @property
    def pid(self) -> Any:
        """USB product, or None."""
        ...

    @property
    def serial_number(self) -> Any:
        """USB serial number, or None."""
        ...


ListPorts = Callable[[], Sequence[PortInfo]]


def list_ports() -> Sequence[PortInfo]:
    """Serial ports of this machine, in the order of their names."""
    from serial.tools.list_ports import comports

    return sorted(comports(), key=lambda port: port.device)


def check_port(port: str) -> str:
    """Refuse a name that can be no port.

    Raises
    ------
    ParameterError
        If it is empty, or begins like a USB identity and is none.
    """
    if not port or (port.startswith("auto:") and not _USB.fullmatch(port)):
        raise ParameterError(
            f"{port!r} is no serial port: give a path, a pattern such as /dev/ttyUSB*, or auto:VID:PID[:SERIAL] "
            "with the USB numbers in four hexadecimal digits, as in auto:0403:6001."
        )
    return port


def find_port(port: str, ports: ListPorts = list_ports) -> str:
    """Path of the port that a name, pattern or USB identity stands for now.

    Raises
    ------
    NoLine
        ``absent`` where there is none, with a list of those that are; ``ambiguous`` where there are several.
    """
    if usb := _USB.fullmatch(port):
        return _single(port, [p.device for p in ports() if _is_usb(p, *usb.groups())], ports)
    if Path(port).exists():
        return port
    anchor = Path(Path(port).anchor)
    return _single(port, sorted(map(str, anchor.glob(str(Path(port).relative_to(anchor))))), ports)


def _is_usb(port: PortInfo, vid: str, pid: str, serial_number: str | None) -> bool:
    same = (port.vid, port.pid) == (int(vid, 16), int(pid, 16))
    return same and (serial_number is None or port.serial_number == serial_number)


def _single(port: str, found: list[str], ports: ListPorts) -> str:
    if not found:
        there = ", ".join(f"{p.device} ({p.description})" for p in ports()) or "none"
        raise NoLine("absent", f"There is no serial port {port}; the ports of this machine: {there}.")
    if len(found) > 1:
        raise NoLine("ambiguous", f"{port} is {len(found)} serial ports, {', '.join(found)}; name one of them.")
    return found[0]
