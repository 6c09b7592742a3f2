"""The chips of the catalogue: every worked example, every count, every known wrong decoder.

Bytes are computed from the scale factors of the sources named in each TOML file (ADXRS290: Linux adxrs290.c; ADXRS453:
data sheet Rev. A; MPU-6000: PS-MPU-6000A-00; MPU-3050: Linux mpu3050-core.c; HMC5983: data sheet of the HMC5883L and
drivers; ADIS16355: data sheet Rev. B, whose table 7 has the gyroscope's codes for ±40 and ±80 deg/s). Those of the
MPU-9250 and later ones are computed by hand from scales and byte orders of the data sheets and drivers that each file
names.
"""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from plumbob.core import flags
from plumbob.protocols import catalog
from plumbob.protocols.decode import Decoder, decode, triads_of
from plumbob.protocols.encode import encode
from plumbob.protocols.field import MARKS
from plumbob.protocols.unpack import counts_of, values_of
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


def bound(name, options=()):
    return catalog.load(name).bind(dict(options))


def one(form, text):
    """The only frame that bytes decode to, and its message's name."""
    found, counts = decode(bytes.fromhex(text), form)
    assert counts.junk == 0
    ((name, frames),) = found.items()
    assert len(frames) == 1
    return name, frames


@pytest.mark.parametrize(("device", "options", "message", "text", "given_", "said"), EXAMPLES)
def test_the_worked_examples_encode_to_these_bytes(device, options, message, text, given_, said):
    rows = encode(bound(device, options), {key: [value] for key, value in given_.items()}, message=message)
    assert rows.tobytes() == bytes.fromhex(text)


@pytest.mark.parametrize(("device", "options", "message", "text", "given_", "said"), EXAMPLES)
def test_the_worked_examples_decode_to_these_values(device, options, message, text, given_, said):
    name, frames = one(bound(device, options), text)
    assert name == (message or bound(device).name)
    for key, value in said.items():
        assert frames.columns[key][0] == pytest.approx(value, rel=1e-12, abs=1e-15), key


def test_codes_of_the_adis_data_sheet():
    # DS-1635x table 7, flags masked: 80 deg/s = 0444, 40 = 0222, -40 = 3DDE, -80 = 3BBC
    form = bound("adis16355")
    rate = np.array([80.0, 40.0, -40.0, -80.0]) * DEG
    word = encode(form, {"gyr.x": rate})[:, :2].copy().view(">u2")[:, 0] & 0x3FFF
    assert [f"{w:04X}" for w in word] == ["0444", "0222", "3DDE", "3BBC"]


CHOICES = [
    (name, option, choice) for name in CHIPS for option, o in bound(name).options.items() for choice in o.choices
]


@pytest.mark.parametrize(("name", "option", "choice"), [*CHOICES, ("adxrs290", "", ""), ("adxrs453", "", "")])
def test_every_count_survives_from_bytes_to_value_and_back(name, option, choice):
    form = bound(name, {option: choice} if option else {})
    for field in (f for f in form.message().fields if f.physical):
        low, high = field.clip or field.limits
        counts = np.arange(low, high + 1)
        rows = encode(form, {field.name: values_of(field, counts)})
        assert np.array_equal(counts_of(field, rows), counts)


@pytest.mark.parametrize("name", CHIPS)
def test_everything_names_its_source_and_how_sure_it_is(name):
    form = catalog.load(name)
    told = {f"{m.name}.{f.name}": f.origin for m in form.messages for f in m.fields}
    told |= {key: o.origin for key, o in form.options.items()} | {key: o for key, (_, o) in form.facts.items()}
    told |= {r.name: r.origin for r in form.registers}
    for key, origin in told.items():
        assert origin.mark in MARKS[:-1], key
        assert origin.source in form.sources or (not origin.source and origin.mark == "UNVERIFIED"), key
    assert form.registers
    assert form.noise in preset_names()


