"""Worked bytes of serial devices: each line decodes and encodes exactly, and lines known to be wrong are refused."""

from typing import NamedTuple

import numpy as np
import pytest

from plumbob import units
from plumbob.sensors import catalog
from plumbob.sensors.decode import decode
from plumbob.sensors.encode import encode


class Line(NamedTuple):
    device: str
    message: str
    hex: str
    says: dict[str, str]
    """By field, a number with its unit as the source states it, or a bare whole number."""
    options: tuple[tuple[str, str], ...] = ()


TURNING = {"roll": "12.5 deg", "pitch": "-3.25 deg", "heading": "271 deg"} | {
    "gyr.x": "10 deg/s",
    "gyr.y": "-4 deg/s",
    "gyr.z": "0.5 deg/s",
    "acc.x": "0.05 g",
    "acc.y": "-0.02 g",
    "acc.z": "-1 g",
}

LINES = [
    # made from the manual's table (7430-0060-02, page 10) and sum of bytes
    Line(
        "ahrs500ga",
        "ahrs500ga",
        "AA55 08E4 FDB0 C0B6 0111 FF93 000E 006D FFD4 F777 0001 0000 0970",
        {**TURNING, "model": "1", "bit": "0"},
    ),
    # the same with a sum of 16-bit words modulo 65535, which the manual does not rule out
    Line(
        "ahrs500ga",
        "ahrs500ga",
        "AA55 08E4 FDB0 C0B6 0111 FF93 000E 006D FFD4 F777 0001 0000 BFB9",
        {**TURNING, "model": "1", "bit": "0"},
        (("checksum", "words"),),
    ),
]


def named(line: Line) -> str:
    return f"{line.device}-{line.message}-{line.hex.replace(' ', '')[-6:]}"


def values(line: Line) -> dict[str, float]:
    found = {}
    for name, text in line.says.items():
        number, unit = units.split(text)
        found[name] = units.to_si(float(number), unit) if unit else int(number)
    return found


@pytest.mark.parametrize("line", LINES, ids=named)
def test_a_worked_line_decodes(line):
    form = catalog.load(line.device).bind(dict(line.options))
    frames, counts = decode(form, bytes.fromhex(line.hex))
    assert counts.junk == 0 and counts.frames[line.message] == 1 and list(frames) == [line.message]
    columns = frames[line.message].columns
    by_name = {one.name: one for one in form.message(line.message).fields}
    for name, expected in values(line).items():
        one, got = by_name[name], columns[name][0]
        if not one.physical:
            assert got == expected
            continue
        turn = 2 * np.pi if one.wrap else np.inf
        # half a count, or what a 32-bit float leaves of the number
        allowed = abs(expected) * 2.0**-24 if one.type == "f32" else 0.5 * abs(one.scale)
        assert abs(np.remainder(got - expected + turn / 2, turn) - turn / 2 if one.wrap else got - expected) <= (
            allowed * (1 + 1e-9) + 1e-12
        )


@pytest.mark.parametrize("line", LINES, ids=named)
def test_a_worked_line_encodes(line):
    form = catalog.load(line.device).bind(dict(line.options))
    rows = encode(form, {name: [value] for name, value in values(line).items()}, message=line.message)
    assert rows.tobytes().hex() == bytes.fromhex(line.hex).hex()


def test_an_angle_that_wraps_goes_round_instead_of_being_cut():
    form = catalog.load("ahrs500ga")
    turns = np.array([np.pi, -np.pi, 3 * np.pi, 1.5 * np.pi, np.inf])
    raw = encode(form, {"heading": turns})[:, 6:8].copy().view(">i2")[:, 0]
    # 180/2^15 degrees a count: half a turn is the count −2^15, whichever way; a number beyond all is none
    assert raw.tolist() == [-32768, -32768, -32768, -16384, 0]
