"""Ports by path, by pattern, by USB identity."""

from dataclasses import dataclass

import pytest

from plumbob.acquisition.serial_line import check_port, find_port, list_ports
from plumbob.acquisition.transport import NoLine
from plumbob.core.errors import ParameterError


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


def test_by_usb_identity():
    assert find("auto:2e8a:0005") == find("auto:2E8A:0005:B") == "/dev/ttyACM0"
    assert find("auto:0403:6001:A2") == "/dev/ttyUSB1"


def test_several_are_refused():
    with pytest.raises(NoLine, match="is 2 serial ports, /dev/ttyUSB0, /dev/ttyUSB1; name one") as no:
        find("auto:0403:6001")
    assert no.value.kind == "ambiguous"


@pytest.mark.parametrize("port", ["auto:0403:6001:A3", "auto:ffff:0001", "/dev/ttyNONE", "/dev/ttyNONE*", "none"])
def test_none_lists_what_there_is(port):
    with pytest.raises(NoLine, match=r"There is no serial port .*/dev/ttyUSB1 \(FT232R\), /dev/ttyACM0 \(Pico\)") as no:
        find(port)
    assert no.value.kind == "absent"
    with pytest.raises(NoLine, match="the ports of this machine: none"):
        find_port(port, list)


def test_by_path_and_by_pattern(tmp_path, monkeypatch):
    (tmp_path / "ttyX1").touch()
    path = str(tmp_path / "ttyX1")
    assert find(path) == find(str(tmp_path / "ttyX*")) == path
    monkeypatch.chdir(tmp_path)
    assert find("ttyX?") == "ttyX1"
    (tmp_path / "ttyX2").touch()
    with pytest.raises(NoLine, match="is 2 serial ports"):
        find(str(tmp_path / "ttyX*"))


def test_this_machine_can_be_asked():
    assert all(port.device for port in list_ports())


@pytest.mark.parametrize("port", ["", "auto:", "auto:403:6001", "auto:0403", "auto:0403:6001:"])
def test_what_can_be_no_port(port):
    with pytest.raises(ParameterError, match="auto:VID:PID"):
        check_port(port)
