"""Words of registers, contents of a FIFO, commands, and replies that come one transfer late."""

import math

import numpy as np
import pytest

from plumbob.core.errors import DecodeError, ParameterError
from plumbob.protocols import catalog
from plumbob.protocols.decode import Decoder
from plumbob.protocols.encode import encode
from plumbob.protocols.format_toml import parse_format
from plumbob.protocols.unpack import counts_of, values_of
from tests.helpers.chips import words_adis16355, words_adxrs453
from tests.helpers.chips.fifo import fifo_format
from tests.helpers.chips.registers import register_bytes, register_values

DEG, G = math.pi / 180, 9.80665

# Chip, register, its bytes, what they mean; computed from the sources named in the catalogue.
WORDS = [
    ("adxrs290", "TEMP", "83 0F", -12.5),
    ("adxrs290", "DATAY", "E1 B1", -99.995 * DEG),
    ("adxrs453", "TEM", "E7 00", 25.0),
    ("adxrs453", "TEM", "00 00", 45.0),
    ("adxrs453", "TEM", "32 00", 85.0),
    ("adxrs453", "TEM", "C7 C0", 0.0),
    ("adxrs453", "TEM", "95 C0", -40.0),
    ("adxrs453", "PID", "52 01", 0x5201),
    ("adxrs453", "QUAD", "FF B0", -1.0 * DEG),
    ("mpu6000", "TEMP_OUT", "F0 B0", -3920 / 340 + 36.53),
    ("mpu3050", "TEMP", "C1 80", 25.0),
    ("hmc5983", "TEMP", "03 40", 31.5),
    ("adis16355", "SUPPLY_OUT", "0A AA", 2730 * 1.8315e-3),
    ("adis16355", "ZTEMP_OUT", "0F 32", 25 - 206 * 0.1453),
    ("adis16355", "YGYRO_OFF", "1F FF", -0.018315 * DEG),
    ("adis16355", "SENS_AVG", "04 02", 0x0402),
]


@pytest.mark.parametrize(("name", "register", "text", "value"), WORDS)
def test_a_register_says_its_value_and_back(name, register, text, value):
    form = catalog.load(name)
    data = bytes.fromhex(text)
    assert register_values(form, register, data)[0] == pytest.approx(value, rel=1e-12, abs=1e-13)
    assert register_bytes(form, register, value) == data


def test_flags_beside_the_value_do_not_matter():
    assert register_values(catalog.load("adis16355"), 0x04, bytes.fromhex("C222"))[0] == pytest.approx(
        546 * 0.07326 * DEG
    )


def test_a_register_follows_the_range():
    form = catalog.load("adis16355").bind({"gyr_range": "75 deg/s"})
    assert register_values(form, "XGYRO_OUT", bytes.fromhex("8222"))[0] == pytest.approx(546 * 0.018315 * DEG)


def test_trap_noos_temperature_of_the_adxrs453():
    """(raw - 31F)/5 on unsigned words agrees at 25 °C, and is wrong above 44.8 °C and below 0 °C."""
    form = catalog.load("adxrs453")

    def wrong(text):
        return (((int(text, 16) >> 6) - 0x31F) & 0xFFFFFFFF) / 5

    assert wrong("E700") == pytest.approx(register_values(form, "TEM", bytes.fromhex("E700"))[0])
    for text, true in (("3200", 85.0), ("95C0", -40.0)):
        assert register_values(form, "TEM", bytes.fromhex(text))[0] == true
        assert abs(wrong(text) - true) > 100.0


@pytest.mark.parametrize("name", ["adxrs290", "adxrs453", "mpu6000", "mpu3050", "hmc5983", "adis16355"])
def test_every_count_of_every_register_survives(name):
    form = catalog.load(name).bind()
    for word in (r.word for r in form.registers if r.word and r.word.physical):
        low, high = word.limits
        counts = np.unique(np.linspace(low, high, 300).astype(np.int64))
        data = b"".join(register_bytes(form, word.name, v) for v in values_of(word, counts)[::50])
        rows = np.frombuffer(data, dtype=np.uint8).reshape(-1, word.size)
        assert np.array_equal(counts_of(word, rows), counts[::50])


def test_a_register_that_is_none_says_so():
    form = catalog.load("adxrs453")
    with pytest.raises(ParameterError, match="no register 'TEMP'"):
        register_values(form, "TEMP", b"\0\0")
    with pytest.raises(DecodeError, match="has 2 bytes, but 3 came"):
        register_values(form, "TEM", b"\0\0\0")
    with pytest.raises(ParameterError, match="makes no number"):
        register_values(catalog.load("adxrs290"), "FILTER", b"\0")


