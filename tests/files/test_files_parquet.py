"""The native recording: bits, damage, and files that claim to be one."""

import json
import threading
from contextlib import suppress
from dataclasses import fields

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import zstandard
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from plumbob import ImuArray, ImuData, ImuMeta, Recording
from plumbob.core.errors import ClockError, DecodeError, FrameError, ParameterError
from plumbob.core.files import require_room
from plumbob.files import header
from plumbob.files.arrow import text_bytes, unpacked_bytes
from plumbob.files.columns import COLUMNS, to_columns
from plumbob.files.parquet import read_parquet, write_parquet
from tests.helpers import examples
from tests.helpers.io_samples import CASES, assert_same, make_imu, put, refused, sealed
from tests.helpers.record_samples import flipped

ROWS = 5
BITS = hnp.arrays(np.uint64, (ROWS - 1, 3), elements=st.integers(0, 2**64 - 1))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("parquet")


BOTH = to_columns(CASES["both"])
CONTENT = header.file_header(CASES["both"], list(BOTH))


@examples(0.3)
@given(gyr=BITS, acc=BITS, flags=hnp.arrays(np.uint32, ROWS), steps=st.lists(st.integers(1, 10**12), min_size=ROWS))
def test_every_bit_pattern_comes_back(folder, gyr, acc, flags, steps):
    """Any 64 bits are a float64: NaN with any payload, −0, denormals, infinities."""
    anchor = np.zeros((1, 3))  # a triad needs one number
    imu = ImuData(
        t=np.cumsum(steps[:ROWS]) / 1e9,
        gyr=np.concatenate([anchor, gyr.view(np.float64)]),
        acc=np.concatenate([anchor, acc.view(np.float64)]),
        flags=flags,
        meta=ImuMeta(unit_check=False),
    )
    path = folder / "bits.parquet"
    write_parquet(path, Recording(imu=imu), overwrite=True)
    assert_same(Recording(imu=imu), read_parquet(path))


@pytest.mark.parametrize("name", ["both", "several units"])
def test_a_cut_is_refused_and_a_flipped_bit_never_gives_other_numbers(folder, name):
    """All 91 608 single flips of the first were tried once: 73 947 refused, 17 661 harmless, none wrong."""
    whole, path = folder / "whole.parquet", folder / "damaged.parquet"
    recording = CASES["both"] if name == "both" else Recording(array=ImuArray({"u1": make_imu(), "u2": make_imu()}))
    write_parquet(whole, recording, overwrite=True)
    raw, before = whole.read_bytes(), read_parquet(whole)
    for size in [*range(0, len(raw) - 12, 97), *range(len(raw) - 12, len(raw))]:
        refused(read_parquet, put(path, raw[:size]), match="damaged.parquet")
    refusals = 0
    for bit in np.random.default_rng(3).choice(8 * len(raw), 120, replace=False):
        path.write_bytes(flipped(raw, bit >> 3, 1 << (bit & 7)))
        try:
            back = read_parquet(path)
            assert_same(before, back)
            for unit in before.array.names if before.array else ():
                assert_same(before.of_unit(unit), back.of_unit(unit))
        except DecodeError as error:
            refusals += 1
            assert "\n" not in str(error)
    assert refusals > 60
    pq.write_table(pa.table(dict.fromkeys("txyz", np.arange(500.0))), path)  # another program's, with statistics
    raw = path.read_bytes()  # a flipped bit of its table of contents may make Arrow end the process
    for bit in np.random.default_rng(3).integers(8 * raw.rindex(b"schema"), 8 * len(raw) - 64, 300):
        path.write_bytes(flipped(raw, bit >> 3, 1 << (bit & 7)))
        with suppress(DecodeError):
            text_bytes(path)


def test_storage_units_and_size_are_as_documented(folder):
    path = folder / "storage.parquet"
    write_parquet(path, CASES["both"])
    group = pq.ParquetFile(path).metadata.row_group(0)
    for i in range(group.num_columns):
        column = group.column(i)
        assert column.compression == "ZSTD"
        assert not column.has_dictionary_page
        expected = {"float64": "BYTE_STREAM_SPLIT", "int64": "DELTA_BINARY_PACKED"}.get(
            COLUMNS[column.path_in_schema].dtype
        )
        # RLE is how Parquet numbers its levels; PLAIN would be listed if it were used.
        assert expected is None or set(column.encodings) - {"RLE"} == {expected}
    path = folder / "plain.parquet"
    write_parquet(path, CASES["both"])
    table = pq.read_table(path)
    assert table.schema.field("gyr_x").metadata == {b"unit": b"rad/s"}
    assert table.schema.field("mag_z").metadata == {b"unit": b"uT"}
    content = json.loads(table.schema.metadata[b"plumbob"])
    assert content["kind"] == "plumbob recording"
    assert content["format_version"] == 1
    assert content["units"]["acc_x"] == "m/s2"
    assert set(content["imu"]) == {field.name for field in fields(ImuMeta)}
    assert content["imu"]["t0_ns"] == 1_700_000_000_123_456_789
    assert content["track"] == {"frame": "NWU", "north": "free", "source": "test, of the files"}
    assert table.column("t_ns").to_numpy()[1] == 253_500_000  # 0.25 s + 3.5 ms
    path = folder / "noise.parquet"
    write_parquet(path, Recording(imu=make_imu(rows=20_000)))
    # 10 float64 columns of white noise, a time and flags are 92 bytes raw; the study measured 59.8 bytes for 9 + time.
    assert path.stat().st_size / 20_000 < 75.0


