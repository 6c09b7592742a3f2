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
from plumbob.core.errors import DecodeError, ParameterError
from plumbob.protocols.decode import decode, triads_of
from plumbob.protocols.encode import encode
from plumbob.protocols.field import MARKS
from plumbob.protocols.format_toml import find_format, parse_format
from plumbob.protocols.unpack import counts_for, field_values, put, read_counts
from plumbob.simulation.presets import preset_names
from tests.helpers import beside
from tests.helpers.commandline import table_of
from tests.helpers.decoder_battery import fields_of, options_of

CHIPS = (
    "adxrs290", "adxrs453", "mpu6000", "mpu3050", "hmc5983", "adis16355", "mpu9250", "icm20948", "bmi088", "bmi160",
    "bmi270", "lsm6dso", "lis3mdl", "lsm9ds1", "bno055", "adis16470", "adis16505",
)  # fmt: skip
DEG, NAN = math.pi / 180, math.nan
POLL = "8222 BDDE BFFF 8000 BE73 818D 8029 8F32 8AAA 8800"
BURST = "00 00 00 00 00 00 0F A0 00 00 00 00 0F A0 00 FA 00 07 02 5F"
EXAMPLES = table_of(beside(__file__, "chips.txt"))
SAID = table_of(beside(__file__, "chips_said.txt"))
WORDS = table_of(beside(__file__, "registers.txt"))


def bound(name, options=""):
    return find_format(name).bind(options_of(options))


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
    rows = encode(form, {key: [value] for key, value in fields_of(given).items()}, message=message)
    assert rows.tobytes() == bytes.fromhex(text)
    name, frames = only_frame(form, bytes.fromhex(text))
    assert name == (message or form.name)
    for key, value in fields_of(said).items():
        assert frames.columns[key][0] == pytest.approx(value, rel=1e-12, abs=1e-15), key


@pytest.mark.parametrize(("device", "options", "text", "said", "flag"), SAID)
def test_bytes_that_are_read_wrongly_elsewhere(device, options, text, said, flag):
    _, frames = only_frame(bound(device, options), bytes.fromhex(text))
    for key, value in fields_of(said).items():
        assert frames.columns[key][0] == pytest.approx(value, rel=1e-12, nan_ok=True), key
    assert frames.flags[""][0] == (getattr(flags, flag) if flag else 0)


def test_axes_that_a_chip_lacks_codes_of_the_adis_and_overflow_and_gains_of_the_hmc5983():
    _, frames = only_frame(bound("adxrs290"), bytes.fromhex("A4 09 E1 B1 3D 01"))
    assert np.isnan(triads_of(frames)["gyr"]).tolist() == [[False, False, True]]
    # DS-1635x table 7, flags masked: 80 deg/s = 0444, 40 = 0222, -40 = 3DDE, -80 = 3BBC
    word = encode(bound("adis16355"), {"gyr.x": np.array([80.0, 40.0, -40.0, -80.0]) * DEG})[:, :2].copy().view(">u2")
    assert (word[:, 0] & 0x3FFF).tolist() == [0x0444, 0x0222, 0x3DDE, 0x3BBC]
    rows = encode(bound("hmc5983"), {"mag.x": [21.5], "mag.y": [NAN], "mag.z": [39.1]})
    assert rows.tobytes() == bytes.fromhex("00 EA 01 AA F0 00")
    # DS-5883 (without L) has 1024 LSB per gauss at the default gain.
    form = bound("hmc5983")
    assert list(form.options["gain"].choices.values()) == [1370, 1090, 820, 660, 440, 390, 330, 230]
    assert form.chosen == {"gain": "1.3 gauss"}


CHOICES = [
    (name, option, choice) for name in CHIPS for option, o in bound(name).options.items() for choice in o.choices
]


@pytest.mark.parametrize(("name", "option", "choice"), [*CHOICES, ("adxrs290", "", ""), ("adxrs453", "", "")])
def test_counts_survive_from_bytes_to_value_and_back(name, option, choice):
    form = bound(name, f"{option} {choice}" if option else "")
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


def test_replies_of_every_kind_are_told_apart_in_one_stream():
    """The top bits of one with sequence number 2 are those of a read; ST tells them apart (DS-453)."""
    for sq in range(8):
        row = encode(bound("adxrs453"), {"gyr.z": [0.1], "sq": [sq]}, message="sensor")
        name, frames = only_frame(bound("adxrs453"), row.tobytes())
        assert (name, frames.columns["sq"][0]) == ("sensor", sq)
    row = encode(bound("adxrs453"), {"gyr.z": [0.1], "st": [3], "sq": [7]}, message="sensor")
    name, frames = only_frame(bound("adxrs453"), row.tobytes())
    assert name == "sensor" and np.isnan(frames.columns["gyr.z"][0])
    assert frames.flags[""][0] == flags.GYR_ABSENT
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


@pytest.mark.parametrize(("device", "text"), [
    ("adxrs453", "00400AE0"),  # WPILib's simulated pattern fails the parity
    ("adis16505", BURST.replace("0F A0", "0E A0", 1)),
])  # fmt: skip
def test_a_burst_that_fails_its_check_is_none(device, text):
    assert decode(bytes.fromhex(text), bound(device))[0] == {}


def test_a_status_of_one_field_keeps_its_unit_inside_a_frame():
    form = parse_format(
        'kind = "plumbob format"\nversion = 1\nname = "carrier"\ntitle = "carrier"\n[frame]\nsync = "A5"\nlength = 21\n'
        '[[embed]]\ndevice = "adis16355"\nat = 1\nunit = "u1"\n'
    )
    frames = decode(b"\xa5" + bytes.fromhex(POLL.replace("BDDE", "3DDE")), form)[0]["carrier"]
    assert np.isnan(frames.columns["u1.gyr.y"][0]) and np.isfinite(frames.columns["u1.gyr.x"][0])
    assert frames.flags["u1"][0] == flags.GYR_ABSENT


@pytest.mark.parametrize("name", ["bmi088", "bmi160", "bmi270"])
def test_sensor_time_of_the_bosch_parts_counts_39_us(name):
    """25600 counts are a second: BST-BMI160-DS000-07 table 11 and BST-BMI088-DS001 page 21, which wraps at 655.36 s."""
    (clock,) = (field for field in bound(name).message().fields if field.role == "clock")
    assert 25600 * clock.scale == pytest.approx(1.0, rel=1e-12)
    assert (clock.type, clock.order) == ("u24", "little")


FINE = {"gyr_range": "75 deg/s"}


def word_of(form, key):
    (register,) = [register for register in form.bind().registers if key in (register.name, str(register.address))]
    return register.word


def said(word, data):
    counts = read_counts(word, np.frombuffer(data, dtype=np.uint8).reshape(-1, word.size))
    return field_values(word, counts) if word.physical else counts


@pytest.mark.parametrize(("name", "options", "key", "text", "meaning"), WORDS)
def test_a_register_says_its_value_and_back(name, options, key, text, meaning):
    word, data, value = word_of(bound(name, options), key), bytes.fromhex(text), fields_of(meaning)["is"]
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
    assert said(word_of(form, "4"), bytes.fromhex("C222"))[0] == pytest.approx(546 * 0.018315 * DEG, rel=1e-12)
    with pytest.raises(ParameterError, match="is settled as '75 deg/s' and cannot become '150 deg/s'"):
        form.bind({"gyr_range": "150 deg/s"})