def test_a_register_in_ones_own_format_is_read_strictly():
    text = (
        'kind = "plumbob format"\nversion = 1\nname = "own"\ntitle = "own"\nbyte_order = "big"\n[frame]\nlength = 2\n'
        '[[field]]\nname = "temp_c"\ntype = "s16"\nunit = "degC"\n'
        '[[register]]\naddress = 1\nname = "V"\nmeaning = "volts"\ntype = "u16"\nunit = "{unit}"\n{more}'
    )
    form = parse_format(text.format(unit="mV", more=""))
    assert register_values(form, "V", b"\x03\xe8")[0] == pytest.approx(1.0)
    with pytest.raises(DecodeError, match="no key 'role'"):
        parse_format(text.format(unit="mV", more='role = "status"\n'))
    with pytest.raises(Exception, match="'bogus' is not a unit"):
        register_values(parse_format(text.format(unit="bogus", more="")), "V", b"\0\0")


def test_a_settled_option_cannot_be_settled_otherwise():
    """Its numbers are in the fields by then; a second choice would change the name of the range and no number."""
    form = catalog.load("adis16355").bind({"gyr_range": "75 deg/s"})
    assert form.bind().chosen["gyr_range"] == "75 deg/s"
    with pytest.raises(ParameterError, match="is settled as '75 deg/s' and cannot become '150 deg/s'"):
        form.bind({"gyr_range": "150 deg/s"})


# --- FIFO ---


@pytest.mark.parametrize(
    ("fifo_en", "length", "names"),
    [
        (0xF8, 14, ["acc.x", "acc.y", "acc.z", "temp_c", "gyr.x", "gyr.y", "gyr.z"]),
        (0x78, 12, ["acc.x", "acc.y", "acc.z", "gyr.x", "gyr.y", "gyr.z"]),
        (0x70, 6, ["gyr.x", "gyr.y", "gyr.z"]),
        (0x88, 8, ["acc.x", "acc.y", "acc.z", "temp_c"]),
        (0x20, 2, ["gyr.y"]),
    ],
)
def test_the_fifo_of_the_mpu6000_has_what_is_on_in_order_of_registers(fifo_en, length, names):
    form = fifo_format(catalog.load("mpu6000"), fifo_en)
    assert form.framing.length == length
    assert [f.name for f in form.message().fields] == names
    assert [f.at for f in form.message().fields] == list(range(0, length, 2))


def test_the_fifo_of_the_mpu3050_is_read_with_8_then_with_10_bytes():
    first = fifo_format(catalog.load("mpu3050"), 0xF1)
    later = fifo_format(catalog.load("mpu3050"), 0xF1, later=True)
    assert (first.framing.length, later.framing.length) == (8, 10)
    sample = bytes.fromhex("C1 80 00 C4 FF 9E 33 2C")
    decoded = Decoder(later).feed(b"\xab\xcd" + sample)["mpu3050"]
    assert decoded.columns["footer"][0] == 0xABCD
    assert decoded.columns["temp_c"][0] == 25.0
    assert Decoder(first).feed(sample)["mpu3050"].columns["gyr.z"][0] == pytest.approx(100 * DEG)
    assert fifo_format(catalog.load("mpu3050"), 0xF0, later=True).framing.length == 8


@pytest.mark.parametrize(("name", "fifo_en"), [("mpu6000", 0), ("mpu6000", 0x79), ("mpu3050", 0x01), ("mpu3050", 0x08)])
def test_a_fifo_of_nothing_or_of_what_the_burst_lacks_is_refused(name, fifo_en):
    with pytest.raises(ParameterError, match=f"but it is {fifo_en:02X}"):
        fifo_format(catalog.load(name), fifo_en)


def test_a_chip_without_a_fifo_says_so():
    with pytest.raises(ParameterError, match="hmc5983 has no FIFO"):
        fifo_format(catalog.load("hmc5983"), 0x80)


# --- commands ---