@pytest.mark.parametrize("name", CHIPS)
def test_registers_and_fields_of_one_quantity_have_one_scale(name):
    """What the burst says of a register, its entry in the map says too."""
    form = bound(name)
    scales = {(f.scale, f.zero, f.raw_offset) for m in form.messages for f in m.fields if f.physical}
    words = [r.word for r in form.registers if r.word and r.word.physical]
    assert scales <= {(w.scale, w.zero, w.raw_offset) for w in words}


# --- absent, clipped, invalid ---


def test_an_overflow_of_the_magnetometer_takes_its_channel_only():
    _, frames = one(bound("hmc5983"), "00 EA 01 AA F0 00")  # DS-5883L p. 15: -4096
    mag = triads_of(frames)["mag"][0]
    assert np.isnan(mag[1])
    assert np.all(np.isfinite(mag[[0, 2]]))
    assert frames.flags[""][0] == flags.MAG_CLIPPED
    rows = encode(bound("hmc5983"), {"mag.x": [21.5], "mag.y": [math.nan], "mag.z": [39.1]})
    assert rows.tobytes() == bytes.fromhex("00 EA 01 AA F0 00")


@pytest.mark.parametrize(("text", "expected"), [("07 FF 00 00 00 00", True), ("F8 00 00 00 00 00", True)])
def test_the_ends_of_the_magnetometers_converter_are_clipped(text, expected):
    _, frames = one(bound("hmc5983"), text)
    assert bool(frames.flags[""][0] & flags.MAG_CLIPPED) is expected
    assert np.isfinite(frames.columns["mag.x"][0])


@pytest.mark.parametrize(
    ("text", "flag"),
    [
        ("14 02 80 01", 0),
        ("10 00 00 84", flags.GYR_INVALID),
        ("08 00 00 FF", flags.GYR_INVALID),
        ("15 77 00 00", flags.GYR_CLIPPED),
    ],
)
def test_status_and_range_of_the_adxrs453(text, flag):
    assert one(bound("adxrs453"), text)[1].flags[""][0] == flag


def test_a_stale_word_of_the_adis_is_no_sample():
    # ND = 0 in the second word: 3DDE in place of BDDE
    _, frames = one(bound("adis16355"), POLL.replace("BDDE", "3DDE"))
    gyr = triads_of(frames)["gyr"][0]
    assert np.isnan(gyr[1])
    assert gyr[0] == pytest.approx(546 * 0.07326 * DEG)
    assert frames.flags[""][0] == flags.GYR_ABSENT
    assert frames.columns["gyr_y_nd"][0] == 0


def test_a_stale_temperature_of_the_adis_flags_nothing():
    _, frames = one(bound("adis16355"), POLL.replace("8029", "0029"))
    assert np.isnan(frames.columns["temp_c"][0])
    assert frames.flags[""][0] == 0


def test_the_error_bit_of_the_adis_is_a_status():
    _, frames = one(bound("adis16355"), POLL.replace("8222", "C222"))
    assert frames.columns["gyr_x_ea"][0] == 1
    assert frames.columns["gyr.x"][0] == pytest.approx(546 * 0.07326 * DEG)


def test_unused_bits_of_the_adis_do_not_matter():
    """Bits 13:12 of 12-bit outputs are unused (DS-1635x)."""
    _, frames = one(bound("adis16355"), POLL.replace("8029", "B029").replace("8AAA", "BAAA"))
    assert frames.columns["temp_c"][0] == pytest.approx(25 + 41 * 0.1453)
    assert frames.columns["supply_v"][0] == pytest.approx(2730 * 1.8315e-3)


# --- kinds of replies of the ADXRS453, and its parity ---


def test_a_sensor_reply_with_sequence_number_2_is_no_read_reply():
    """Its top bits are those of a read; ST tells them apart (DS-453)."""
    for sq in range(8):
        row = encode(bound("adxrs453"), {"gyr.z": [0.1], "sq": [sq]}, message="sensor")
        name, frames = one(bound("adxrs453"), row.tobytes().hex())
        assert (name, frames.columns["sq"][0]) == ("sensor", sq)


