"""The chips of the catalogue: every worked example, every count, every known wrong decoder.

Bytes are computed from the scale factors of the sources named in each TOML file (ADXRS290: Linux adxrs290.c; ADXRS453:
data sheet Rev. A; MPU-6000: PS-MPU-6000A-00; MPU-3050: Linux mpu3050-core.c; HMC5983: data sheet of the HMC5883L and
drivers; ADIS16355: data sheet Rev. B, whose table 7 has the gyroscope's codes for ±40 and ±80 deg/s). Those of the
MPU-9250 and later ones are computed by hand from scales and byte orders of the data sheets and drivers that each file
names.
"""

import math

import numpy as np
import pytest

from plumbob.core import flags
from plumbob.protocols.decode import decode, triads_of
from plumbob.protocols.encode import encode
from plumbob.protocols.field import MARKS
from plumbob.protocols.format_toml import find_format, parse_format
from plumbob.protocols.unpack import field_values, read_counts
from plumbob.simulation.presets import preset_names

CHIPS = (
    "adxrs290", "adxrs453", "mpu6000", "mpu3050", "hmc5983", "adis16355", "mpu9250", "icm20948", "bmi088", "bmi160",
    "bmi270", "lsm6dso", "lis3mdl", "lsm9ds1", "bno055", "adis16470", "adis16505",
)  # fmt: skip
DEG, G, GAUSS = math.pi / 180, 9.80665, 100.0
POLL = "8222 BDDE BFFF 8000 BE73 818D 8029 8F32 8AAA 8800"

