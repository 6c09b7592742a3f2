"""plumbob decode on frames that were put together by hand, and what other verbs read of what it wrote."""

import binascii
import json
import random
import struct

import numpy as np
import pytest
from pyarrow import parquet as pq

from benchmarks.harness.decoder_streams import frames_of, settled
from plumbob import read
from plumbob.core.constants import G0
from plumbob.core.errors import DecodeError
from plumbob.protocols.decode import decode, prefix_by_unit, triads_of
from plumbob.protocols.format_toml import device_names, find_format, rig_names
from tests.helpers import beside
from tests.helpers.commandline import answer, ok, typed

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


SENSORS = [name for name in (*device_names(), *rig_names()) if any(map(prefix_by_unit, find_format(name).messages))]


@pytest.fixture(scope="module")
def buoy(tmp_path_factory):
    folder = tmp_path_factory.mktemp("buoy")
    ok("emulate", "buoy", "--seed", "1", "--duration", "12s", "--write", "sea.bin", cwd=folder)
    return folder


def bytes_of(form):
    """Thirty frames of each message."""
    return b"".join(frames_of(form, 30, np.random.default_rng(1)))


@pytest.mark.parametrize("name", SENSORS)
def test_every_format_with_sensors_is_read_back(name, tmp_path):
    form = settled(find_format(name))
    raw = bytes_of(form)
    (tmp_path / "raw.bin").write_bytes(raw)
    asked = {key: next(iter(o.choices), "1") for key, o in find_format(name).options.items() if o.default is None}
    options = [word for key, value in asked.items() for word in ("--option", f"{key}={value}")]
    for message, unit in ((m, u) for m in form.messages for u in prefix_by_unit(m)):
        want = triads_of(decode(raw, form)[0][message.name], unit)
        if not any(np.isfinite(values).any() for values in want.values()):
            continue
        for suffix, slack in (("csv", 1e-11), ("parquet", 0.0)):  # CSV has twelve digits
            out = tmp_path / f"a.{suffix}"
            words = ["--message", message.name, "--unit", unit, "--rate", "50 Hz", *options, "--force", "--out", out]
            ok("decode", tmp_path / "raw.bin", "--format", name, *words)
            imu = read(out).imu
            assert imu.meta.device == name
            assert imu.t == pytest.approx(np.arange(len(imu)) / 50.0, abs=1e-9)
            for triad, values in want.items():
                got = getattr(imu, triad)
                assert np.allclose(got, values, rtol=slack, atol=slack, equal_nan=True), (message.name, triad)


@pytest.mark.parametrize("suffix", ["csv", "txt", "parquet"])
def test_every_verb_reads_it(buoy, suffix):
    file = f"{suffix}.{suffix}"
    typed(f"decode sea.bin --format buoy --out {file}", cwd=buoy)
    time = answer(f"info {file}", cwd=buoy)["sensors"]["time"]
    assert (time["samples"], time["rate_hz"]) == (1200, pytest.approx(100.0))
    assert answer(f"run {file} --filter mahony --frame NED", cwd=buoy)["samples"] == 1200
    typed(f"convert {file} from_{suffix}.parquet", cwd=buoy)
    imu = read(buoy / f"from_{suffix}.parquet").imu
    assert np.count_nonzero(np.isnan(imu.mag[:, 0])) == 300  # the magnetometer has 75 Hz: each fourth is absent
    for verb in ("allan", "calibrate gyro --method rest"):  # it was read, and judged: a buoy moves
        assert "still" in typed(verb, file, cwd=buoy, code=1).stderr


def test_the_unit_that_is_read_is_one_of_the_frame(tmp_path):
    raw, form = tmp_path / "raw.bin", settled(find_format("arm"))
    raw.write_bytes(bytes_of(form))
    typed("decode raw.bin --format arm --unit u2 --rate '50 Hz' --out a.csv", cwd=tmp_path)
    done = typed("decode raw.bin --format arm --rate '50 Hz' --out b.csv", cwd=tmp_path)
    assert "read as unit u1 of u1, u2, u3, u4, u5, u6" in done.stderr
    decoded = next(iter(decode(raw.read_bytes(), form)[0].values()))
    for name, unit in (("a", "u2"), ("b", "u1")):
        np.testing.assert_allclose(read(tmp_path / f"{name}.csv").imu.gyr, triads_of(decoded, unit)["gyr"], rtol=1e-11)


def test_a_table_that_was_changed_or_has_no_time_is_refused(buoy, tmp_path):
    typed(f"decode sea.bin --format buoy --out {tmp_path}/whole.parquet", cwd=buoy)
    table = pq.read_table(tmp_path / "whole.parquet")
    assert len(read(tmp_path / "whole.parquet").imu) == len(table)
    pq.write_table(table.drop_columns(["gyr.x [rad/s]"]), tmp_path / "less.parquet")
    flags = table.column_names.index("flags")
    pq.write_table(table.set_column(flags, "flags", [["gap+tired"] * len(table)]), tmp_path / "odd.parquet")
    (tmp_path / "raw.bin").write_bytes(bytes_of(settled(find_format("hmc5983"))))
    for suffix in ("csv", "parquet"):
        typed(f"decode raw.bin --format hmc5983 --out timeless.{suffix}", cwd=tmp_path)
    for name, why in (
        ("less.parquet", r"less\.parquet: the column 'gyr\.x \[rad/s\]' is nowhere in the row of names"),
        ("odd.parquet", "'tired' is not the name of a flag"),
        ("timeless.csv", r"1 open question: time\.rate"),
        ("timeless.parquet", r"1 open question: time\.rate"),
    ):
        with pytest.raises(DecodeError, match=why):
            read(tmp_path / name)
