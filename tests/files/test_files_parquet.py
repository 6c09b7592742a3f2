"""The native recording: bits, damage, and files that claim to be one."""

import json
import threading
from dataclasses import fields

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import zstandard
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from plumbob.core import files
from plumbob.core.errors import ClockError, DecodeError, FrameError, ParameterError
from plumbob.data import ImuData, ImuMeta
from plumbob.files import Recording, arrow, header, parquet
from plumbob.files.columns import COLUMNS, to_columns
from plumbob.files.parquet import read_parquet, write_parquet
from tests.helpers import examples
from tests.helpers.io_samples import CASES, assert_same, make_imu, make_track

ROWS = 5
BITS = hnp.arrays(np.uint64, (ROWS - 1, 3), elements=st.integers(0, 2**64 - 1))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("parquet")


def refused(path, match, error=DecodeError):
    with pytest.raises(error, match=match) as caught:
        read_parquet(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def tabled(columns, content):
    """Table as it was read from a file with this header."""
    sealed = content | {"crc32": parquet._checksum(content, sorted(columns.items()))}
    return parquet._table(columns, {parquet.KEY: header.dump(sealed)})


def forged(path, *, content=None, table=None, key=b"plumbob", seal=True):
    """A native file with another header or table and, where sealed, a checksum that fits."""
    columns = to_columns(CASES["both"])
    original = header.header_of(CASES["both"], list(columns))
    content = {**original, **(content or {})}
    content = {k: v for k, v in content.items() if v is not ...}
    table = table if table is not None else tabled(columns, original)
    crc = {"crc32": parquet._checksum(content, sorted(columns.items()))} if seal else {}
    raw = json.dumps(content | crc)
    pq.write_table(table.replace_schema_metadata({key: raw}), path)
    return path


@examples(0.6)
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


def test_truncation_at_every_byte_is_refused(folder):
    whole = folder / "whole.parquet"
    write_parquet(whole, Recording(imu=make_imu(rows=2, mag=None, acc=None, temp_c=None)))
    raw = whole.read_bytes()
    read_parquet(whole)
    path = folder / "cut.parquet"
    for size in range(len(raw)):
        path.write_bytes(raw[:size])
        refused(path, "cut.parquet")


def test_a_flipped_bit_never_gives_other_numbers(folder):
    """All 91 608 single flips of this file were tried once: 73 947 refused, 17 661 harmless, none wrong."""
    whole, path = folder / "unflipped.parquet", folder / "flipped.parquet"
    write_parquet(whole, CASES["both"])
    raw, before = whole.read_bytes(), read_parquet(whole)
    refusals = 0
    for bit in np.random.default_rng(3).choice(8 * len(raw), 600, replace=False):
        damaged = bytearray(raw)
        damaged[bit >> 3] ^= 1 << (bit & 7)
        path.write_bytes(damaged)
        try:
            assert_same(before, read_parquet(path))
        except DecodeError as error:
            refusals += 1
            assert "\n" not in str(error)
    assert refusals > 400


def test_swapped_columns_are_refused(folder):
    """The numbers of two columns change places; every page and the footer are whole."""
    columns = to_columns(CASES["both"])
    sealed = tabled(columns, header.header_of(CASES["both"], list(columns)))
    swapped = sealed.set_column(1, sealed.field(1), sealed.column(2)).set_column(2, sealed.field(2), sealed.column(1))
    pq.write_table(swapped, folder / "swapped.parquet")
    refused(folder / "swapped.parquet", "does not fit its checksum")


def test_storage_is_as_documented(folder):
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


def test_any_tool_sees_units_and_header(folder):
    path = folder / "plain.parquet"
    write_parquet(path, CASES["both"])
    table = pq.read_table(path)
    assert table.schema.field("gyr_x").metadata == {b"unit": b"rad/s"}
    assert table.schema.field("mag_z").metadata == {b"unit": b"uT"}
    content = json.loads(table.schema.metadata[b"plumbob"])
    assert content["kind"] == "plumbob recording"
    assert content["format_version"] == 1
    assert content["units"]["acc_x"] == "m/s2"
    assert content["imu"]["t0_ns"] == 1_700_000_000_123_456_789
    assert content["track"] == {"frame": "NWU", "north": "free", "source": "test, of the files"}
    assert table.column("t_ns").to_numpy()[1] == 253_500_000  # 0.25 s + 3.5 ms


def test_an_absent_triad_has_no_columns(folder):
    path = folder / "absent.parquet"
    write_parquet(path, CASES["imu without mag"])
    assert not [name for name in pq.read_schema(path).names if name.startswith(("mag", "temp", "q_"))]


def test_the_header_holds_every_field_of_the_meta():
    assert set(header._META) == {f.name for f in fields(ImuMeta)}


def test_noise_is_stored_below_its_raw_size(folder):
    path = folder / "noise.parquet"
    write_parquet(path, Recording(imu=make_imu(rows=20_000)))
    # 10 float64 columns of white noise, a time and flags are 92 bytes raw; the study measured 59.8 bytes for 9 + time.
    assert path.stat().st_size / 20_000 < 75.0


def test_a_recording_of_constants_is_not_taken_for_a_lie(folder):
    path = folder / "constant.parquet"
    imu = ImuData(t=np.arange(1_000_000) * 0.01, acc=np.tile([0.0, 0.0, 9.8], (1_000_000, 1)))
    write_parquet(path, Recording(imu=imu))
    assert len(read_parquet(path).imu) == 1_000_000


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
    assert 24 * 3600 * 200 / rows * unpacked > 1.5e9
    assert unpacked / (folder / "rest.parquet").stat().st_size < files._MAX_RATIO


def test_a_foreign_parquet_is_named_so(folder):
    path = folder / "foreign.parquet"
    pq.write_table(pa.table({"t": [0.0, 1.0], "x": [1.0, 2.0]}), path)
    refused(path, "of another program")
    refused(forged(path, key=b"other"), "of another program")


@pytest.mark.parametrize("version", [3, 99])
def test_a_newer_version_says_update(folder, version):
    refused(
        forged(folder / "new.parquet", content={"format_version": version}), f"format_version {version}.*update Plumbob"
    )


@pytest.mark.parametrize(
    ("content", "match"),
    [
        ({"kind": "plumbob noise card"}, "does not say 'plumbob recording'"),
        ({"format_version": True}, "no format_version"),
        ({"format_version": ...}, "no format_version"),
        ({"notes": ...}, "must have the keys"),
        ({"extra": 1}, "must have the keys"),
        ({"notes": "text"}, "list of texts"),
        ({"notes": [1]}, "list of texts"),
        ({"imu": [1]}, "'imu' in its header must have the keys"),
        ({"track": {"frame": "ENU"}}, "'track' in its header must have the keys"),
        ({"imu": None}, "do not belong here"),
        ({"track": None}, "do not belong here"),
        ({"units": {}}, "the units in its header"),
        ({"units": None}, "the units in its header"),
    ],
)
def test_a_header_that_is_not_ours_is_refused(folder, content, match):
    refused(forged(folder / "header.parquet", content=content), match)


@pytest.mark.parametrize(
    ("part", "key", "value", "error"),
    [
        ("imu", "device", 1, DecodeError),
        ("imu", "gyr_range", "2000 dps", DecodeError),
        ("imu", "gyr_range", True, DecodeError),
        ("imu", "t0_ns", 1.5, DecodeError),
        ("imu", "unit_check", 1, DecodeError),
        ("imu", "frame", "NEU", FrameError),
        ("imu", "axes", "x x z", FrameError),
        ("track", "frame", None, DecodeError),
        ("track", "north", 1, DecodeError),
        ("track", "source", None, DecodeError),
    ],
)
def test_a_field_of_the_wrong_type_is_refused(folder, part, key, value, error):
    content = header.header_of(CASES["both"], list(to_columns(CASES["both"])))
    refused(forged(folder / "typed.parquet", content={part: {**content[part], key: value}}), key, error)


@pytest.mark.parametrize("raw", [b"{", b"[]", b'"x"', b"\xff", b'{"kind": NaN}', b'{"a":1,"a":1}', b"[" * 100_000])
def test_a_header_that_is_no_strict_json_is_refused(folder, raw):
    path = folder / "json.parquet"
    pq.write_table(pa.table({"t_ns": [0]}).replace_schema_metadata({b"plumbob": raw}), path)
    refused(path, "header")


def test_a_repeated_key_in_the_header_is_refused(folder):
    path = folder / "twice.parquet"
    raw = json.dumps(header.header_of(CASES["track"], [])).replace('"kind"', '"kind": "", "kind"')
    pq.write_table(pa.table({"t_ns": [0]}).replace_schema_metadata({b"plumbob": raw}), path)
    refused(path, "a key is repeated")


def test_a_number_beyond_float64_in_the_header_is_refused(folder):
    path = folder / "huge.parquet"
    raw = b'{"kind":"plumbob recording","format_version":1,"units":{"t_ns":"ns"},"x":1e999}'
    pq.write_table(pa.table({"t_ns": [0]}).replace_schema_metadata({b"plumbob": raw}), path)
    refused(path, "1e999 is beyond")


def whole_table():
    columns = to_columns(CASES["both"])
    return tabled(columns, header.header_of(CASES["both"], list(columns)))


def units_of(table):
    return {"units": {name: COLUMNS[name].unit if name in COLUMNS else "1" for name in table.column_names}}


@pytest.mark.parametrize("name", ["t_ns", "gyr_y", "flags", "q_w", "cov_zz"])
def test_a_missing_column_is_named(folder, name):
    table = whole_table().drop_columns([name])
    path = folder / "missing.parquet"
    refused(forged(path, table=table), "not of the same names")
    columns = {k: v for k, v in to_columns(CASES["both"]).items() if k != name}
    content = header.header_of(CASES["both"], list(columns))
    pq.write_table(tabled(columns, content), path)
    refused(path, f"the columns {name} are missing")


def test_an_unknown_column_is_named(folder):
    table = whole_table().append_column(pa.field("heart", pa.float64(), False, {b"unit": b"1"}), pa.array([0.0] * 12))
    refused(forged(folder / "extra.parquet", table=table, content=units_of(table)), "column heart is unknown")


@pytest.mark.parametrize(("name", "kind"), [("gyr_x", pa.float32()), ("t_ns", pa.int32()), ("score", pa.uint8())])
def test_a_column_of_another_type_is_refused(folder, name, kind):
    table = whole_table()
    place = table.column_names.index(name)
    table = table.set_column(place, table.field(name).with_type(kind), table.column(name).cast(kind, safe=False))
    refused(forged(folder / "typed.parquet", table=table), f"the column {name} must be")


@pytest.mark.parametrize("unit", [b"deg/s", b"", None])
def test_another_unit_is_refused(folder, unit):
    table = whole_table()
    field = table.field("gyr_x").with_metadata(None if unit is None else {b"unit": unit})
    table = table.set_column(table.column_names.index("gyr_x"), field, table.column("gyr_x"))
    refused(forged(folder / "unit.parquet", table=table), "gyr_x must be in rad/s, but its metadata says")


def test_another_unit_in_the_header_is_refused(folder):
    table = whole_table()
    units = units_of(table)["units"] | {"gyr_x": "deg/s"}
    refused(forged(folder / "unit.parquet", table=table, content={"units": units}), "the header 'deg/s'")


def test_nulls_are_refused(folder):
    table = whole_table()
    field = table.field("gyr_x").with_nullable(True)
    values = pa.array([None] + [0.0] * 11)
    table = table.set_column(table.column_names.index("gyr_x"), field, values)
    refused(forged(folder / "null.parquet", table=table), "gyr_x holds 1 nulls")


def test_a_header_without_its_checksum_is_refused(folder):
    refused(forged(folder / "bare.parquet", seal=False), "does not fit its checksum")


def test_no_rows_are_refused(folder):
    refused(forged(folder / "empty.parquet", table=whole_table().slice(0, 0)), "claims 0 rows")


def test_more_rows_than_a_file_of_its_size_may_hold_are_refused(folder, monkeypatch):
    path = folder / "claim.parquet"
    imu = ImuData(t=np.arange(1_000_000) * 0.01, acc=np.tile([0.0, 0.0, 9.8], (1_000_000, 1)))
    write_parquet(path, Recording(imu=imu))
    monkeypatch.setattr(files, "_FREE_BYTES", 16 << 20)  # a test need not unpack 64 MiB
    refused(path, r"unpack to 360\d{5}, but .* are allowed: .* allow more, for example PLUMBOB_MEMORY=1GiB")
    monkeypatch.setenv("PLUMBOB_MEMORY", "40MiB")
    assert len(read_parquet(path).imu) == 1_000_000
    monkeypatch.setenv("PLUMBOB_MEMORY", "much")
    refused(path, "PLUMBOB_MEMORY must be a size, for example 4GiB, but it is 'much'")


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


def test_pages_that_unpack_to_more_than_their_table_of_contents_says_are_refused(folder):
    """A page says itself what it unpacks to, and Arrow believes it: here one says a gigabyte, and holds it."""
    path = folder / "bomb.parquet"
    write_parquet(path, Recording(imu=make_imu(rows=50_000)))
    column = pq.ParquetFile(path).metadata.row_group(0).column(1)
    bomb = zstandard.compress(bytes(64 << 20)) * 16  # frames after one another are one
    content = page(1 << 30, len(bomb), 1 << 27) + bomb
    rest = column.total_compressed_size - len(content) - len(page(0, 1 << 17))
    content += page(0, rest)
    content += bytes(column.total_compressed_size - len(content))
    data = bytearray(path.read_bytes())
    data[column.data_page_offset : column.data_page_offset + len(content)] = content
    path.write_bytes(data)
    refused(path, r"bytes unpack to 10\d{8}, but")


def test_pages_of_a_decoded_table_are_judged_too(folder, monkeypatch):
    """Three columns of a million equal numbers unpack to 24 MB."""
    path = folder / "decoded.parquet"
    profile = 'separator = ","\n[header]\nnames = true\n[time]\nrate = "100 Hz"\n'
    profile += '[acc]\ncolumns = ["x", "y", "z"]\nunit = "m/s2"\nsign = "specific-force"\n'
    table = pa.table({name: np.full(1_000_000, value) for name, value in zip("xyz", (0.0, 0.0, 9.8), strict=True)})
    table = table.replace_schema_metadata({"plumbob profile": profile})
    pq.write_table(table, path, compression="zstd", use_dictionary=False)
    assert len(read_parquet(path).imu) == 1_000_000
    monkeypatch.setattr(files, "_FREE_BYTES", 16 << 20)
    refused(path, r"unpack to 24\d{6}, but")


@pytest.mark.parametrize(
    ("header", "says"),
    [
        (page(8, 9) + bytes(8), "a page of it is damaged"),  # beyond the chunk
        (page(8, 8)[:-3], "the header of a page is cut"),
        (b"\x15\x00\x15\x02\x00", "a page of it is damaged"),  # without a stored size
        (b"\x15\x00\x15\x01\x15\x02\x00", "a page of it is damaged"),  # -1 bytes
        (b"\x19\x15\x00", "a field of type 9"),
        (b"\x1c" * 100, "a field of type 12"),
        (b"\x18" + b"\xff" * 70, "the header of a page is cut"),
        (b"\x18\xff\xff\xff\x7f", "the header of a page is cut"),  # a text beyond the end
    ],
)
def test_headers_of_pages_are_believed_only_where_they_are_whole(header, says):
    with pytest.raises(DecodeError, match=says):
        arrow._of_pages(header)


def test_headers_of_pages_are_read_to_their_end():
    assert arrow._of_pages(page(700, 3) + b"abc" + page(1 << 20, 0)) == 700 + (1 << 20)


def test_a_table_of_contents_that_is_too_large_is_not_read(folder):
    path = folder / "contents.parquet"
    path.write_bytes(b"PAR1" + bytes(2 << 20) + (2 << 20).to_bytes(4, "little") + b"PAR1")
    refused(path, "its table of contents has 2097152 bytes")


@pytest.mark.parametrize("meta", [ImuMeta(device=None), ImuMeta(unit_check="no")])
def test_meta_that_no_file_can_keep_is_refused_before_writing(folder, meta):
    path = folder / "meta.parquet"
    with pytest.raises(ParameterError, match="a file cannot keep it"):
        write_parquet(path, Recording(imu=make_imu(meta=meta)))
    assert not path.exists()


def test_times_that_go_back_are_refused_with_the_file_named(folder):
    columns = to_columns(CASES["track"])
    columns["t_ns"] = columns["t_ns"][::-1].copy()
    path = folder / "back.parquet"
    pq.write_table(tabled(columns, header.header_of(CASES["track"], list(columns))), path)
    refused(path, "must strictly increase", ClockError)


def test_a_track_of_a_filter_keeps_its_quaternions(folder):
    track = make_track()
    write_parquet(folder / "track.parquet", Recording(track=track))
    assert read_parquet(folder / "track.parquet").track.q_nb.tobytes() == track.q_nb.tobytes()


def test_reading_in_parts_leaves_the_callers_arithmetic_alone(tmp_path):
    """A generator that is abandoned may end in another thread, where NumPy's settings are not its own to restore."""
    write_parquet(tmp_path / "a.parquet", Recording(imu=make_imu()))
    before = np.geterr()
    parts = parquet.open_parquet(tmp_path / "a.parquet").imu._parts(0)
    next(parts)
    assert np.geterr() == before
    ended = []
    thread = threading.Thread(target=lambda: ended.append(parts.close()))
    thread.start()
    thread.join()
    assert ended == [None]