# device, options, message, bytes, what is asked to be encoded, what these bytes then say exactly
EXAMPLES = [
    (
        "adxrs290", {}, "", "A4 09 E1 B1 3D 01",
        {"gyr.x": 12.34 * DEG, "gyr.y": -99.995 * DEG, "temp_c": 31.7},
        {"gyr.x": 2468 / 200 * DEG, "gyr.y": -19999 / 200 * DEG, "temp_c": 31.7},
    ),
    ("adxrs290", {}, "", "00 00 00 00 83 0F", {"temp_c": -12.5}, {"gyr.x": 0.0, "gyr.y": 0.0, "temp_c": -12.5}),
    (
        "adxrs453", {}, "sensor", "14 02 80 01", {"gyr.z": 2 * DEG},
        {"gyr.z": 2 * DEG, "st": 1, "sq": 0, "faults": 0},
    ),
    ("adxrs453", {}, "sensor", "17 FD 80 01", {"gyr.z": -2 * DEG}, {"gyr.z": -2 * DEG}),
    ("adxrs453", {}, "sensor", "15 77 00 00", {"gyr.z": 300 * DEG}, {"gyr.z": 300 * DEG}),
    ("adxrs453", {}, "sensor", "15 77 00 00", {"gyr.z": 401 * DEG}, {"gyr.z": 300 * DEG}),
    ("adxrs453", {}, "sensor", "A6 89 00 00", {"gyr.z": -300 * DEG, "sq": 5}, {"gyr.z": -300 * DEG, "sq": 5}),
    ("adxrs453", {}, "sensor", "04 00 00 00", {"gyr.z": 0.0}, {"gyr.z": 0.0}),
    (
        "adxrs453", {}, "sensor", "10 00 00 84", {"gyr.z": 0.0, "st": 0, "faults": 64 + 2},
        {"gyr.z": 0.0, "st": 0, "faults": 66},
    ),
    (
        "adxrs453", {}, "sensor", "08 00 00 FF", {"gyr.z": 0.0, "st": 2, "faults": 127},
        {"gyr.z": 0.0, "st": 2, "faults": 127},
    ),
    ("adxrs453", {}, "read", "4E 1C E0 01", {"data": 0xE700}, {"data": 0xE700, "sm": 0}),
    ("adxrs453", {}, "read", "5E 00 00 00", {"data": 0x0000}, {"data": 0x0000}),
    ("adxrs453", {}, "read", "5E 06 40 01", {"data": 0x3200}, {"data": 0x3200}),
    ("adxrs453", {}, "read", "5E 18 F8 01", {"data": 0xC7C0}, {"data": 0xC7C0}),
    ("adxrs453", {}, "read", "5E 12 B8 00", {"data": 0x95C0}, {"data": 0x95C0}),
    ("adxrs453", {}, "read", "5E 0A 40 20", {"data": 0x5201}, {"data": 0x5201}),
    ("adxrs453", {}, "error", "1E 02 00 00", {"re": 1}, {"re": 1, "spi": 0, "du": 0, "faults": 0}),
    ("adxrs453", {}, "error", "1E 04 00 00", {"spi": 1}, {"re": 0, "spi": 1, "du": 0, "faults": 0}),
    (
        "mpu6050", {}, "", "01 48 FF 5C 3F DF F0 B0 00 C4 FF 9E 33 2C",
        {"acc.x": 0.02 * G, "acc.y": -0.01 * G, "acc.z": 0.998 * G, "temp_c": 25.0}
        | {"gyr.x": 1.5 * DEG, "gyr.y": -0.75 * DEG, "gyr.z": 100 * DEG},
        {"acc.x": 328 / 16384 * G, "acc.y": -164 / 16384 * G, "acc.z": 16351 / 16384 * G}
        | {"temp_c": -3920 / 340 + 36.53, "gyr.x": 196 / 131 * DEG, "gyr.y": -98 / 131 * DEG, "gyr.z": 100 * DEG},
    ),
    (
        "mpu3050", {}, "", "C1 80 00 C4 FF 9E 33 2C",
        {"temp_c": 25.0, "gyr.x": 1.5 * DEG, "gyr.y": -0.75 * DEG, "gyr.z": 100 * DEG},
        {"temp_c": 25.0, "gyr.x": 196 / 131 * DEG, "gyr.y": -98 / 131 * DEG, "gyr.z": 100 * DEG},
    ),
    (
        "hmc5983", {}, "", "00 EA 01 AA FF D2",
        {"mag.x": 0.215 * GAUSS, "mag.y": -0.042 * GAUSS, "mag.z": 0.391 * GAUSS},
        {"mag.x": 234 / 1090 * GAUSS, "mag.y": -46 / 1090 * GAUSS, "mag.z": 426 / 1090 * GAUSS},
    ),
    (
        "hmc5983", {"gain": "4.7 gauss"}, "", "01 C4 01 A5 01 C4",
        {"mag.x": 1.16 * GAUSS, "mag.y": 1.16 * GAUSS, "mag.z": 1.08 * GAUSS},
        {"mag.x": 452 / 390 * GAUSS, "mag.y": 452 / 390 * GAUSS, "mag.z": 421 / 390 * GAUSS},
    ),
    (
        "adis16355", {}, "", POLL,
        {"gyr.x": 40 * DEG, "gyr.y": -40 * DEG, "gyr.z": -0.07326 * DEG, "acc.x": 0.0, "acc.y": -G, "acc.z": G}
        | {"temp_c": 31.0, "temp_y_c": -5.0, "supply_v": 5.0, "aux_v": 1.25},
        {"gyr.x": 546 * 0.07326 * DEG, "gyr.y": -546 * 0.07326 * DEG, "gyr.z": -0.07326 * DEG}
        | {"acc.x": 0.0, "acc.y": -397 * 2.522e-3 * G, "acc.z": 397 * 2.522e-3 * G, "temp_c": 25 + 41 * 0.1453}
        | {"temp_y_c": 25 - 206 * 0.1453, "supply_v": 2730 * 1.8315e-3, "aux_v": 2048 * 0.6105e-3},
    ),
    (  # the AK8963 says 100, -200, 300 along its x, y, z: body y, body x, minus body z
        "mpu9250", {}, "", "00 00 00 00 40 00 05 38 00 00 00 00 33 2C 64 00 38 FF 2C 01 00",
        {"acc.z": G, "temp_c": 25.0, "gyr.z": 100 * DEG, "mag.x": -30.0, "mag.y": 15.0, "mag.z": -45.0},
        {"acc.z": G, "temp_c": (1336 + 7011) * 2.995178e-3, "gyr.z": 100 * DEG}
        | {"mag.x": -30.0, "mag.y": 15.0, "mag.z": -45.0},
    ),
    (  # the AK09916 says 100, -200, 300: its y and z are reversed
        "icm20948", {}, "", "00 00 00 00 40 00 00 00 00 00 33 2C 05 37 01 64 00 38 FF 2C 01 00 00",
        {"acc.z": G, "temp_c": 25.0, "gyr.z": 100 * DEG, "mag.x": 15.0, "mag.y": 30.0, "mag.z": -45.0},
        {"acc.z": G, "temp_c": 21 + 1335 / 333.87, "gyr.z": 100 * DEG, "mag.x": 15.0, "mag.y": 30.0, "mag.z": -45.0},
    ),
    (
        "bmi088", {}, "", "00 00 00 00 55 15 00 00 00 00 00 00 00 00 00 00 00 60 00 00 00 00 66 06",
        {"acc.z": G, "temp_c": 23.375, "gyr.z": 100 * DEG},
        {"acc.z": 5461 * 6 / 32768 * G, "temp_c": 23.375, "gyr.z": 1638 * 2000 / 32768 * DEG},
    ),
    (
        "bmi160", {}, "", "00 00 00 00 66 06 00 00 00 00 00 40 00 00 00", {"gyr.z": 100 * DEG, "acc.z": G},
        {"gyr.z": 1638 * 2000 / 32768 * DEG, "acc.z": G},
    ),
    (
        "bmi270", {}, "", "00 00 00 00 00 10 00 00 00 00 66 06 00 00 00", {"gyr.z": 100 * DEG, "acc.z": G},
        {"gyr.z": 1638 * 2000 / 32768 * DEG, "acc.z": G},
    ),
    (
        "lsm6dso", {}, "", "80 00 00 00 00 00 A4 2C 00 00 00 00 09 40",
        {"temp_c": 25.5, "gyr.z": 99.995 * DEG, "acc.z": G},
        {"temp_c": 25.5, "gyr.z": 99.995 * DEG, "acc.z": 16393 * 0.061e-3 * G},
    ),
    (
        "lis3mdl", {}, "", "5D 0D 46 E5 00 00 00 00",
        {"mag.x": 0.5 * GAUSS, "mag.y": -1.0 * GAUSS, "mag.z": 0.0, "temp_c": 25.0},
        {"mag.x": 0.5 * GAUSS, "mag.y": -1.0 * GAUSS, "mag.z": 0.0, "temp_c": 25.0},
    ),
    (  # x of the magnetometer is mirrored: 1000 counts are -0.14 gauss
        "lsm9ds1", {}, "", "10 00 00 00 00 00 00 A4 2C 00 00 00 00 09 40 E8 03 D0 07 00 00",
        {"temp_c": 26.0, "gyr.z": 99.995 * DEG, "acc.z": G, "mag.x": -0.14 * GAUSS, "mag.y": 0.28 * GAUSS},
        {"temp_c": 26.0, "gyr.z": 99.995 * DEG, "acc.z": 16393 * 0.061e-3 * G}
        | {"mag.x": -0.14 * GAUSS, "mag.y": 0.28 * GAUSS},
    ),
    (
        "bno055", {}, "",
        "00 00 00 00 D5 03 40 01 00 00 00 00 00 00 00 00 40 06 A0 05 00 00 00 00 00 40 00 00 00 00 00 00"
        "00 00 00 00 00 00 00 00 00 00 D5 03 19 FF",
        {"acc.z": 9.81, "mag.x": 20.0, "gyr.z": 100 * DEG, "heading": 90 * DEG, "qw": 1.0, "gravity_z": 9.81}
        | {"temp_c": 25.0, "calibrated": 255},
        {"acc.z": 9.81, "mag.x": 20.0, "gyr.z": 100 * DEG, "heading": 90 * DEG, "roll": 0.0, "qw": 1.0, "qx": 0.0}
        | {"gravity_z": 9.81, "temp_c": 25.0, "calibrated": 255},
    ),
    (  # 90 counts per deg/s of 900 per rad/s, 1 count for 1 mg
        "bno055", {"gyr_unit": "rad/s", "acc_unit": "mg"}, "",
        "00 00 00 00 E8 03 00 00 00 00 00 00 00 00 00 00 84 03" + 26 * "00" + "19 00",
        {"acc.z": G, "gyr.z": 1.0, "temp_c": 25.0}, {"acc.z": G, "gyr.z": 1.0},
    ),
    (
        "adis16470", {}, "", "00 00 00 00 00 00 03 E8 00 00 00 00 03 20 00 FA 00 07 02 0F",
        {"gyr.z": 100 * DEG, "acc.z": G, "temp_c": 25.0, "data_counter": 7},
        {"gyr.z": 100 * DEG, "acc.z": G, "temp_c": 25.0, "data_counter": 7},
    ),
    (
        "adis16505", {}, "", "00 00 00 00 00 00 0F A0 00 00 00 00 0F A0 00 FA 00 07 02 5F",
        {"gyr.z": 100 * DEG, "acc.z": 9.75, "temp_c": 25.0, "data_counter": 7},
        {"gyr.z": 100 * DEG, "acc.z": 9.75, "temp_c": 25.0, "data_counter": 7},
    ),
]  # fmt: skip


