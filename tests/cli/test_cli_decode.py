"""plumbob decode on frames that were put together by hand: rows, times, and what it says of the rest."""

import binascii
import json
import random
import struct

import pytest

from plumbob.cli import decode
from plumbob.cli.main import main
from plumbob.core.constants import G0
from tests.helpers.commandline import ok

FORMAT = """
kind = "plumbob format"
version = 1
name = "pair"
title = "made-up unit with two kinds of frames"
byte_order = "little"

[frame]
sync = "A5 5A"
length_field = { at = 2, size = 1, add = 6, least = 6, most = 40 }
checksum = { kind = "crc16-xmodem", at = -2, from = 2 }

[[message]]
name = "fast"
length = 14
field = [
  { name = "id", at = 3, type = "u8", role = "constant", value = 1 },
  { name = "n", type = "u16", role = "counter" },
  { name = "acc", axes = "xyz", type = "s16", counts = 1000, unit = "g" },
]

[[message]]
name = "slow"
length = 8
field = [
  { name = "id", at = 3, type = "u8", role = "constant", value = 2 },
  { name = "temp_c", type = "s16", counts = 100, unit = "degC" },
]
"""


def framed(kind, content):
    """A frame by its description; the standard library's CRC."""
    body = bytes([len(content), kind]) + content
    return b"\xa5\x5a" + body + struct.pack("<H", binascii.crc_hqx(body, 0))


def fast(n, x=0, y=0, z=1000):
    return framed(1, struct.pack("<Hhhh", n, x, y, z))


def slow(temp_c):
    return framed(2, struct.pack("<h", round(100 * temp_c)))


@pytest.fixture
def call(tmp_path, monkeypatch, capsys):
    """Decode bytes; the lines of the table, and the notes but the one on calibration, which is always there."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "pair.toml").write_text(FORMAT, encoding="utf-8")

    def run(data, *words, code=0):
        (tmp_path / "in.csv").write_bytes(data)
        assert main(["decode", "in.csv", "--format", "pair.toml", *words]) == code
        out, err = capsys.readouterr()
        notes = [line.removeprefix("note: ") for line in err.splitlines()]
        if code == 0:
            assert notes.pop().startswith("calibration NONE")
        return out.splitlines(), notes

    return run


@pytest.mark.parametrize(("name", "size"), [("adxrs290", 6), ("adis16355", 20)])
def test_a_device_without_any_check_is_said_to_have_none(tmp_path, name, size):
    """Random bytes are rows, for nothing tells them from the sensor's: each output says so."""
    (tmp_path / "in.bin").write_bytes(random.Random(1).randbytes(100 * size))
    says = f"NONE: no sync, checksum or constant, so any {size} bytes pass for a sample, even noise"
    assert f"checks of {name}: {says}" in ok("decode", tmp_path / "in.bin", "--format", name).stderr
    capture = ("record", "--from", tmp_path / "in.bin", "--format", name, "--rate", "50 Hz")
    assert f"checks       {says}\n" in ok(*capture).stdout
    assert json.loads(ok(*capture, "--json").stdout)["unchecked_bytes"] == size
    assert says in ok("devices", name).stdout
    assert f"{size} bytes, NO CHECK" in ok("devices").stdout


def test_a_row_is_what_the_bytes_say(call):
    rows, notes = call(fast(7, 1000, -500, 2000) + fast(8, 0, 0, -1))
    assert rows[0] == "byte,n,acc.x [m/s2],acc.y [m/s2],acc.z [m/s2],flags"
    start, n, *acc, marks = rows[1].split(",")
    assert (start, n, marks) == ("0", "7", "")
    assert [float(v) for v in acc] == pytest.approx([G0, -0.5 * G0, 2.0 * G0], rel=1e-11)
    assert rows[2].split(",")[0] == "14"
    assert notes == []


@pytest.mark.parametrize("piece", [1, 14, 50, 1 << 20])
def test_times_and_counts_go_on_from_piece_to_piece(call, monkeypatch, piece):
    """400 frames at 50 Hz, whose count of 16 bits turns; 300 are missing at one place and 1 at another."""
    monkeypatch.setattr(decode, "_READ", piece)
    counts = [n % 65536 for n in range(65400, 66101) if not (65450 <= n < 65750 or n == 66000)]
    assert len(counts) == 400
    rows, notes = call(b"".join(map(fast, counts)), "--rate", "50 Hz")
    assert rows[0].startswith("t [s],byte,")
    assert [float(row.split(",")[0]) for row in rows[1:]] == pytest.approx([i / 50.0 for i in range(400)], abs=1e-9)
    assert [int(row.split(",")[2]) for row in rows[1:]] == counts
    assert notes == [
        "the frame counter skips 301: that many frames are missing, or it jumped; t [s] counts rows, so it is early "
        "by that many periods after each gap"
    ]