def test_a_day_of_a_unit_at_rest_is_not_taken_for_a_bomb(folder):
    """Nine channels that stir by a count in a hundred samples, and a constant temperature: a day is 1.6 GB unpacked."""
    rows, counts = 100_000, np.random.default_rng(0)
    still = [np.where(counts.random((rows, 3)) < 0.01, 1.0, 0.0) for _ in range(3)]
    imu = ImuData(
        t=np.arange(rows) / 200.0, gyr=1e-3 * still[0], acc=1e-3 * still[1] + [0.0, 0.0, 9.8],
        mag=0.1 * still[2] + [20.0, 0.0, 40.0], temp_c=np.full(rows, 25.0),
    )  # fmt: skip
    write_parquet(folder / "rest.parquet", Recording(imu=imu))
    unpacked = rows * (8 + 4 + 10 * 8)
    times = 24 * 3600 * 200 // rows
    assert times * unpacked > 1.5e9
    require_room(times * unpacked, times * (folder / "rest.parquet").stat().st_size)


def test_a_file_unpacks_to_64_mib_and_128_times_its_size_or_to_what_the_environment_allows(monkeypatch):
    free = 64 << 20
    for unpacked, stored in ((free, 0), (free + 128_000, 1000)):
        require_room(unpacked, stored)
        refused(require_room, unpacked + 1, stored, match=rf"unpack to {unpacked + 1}, but {unpacked} are allowed")
    refused(require_room, 1 << 30, 0, match="allow more, for example PLUMBOB_MEMORY=2GiB")
    for word, most in (("80MiB", 80 << 20), ("99000KiB", 99_000 << 10), ("1GiB", 1 << 30), ("70000000", 70_000_000)):
        monkeypatch.setenv("PLUMBOB_MEMORY", word)
        require_room(most, 0)
        refused(require_room, most + 1, 0, match=f"but {most} are allowed")
    monkeypatch.setenv("PLUMBOB_MEMORY", "much")
    refused(require_room, 1, 1, match="PLUMBOB_MEMORY must be a size, for example 4GiB, but it is 'much'")


def bare(raw, key=b"plumbob"):
    """Maker of a table of a single column with this text as header."""
    return lambda: pa.table({"t_ns": [0]}).replace_schema_metadata({key: raw})


def told(**changes):
    """Maker of a recording with other entries in its header, whose checksum fits; those that are ... are left out."""
    content = {key: value for key, value in (CONTENT | changes).items() if value is not ...}
    return lambda: sealed(BOTH, content)


def typed(part, key, value):
    return told(**{part: CONTENT[part] | {key: value}})


def replaced(name, values=None, kind=None, **field):
    """Maker of a recording with a column whose values, type or properties are others."""

    def make():
        table = sealed(BOTH, CONTENT)
        place = table.column_names.index(name)
        column = table.column(name) if values is None else values
        with_ = table.field(name) if kind is None else table.field(name).with_type(kind)
        for what, value in field.items():
            with_ = getattr(with_, f"with_{what}")(value)
        return table.set_column(place, with_, column if kind is None else column.cast(kind, safe=False))

    return make


def without(name, told=True):
    """Maker of a recording without a column, which its header does not have either, or still does."""
    columns = {key: values for key, values in BOTH.items() if key != name}
    content = header.file_header(CASES["both"], list(columns))
    return lambda: sealed(columns, content) if told else sealed(BOTH, CONTENT).drop_columns([name])


def extra():
    table = sealed(BOTH, CONTENT | {"units": CONTENT["units"] | {"heart": "1"}})
    return table.append_column(pa.field("heart", pa.float64(), False, {"unit": "1"}), pa.array([0.0] * 12))