NAN = math.nan
TURN, BURST = 546 * 0.07326 * DEG, "00 00 00 00 00 00 0F A0 00 00 00 00 0F A0 00 FA 00 07 02 5F"
ICM = "00" * 14 + "{} 64 00 38 FF 2C 01 00 {}"
BMI = "66 06 00 00 00 00 00 00 00 00 00 10 00 00 00"

# Device, options, bytes, what they say exactly, and flags: what is absent, clipped or stale, bits that do not matter,
# and what known wrong decoders take for something else.
SAID = [
    # DS-5883L p. 15: -4096 is an overflow, and of its channel alone; the ends of the converter are clipped
    ("hmc5983", {}, "00 EA 01 AA F0 00", {"mag.x": 234 / 1090 * GAUSS, "mag.y": NAN}, flags.MAG_CLIPPED),
    ("hmc5983", {}, "07 FF 00 00 00 00", {"mag.x": 2047 / 1090 * GAUSS}, flags.MAG_CLIPPED),
    ("hmc5983", {}, "F8 00 00 00 00 00", {"mag.x": -2048 / 1090 * GAUSS}, flags.MAG_CLIPPED),
    ("adxrs290", {}, "00 00 00 00 3D 51", {"temp_c": 31.7}, 0),  # NOOS-290 does not mask the upper four bits
    ("adxrs453", {}, "14 02 80 01", {"gyr.z": 2 * DEG}, 0),
    ("adxrs453", {}, "10 00 00 84", {"st": 0}, flags.GYR_INVALID),
    ("adxrs453", {}, "08 00 00 FF", {"st": 2}, flags.GYR_INVALID),
    ("adxrs453", {}, "15 77 00 00", {"gyr.z": 300 * DEG}, flags.GYR_CLIPPED),
    # ND = 0 in the second word: 3DDE in place of BDDE; a stale temperature flags nothing
    ("adis16355", {}, POLL.replace("BDDE", "3DDE"), {"gyr.x": TURN, "gyr.y": NAN, "gyr_y_nd": 0}, flags.GYR_ABSENT),
    ("adis16355", {}, POLL.replace("8029", "0029"), {"temp_c": NAN}, 0),
    ("adis16355", {}, POLL.replace("8222", "C222"), {"gyr_x_ea": 1, "gyr.x": TURN}, 0),
    # bits 13:12 of 12-bit outputs are unused (DS-1635x)
    ("adis16355", {}, POLL.replace("8029", "B029"), {"temp_c": 25 + 41 * 0.1453}, 0),
    ("adis16355", {}, POLL.replace("8AAA", "BAAA"), {"supply_v": 2730 * 1.8315e-3}, 0),
    ("adis16355", {"gyr_range": "150 deg/s"}, POLL, {"gyr.x": 546 * 0.03663 * DEG}, 0),
    ("adis16355", {"gyr_range": "75 deg/s"}, POLL, {"gyr.x": 546 * 0.018315 * DEG}, 0),
    # ArduPilot: revisions C4 and C5 have 4096 LSB/g with AFS_SEL 1, where the sheet has 8192
    ("mpu6000", {"silicon": "C4 or C5", "acc_range": "4 g"}, "10 00" + 12 * "00", {"acc.x": G}, 0),
    ("mpu6000", {"acc_range": "4 g"}, "10 00" + 12 * "00", {"acc.x": G / 2}, 0),
    # BST-BMI088-DS001 page 21, table of the temperature sensor; 80 is invalid there
    ("bmi088", {}, "00" * 16 + "3E 00" + "00" * 6, {"temp_c": 85.0}, 0),
    ("bmi088", {}, "00" * 16 + "00 60" + "00" * 6, {"temp_c": 23.375}, 0),
    ("bmi088", {}, "00" * 16 + "00 20" + "00" * 6, {"temp_c": 23.125}, 0),
    ("bmi088", {}, "00" * 24, {"temp_c": 23.0}, 0),
    ("bmi088", {}, "00" * 16 + "C1 00" + "00" * 6, {"temp_c": -40.0}, 0),
    ("bmi088", {}, "00" * 16 + "80 00" + "00" * 6, {"temp_c": NAN}, 0),
    # an old or overflowed field is no field
    ("icm20948", {}, ICM.format("01", "00"), {"mag.x": 15.0}, 0),
    ("icm20948", {}, ICM.format("00", "00"), {"mag.x": NAN, "mag.y": NAN, "mag.z": NAN}, flags.MAG_ABSENT),
    ("icm20948", {}, ICM.format("01", "08"), {}, flags.MAG_INVALID),
    ("mpu9250", {}, "00" * 14 + "64 00 38 FF 2C 01 08", {}, flags.MAG_INVALID),
    # the same bytes, from the same registers: rates first in the one, specific forces in the other
    ("bmi160", {}, BMI, {"gyr.x": 1638 * 2000 / 32768 * DEG}, 0),
    ("bmi270", {}, BMI, {"acc.x": 1638 * 8 / 32768 * G}, 0),
    ("lsm9ds1", {"acc_range": "16 g"}, "00" * 9 + "E8 03" + "00" * 10, {"acc.x": 0.732 * G}, 0),
]