def test_a_reply_with_st_3_that_is_no_known_kind_has_no_rate():
    row = encode(bound("adxrs453"), {"gyr.z": [0.1], "st": [3], "sq": [7]}, message="sensor")
    name, frames = one(bound("adxrs453"), row.tobytes().hex())
    assert name == "sensor"
    assert np.isnan(frames.columns["gyr.z"][0])
    assert frames.flags[""][0] == flags.GYR_ABSENT


def test_replies_of_every_kind_in_one_stream():
    data = (
        bytes.fromhex("14028001 4E1CE001 1E020000")
        + encode(bound("adxrs453"), {"data": [0xBEEF]}, message="write").tobytes()
    )
    found, counts = decode(data, bound("adxrs453"))
    assert {name: int(frames.start[0]) for name, frames in found.items()} == {
        "sensor": 0, "read": 4, "error": 8, "write": 12
    }  # fmt: skip
    assert found["write"].columns["data"][0] == 0xBEEF
    assert counts.junk == 0


KINDS = st.one_of(
    st.fixed_dictionaries(
        {"message": st.just("sensor"), "counts": st.integers(-24000, 24000)}
        | {"st": st.integers(0, 2), "sq": st.integers(0, 7), "faults": st.integers(0, 127)}
    ),
    st.fixed_dictionaries({"message": st.sampled_from(["read", "write"]), "data": st.integers(0, 0xFFFF)}),
    st.fixed_dictionaries(
        {"message": st.just("error"), "re": st.integers(0, 1), "spi": st.integers(0, 1), "faults": st.integers(0, 127)}
    ),
)


@given(KINDS)
def test_a_single_flipped_bit_of_an_adxrs453_frame_is_always_rejected(reply):
    form = bound("adxrs453")
    columns = {key: [value] for key, value in reply.items() if key not in ("message", "counts")}
    if "counts" in reply:
        columns["gyr.z"] = [reply["counts"] / 80 * DEG]
    whole = int.from_bytes(encode(form, columns, message=reply["message"]).tobytes(), "big")
    assert (whole >> 16).bit_count() % 2 == 1
    assert whole.bit_count() % 2 == 1
    flipped = b"".join((whole ^ 1 << bit).to_bytes(4, "big") for bit in range(32))
    found, counts = decode(flipped, form)
    assert found == {}
    assert (counts.junk, counts.bad_content) == (128, 32)


@given(st.binary(max_size=200), st.lists(st.integers(0, 200), max_size=6))
def test_a_bus_gives_the_same_frames_in_any_chunking(data, cuts):
    form = bound("adxrs453")
    whole, counts = decode(data, form)
    decoder = Decoder(form)
    places = [0, *sorted(min(c, len(data)) for c in cuts), len(data)]
    parts = [decoder.feed(data[a:b]) for a, b in itertools.pairwise(places)] + [decoder.finish()]
    for name in form.messages:
        expected = whole[name.name].start.tolist() if name.name in whole else []
        assert [int(s) for p in parts if name.name in p for s in p[name.name].start] == expected
    assert decoder.counts.summary() == counts.summary()


# --- known wrong decoders, which ours must not agree with ---


def test_trap_adxrs290_temperature_without_its_sign():
    """K-290 and NOOS-290 read raw & 0FFF."""
    wrong = 0.1 * (int.from_bytes(bytes.fromhex("83 0F"), "little") & 0xFFF)
    ours = one(bound("adxrs290"), "00 00 00 00 83 0F")[1].columns["temp_c"][0]
    assert ours == -12.5
    assert wrong - ours == pytest.approx(409.6)


