"""Guards of frames: overlaps, and how often noise is taken for a frame."""

import re
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.harness.false_accepts import false_accepts
from plumbob import Decoder, flags
from plumbob.core import errors
from plumbob.core.errors import DecodeError, ParameterError, ShapeError
from plumbob.protocols.decode import decode, format_title
from plumbob.protocols.encode import encode
from plumbob.protocols.format_toml import device_names, find_format, parse_format
from plumbob.protocols.overlap import passes_anything
from plumbob.protocols.page import framing_words
from plumbob.protocols.unpack import read_counts
from tests.helpers import beside, in_the_other_mode, slow_as_python
from tests.helpers.commandline import table_of
from tests.helpers.decoder_battery import DecoderBattery, digest, fields_of, in_pieces, options_of

HEAD = 'kind = "plumbob format"\nversion = 1\nname = "mine"\ntitle = "mine"\n'

RANGED = beside(__file__, "ranged.toml")


def decimal(count, rng):
    """Words of three bytes with a sign and five digits."""
    digits = rng.integers(0, 10, (count, 6))
    digits[:, 0] = rng.integers(0, 2, count)
    return (digits[:, 0::2] << 4 | digits[:, 1::2]).astype(np.uint8)


@pytest.mark.parametrize("order", ["big", "little"])
def test_a_frame_is_believed_where_every_count_is_within_its_range(order):
    form = parse_format(HEAD + RANGED.format(order=order))
    rng = np.random.default_rng(1)
    rows = rng.integers(0, 256, (20_000, 13), dtype=np.uint8)
    rows[:, 10:] = decimal(len(rows), rng)
    inside = np.ones(len(rows), dtype=bool)
    for one in form.message().fields:
        counts = read_counts(one, rows)  # the other way to read them: many frames at once
        inside &= (one.range[0] <= counts) & (counts <= one.range[1])
    assert 1000 < inside.sum() < 19_000
    found, counts = decode(rows.tobytes(), form)
    assert found["mine"].start.tolist() == (np.flatnonzero(inside) * 13).tolist()
    assert counts.bad_content == (~inside).sum()


def test_what_comes_in_one_piece_is_taken_apart_at_once_however_long():
    form = parse_format(HEAD + RANGED.format(order="big"))
    rows = encode(form, {"b": np.zeros(200_000), "e": np.zeros(200_000), "a": np.full(200_000, 10)})
    at_once = Decoder(form).feed(rows.tobytes() + b"\x00")  # 2.6 MB; only the start of a frame may wait
    assert len(at_once["mine"].start) == 200_000


def test_what_is_encoded_stays_within_the_range():
    form = parse_format(HEAD + RANGED.format(order="big"))
    rows = encode(form, {"b": np.radians([1e5, -1e5]), "e": np.radians([1e5, -1e5]), "a": [10, 240]})
    found, counts = decode(rows.tobytes(), form)
    assert counts.frames == {"mine": 2}
    # 20000 and −30000 counts of 0.1°, 90000 and −5000 of 0.01°
    np.testing.assert_allclose(np.degrees(found["mine"].columns["b"]), [2000.0, -3000.0])
    np.testing.assert_allclose(np.degrees(found["mine"].columns["e"]), [900.0, -50.0])
    for kind in (
        '"f32", unit = "deg", range = [0',
        '"u64", role = "status", range = [0',
        '"u16", role = "status", range = [2',
    ):
        field = f'{{ name = "a", type = {kind}, 1] }}'
        with pytest.raises(DecodeError, match=r"field a: range is \[least, greatest\] count"):
            parse_format(HEAD + f'byte_order = "big"\nframe = {{ length = 8 }}\nfield = [{field}]\n')


def test_frames_that_end_with_fixed_bytes():
    text = 'byte_order = "big"\nframe = { sync = "24", end = "0D 0A", length = 6, checksum = { kind = "xor8", at = 3, '
    text += "from = 1 } }\n"
    text += 'field = [{ name = "a", type = "u8", role = "status" }, { name = "b", type = "u8", role = "status" }]\n'
    form = parse_format(HEAD + text)
    row = encode(form, {"a": [5], "b": [6]}).tobytes()
    assert row == bytes.fromhex("24 05 06 03 0D 0A")  # 5 xor 6 is 3
    for wrong in ("24 05 06 03 0D 0B", "24 05 06 03 0C 0A"):
        found, counts = decode(bytes.fromhex(wrong) + row, form)
        assert found["mine"].start.tolist() == [6] and counts.bad_content == 1
    assert false_accepts(form) == 256.0**-4


CONFIRMED = """
byte_order = "big"
frame = { sync = "A5", length = 8, confirm = true, checksum = { kind = "sum16-either", at = 6, from = 1, to = 6 } }
field = [{ name = "a", type = "u8", role = "status" }, { name = "b", type = "u32", role = "status" }]
"""