@pytest.mark.parametrize(
    ("command", "text"),
    [  # DS-453: the words for SQ 0 and CHK stand in its table of the start-up; the others computed from its bits
        (words_adxrs453.sensor_command(), "20000000"),
        (words_adxrs453.sensor_command(1), "60000001"),
        (words_adxrs453.sensor_command(2), "A0000001"),
        (words_adxrs453.sensor_command(3), "E0000000"),
        (words_adxrs453.sensor_command(4), "30000001"),
        (words_adxrs453.sensor_command(check=True), "20000003"),
        (words_adxrs453.read_command(0x00), "80000000"),
        (words_adxrs453.read_command(0x02), "80040001"),
        (words_adxrs453.read_command(0x08), "80100001"),
        (words_adxrs453.read_command(0x0A), "80140000"),
        (words_adxrs453.read_command(0x0C), "80180000"),
        (words_adis16355.read_command(0x04), "0400"),
        (words_adis16355.write_command(0x39, 0x02), "B902"),
    ],
)
def test_commands(command, text):
    assert command == bytes.fromhex(text)


def test_a_write_carries_its_bits_and_odd_parity():
    word = int.from_bytes(words_adxrs453.write_command(0x1FF, 0xFFFF), "big")
    assert (word >> 29, word >> 17 & 0x1FF, word >> 1 & 0xFFFF, word.bit_count() % 2) == (0b010, 0x1FF, 0xFFFF, 1)


@pytest.mark.parametrize(
    "call",
    [
        lambda: words_adxrs453.sensor_command(8),
        lambda: words_adxrs453.read_command(0x200),
        lambda: words_adxrs453.write_command(0, 0x10000),
        lambda: words_adis16355.read_command(0x40),
        lambda: words_adis16355.write_command(0, 256),
    ],
)
def test_commands_beyond_their_bits_are_refused(call):
    with pytest.raises(ParameterError, match="must"):
        call()


# --- replies one transfer late ---


def test_replies_of_the_adxrs453_find_their_registers():
    asked = [0x02, None, 0x0C, 0x02, 0x40, 0x02, 0x02]
    commands = b"".join(words_adxrs453.sensor_command() if a is None else words_adxrs453.read_command(a) for a in asked)
    replies = bytes.fromhex("00000001 4E1CE001 14028001 5E0A4020 5E064001 5E000000 5E12B801")  # the last is damaged
    answers = words_adxrs453.register_readings(commands, replies)
    tem, pid = answers.readings["TEM"], answers.readings["PID"]
    assert (tem.place.tolist(), tem.values.tolist()) == ([0, 3], [25.0, 85.0])
    assert (pid.place.tolist(), pid.values.tolist(), pid.words.tolist()) == ([2], [0x5201], [0x5201])
    assert (answers.unanswered, answers.unknown) == (2, 1)


def test_a_refused_read_is_unanswered():
    answers = words_adxrs453.register_readings(
        words_adxrs453.read_command(0x02) * 2, bytes.fromhex("00000001 1E020000")
    )
    assert (answers.readings, answers.unanswered) == ({}, 2)


def test_replies_of_the_adis_find_their_registers():
    commands = (
        words_adis16355.read_command(0x10) + words_adis16355.write_command(0x38, 1) + words_adis16355.read_command(0x12)
    )
    answers = words_adis16355.register_readings(catalog.load("adis16355"), commands, bytes.fromhex("0000 8029 0000"))
    assert answers.readings["XTEMP_OUT"].values[0] == pytest.approx(25 + 41 * 0.1453)
    assert answers.readings["XTEMP_OUT"].words[0] >> 15 == 1
    assert answers.unanswered == 1


def test_commands_and_replies_must_belong_together():
    with pytest.raises(DecodeError, match="transfers of 4 bytes"):
        words_adxrs453.register_readings(bytes(8), bytes(4))
    with pytest.raises(DecodeError, match="transfers of 2 bytes"):
        words_adis16355.register_readings(catalog.load("adis16355"), bytes(3), bytes(3))


def test_a_poll_is_the_frame_of_the_catalogue():
    form = catalog.load("adis16355").bind()
    frame = encode(form, {"gyr.x": [1.0], "acc.z": [G], "temp_c": [30.0]}).tobytes()
    answers = words_adis16355.register_readings(form, words_adis16355.poll_commands(), b"\0\0" + frame)
    decoded = Decoder(form).feed(frame)["adis16355"].columns
    assert answers.readings["XGYRO_OUT"].values[0] == decoded["gyr.x"][0]
    assert answers.readings["ZACCL_OUT"].values[0] == decoded["acc.z"][0]
    assert answers.readings["XTEMP_OUT"].values[0] == decoded["temp_c"][0]
    assert answers.unanswered == 1