def test_trap_adxrs290_upper_bits_are_not_data():
    """NOOS-290's burst read does not mask."""
    assert one(bound("adxrs290"), "00 00 00 00 3D 51")[1].columns["temp_c"][0] == pytest.approx(31.7)


def test_trap_adxrs290_rate_without_its_sign():
    """Older kernels, before fde272e78e; and big-endian would be wrong too."""
    ours = one(bound("adxrs290"), "00 00 E1 B1 00 00")[1].columns["gyr.y"][0]
    unsigned = int.from_bytes(bytes.fromhex("E1B1"), "little") / 200 * DEG
    assert unsigned - ours == pytest.approx(65536 / 200 * DEG)


def test_trap_adxrs453_simulated_pattern_fails_the_parity():
    """WPILib's 00400AE0."""
    assert decode(bytes.fromhex("00400AE0"), bound("adxrs453"))[0] == {}


def test_trap_mpu6000_scale_of_the_full_range():
    """131 (data sheet) against 131.072 = 32768/250 and the kernel's 133090 nrad/s: 0.1 % apart."""
    ours = one(bound("mpu6050"), "01 48 FF 5C 3F DF F0 B0 00 C4 FF 9E 33 2C")[1].columns["gyr.z"][0]
    assert ours == pytest.approx(13100 / 131 * DEG, rel=1e-12)
    assert abs(13100 / 131.072 * DEG / ours - 1) > 5e-4
    assert abs(13100 * 133090e-9 / ours - 1) > 9e-4


def test_trap_mpu6000_early_silicon_has_half_the_sensitivity():
    """ArduPilot: revisions C4 and C5 have 4096 LSB/g with AFS_SEL 1, where the sheet has 8192."""
    early = bound("mpu6000", {"silicon": "C4 or C5", "acc_range": "4 g"})
    text = "10 00" + 12 * "00"
    assert one(early, text)[1].columns["acc.x"][0] == pytest.approx(G, rel=1e-12)
    later = bound("mpu6000", {"acc_range": "4 g"})
    assert one(later, text)[1].columns["acc.x"][0] == pytest.approx(G / 2, rel=1e-12)


def test_trap_mpu3050_rate_without_its_sign():
    """K-3050's raw path."""
    ours = one(bound("mpu3050"), "C1 80 00 C4 FF 9E 33 2C")[1].columns["gyr.y"][0]
    assert 0xFF9E / 131 * DEG - ours == pytest.approx(65536 / 131 * DEG)


def test_trap_hmc5983_negative_numbers_and_order():
    """One library rebuilds FFD2 as FFFF - v = 45; a crate hands out X, Z, Y as X, Y, Z."""
    mag = triads_of(one(bound("hmc5983"), "00 EA 01 AA FF D2")[1])["mag"][0]
    assert np.rint(mag * 1090 / GAUSS).tolist() == [234, -46, 426]


def test_trap_hmc5983_gain_of_another_part():
    """DS-5883 (without L) has 1024 LSB per gauss at the default gain."""
    form = bound("hmc5983")
    assert list(form.options["gain"].choices.values()) == [1370, 1090, 820, 660, 440, 390, 330, 230]
    assert form.chosen["gain"] == "1.3 gauss"


def test_trap_adis16355_supply_of_a_later_part():
    """K-16400 has 2.418 mV per LSB."""
    supply = one(bound("adis16355"), POLL)[1].columns["supply_v"][0]
    assert supply == pytest.approx(5.0, abs=1e-3)
    assert abs(2730 * 2.418e-3 - supply) > 1.0


@pytest.mark.parametrize(("choice", "lsb"), [("300 deg/s", 0.07326), ("150 deg/s", 0.03663), ("75 deg/s", 0.018315)])
def test_the_range_of_the_adis_changes_the_size_of_a_count(choice, lsb):
    _, frames = one(bound("adis16355", {"gyr_range": choice}), POLL)
    assert frames.columns["gyr.x"][0] == pytest.approx(546 * lsb * DEG, rel=1e-12)


