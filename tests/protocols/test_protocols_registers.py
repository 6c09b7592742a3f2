"""Words of registers: what the catalogue says of their bytes, both ways."""

import math

import numpy as np
import pytest

from plumbob.core.errors import DecodeError, ParameterError
from plumbob.protocols.format_toml import find_format, parse_format
from plumbob.protocols.unpack import counts_for, field_values, put, read_counts

DEG = math.pi / 180
FINE = {"gyr_range": "75 deg/s"}

# Chip, options, register by name or address, its bytes, what they mean; computed from the catalogue's sources.
WORDS = [
    ("adxrs290", {}, "TEMP", "83 0F", -12.5),
    ("adxrs290", {}, "DATAY", "E1 B1", -99.995 * DEG),
    ("adxrs453", {}, "TEM", "E7 00", 25.0),
    ("adxrs453", {}, "TEM", "00 00", 45.0),
    ("adxrs453", {}, "TEM", "32 00", 85.0),  # (raw - 31F)/5 on unsigned words, as one driver has it, is wrong here
    ("adxrs453", {}, "TEM", "C7 C0", 0.0),
    ("adxrs453", {}, "TEM", "95 C0", -40.0),  # and here
    ("adxrs453", {}, "PID", "52 01", 0x5201),
    ("adxrs453", {}, "QUAD", "FF B0", -1.0 * DEG),
    ("mpu6000", {}, "TEMP_OUT", "F0 B0", -3920 / 340 + 36.53),
    ("mpu3050", {}, "TEMP", "C1 80", 25.0),
    ("hmc5983", {}, "TEMP", "03 40", 31.5),
    ("adis16355", {}, "SUPPLY_OUT", "0A AA", 2730 * 1.8315e-3),
    ("adis16355", {}, "ZTEMP_OUT", "0F 32", 25 - 206 * 0.1453),
    ("adis16355", {}, "YGYRO_OFF", "1F FF", -0.018315 * DEG),
    ("adis16355", {}, "SENS_AVG", "04 02", 0x0402),
    ("adis16355", {}, 0x04, "02 22", 546 * 0.07326 * DEG),
    ("adis16355", FINE, "XGYRO_OUT", "02 22", 546 * 0.018315 * DEG),
]


def word_of(form, key):
    (register,) = [register for register in form.bind().registers if key in (register.name, register.address)]
    return register.word


def said(word, data):
    counts = read_counts(word, np.frombuffer(data, dtype=np.uint8).reshape(-1, word.size))
    return field_values(word, counts) if word.physical else counts


@pytest.mark.parametrize(("name", "options", "key", "text", "value"), WORDS)
def test_a_register_says_its_value_and_back(name, options, key, text, value):
    word, data = word_of(find_format(name).bind(options), key), bytes.fromhex(text)
    assert said(word, data)[0] == pytest.approx(value, rel=1e-12, abs=1e-13)
    row = np.zeros((1, word.size), dtype=np.uint8)
    put(word, row, counts_for(word, np.array([value]))[0] if word.physical else np.array([value]))
    assert row.tobytes() == data


@pytest.mark.parametrize("name", ["adxrs290", "adxrs453", "mpu6000", "mpu3050", "hmc5983", "adis16355"])
def test_counts_of_every_register_survive(name):
    for word in (r.word for r in find_format(name).bind().registers if r.word and r.word.physical):
        counts = np.unique(np.linspace(*word.limits, 7).astype(np.int64))
        rows = np.zeros((counts.size, word.size), dtype=np.uint8)
        put(word, rows, counts_for(word, field_values(word, counts))[0])
        assert np.array_equal(read_counts(word, rows), counts)


def test_a_register_in_ones_own_format_is_read_strictly_and_a_settled_option_stays():
    text = (
        'kind = "plumbob format"\nversion = 1\nname = "own"\ntitle = "own"\nbyte_order = "big"\n[frame]\nlength = 2\n'
        '[[field]]\nname = "temp_c"\ntype = "s16"\nunit = "degC"\n'
        '[[register]]\naddress = 1\nname = "V"\nmeaning = "volts"\ntype = "u16"\nunit = "{unit}"\n{more}'
    )
    form = parse_format(text.format(unit="mV", more=""))
    assert said(word_of(form, "V"), b"\x03\xe8")[0] == pytest.approx(1.0)
    with pytest.raises(DecodeError, match="no key 'role'"):
        parse_format(text.format(unit="mV", more='role = "status"\n'))
    with pytest.raises(Exception, match="'bogus' is not a unit"):
        said(word_of(parse_format(text.format(unit="bogus", more="")), "V"), b"\0\0")
    # Its numbers are in the fields by then; a second choice would change the name of the range and no number.
    form = find_format("adis16355").bind(FINE)
    assert form.bind().chosen == FINE
    # bits beside the value do not matter
    assert said(word_of(form, 0x04), bytes.fromhex("C222"))[0] == pytest.approx(546 * 0.018315 * DEG, rel=1e-12)
    with pytest.raises(ParameterError, match="is settled as '75 deg/s' and cannot become '150 deg/s'"):
        form.bind({"gyr_range": "150 deg/s"})
