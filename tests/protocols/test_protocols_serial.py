"""Worked bytes of serial devices: each line decodes and encodes exactly, and lines known to be wrong are refused."""

from typing import NamedTuple

import numpy as np
import pytest

from plumbob.core import units
from plumbob.core.errors import ShapeError
from plumbob.protocols import catalog
from plumbob.protocols.decode import decode
from plumbob.protocols.encode import encode


class Stream(NamedTuple):
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


def angles(pitch, roll, heading, header):
    return {"pitch": f"{pitch} deg", "roll": f"{roll} deg", "heading": f"{heading} deg", "header": str(header)}


LINES = [
    # made from the manual's table (7430-0060-02, page 10) and sum of bytes
    Stream(
        "ahrs500ga",
        "ahrs500ga",
        "AA55 08E4 FDB0 C0B6 0111 FF93 000E 006D FFD4 F777 0001 0000 0970",
        {**TURNING, "model": "1", "bit": "0"},
    ),
    # the same with a sum of 16-bit words modulo 65535, which the manual does not rule out
    Stream(
        "ahrs500ga",
        "ahrs500ga",
        "AA55 08E4 FDB0 C0B6 0111 FF93 000E 006D FFD4 F777 0001 0000 BFB9",
        {**TURNING, "model": "1", "bit": "0"},
        (("checksum", "words"),),
    ),
    # made from the manual's table (7430-0004-01, page 24) for a unit of RR 200, GR 4
    Stream(
        "ahrs400",
        "ahrs400",
        "FF 08E4 FDB0 C0B6 0444 FE4B 0037 0111 FF93 EAAB 0F05 00AF E148 06A2 9C40 80",
        {**TURNING, "mag.x": "0.22 gauss", "mag.y": "0.01 gauss", "mag.z": "-0.45 gauss", "temp_c": "31 degC"}
        | {"time": "40000"},
        (("rr", "200"), ("gr", "4")),
    ),
    # Crossbow NAV440 manual
    Stream("x5555", "ping", "5555 504B 00 9EF4", {}),
    # Rion HCM705B manual, pages 13-17
    Stream("rion", "read_angles", "68 04 00 04 08", {"header": "104", "address": "0"}),
    Stream("rion", "angles", "68 0D 00 84 002010 100525 018000 7C", angles("20.10", "-5.25", "180.00", 0x68)),
    # drivers of the DCM260B
    Stream(
        "rion",
        "angles_status",
        "68 0E 00 84 001050 101005 010401 00 1D",
        {**angles("10.50", "-10.05", "104.01", 0x68), "disturbance": "0", "mode": "0", "over_range": "0"},
    ),
    # Bewis-Sensing BMR3000 manual, page 8, and a driver's tests
    Stream("rion", "angles", "77 0D 00 84 100154 001443 001520 82", angles("-1.54", "14.43", "15.20", 0x77)),
    Stream("rion", "angles", "77 0D 00 84 000071 000012 013217 5E", angles("0.71", "0.12", "132.17", 0x77)),
    Stream("rion", "read_heading", "77 04 00 03 07", {"header": "119"}),
    Stream("rion", "mode_reply", "77 05 00 8C 00 91", {"header": "119", "failed": "0"}),
    # computed from the layout
    Stream("rion", "angles", "68 0D 00 84 101234 000567 027105 CB", angles("-12.34", "5.67", "271.05", 0x68)),
    # computed from the protocol's layout: 12.5° and −3.25°, cut toward zero to counts of 180°/2^15
    Stream(
        "witmotion",
        "angle",
        "55 53 E308 B1FD 0040 0000 81",
        {"roll": "12.497 deg", "pitch": "-3.2465 deg", "yaw": "90 deg"},
    ),
    # CEVA BNO08X data sheet, UART-RVC
    Stream(
        "bno08x_rvc",
        "bno08x_rvc",
        "AAAA DE 0100 92FF 2508 8DFE ECFF D103 000000 E7",
        {"index": "222", "yaw": "0.01 deg", "pitch": "-1.10 deg", "roll": "20.85 deg", "acc.x": "-371 mg"}
        | {"acc.y": "-20 mg", "acc.z": "977 mg", "reserved": "0"},
    ),
    # computed from the protocol's layout
    Stream(
        "xbus_mtdata2",
        "xbus_mtdata2",
        "FAFF 36 14 102002 1234 80200C 3DCCCCCD BE4CCCCD 3E99999A 44",
        {"counter": "4660", "gyr.x": "0.1 rad/s", "gyr.y": "-0.2 rad/s", "gyr.z": "0.3 rad/s"},
    ),
    # VectorNav UM001, first example, which prints +043.579, +001.885, -000.002
    Stream(
        "vectornav_ypr",
        "vectornav_ypr",
        "FA 01 0800 93502E42 833EF13F 48B504BB 9288",
        {"yaw": "43.57868576 deg", "pitch": "1.88472021 deg", "roll": "-0.00202496536 deg"},
    ),
    # MicroStrain MIP documentation
    Stream("mip", "ping", "7565 01 02 0201 E0C6", {}),
    # a made-up log in the frame of sbgECom
    Stream(
        "sbg_ecom",
        "example",
        "FF5A 06 00 1000 40420F00 CDCCCC3D CDCC4CBE 0000C03F 182D 33",
        {"time": "1000000", "first": "0.1 1", "second": "-0.2 1", "third": "1.5 1"},
    ),
]