def test_a_status_of_one_field_keeps_its_unit_inside_a_frame():
    from plumbob.protocols.format_toml import parse_format

    form = parse_format(
        'kind = "plumbob format"\nversion = 1\nname = "carrier"\ntitle = "carrier"\n[frame]\nsync = "A5"\nlength = 21\n'
        '[[embed]]\ndevice = "adis16355"\nat = 1\nunit = "u1"\n'
    )
    frames = decode(b"\xa5" + bytes.fromhex(POLL.replace("BDDE", "3DDE")), form)[0]["carrier"]
    assert np.isnan(frames.columns["u1.gyr.y"][0])
    assert np.isfinite(frames.columns["u1.gyr.x"][0])
    assert frames.flags["u1"][0] == flags.GYR_ABSENT


@pytest.mark.parametrize(
    ("text", "value"), [("3E 00", 85.0), ("00 60", 23.375), ("00 20", 23.125), ("00 00", 23.0), ("C1 00", -40.0)]
)
def test_codes_of_the_bmi088_data_sheet(text, value):
    """Page 21, table of the temperature sensor; 80 is invalid there."""
    frame = "00" * 16 + text + "00" * 6
    assert one(bound("bmi088"), frame)[1].columns["temp_c"][0] == value
    assert np.isnan(one(bound("bmi088"), "00" * 16 + "80 00" + "00" * 6)[1].columns["temp_c"][0])


def test_an_old_or_overflowed_field_of_the_icm20948_is_no_field():
    whole = "00" * 14 + "{} 64 00 38 FF 2C 01 00 {}"
    assert np.isfinite(triads_of(one(bound("icm20948"), whole.format("01", "00"))[1])["mag"]).all()
    old = one(bound("icm20948"), whole.format("00", "00"))[1]
    assert np.isnan(triads_of(old)["mag"]).all()
    assert old.flags[""][0] == flags.MAG_ABSENT
    assert one(bound("icm20948"), whole.format("01", "08"))[1].flags[""][0] == flags.MAG_INVALID
    overflowed = one(bound("mpu9250"), "00" * 14 + "64 00 38 FF 2C 01 08")[1]
    assert overflowed.flags[""][0] == flags.MAG_INVALID


def test_trap_order_of_bmi160_and_bmi270():
    """The same bytes, from the same registers: rates first in the one, specific forces in the other."""
    text = "66 06 00 00 00 00 00 00 00 00 00 10 00 00 00"
    older, newer = (one(bound(name), text)[1].columns for name in ("bmi160", "bmi270"))
    assert older["gyr.x"][0] == pytest.approx(1638 * 2000 / 32768 * DEG)
    assert newer["acc.x"][0] == pytest.approx(1638 * 8 / 32768 * G)


def test_trap_scale_of_the_lsm9ds1_at_16_g():
    frame = "00" * 9 + "E8 03" + "00" * 10
    assert one(bound("lsm9ds1", {"acc_range": "16 g"}), frame)[1].columns["acc.x"][0] == pytest.approx(0.732 * G)


def test_a_damaged_burst_of_the_adis_is_rejected():
    frame = bytearray(bytes.fromhex("00 00 00 00 00 00 0F A0 00 00 00 00 0F A0 00 FA 00 07 02 5F"))
    frame[7] ^= 1
    assert decode(bytes(frame), bound("adis16505"))[0] == {}


def test_sensor_time_of_the_bosch_parts_counts_39_us():
    """25600 counts are a second: BST-BMI160-DS000-07 table 11 and BST-BMI088-DS001 page 21, which wraps at 655.36 s."""
    for name in ("bmi088", "bmi160", "bmi270"):
        (clock,) = (field for field in bound(name).message().fields if field.role == "clock")
        assert 25600 * clock.scale == pytest.approx(1.0, rel=1e-12)
        assert (clock.type, clock.order) == ("u24", "little")
