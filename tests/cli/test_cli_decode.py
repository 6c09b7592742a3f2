"""plumbob decode on frames that were put together by hand: rows, times, and what it says of the rest."""

import binascii
import json
import random
import struct

import pytest

from plumbob.core.constants import G0
from tests.helpers import beside
from tests.helpers.commandline import answer, typed

FORMAT = beside(__file__, "pair.toml")


def framed(kind, content):
    """A frame by its description; the standard library's CRC."""
    body = bytes([len(content), kind]) + content
    return b"\xa5\x5a" + body + struct.pack("<H", binascii.crc_hqx(body, 0))


def fast(n, x=0, y=0, z=1000):
    return framed(1, struct.pack("<Hhhh", n, x, y, z))


def slow(temp_c):
    return framed(2, struct.pack("<h", round(100 * temp_c)))


@pytest.fixture
def call(tmp_path):
    """Decode bytes; the lines of the table, and the notes but the one on calibration, which is always there."""
    (tmp_path / "pair.toml").write_text(FORMAT, encoding="utf-8")

    def run(data, *words):
        (tmp_path / "in.bin").write_bytes(data)
        done = typed("decode in.bin --format pair.toml", *words, cwd=tmp_path)
        notes = [line.removeprefix("note: ") for line in done.stderr.splitlines()]
        assert notes.pop().startswith("calibration NONE")
        return done.stdout.splitlines(), notes

    return run


@pytest.mark.parametrize(("name", "size"), [("adxrs290", 6), ("adis16355", 20)])
def test_a_device_without_any_check_is_said_to_have_none(tmp_path, name, size):
    """Random bytes are rows, for nothing tells them from the sensor's."""
    (tmp_path / "in.bin").write_bytes(random.Random(1).randbytes(100 * size))
    says = f"NONE: no sync, checksum or constant, so any {size} bytes pass for a sample, even noise"
    assert f"checks of {name}: {says}" in typed(f"decode in.bin --format {name}", cwd=tmp_path).stderr
    capture = f"record --from in.bin --format {name} --rate '50 Hz'"
    assert answer(capture, cwd=tmp_path)["unchecked_bytes"] == size
    assert f"checks       {says}\n" in typed(capture, cwd=tmp_path).stdout
    assert says in typed(f"list devices {name}").stdout


def test_a_row_and_a_column_in_json_are_what_the_bytes_say_and_junk_is_counted(call, tmp_path):
    rows, notes = call(fast(7, 1000, -500, 2000) + fast(8, 0, 0, -1))
    assert rows[0] == "byte,n,acc.x [m/s2],acc.y [m/s2],acc.z [m/s2],flags"
    start, n, *acc, marks = rows[1].split(",")
    assert (start, n, marks) == ("0", "7", "")
    assert [float(v) for v in acc] == pytest.approx([G0, -0.5 * G0, 2.0 * G0], rel=1e-11)
    assert rows[2].split(",")[0] == "14"
    assert notes == []
    call(fast(7, 1000) + fast(8), "--rate", "2Hz", "--out", "x.json")
    table = json.loads((tmp_path / "x.json").read_text(encoding="utf-8"))
    assert (table["message"], table["columns"]["t [s]"]) == ("fast", [0.0, 0.5])
    assert table["columns"]["acc.x [m/s2]"] == pytest.approx([G0, 0.0])
    assert table["counts"]["frames"] == {"fast": 2, "slow": 0}
    # One frame of a kind 9, three bytes of junk, and a frame with one bit wrong, 14 bytes; a count that repeats.
    broken = bytearray(fast(2))
    broken[8] ^= 4
    rows, notes = call(fast(1) + framed(9, b"abcd") + b"\x00\x01\x02" + bytes(broken) + fast(3) + fast(3))
    assert len(rows) == 4
    assert notes == [
        "checked, but of no message that pair describes: 1 frame",
        "17 bytes of 69 belong to no frame; candidates rejected: 1 for their checksum",
        SKIPPED.format(1),
    ]


SKIPPED = "the frame counter skips {}: that many frames are missing, or it jumped"


def test_times_and_counts_go_on_from_piece_to_piece(call):
    """A MiB and more of frames at 50 Hz, whose count of 16 bits turns; 300 are missing at one place, 1 at another."""
    counts = [n % 65536 for n in range(65400, 140_600) if not (65450 <= n < 65750 or n == 66000)]
    data = b"".join(map(fast, counts))
    assert len(data) > 1 << 20
    rows, notes = call(data, "--rate", "50 Hz")
    table = [row.split(",") for row in rows]
    assert table[0][:3] == ["t [s]", "byte", "n"]
    assert [float(row[0]) for row in table[1:]] == pytest.approx([i / 50.0 for i in range(len(counts))], abs=1e-9)
    assert [int(row[1]) for row in table[1:]] == list(range(0, len(data), 14))
    assert [int(row[2]) for row in table[1:]] == counts
    early = "; t [s] counts rows, so it is early by that many periods after each gap"
    assert notes == [SKIPPED.format(301) + early]


def test_the_first_kind_of_frame_is_the_table_and_the_others_are_named(call):
    """Which is the first does not depend on the order of the description, or on what is beyond the first MiB."""
    data = slow(21.5) + fast(1) + fast(2) + slow(-3.25)
    rows, notes = call(data)
    assert rows == ["byte,temp_c [degC],flags", "0,21.5,", "36,-3.25,"]
    assert notes == ["2 frames of slow; also 2 of fast: ask with --message"]
    rows, notes = call(data + fast(3), "--message", "fast")
    assert [row.split(",")[1] for row in rows[1:]] == ["1", "2", "3"]
    assert notes == ["3 frames of fast; also 2 of slow: ask with --message"]
    assert call(slow(1.0))[1] == []


def test_a_number_beyond_all_numbers_is_no_value(tmp_path):
    """By a scale that was declared wrongly; JSON has no infinity, and no reader takes it from a table."""
    (tmp_path / "pair.toml").write_text(FORMAT.replace("counts = 1000", "counts = 1e-320"))
    (tmp_path / "a.bin").write_bytes(fast(0, 1, 0, 1))
    for out in ("a.json", "a.csv"):
        typed(f"decode a.bin --format pair.toml --out {out}", cwd=tmp_path)
    columns = json.loads((tmp_path / "a.json").read_text())["columns"]
    assert [columns[f"acc.{axis} [m/s2]"] for axis in "xyz"] == [[None]] * 3
    assert (tmp_path / "a.csv").read_text().splitlines()[1].split(",")[2:5] == [""] * 3