def framed(rng, words):
    body = rng.bytes(5)
    padded = body + b"\0"
    total = sum(256 * padded[i] + padded[i + 1] for i in (0, 2, 4)) % 65535 if words else sum(body)
    return b"\xa5" + body + total.to_bytes(2, "big")


@pytest.mark.parametrize("words", [False, True])
def test_a_check_of_two_kinds_is_learnt_alike_however_the_bytes_are_cut(words):
    form, rng = parse_format(HEAD + CONFIRMED), np.random.default_rng(2)
    frames = [framed(rng, words) for _ in range(20)]
    noise = [b"" if i % 3 else rng.bytes(4) for i in range(20)]
    stream = b"".join(piece for pair in zip(frames, noise, strict=True) for piece in pair)
    whole = in_pieces(form, stream, [])
    assert in_pieces(form, stream, range(len(stream))) == whole
    for at in range(1, len(stream)):
        assert in_pieces(form, stream, [at]) == whole


def test_floats_that_are_no_numbers_are_flagged_and_a_disturbed_frame_counts_once_another_begins():
    form = find_format("xbus_mtdata2")
    rows = encode(form, {"gyr.x": [1.0, np.inf, -np.inf, 2.0], "gyr.y": [1.0, 2.0, 3.0, 4.0]}, message="rate")
    found = decode(rows.tobytes(), form)[0]["rate"]
    np.testing.assert_array_equal(found.columns["gyr.x"], [1.0, np.nan, np.nan, 2.0])
    assert found.columns["gyr.y"].tolist() == [1.0, 2.0, 3.0, 4.0]
    assert (found.flags[""] == [0, flags.GYR_INVALID, flags.GYR_INVALID, 0]).all()
    form, rng = parse_format(HEAD + CONFIRMED), np.random.default_rng(3)
    first, second, third = (framed(rng, False) for _ in range(3))
    decoder = Decoder(form)
    assert decoder.feed(first, 1) == {}
    assert decoder.feed(second, 2)["mine"].t_ns.tolist() == [1, 2]  # the second needs no other
    decoder = Decoder(form)
    assert decoder.feed(first + b"\x00" + second, 1) == {}  # no frame begins behind the first
    assert (decoder.feed(third, 2)["mine"].start.tolist(), decoder.counts.junk) == ([9, 17], 9)


ONE_OF_TWO = beside(__file__, "one_of_two.toml")
VARIABLE, FIXED = "length_field = { at = 1, size = 1, add = 0, least = 5, most = 9 }", "length = 8"


@pytest.mark.parametrize(("length", "checksum", "believed"), [
    (VARIABLE, "crc16-xmodem", True),
    (VARIABLE, "fletcher16", True),
    (VARIABLE, "crc8", False),
    (VARIABLE, "sum8", False),
    (FIXED, "crc16-xmodem", False),
])  # fmt: skip
def test_a_frame_of_no_known_message_is_believed_by_its_length_and_a_check_of_16_bits(length, checksum, believed):
    """Else it is no frame: a format of one length describes all of its frames, and a short check fits by chance."""
    words = {"length": length, "kind": checksum, "at": -1 if checksum in {"crc8", "sum8"} else -2}
    known, other = (parse_format(HEAD + ONE_OF_TWO.format(**words, value=value)) for value in (1, 2))
    stream = b"".join(encode(form, {"a": [77]}).tobytes() for form in (known, other, known))
    found, counts = decode(stream, known)
    assert found["mine"].start.tolist() == [0, 16]
    assert (counts.unknown, counts.junk) == ((1, 0) if believed else (0, 8))


PARTS = beside(__file__, "parts.toml")


def test_parts_lie_one_behind_the_other_and_their_places_count_from_their_first_byte():
    form = parse_format(HEAD + PARTS)
    assert [(f.name, f.at) for f in form.message("both").fields] == [
        ("id", 2), ("count", 3), ("kind", 4), ("high", 5), ("low", 5), ("temp_c", 6), ("last", 7)
    ]  # fmt: skip
    found, counts = decode(bytes.fromhex("A508 0109 025AF8 07 A507 027C14 010A"), form)
    assert counts.junk == 0
    both, turned = found["both"].columns, found["turned"].columns
    assert [both[name][0] for name in ("count", "high", "low", "temp_c", "last")] == [9, 5, 10, -8.0, 7]
    assert [turned[name][0] for name in ("high", "low", "temp_c", "count")] == [7, 12, 20.0, 10]
    for old, new, pattern in (
        ('["count", "bits"]', '["count", "bit"]', "message both has no part 'bit'; known: count, bits"),
        ('["count", "bits"]', '["count", "bits", "count"]', "message both has a part twice"),
        ("length = 7", "length = 6", "field count ends at byte 7, but message turned has 6"),
        ('at = 1, type = "u8", bits = [3, 0]', 'at = 0, type = "u8", bits = [3, 0]', "kind and field low share byte"),
    ):
        with pytest.raises(DecodeError, match=pattern):
            parse_format(HEAD + PARTS.replace(old, new))