def swapped():
    """The numbers of two columns change places; every page and the footer are whole."""
    table = sealed(BOTH, CONTENT)
    first, second = table.column(1), table.column(2)
    return table.set_column(1, table.field(1), second).set_column(2, table.field(2), first)


def back():
    columns = to_columns(CASES["track"])
    content = header.file_header(CASES["track"], list(columns))
    return sealed(columns | {"t_ns": columns["t_ns"][::-1].copy()}, content)


TWICE = json.dumps(header.file_header(CASES["track"], [])).replace('"kind"', '"kind": "", "kind"')
HUGE = b'{"kind":"plumbob recording","format_version":1,"units":{"t_ns":"ns"},"x":1e999}'
REFUSED = [
    (lambda: pa.table({"t": [0.0, 1.0], "x": [1.0, 2.0]}), "does not say its frame and axes"),
    (lambda: sealed(BOTH, CONTENT).replace_schema_metadata({b"other": b"{}"}), "does not say its frame and axes"),
    *((told(format_version=version), f"format_version {version}.*update Plumbob") for version in (3, 99)),
    (told(kind="plumbob noise card"), "does not say 'plumbob recording'"),
    *((told(format_version=version), "no format_version") for version in (True, ...)),
    (told(notes=...), "its header: it needs the key 'notes'.*; write the file again"),
    (told(extra=1), "it has no key 'extra'"),
    (told(notes="text"), "notes must be a list of findings"),
    (told(notes=[1]), r"notes\[1\] must be text or a table"),
    (told(imu=[1]), "imu must be a table"),
    (told(track={"frame": "ENU"}), "track needs the key 'north'"),
    *((told(**{part: None}), "do not belong here") for part in ("imu", "track")),
    *((told(units=units), "the units in its header") for units in ({}, None)),
    (told(units=CONTENT["units"] | {"gyr_x": "deg/s"}), "the header 'deg/s'"),
    (typed("imu", "device", 1), "device"),
    *((typed("imu", "gyr_range", value), "gyr_range") for value in ("2000 dps", True)),
    (typed("imu", "t0_ns", 1.5), "t0_ns"),
    (typed("imu", "unit_check", 1), "unit_check"),
    (typed("imu", "frame", "NEU"), "frame", FrameError),
    (typed("imu", "axes", "x x z"), "axes", FrameError),
    (typed("track", "frame", None), "frame"),
    (typed("track", "north", 1), "north"),
    (typed("track", "source", None), "source"),
    *((bare(raw), "header") for raw in (b"{", b"[]", b'"x"', b"\xff", b'{"kind": NaN}', b"[" * 100_000)),
    (bare(TWICE), "a key occurs twice among .*kind"),
    (bare(HUGE), "1e999 is .* out of range"),
    *((without(name, told=False), "do not have the same names") for name in ("t_ns", "flags")),
    *((without(name), f"the columns {name} are missing") for name in ("t_ns", "gyr_y", "flags", "q_w", "cov_zz")),
    (extra, "column heart is unknown"),
    (replaced("gyr_x", kind=pa.float32()), "the column gyr_x must be"),
    *((replaced("gyr_x", metadata=unit), "must be in rad/s, but its metadata") for unit in ({"unit": "deg/s"}, None)),
    (replaced("gyr_x", pa.array([None] + [0.0] * 11), nullable=True), "gyr_x holds 1 nulls"),
    (lambda: sealed(BOTH, CONTENT, seal=False), "does not fit its checksum"),
    (swapped, "does not fit its checksum"),
    (lambda: sealed(BOTH, CONTENT).slice(0, 0), "claims 0 rows"),
    (back, "must strictly increase", ClockError),
]


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_recording_or_another_than_its_header_says_is_refused(tmp_path, case):
    make, match, error = (*case, DecodeError)[:3]
    path = tmp_path / "a.parquet"
    pq.write_table(make(), path)
    refused(read_parquet, path, match=match, error=error, name=str(path))


def test_a_forged_file_is_read_and_a_fault_of_the_program_is_not_called_damage(tmp_path, monkeypatch):
    pq.write_table(sealed(BOTH, CONTENT), tmp_path / "a.parquet")
    assert_same(CASES["both"], read_parquet(tmp_path / "a.parquet"))
    monkeypatch.delattr(header, "load")
    with pytest.raises(AttributeError):
        read_parquet(tmp_path / "a.parquet")


def integer(value):
    """Zigzag and variable length, as Thrift's compact protocol writes an i32."""
    value, out = value << 1, b""
    while value > 0x7F:
        out, value = out + bytes([value & 0x7F | 0x80]), value >> 7
    return out + bytes([value])