WRONG = [
    # lines of the Rion manuals that fail their own sum, or lack a byte
    ("rion", "68 05 00 CB 00 CE"),
    ("rion", "68 05 00 CF 00 54"),
    ("rion", "68 05 00 C8 00 CC"),
    ("rion", "68 05 00 8F 94"),
    # another last byte, which the check does not cover
    ("sbg_ecom", "FF5A 06 00 1000 40420F00 CDCCCC3D CDCC4CBE 0000C03F 182D 32"),
]


def named(line: Stream) -> str:
    return f"{line.device}-{line.message}-{line.hex.replace(' ', '')[-6:]}"


def values(line: Stream) -> dict[str, float]:
    found = {}
    for name, text in line.says.items():
        number, unit = units.split(text)
        found[name] = units.to_si(float(number), unit) if unit else int(number)
    return found


@pytest.mark.parametrize("line", LINES, ids=named)
def test_a_worked_line_decodes(line):
    form = catalog.load(line.device).bind(dict(line.options))
    frames, counts = decode(bytes.fromhex(line.hex), form)
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


@pytest.mark.parametrize(("device", "text"), WRONG)
def test_a_line_that_is_wrong_is_refused(device, text):
    frames, counts = decode(bytes.fromhex(text), catalog.load(device))
    assert frames == {} and counts.junk == counts.received and counts.framed == 0


def test_what_cannot_be_is_refused_although_the_sum_is_right():
    form = catalog.load("ahrs400").bind({"rr": "200", "gr": "4"})
    whole = bytes.fromhex("FF 08E4 FDB0 C0B6 0444 FE4B 0037 0111 FF93 EAAB 0F05 00AF E148 06A2 9C40 80")

    def with_word(at, value):
        body = whole[1:at] + value.to_bytes(2, "big") + whole[at + 2 : 29]
        return b"\xff" + body + bytes([sum(body) & 0xFF])

    for at, value, frames in [
        (3, 0x4000, 1),
        (3, 0x4001, 0),
        (3, 0xC000, 1),
        (3, 0xBFFF, 0),
        (25, 4095, 1),
        (25, 4096, 0),
    ]:
        counts = decode(with_word(at, value), form)[1]
        assert (counts.frames["ahrs400"], counts.bad_content > 0) == (frames, not frames)


def test_decimal_angles_that_cannot_be_are_refused():
    def frame(pitch, roll, heading):
        body = bytes.fromhex("0D 00 84" + pitch + roll + heading)
        return b"\x68" + body + bytes([sum(body) & 0xFF])

    form = catalog.load("rion")
    possible = [("009000", "018000", "036000"), ("109000", "118000", "000000"), ("100000", "100000", "100000")]
    impossible = [("009001", "000000", "000000"), ("109001", "000000", "000000"), ("000000", "118001", "000000")]
    impossible += [("000000", "000000", "100001"), ("000000", "000000", "036001"), ("000000", "000000", "200000")]
    impossible += [("00000A", "000000", "000000")]
    assert [decode(frame(*text), form)[1].frames["angles"] for text in possible] == [1, 1, 1]
    assert [decode(frame(*text), form)[1].frames["angles"] for text in impossible] == [0] * 7


def test_an_unknown_packet_that_passes_its_check_is_counted_and_not_data():
    # NAK 15 15 with two bytes, as NAV440 sends; its check by the polynomial's definition, bit by bit
    body, value = bytes.fromhex("1515 02 504B"), 0x1D0F
    for byte in body:
        value ^= byte << 8
        for _ in range(8):
            value = (value << 1 ^ (0x1021 if value & 0x8000 else 0)) & 0xFFFF
    frames, counts = decode(b"\x55\x55" + body + value.to_bytes(2, "big"), catalog.load("x5555"))
    assert frames == {} and counts.unknown == 1 and counts.junk == 0


def test_a_request_is_one_frame_without_columns():
    assert encode(catalog.load("x5555"), {}, message="ping").tobytes().hex() == "5555504b009ef4"
    with pytest.raises(ShapeError, match="columns of rion"):
        encode(catalog.load("rion"), {}, message="angles")


def test_an_angle_that_wraps_goes_round_instead_of_being_cut():
    form = catalog.load("ahrs500ga")
    turns = np.array([np.pi, -np.pi, 3 * np.pi, 1.5 * np.pi, np.inf])
    raw = encode(form, {"heading": turns})[:, 6:8].copy().view(">i2")[:, 0]
    # 180/2^15 degrees a count: half a turn is the count −2^15, whichever way; a number beyond all is none
    assert raw.tolist() == [-32768, -32768, -32768, -16384, 0]
