"""Worked bytes of serial devices: each line decodes and encodes exactly, and lines known to be wrong are refused."""

import numpy as np
import pytest

from plumbob import find_format, flags
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.protocols.decode import decode, format_title
from plumbob.protocols.encode import encode
from tests.helpers import beside
from tests.helpers.commandline import table_of
from tests.helpers.decoder_battery import fields_of, options_of

LINES = table_of(beside(__file__, "lines.txt"))
WRONG = [
    # lines of the Rion manuals that fail their own sum, or lack a byte
    ("rion", "68 05 00 CB 00 CE"),
    ("rion", "68 05 00 CF 00 54"),
    ("rion", "68 05 00 C8 00 CC"),
    ("rion", "68 05 00 8F 94"),
    # another last byte, which the check does not cover
    ("sbg_ecom", "FF5A 06 00 1000 40420F00 CDCCCC3D CDCC4CBE 0000C03F 182D 32"),
]


@pytest.mark.parametrize("line", LINES, ids=lambda line: line[0])
def test_a_worked_line_decodes_and_encodes(line):
    device, message, data = line[0].split(" ", 2)
    form, data = find_format(device).bind(options_of(*line[2:])), bytes.fromhex(data)
    values = fields_of(*line[1:2])
    assert encode(form, {name: [one] for name, one in values.items()}, message=message).tobytes() == data
    frames, counts = decode(data, form)
    assert counts.junk == 0 and counts.frames[message] == 1 and list(frames) == [message]
    columns = frames[message].columns
    by_name = {one.name: one for one in form.message(message).fields}
    for name, expected in values.items():
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


@pytest.mark.parametrize(("device", "text"), WRONG)
def test_a_line_that_is_wrong_is_refused(device, text):
    frames, counts = decode(bytes.fromhex(text), find_format(device))
    assert frames == {} and counts.junk == counts.received and counts.framed == 0


def test_what_cannot_be_is_refused_although_the_sum_is_right():
    form = find_format("ahrs400").bind({"rr": "200", "gr": "4"})
    whole = bytes.fromhex("FF 08E4 FDB0 C0B6 0444 FE4B 0037 0111 FF93 EAAB 0F05 00AF E148 06A2 9C40 80")

    def with_word(at, value):
        body = whole[1:at] + value.to_bytes(2, "big") + whole[at + 2 : 29]
        return b"\xff" + body + bytes([sum(body) & 0xFF])

    edges = [(3, 0x4000, 1), (3, 0x4001, 0), (3, 0xC000, 1), (3, 0xBFFF, 0), (25, 4095, 1), (25, 4096, 0)]
    for at, value, frames in edges:
        counts = decode(with_word(at, value), form)[1]
        assert (counts.frames["ahrs400"], counts.bad_content > 0) == (frames, not frames)

    def frame(pitch, roll, heading):
        body = bytes.fromhex("0D 00 84" + pitch + roll + heading)
        return b"\x68" + body + bytes([sum(body) & 0xFF])

    form = find_format("rion")
    possible = [("009000", "018000", "036000"), ("109000", "118000", "000000"), ("100000", "100000", "100000")]
    impossible = [("009001", "000000", "000000"), ("109001", "000000", "000000"), ("000000", "118001", "000000")]
    impossible += [("000000", "000000", "100001"), ("000000", "000000", "036001"), ("000000", "000000", "200000")]
    impossible += [("00000A", "000000", "000000")]
    assert [decode(frame(*text), form)[1].frames["angles"] for text in possible] == [1, 1, 1]
    assert [decode(frame(*text), form)[1].frames["angles"] for text in impossible] == [0] * 7