def test_a_count_that_repeats_skips_nothing(call):
    assert call(fast(5) + fast(5) + fast(6))[1] == []


@pytest.mark.parametrize("piece", [5, 1 << 20])
def test_the_first_kind_of_frame_is_the_table_and_the_others_are_named(call, monkeypatch, piece):
    """Which is the first does not depend on how the bytes were cut, or on the order of the description."""
    monkeypatch.setattr(decode, "_READ", piece)
    data = slow(21.5) + fast(1) + fast(2) + slow(-3.25)
    rows, notes = call(data)
    assert rows == ["byte,temp_c [degC],flags", "0,21.5,", "36,-3.25,"]
    assert notes == ["2 frames of slow; also 2 of fast: ask with --message"]
    rows, notes = call(data + fast(3), "--message", "fast")
    assert [row.split(",")[1] for row in rows[1:]] == ["1", "2", "3"]
    assert notes == ["3 frames of fast; also 2 of slow: ask with --message"]
    assert call(slow(1.0))[1] == []


def test_frames_of_no_described_message_and_junk_are_counted(call):
    """One frame of a kind 9, three bytes of junk, and a frame with one bit wrong, 14 bytes."""
    broken = bytearray(fast(2))
    broken[8] ^= 4
    _, notes = call(fast(1) + framed(9, b"abcd") + b"\x00\x01\x02" + bytes(broken) + fast(3))
    assert notes == [
        "checked, but of no message that pair describes: 1 frame",
        "17 bytes of 55 belong to no frame; candidates rejected: 1 for their checksum",
        "the frame counter skips 1: that many frames are missing, or it jumped",
    ]


def test_a_table_in_json_holds_columns_with_units(call, tmp_path):
    call(fast(7, 1000) + fast(8), "--rate", "2Hz", "--out", "x.json")
    told = json.loads((tmp_path / "x.json").read_text(encoding="utf-8"))
    assert told["message"] == "fast"
    assert told["columns"]["t [s]"] == [0.0, 0.5]
    assert told["columns"]["acc.x [m/s2]"] == pytest.approx([G0, 0.0])
    assert told["counts"]["frames"] == {"fast": 2, "slow": 0}


@pytest.mark.parametrize("suffix", [".json", ".csv"])
def test_a_number_beyond_all_numbers_is_no_value(tmp_path, suffix):
    """By a scale that was declared wrongly; JSON has no infinity, and no reader takes it from a table."""
    (tmp_path / "pair.toml").write_text(FORMAT.replace("counts = 1000", "counts = 1e-320"))
    (tmp_path / "a.bin").write_bytes(fast(0, 1, 0, 1))
    out = tmp_path / f"a{suffix}"
    ok("decode", tmp_path / "a.bin", "--format", tmp_path / "pair.toml", "--out", out)
    assert "inf" not in out.read_text().lower()


def test_the_bytes_are_never_replaced_by_their_table(call, tmp_path):
    data = fast(1) + fast(2)
    _, (line,) = call(data, "--out", "./in.csv", code=1)
    assert "in.csv is an input" in line
    assert (tmp_path / "in.csv").read_bytes() == data


@pytest.mark.parametrize(
    ("data", "words", "says"),
    [
        (b"", (), "in.csv is empty. Give a file of raw bytes."),
        (b"\x00", (), "none of its 1 byte is a frame of pair."),
        (b"\x00" * 9, (), "none of its 9 bytes is a frame of pair."),
        (fast(1)[:-1] + b"\x00", (), "; candidates rejected: 1 for their checksum"),
        (fast(1), ("--message", "third"), "third"),
        (fast(1), ("--rate", "20 ms"), "not a unit of frequency"),
        (fast(1), ("--option", "a=1"), "a"),
    ],
)
def test_what_gives_no_row_is_one_line(call, data, words, says):
    rows, (line,) = call(data, *words, code=1)
    assert rows == []
    assert says in line
