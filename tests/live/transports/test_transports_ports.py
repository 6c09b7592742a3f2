"""Ports by path, by pattern, by USB identity."""

from dataclasses import dataclass

import pytest

from plumbob.core.errors import ParameterError
from plumbob.live.transports.serial_line import check_port, find_port, list_ports
from plumbob.live.transports.transport import NoLine


@dataclass
class Port:
    device: str
    description: str = "n/a"
    vid: int | None = None
    pid: int | None = None
    serial_number: str | None = None


PORTS = [
    Port("/dev/ttyS0"),
    Port("/dev/ttyUSB0", "FT232R", 0x0403, 0x6001, "A1"),
    Port("/dev/ttyUSB1", "FT232R", 0x0403, 0x6001, "A2"),
    Port("/dev/ttyACM0", "Pico", 0x2E8A, 0x0005, "B"),
]


def find(port):
    return find_port(port, lambda: PORTS)


def kind_of(port, ports, words):
    with pytest.raises(NoLine, match=words) as no:
        find_port(port, lambda: ports)
    return no.value.kind


def test_by_path_pattern_and_usb_identity(tmp_path, monkeypatch):
    (tmp_path / "ttyX1").touch()
    path = str(tmp_path / "ttyX1")
    assert find(path) == find(str(tmp_path / "ttyX*")) == path
    monkeypatch.chdir(tmp_path)
    pico = "/dev/ttyACM0"
    ports = {"ttyX?": "ttyX1", "auto:2e8a:0005": pico, "auto:2E8A:0005:B": pico, "auto:0403:6001:A2": "/dev/ttyUSB1"}
    assert {port: find(port) for port in ports} == ports
    (tmp_path / "ttyX2").touch()
    listed = r"There is no serial port .*/dev/ttyUSB1 \(FT232R\), /dev/ttyACM0 \(Pico\)"
    for port, kind, words in (
        (str(tmp_path / "ttyX*"), "ambiguous", "is 2 serial ports"),
        ("auto:0403:6001", "ambiguous", "/dev/ttyUSB0, /dev/ttyUSB1; name one"),
        *((port, "absent", listed) for port in ("auto:0403:6001:A3", "auto:ffff:0001", "/dev/ttyNONE*", "none")),
    ):
        assert kind_of(port, PORTS, words) == kind
    assert kind_of("none", [], "the ports of this machine: none") == "absent"


def test_ports_of_this_machine_and_what_can_be_none():
    assert all(port.device for port in list_ports())
    for port in ("", "auto:", "auto:403:6001", "auto:0403", "auto:0403:6001:"):
        with pytest.raises(ParameterError):
            check_port(port)