def page(unpacked, stored, values=0):
    """Header of a data page: type, sizes, and the values, encodings and statistics of DataPageHeader."""
    inner = b"\x15" + integer(values) + b"\x15\x12\x15\x06\x15\x06\x1c\x18\x02ab\x16\x02\x00\x00"
    return b"\x15\x00\x15" + integer(unpacked) + b"\x15" + integer(stored) + b"\x2c" + inner + b"\x00"


def with_pages(path, pages):
    """Put these bytes at the end of the second column of a file, and before them a page that unpacks to nothing."""
    column = pq.read_metadata(path).row_group(0).column(1)
    room = column.total_compressed_size - len(pages)
    rest = next(n for n in range(room, 0, -1) if n + len(page(0, n)) == room)
    raw = bytearray(path.read_bytes())
    start = column.data_page_offset
    raw[start : start + column.total_compressed_size] = page(0, rest) + bytes(rest) + pages
    path.write_bytes(raw)


PROFILE = 'separator = ","\n[header]\nnames = true\n[time]\nrate = "100 Hz"\n'
PROFILE += '[acc]\ncolumns = ["x", "y", "z"]\nunit = "m/s2"\nsign = "specific-force"\n'


@pytest.mark.parametrize("described", [True, False])
def test_pages_are_judged_by_what_they_say_before_any_is_unpacked(tmp_path, described):
    """A page says itself what it unpacks to, and Arrow believes it: here one says a gigabyte, and holds it."""
    path, bomb = tmp_path / "bomb.parquet", zstandard.compress(bytes(64 << 20)) * 16  # frames in a row are one
    noise = np.random.default_rng(0).normal(size=(50_000, 3)) + [0.0, 0.0, 9.8]
    write_parquet(path, Recording(imu=ImuData(t=np.arange(50_000) / 100, acc=noise)))
    if described:
        table = pa.table(dict(zip("xyz", noise.T, strict=True))).replace_schema_metadata({"plumbob profile": PROFILE})
        pq.write_table(table, path, compression="zstd", use_dictionary=False)
    before = unpacked_bytes(path)
    assert len(read_parquet(path).imu) == 50_000
    with_pages(path, page(1 << 30, len(bomb), 1 << 27) + bomb)
    after = unpacked_bytes(path)
    assert after == (1 << 30) + before * 2 // 3 or not described  # instead of one of three equal columns
    refused(read_parquet, path, match=f"bytes unpack to {after}, but", name=path.name)
    path.write_bytes(b"PAR1" + bytes(2 << 20) + (2 << 20).to_bytes(4, "little") + b"PAR1")
    refused(read_parquet, path, match="its table of contents has 2097152 bytes")


@pytest.mark.parametrize(
    ("pages", "match"),
    [
        (page(8, 9) + bytes(8), "a page of it is damaged"),  # beyond the chunk
        (page(8, 8)[:-3], "the header of a page is cut"),
        (b"\x15\x00\x15\x02\x00", "a page of it is damaged"),  # without a stored size
        (b"\x15\x00\x15\x01\x15\x02\x00", "a page of it is damaged"),  # -1 bytes
        (b"\x1b\x15\x00", "a field of type 11"),
        (b"\x1c" * 100, "a field of type 12"),
        (b"\x18" + b"\xff" * 70, "the header of a page is cut"),
        (b"\x18\xff\xff\xff\x7f", "the header of a page is cut"),  # a text beyond the end
    ],
)
def test_headers_of_pages_are_believed_only_where_they_are_whole(folder, pages, match):
    path = folder / "pages.parquet"
    write_parquet(path, CASES["imu without mag"], overwrite=True)
    with_pages(path, pages)
    refused(read_parquet, path, match=match, name=path.name)


@pytest.mark.parametrize("meta", [ImuMeta(device=None), ImuMeta(unit_check="no")])
def test_meta_that_no_file_can_keep_is_refused_before_writing(folder, meta):
    path = folder / "meta.parquet"
    with pytest.raises(ParameterError, match="a file cannot keep it"):
        write_parquet(path, Recording(imu=make_imu(meta=meta)))
    assert not path.exists()


def test_reading_in_parts_leaves_the_callers_arithmetic_alone(tmp_path):
    """A generator that is abandoned may end in another thread, where NumPy's settings are not its own to restore."""
    write_parquet(tmp_path / "a.parquet", Recording(imu=make_imu()))
    before = np.geterr()
    parts = read_parquet(tmp_path / "a.parquet", in_memory=False).imu.chunks(5)
    next(parts)
    assert np.geterr() == before
    ended = []
    thread = threading.Thread(target=lambda: ended.append(parts.close()))
    thread.start()
    thread.join()
    assert ended == [None]
