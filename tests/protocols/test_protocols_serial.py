"""Worked bytes of serial devices: each line decodes and encodes exactly, and lines known to be wrong are refused."""

import numpy as np
import pytest

from plumbob import find_format, flags, units
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.protocols.decode import decode, format_title
from plumbob.protocols.encode import encode

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


REPORT = "03 00 0002 00FF 0100"
ZEROS = {"cargo": "0", "base": "0", "report_count": "0", "delay_high": "0", "delay": "0"}
UNITS = {"gyr": "rad/s", "mag": "uT", "linear": "m/s2", "gravity": "m/s2"}


def axes(name, counts):
    """What the three words of `REPORT` are, 512, -256 and 1 counts, and what stands around them."""
    said = {
        f"{name}.{axis}": f"{count / counts} {UNITS[name]}" for axis, count in zip("xyz", (512, -256, 1), strict=True)
    }
    return said | {"accuracy": "3"} | ZEROS


# Device, message and bytes; by field a number with its unit as the source states it, or a bare whole number; options.
LINES = [
    # made from the manual's table (7430-0060-02, page 10) and sum of bytes
    (
        "ahrs500ga ahrs500ga AA55 08E4 FDB0 C0B6 0111 FF93 000E 006D FFD4 F777 0001 0000 0970",
        {**TURNING, "model": "1", "bit": "0"},
    ),
    # the same with a sum of 16-bit words modulo 65535, which the manual does not rule out
    (
        "ahrs500ga ahrs500ga AA55 08E4 FDB0 C0B6 0111 FF93 000E 006D FFD4 F777 0001 0000 BFB9",
        {**TURNING, "model": "1", "bit": "0"},
        {"checksum": "words"},
    ),
    # made from the manual's table (7430-0004-01, page 24) for a unit of RR 200, GR 4
    (
        "ahrs400 ahrs400 FF 08E4 FDB0 C0B6 0444 FE4B 0037 0111 FF93 EAAB 0F05 00AF E148 06A2 9C40 80",
        {**TURNING, "mag.x": "0.22 gauss", "mag.y": "0.01 gauss", "mag.z": "-0.45 gauss", "temp_c": "31 degC"}
        | {"time": "40000"},
        {"rr": "200", "gr": "4"},
    ),
    # Crossbow NAV440 manual
    ("x5555 ping 5555 504B 00 9EF4", {}),
    # Rion HCM705B manual, pages 13-17
    ("rion read_angles 68 04 00 04 08", {"header": "104", "address": "0"}),
    ("rion angles 68 0D 00 84 002010 100525 018000 7C", angles("20.10", "-5.25", "180.00", 0x68)),
    # drivers of the DCM260B
    (
        "rion angles_status 68 0E 00 84 001050 101005 010401 00 1D",
        {**angles("10.50", "-10.05", "104.01", 0x68), "disturbance": "0", "mode": "0", "over_range": "0"},
    ),
    # Bewis-Sensing BMR3000 manual, page 8, and a driver's tests
    ("rion angles 77 0D 00 84 100154 001443 001520 82", angles("-1.54", "14.43", "15.20", 0x77)),
    ("rion angles 77 0D 00 84 000071 000012 013217 5E", angles("0.71", "0.12", "132.17", 0x77)),
    ("rion read_heading 77 04 00 03 07", {"header": "119"}),
    ("rion mode_reply 77 05 00 8C 00 91", {"header": "119", "failed": "0"}),
    # computed from the layout
    ("rion angles 68 0D 00 84 101234 000567 027105 CB", angles("-12.34", "5.67", "271.05", 0x68)),
    # computed from the protocol's layout: 12.5° and −3.25°, cut toward zero to counts of 180°/2^15
    ("witmotion angle 55 53 E308 B1FD 0040 0000 81", {"roll": "12.497 deg", "pitch": "-3.2465 deg", "yaw": "90 deg"}),
    # WT901BLECL data sheet v20-0707, page 16: field of 360, 105 and 122 mG
    (
        "witmotion_ble field 55 71 3A00 6801 6900 7A00 00000000000000000000",
        {"mag.x": "360 mgauss", "mag.y": "105 mgauss", "mag.z": "122 mgauss"},
    ),
    # computed from the scales on page 12: 1 g upwards, half the range of the rate, angles as above
    (
        "witmotion_ble motion 55 61 000000000008 00400000 00C0 E308 B1FD 0040",
        {"acc.x": "0 g", "acc.y": "0 g", "acc.z": "1 g", "gyr.x": "1000 deg/s", "gyr.y": "0 deg/s"}
        | {"gyr.z": "-1000 deg/s", "roll": "12.497 deg", "pitch": "-3.2465 deg", "yaw": "90 deg"},
    ),
    # computed from the same sheet, page 16, with its sum: half a turn about z
    ("witmotion quaternion 55 59 0000 0000 0000 0040 EE", {"qw": "0 1", "qx": "0 1", "qy": "0 1", "qz": "0.5 1"}),
    # report of a unit test (formove-ai/STM32_BNO085, parse_input_report_test.c: I 0201, J 0403, K 0605, real 0807)
    # behind the header and base time of sh2.c
    (
        "bno08x_shtp game 1500 03 07 FB 00000000 08 00 02 00 0102 0304 0506 0708",
        {"cargo": "7", "base": "0", "report_count": "0", "accuracy": "2", "delay_high": "0", "delay": "0"}
        | {"qx": f"{0x0201 / 16384} 1", "qy": f"{0x0403 / 16384} 1", "qz": f"{0x0605 / 16384} 1"}
        | {"qw": f"{0x0807 / 16384} 1"},
    ),
    # the same test's acceleration, X 0201, Y 0403, Z 0605, in 1/256 m/s2
    (
        "bno08x_shtp acc 1300 03 08 FB 64000000 01 00 02 00 0102 0304 0506",
        {"cargo": "8", "base": "100", "accuracy": "2", "acc.x": f"{0x0201 / 256} m/s2"}
        | {"acc.y": f"{0x0403 / 256} m/s2", "acc.z": f"{0x0605 / 256} m/s2"},
    ),
    # computed from the layout of sh2_SensorValue.c: 1, -1 and 2 rad/s, and a bias of 1/512 about z; delay of 261
    (
        "bno08x_shtp gyr_raw 1900 03 09 FB 00000000 07 05 07 05 0002 00FE 0004 0000 0000 0100",
        {"cargo": "9", "base": "0", "report_count": "5", "accuracy": "3", "delay_high": "1", "delay": "5"}
        | {"gyr.x": "1 rad/s", "gyr.y": "-1 rad/s", "gyr.z": "2 rad/s", "bias.x": "0 rad/s", "bias.y": "0 rad/s"}
        | {"bias.z": f"{1 / 512} rad/s"},
    ),
    # computed from the same file: scales of 1/512, 1/16, 1/256, 1/16384 and 1/4096
    (f"bno08x_shtp gyr 1300 03 00 FB 00000000 02 00 {REPORT}", axes("gyr", 512)),
    (f"bno08x_shtp mag 1300 03 00 FB 00000000 03 00 {REPORT}", axes("mag", 16)),
    (f"bno08x_shtp linear 1300 03 00 FB 00000000 04 00 {REPORT}", axes("linear", 256)),
    (f"bno08x_shtp gravity 1300 03 00 FB 00000000 06 00 {REPORT}", axes("gravity", 256)),
    (
        f"bno08x_shtp mag_raw 1900 03 00 FB 00000000 0F 00 {REPORT} 1000 F0FF 0100",
        axes("mag", 16) | {"bias.x": "1 uT", "bias.y": "-1 uT", "bias.z": "0.0625 uT"},
    ),
    (
        "bno08x_shtp rotation 1700 03 00 FB 00000000 05 00 03 00 0010 0020 00E0 0040 0001",
        {"accuracy": "3", "qx": "0.25 1", "qy": "0.5 1", "qz": "-0.5 1", "qw": "1 1", "heading_sd": "0.0625 rad"}
        | ZEROS,
    ),
    # CEVA BNO08X data sheet, UART-RVC
    (
        "bno08x_rvc bno08x_rvc AAAA DE 0100 92FF 2508 8DFE ECFF D103 000000 E7",
        {"index": "222", "yaw": "0.01 deg", "pitch": "-1.10 deg", "roll": "20.85 deg", "acc.x": "-371 mg"}
        | {"acc.y": "-20 mg", "acc.z": "977 mg", "reserved": "0"},
    ),
    # computed from the protocol's layout
    (
        "xbus_mtdata2 rate FAFF 36 14 102002 1234 80200C 3DCCCCCD BE4CCCCD 3E99999A 44",
        {"counter": "4660", "gyr.x": "0.1 rad/s", "gyr.y": "-0.2 rad/s", "gyr.z": "0.3 rad/s"},
    ),
    # computed from the blocks of the packets of an MTi-300: x of the acceleration and z of the rate clip
    (
        "xbus_mtdata2 imu_no_mag FAFF363110200200011060040000271040200C00000000C0000000411C000080200C3F00000"
        "0BE80000000000000E0200400082103DA",
        {"counter": "1", "time": "10000", "acc.x": "0 m/s2", "acc.y": "-2 m/s2", "acc.z": "9.75 m/s2"}
        | {"gyr.x": "0.5 rad/s", "gyr.y": "-0.25 rad/s", "gyr.z": "0 rad/s", "self_test": "1", "filter_valid": "1"}
        | {"clips": "1", "sync_out": "0", "acc_clips": "1", "gyr_clips": "4"},
    ),
    # VectorNav UM001, first example, which prints +043.579, +001.885, -000.002
    (
        "vectornav_ypr vectornav_ypr FA 01 0800 93502E42 833EF13F 48B504BB 9288",
        {"yaw": "43.57868576 deg", "pitch": "1.88472021 deg", "roll": "-0.00202496536 deg"},
    ),
    # computed from the layout of the maker's library; check by binascii.crc_hqx
    (
        "vectornav_imu vectornav_imu FA 01 0106 00CA9A3B00000000 0000803F 000000C0 00001CC1 0000003F 000080BE 00000000"
        "0000803E 000000BF 00004040 0000C841 0080CA42 1F83",
        {"time": "1000000000", "acc.x": "1 m/s2", "acc.y": "-2 m/s2", "acc.z": "-9.75 m/s2", "gyr.x": "0.5 rad/s"}
        | {"gyr.y": "-0.25 rad/s", "gyr.z": "0 rad/s", "mag.x": "0.25 gauss", "mag.y": "-0.5 gauss"}
        | {"mag.z": "3 gauss", "temp_c": "25 degC", "pressure_kpa": "101.25 1"},
    ),
    (
        "vectornav_ahrs vectornav_ahrs FA 01 3105 00CA9A3B00000000 00000000 0000003F 000000BF 0000403F 000000"
        "3F 000080BE 000000000000803F 000000C0 00001CC1 0000803E 000000BF 00004040 0000C841 0080CA42 7ACB",
        {"time": "1000000000", "qx": "0 1", "qy": "0.5 1", "qz": "-0.5 1", "qw": "0.75 1", "gyr.x": "0.5 rad/s"}
        | {"gyr.y": "-0.25 rad/s", "gyr.z": "0 rad/s", "acc.x": "1 m/s2", "acc.y": "-2 m/s2", "acc.z": "-9.75 m/s2"}
        | {"mag.x": "0.25 gauss", "mag.y": "-0.5 gauss", "mag.z": "3 gauss", "temp_c": "25 degC"}
        | {"pressure_kpa": "101.25 1"},
    ),
    # MicroStrain MIP documentation
    ("mip ping 7565 01 02 0201 E0C6", {}),
    # a made-up log in the frame of sbgECom
    (
        "sbg_ecom example FF5A 06 00 1000 40420F00 CDCCCC3D CDCC4CBE 0000C03F 182D 33",
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


def value(text):
    number, unit = units.split(text)
    return units.to_si(float(number), unit) if unit else int(number)


@pytest.mark.parametrize("line", LINES, ids=lambda line: line[0])
def test_a_worked_line_decodes_and_encodes(line):
    device, message, data = line[0].split(" ", 2)
    form, data = find_format(device).bind(dict(*line[2:])), bytes.fromhex(data)
    values = {name: value(text) for name, text in line[1].items()}
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


def test_decimal_angles_that_cannot_be_are_refused():
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


def test_an_unknown_packet_that_passes_its_check_is_counted_and_not_data():
    # NAK 15 15 with two bytes, as NAV440 sends; its check by the polynomial's definition, bit by bit
    body, value = bytes.fromhex("1515 02 504B"), 0x1D0F
    for byte in body:
        value ^= byte << 8
        for _ in range(8):
            value = (value << 1 ^ (0x1021 if value & 0x8000 else 0)) & 0xFFFF
    frames, counts = decode(b"\x55\x55" + body + value.to_bytes(2, "big"), find_format("x5555"))
    assert frames == {} and counts.unknown == 1 and counts.junk == 0


def test_a_request_is_one_frame_without_columns():
    assert encode(find_format("x5555"), {}, message="ping").tobytes() == bytes.fromhex("5555 504B 00 9EF4")
    pair = {"pitch": [0.1], "roll": [0.1, 0.2]}
    for columns, message, error, match in (
        ({}, "angles", ShapeError, "columns of rion"),
        (pair, "angles", ShapeError, "columns of rion"),
        ({"yaw": [0.1]}, "angles", ParameterError, "message angles has no field 'yaw' to encode"),
        ({}, "angle", ParameterError, "rion has no message 'angle'; known are"),
    ):
        with pytest.raises(error, match=match):
            encode(find_format("rion"), columns, message=message)


def test_an_angle_that_wraps_goes_round_instead_of_being_cut():
    form = find_format("ahrs500ga")
    turns = np.array([np.pi, -np.pi, 3 * np.pi, 1.5 * np.pi, np.inf])
    raw = encode(form, {"heading": turns})[:, 6:8].copy().view(">i2")[:, 0]
    # 180/2^15 degrees a count: half a turn is the count −2^15, whichever way; a number beyond all is none
    assert raw.tolist() == [-32768, -32768, -32768, -16384, 0]


# Packets of an MTi-300 and what MT Manager decodes from them, to 8 decimals: tests and golden packets of
# Scottapotamas/xsens-mti (21350e9f). Sums of the first two are published; those of the others are computed.
MTI = {
    "orientation": (
        "FAFF3626 102002 4682 106004 01C4FC3E 201010 3F71CE6C BEA56BCF 3C613BD8 BD691D25 E02004 00400003 12",
        {"counter": 18050, "time": 29686846, "q": (0.94455600, -0.32308814, 0.01374718, -0.05691256)}
        | {"status": 0x400003},
    ),
    "all_no_temp": (  # shaken, so that y of the rate and z of the acceleration clip
        "FAFF368B 102002 FB85 106004 01A498DE 201010 3F2A1463 BED7EFA7 3CDEE508 3F1DCEC9 40200C C1F246C3 C1ECE076"
        "C28F853F 40100C BD932CCC BD920A16 BE3A6EEC 40300C 42519464 C27B5A5A C1CCC0AE 80200C 40854D6D C125559E"
        "C0908E1F 803010 3F7FF898 3BAA9EE5 BC539EC0 BBB9060C C0200C 3EDC7439 BE752B48 3FAF9A3F 301004 000186DE"
        "E02004 00481401 8E",
        {"counter": 64389, "time": 27564254, "q": (0.66437358, -0.42175028, 0.02720882, 0.61643654)}
        | {"acc": (-30.28455162, -29.60960007, -71.76024628), "delta_v": (-0.07186279, -0.07130830, -0.18206376)}
        | {"free_acc": (52.39491272, -62.83823395, -25.59408188), "gyr": (4.16570139, -10.33340263, -4.51734877)}
        | {"turn": (0.99988699, 0.00520693, -0.01291627, -0.00564647), "mag": (0.43057421, -0.23942292, 1.37189472)}
        | {"pressure_pa": 100062, "self_test": 1, "filter_valid": 0, "acc_clips": 4, "gyr_clips": 2, "mag_clips": 0}
        | {"clips": 1, "sync_out": 1},
    ),
    "all_no_pressure": (
        "FAFF3684 102002 A651 106004 005746CA 201010 3F7F7DAF BC10178D 3BA15D51 BD7EDC78 40200C BD9A97A6 BE26F9BF"
        "411CB2E4 40100C B9464400 B9D59C00 3CC89310 40300C 3C3FEE14 3C5F69B0 BAF28000 80200C BB706E03 BBC23D00"
        "BBD49903 803010 3F800000 B699E001 B6F8A000 B7081000 C0200C BE91DCFF 3FB66C36 3F187168 E02004 00400003 9B",
        {"counter": 42577, "time": 5719754, "q": (0.99801153, -0.00879468, 0.00492445, -0.06222197)}
        | {"acc": (-0.07548456, -0.16306208, 9.79367447), "gyr": (-0.00366867, -0.00592768, -0.00648797)}
        | {"mag": (-0.28488919, 1.42517734, 0.59548044), "filter_valid": 1, "clips": 0},
    ),
    "all_no_mag": (
        "FAFF3675 102002 8D90 106004 0054DBF1 201010 3F7F8911 BC111DFA 3BA0CEF0 BD732573 40200C BDDCF9D0 BE3C8619"
        "411D0B47 40100C B98DB000 B9F14800 3CC90430 40300C BCB9892E BB098C00 3CA70800 80200C BA63BC01 BC04D63F"
        "BB6DE3FE 803010 3F800001 B591C000 B72A0800 B6984000 E02004 00400003 77",
        {"counter": 36240, "time": 5561329, "q": (0.99818522, -0.00885724, 0.00490748, -0.05936189)}
        | {"acc": (-0.10789835, -0.18410529, 9.81525326), "gyr": (-0.00086874, -0.00810772, -0.00362992)},
    ),
    "all": (
        "FAFF3692 102002 918D 106004 01363FA6 201010 3F35E042 3F31CD15 BD9F49DB BDA938CF 40200C BD635A90 411D08D4"
        "3E5FAA50 40100C B9116800 3CC90100 3A0F7D00 40300C BC3B2980 3C35FC00 3CA46E00 80200C 3CAEA241 BB56D800"
        "BAD5AC01 803010 3F800000 37DF8801 B6898000 B608C000 C0200C BEFBFBF2 3F33C485 BFA0A2C1 081004 42168000"
        "301004 000186E1 E02004 00400003 DD",
        {"counter": 37261, "time": 20332454, "q": (0.71045315, 0.69453555, -0.07777759, -0.08262789)}
        | {"acc": (-0.05550629, 9.81465530, 0.21842313), "gyr": (0.02131760, -0.00327826, -0.00163019)}
        | {"mag": (-0.49215657, 0.70221740, -1.25496686), "temp_c": 37.625, "pressure_pa": 100065},
    ),
}
NOMINAL = 50.0  # uT for a field of 1, whose size the device does not say


@pytest.mark.parametrize("name", MTI)
def test_a_packet_of_an_mti_says_what_its_maker_says(name):
    text, told = MTI[name]
    form, whole = find_format("xbus_mtdata2"), bytes.fromhex(text)
    frames, counts = decode(whole, form)
    assert counts.junk == 0 and list(frames) == [name]
    columns = frames[name].columns
    for key, expected in told.items():
        own = [column for one, column in columns.items() if one[:-2] == key or (key == "q" and one[:1] == "q")]
        own = own or [columns[key]]
        scale = NOMINAL if key == "mag" else 1.0
        got = np.concatenate(own) / scale
        np.testing.assert_allclose(got, np.atleast_1d(expected), rtol=2.0**-24, atol=0.51e-8)
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