def bound(name, options=()):
    return find_format(name).bind(dict(options))


def only_frame(form, data):
    """The only frame that bytes decode to, and its message's name."""
    found, counts = decode(data, form)
    assert counts.junk == 0
    ((name, frames),) = found.items()
    assert len(frames) == 1
    return name, frames


@pytest.mark.parametrize(("device", "options", "message", "text", "given", "said"), EXAMPLES)
def test_worked_examples_encode_and_decode(device, options, message, text, given, said):
    form = bound(device, options)
    rows = encode(form, {key: [value] for key, value in given.items()}, message=message)
    assert rows.tobytes() == bytes.fromhex(text)
    name, frames = only_frame(form, bytes.fromhex(text))
    assert name == (message or form.name)
    for key, value in said.items():
        assert frames.columns[key][0] == pytest.approx(value, rel=1e-12, abs=1e-15), key


@pytest.mark.parametrize(("device", "options", "text", "said", "flag"), SAID)
def test_bytes_that_are_read_wrongly_elsewhere(device, options, text, said, flag):
    _, frames = only_frame(bound(device, options), bytes.fromhex(text))
    for key, value in said.items():
        assert frames.columns[key][0] == pytest.approx(value, rel=1e-12, nan_ok=True), key
    assert frames.flags[""][0] == flag