BOARD = beside(__file__, "board.toml")


@pytest.mark.parametrize(("error", "old", "new", "pattern"), table_of(beside(__file__, "board_wrong.txt")))
def test_what_cannot_lie_in_the_frame_is_refused_with_its_field(error, old, new, pattern):
    with pytest.raises(getattr(errors, error), match=pattern):
        parse_format(BOARD.replace(old.replace(r"\n", "\n"), new.replace(r"\n", "\n"), 1))


def test_a_buffer_that_is_used_again_does_not_change_what_waits():
    """A caller who reads into one buffer must not change the half frame that the decoder keeps."""
    form = parse_format(BOARD)
    assert form.message().length == 18
    stream = encode(form, {"gyr.x": np.zeros(4)}).tobytes()
    decoder, buffer, found = Decoder(form), bytearray(9), 0
    for at in range(0, len(stream), 9):
        buffer[:] = stream[at : at + 9]
        found += sum(map(len, decoder.feed(memoryview(buffer)).values()))
    assert (found, decoder.counts.junk) == (4, 0)
    assert len(decode(np.frombuffer(stream, dtype=np.uint8), form)[0]["board"]) == 4


STREAMS = [name for name in device_names() if not find_format(name).framing.transfers]


def settled(name):
    """A device with options that are not known given some number: they do not change what passes."""
    form = find_format(name)
    return form.bind({key: "1" for key, option in form.options.items() if option.default is None})


@pytest.mark.parametrize("name", device_names())
def test_a_format_that_takes_anything_is_one_that_every_random_transfer_passes(name):
    form = settled(name)
    assert passes_anything(form) == (form.framing.transfers and false_accepts(form) == 1.0)
    rows = np.random.default_rng(1).integers(0, 256, 2000 * form.framing.most, dtype=np.uint8)
    taken = sum(decode(rows.tobytes(), form)[1].frames.values())
    assert (taken == 2000) == passes_anything(form)
    assert passes_anything(form) == (", NO CHECK" in framing_words(form))


@pytest.mark.parametrize("name", STREAMS)
def test_the_catalogue_declares_what_follows_from_the_format(name):
    text, _ = find_format(name).facts["false_accepts"]
    declared = float(re.search(r" (\S+) per byte", text)[1])
    assert declared == float(f"{false_accepts(settled(name)):.1e}")


@pytest.mark.parametrize(("name", "odds"), [
    # sync twice (confirmed), sum of 8 bits, a pitch of 32769 and a temperature of 4096 counts among 65536
    ("ahrs400", 256.0**-2 / 256 * 32769 / 65536 * 4096 / 65536),
    # sync of 16 bits, two sums of 16 bits, pitch as above
    ("ahrs500ga", 256.0**-2 * 2 * 256.0**-2 * 32769 / 65536),
    # sync, kind out of 5, sum of 8 bits, the next sync
    ("witmotion", 256.0**-4 * 5),
    # one of two beginnings of 16 bits, three messages with a register behind; the next, of either kind, confirms
    ("witmotion_ble", 256.0**-2 * (1 + 3 * 256.0**-2) * 2 * 256.0**-2),
    # sync of 24 bits out of 8 twice (confirmed), base and identity of 9 reports; the sync says the length
    ("bno08x_shtp", (8 * 256.0**-3) ** 2 * 9 * 256.0**-2),
    # sync of 32 bits, check of 16
    ("vectornav_ypr", 256.0**-6),
])  # fmt: skip
def test_it_is_the_product_of_what_guards(name, odds):
    assert false_accepts(settled(name)) == pytest.approx(odds, rel=1e-12)


@slow_as_python
@pytest.mark.parametrize("name", ["ahrs400", "witmotion", "witmotion_ble"])
def test_random_bytes_pass_as_often_as_computed(name):
    form = settled(name)
    form = replace(form, framing=replace(form.framing, confirm=False))  # else there would be nothing to count
    size = 40_000_000 if name == "witmotion" else 20_000_000
    noise = np.random.default_rng(1).integers(0, 256, size, dtype=np.uint8).tobytes()
    expected = false_accepts(form) * size
    found = sum(decode(noise, form)[1].frames.values())
    assert expected > 9 and abs(found - expected) < 4 * expected**0.5  # a Poisson count within four of its deviations


class TestEveryFormat(DecoderBattery):
    pass


def test_compiled_and_plain_python_give_the_same_bits():
    code = "from tests.helpers.decoder_battery import device_names, digest; "
    code += "given = {name: digest(name) for name in device_names()}"
    assert in_the_other_mode(code, warnings="default") == {name: digest(name) for name in device_names()}


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