def test_an_unknown_packet_is_counted_a_request_has_no_columns_and_an_angle_goes_round():
    # NAK 15 15 with two bytes, as NAV440 sends; its check by the polynomial's definition, bit by bit
    body, value = bytes.fromhex("1515 02 504B"), 0x1D0F
    for byte in body:
        value ^= byte << 8
        for _ in range(8):
            value = (value << 1 ^ (0x1021 if value & 0x8000 else 0)) & 0xFFFF
    frames, counts = decode(b"\x55\x55" + body + value.to_bytes(2, "big"), find_format("x5555"))
    assert frames == {} and counts.unknown == 1 and counts.junk == 0
    assert encode(find_format("x5555"), {}, message="ping").tobytes() == bytes.fromhex("5555 504B 00 9EF4")
    pair = {"pitch": [0.1], "roll": [0.1, 0.2]}
    for columns, message, error, match in (
        ({}, "angles", ShapeError, "columns of rion"),
        (pair, "angles", ShapeError, "columns of rion"),
        ({"yaw": [0.1]}, "angles", ParameterError, "message angles has no field to encode 'yaw'"),
        ({}, "angle", ParameterError, "rion has no message 'angle'; known:"),
    ):
        with pytest.raises(error, match=match):
            encode(find_format("rion"), columns, message=message)
    form = find_format("ahrs500ga")
    turns = np.array([np.pi, -np.pi, 3 * np.pi, 1.5 * np.pi, np.inf])
    raw = encode(form, {"heading": turns})[:, 6:8].copy().view(">i2")[:, 0]
    # 180/2^15 degrees a count: half a turn is the count −2^15, whichever way; a number beyond all is none
    assert raw.tolist() == [-32768, -32768, -32768, -16384, 0]


MTI = {name: row for name, *row in table_of(beside(__file__, "mti.txt"))}
NOMINAL = 50.0  # uT for a field of 1, whose size the device does not say


@pytest.mark.parametrize("name", MTI)
def test_a_packet_of_an_mti_says_what_its_maker_says(name):
    text, told = MTI[name]
    form, whole = find_format("xbus_mtdata2"), bytes.fromhex(text)
    frames, counts = decode(whole, form)
    assert counts.junk == 0 and list(frames) == [name]
    columns = frames[name].columns
    for key, *expected in map(str.split, told.split(", ")):
        own = [column for one, column in columns.items() if one[:-2] == key or (key == "q" and one[:1] == "q")]
        own = own or [columns[key]]
        scale = NOMINAL if key == "mag" else 1.0
        got = np.concatenate(own) / scale
        np.testing.assert_allclose(got, np.array(expected, dtype=float), rtol=2.0**-24, atol=0.51e-8)
    shaken = flags.GYR_CLIPPED | flags.ACC_CLIPPED if name == "all_no_temp" else 0
    assert frames[name].flags[""].tolist() == [shaken]
    assert encode(form, columns, message=name).tobytes() == whole


def test_a_stream_of_an_mti_whose_outputs_have_several_rates_loses_nothing():
    stream = b"".join(bytes.fromhex(text) for text, _ in MTI.values())
    frames, counts = decode(stream + stream, find_format("xbus_mtdata2"))
    assert counts.junk == 0 and {name: len(found) for name, found in frames.items()} == dict.fromkeys(MTI, 2)


@pytest.mark.parametrize(
    ("device", "field", "title"),
    [
        ("xbus_mtdata2", "time", "time [0.1 ms]"),
        ("bmi088", "clock", "clock [39.0625 us]"),
        ("ahrs400", "time", "time [0.79 us]"),
    ]
    + [("vectornav_imu", "time", "time [ns]"), ("xbus_mtdata2", "acc.x", "acc.x [m/s2]")],
)
def test_a_table_says_what_one_count_of_a_clock_is(device, field, title):
    assert format_title({one.name: one for one in find_format(device).message().fields}[field]) == title


def test_a_whole_cargo_counts_with_and_without_the_bit_of_a_continued_one():
    (text,) = [line[0] for line in LINES if line[0].startswith("bno08x_shtp acc ")]
    whole = bytearray.fromhex(text.split(" ", 2)[2])
    whole[1] = 0x80
    form = find_format("bno08x_shtp")
    frames, counts = decode(bytes(whole), form)
    assert counts.junk == 0 and frames["acc"].columns["cargo"].tolist() == [8]
    rest = bytes.fromhex("1380 03 09 0102 0304 0506 0708 090A 0B0C 0D0E 0F")  # of another cargo: no base time
    assert decode(rest, form)[1].framed == 0