def test_an_axis_that_a_chip_lacks_has_no_values():
    _, frames = only_frame(bound("adxrs290"), bytes.fromhex("A4 09 E1 B1 3D 01"))
    assert np.isnan(triads_of(frames)["gyr"]).tolist() == [[False, False, True]]


def test_codes_of_the_adis_data_sheet():
    # DS-1635x table 7, flags masked: 80 deg/s = 0444, 40 = 0222, -40 = 3DDE, -80 = 3BBC
    word = encode(bound("adis16355"), {"gyr.x": np.array([80.0, 40.0, -40.0, -80.0]) * DEG})[:, :2].copy().view(">u2")
    assert (word[:, 0] & 0x3FFF).tolist() == [0x0444, 0x0222, 0x3DDE, 0x3BBC]


def test_a_missing_channel_of_the_magnetometer_is_sent_as_its_overflow():
    rows = encode(bound("hmc5983"), {"mag.x": [21.5], "mag.y": [NAN], "mag.z": [39.1]})
    assert rows.tobytes() == bytes.fromhex("00 EA 01 AA F0 00")


def test_gains_of_the_hmc5983():
    """DS-5883 (without L) has 1024 LSB per gauss at the default gain."""
    form = bound("hmc5983")
    assert list(form.options["gain"].choices.values()) == [1370, 1090, 820, 660, 440, 390, 330, 230]
    assert form.chosen == {"gain": "1.3 gauss"}


CHOICES = [
    (name, option, choice) for name in CHIPS for option, o in bound(name).options.items() for choice in o.choices
]


@pytest.mark.parametrize(("name", "option", "choice"), [*CHOICES, ("adxrs290", "", ""), ("adxrs453", "", "")])
def test_counts_survive_from_bytes_to_value_and_back(name, option, choice):
    form = bound(name, {option: choice} if option else {})
    for field in (f for f in form.message().fields if f.physical):
        low, high = field.clip or field.limits
        counts = np.unique(np.r_[low : high + 1 : 13, -1:2, high - 1, high].clip(low, high))
        rows = encode(form, {field.name: field_values(field, counts)})
        assert np.array_equal(read_counts(field, rows), counts)


@pytest.mark.parametrize("name", CHIPS)
def test_everything_names_its_source_and_registers_have_the_scales_of_their_fields(name):
    form = bound(name)
    origins = {f"{m.name}.{f.name}": f.origin for m in form.messages for f in m.fields}
    origins |= {key: o.origin for key, o in form.options.items()} | {key: o for key, (_, o) in form.facts.items()}
    origins |= {r.name: r.origin for r in form.registers}
    for key, origin in origins.items():
        assert origin.mark in MARKS[:-1], key
        assert origin.source in form.sources or (not origin.source and origin.mark == "UNVERIFIED"), key
    assert form.noise in preset_names()
    scales = {(f.scale, f.zero, f.raw_offset) for m in form.messages for f in m.fields if f.physical}
    words = [r.word for r in form.registers if r.word and r.word.physical]
    assert scales <= {(w.scale, w.zero, w.raw_offset) for w in words}


# --- kinds of replies of the ADXRS453, and its parity ---


def test_a_sensor_reply_is_told_by_its_status_from_a_read_and_has_no_rate_in_a_reply_of_no_kind():
    """The top bits of one with sequence number 2 are those of a read; ST tells them apart (DS-453)."""
    for sq in range(8):
        row = encode(bound("adxrs453"), {"gyr.z": [0.1], "sq": [sq]}, message="sensor")
        name, frames = only_frame(bound("adxrs453"), row.tobytes())
        assert (name, frames.columns["sq"][0]) == ("sensor", sq)
    row = encode(bound("adxrs453"), {"gyr.z": [0.1], "st": [3], "sq": [7]}, message="sensor")
    name, frames = only_frame(bound("adxrs453"), row.tobytes())
    assert name == "sensor" and np.isnan(frames.columns["gyr.z"][0])
    assert frames.flags[""][0] == flags.GYR_ABSENT


def test_replies_of_every_kind_in_one_stream():
    write = encode(bound("adxrs453"), {"data": [0xBEEF]}, message="write").tobytes()
    found, counts = decode(bytes.fromhex("14028001 4E1CE001 1E020000") + write, bound("adxrs453"))
    starts = {name: int(frames.start[0]) for name, frames in found.items()}
    assert starts == {"sensor": 0, "read": 4, "error": 8, "write": 12}
    assert found["write"].columns["data"][0] == 0xBEEF
    assert counts.junk == 0


@pytest.mark.parametrize("text", sorted({row[3] for row in EXAMPLES if row[0] == "adxrs453"}))
def test_a_single_flipped_bit_of_an_adxrs453_frame_is_always_rejected(text):
    whole = int.from_bytes(bytes.fromhex(text), "big")
    assert (whole >> 16).bit_count() % 2 == whole.bit_count() % 2 == 1
    flipped = b"".join((whole ^ 1 << bit).to_bytes(4, "big") for bit in range(32))
    found, counts = decode(flipped, bound("adxrs453"))
    assert found == {}
    assert (counts.junk, counts.bad_content) == (128, 32)


@pytest.mark.parametrize(
    ("device", "text"),
    [
        ("adxrs453", "00400AE0"),  # WPILib's simulated pattern fails the parity
        ("adis16505", BURST.replace("0F A0", "0E A0", 1)),
    ],
)
def test_a_burst_that_fails_its_check_is_none(device, text):
    assert decode(bytes.fromhex(text), bound(device))[0] == {}


def test_a_status_of_one_field_keeps_its_unit_inside_a_frame():
    form = parse_format(
        'kind = "plumbob format"\nversion = 1\nname = "carrier"\ntitle = "carrier"\n[frame]\nsync = "A5"\nlength = 21\n'
        '[[embed]]\ndevice = "adis16355"\nat = 1\nunit = "u1"\n'
    )
    frames = decode(b"\xa5" + bytes.fromhex(POLL.replace("BDDE", "3DDE")), form)[0]["carrier"]
    assert np.isnan(frames.columns["u1.gyr.y"][0])
    assert np.isfinite(frames.columns["u1.gyr.x"][0])
    assert frames.flags["u1"][0] == flags.GYR_ABSENT


@pytest.mark.parametrize("name", ["bmi088", "bmi160", "bmi270"])
def test_sensor_time_of_the_bosch_parts_counts_39_us(name):
    """25600 counts are a second: BST-BMI160-DS000-07 table 11 and BST-BMI088-DS001 page 21, which wraps at 655.36 s."""
    (clock,) = (field for field in bound(name).message().fields if field.role == "clock")
    assert 25600 * clock.scale == pytest.approx(1.0, rel=1e-12)
    assert (clock.type, clock.order) == ("u24", "little")
