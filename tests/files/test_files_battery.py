"""What every format that can be written promises: a format joins by one line in FORMATS_WRITTEN."""

import errno
import os
import pickle

import numpy as np
import pytest

from plumbob import profile
from plumbob.core.errors import ClockError, DecodeError, ParameterError, ShapeError
from plumbob.data import ImuMeta
from plumbob.data.recording import Recording
from plumbob.files import FORMATS, read, write
from tests.helpers import full_disk
from tests.helpers.io_samples import CASES, ROWS, assert_same, make_imu, make_track, put, refused

FORMATS_WRITTEN = {
    **{suffix: {"nan_bits": True} for suffix in (".parquet", ".mat", ".nc")},
    **{suffix: {"nan_bits": False} for suffix in (".csv", ".txt")},
}
SUFFIXES = [suffix for kind in FORMATS for suffix in kind.suffixes]
every_format = pytest.mark.parametrize("suffix", FORMATS_WRITTEN)


def test_battery_covers_every_format_that_is_written():
    assert {suffix for kind in FORMATS for suffix, _ in kind.writers} == {*FORMATS_WRITTEN, ".sto"}  # an attitude alone


@every_format
@pytest.mark.parametrize("case", CASES)
def test_round_trip_keeps_every_bit(tmp_path, suffix, case):
    recording = CASES[case]
    path = write(tmp_path / f"a{suffix}", recording)
    assert_same(recording, read(path), **FORMATS_WRITTEN[suffix])


@every_format
def test_numbers_of_numpy_in_the_meta_are_kept(tmp_path, suffix):
    meta = ImuMeta(gyr_range=np.float64(35.1), t0_ns=np.int64(2**60 + 1), rate_nominal=np.float64(1e3 / 3.0))
    back = read(write(tmp_path / f"a{suffix}", make_imu(meta=meta)))
    assert back.imu.meta == meta
    assert type(back.imu.meta.t0_ns) is int


@every_format
def test_second_generation_equals_the_first(tmp_path, suffix):
    first = read(write(tmp_path / f"a{suffix}", CASES["both"]))
    second = read(write(tmp_path / f"b{suffix}", first))
    assert_same(first, second)
    # The profile's name is provenance, so it may be added; nothing is lost or repeated.
    kept = [[n for n in map(str, made.notes) if not n.startswith("read with")] for made in (first, second)]
    assert kept[0] == kept[1]


@every_format
def test_samples_and_tracks_are_written_bare_and_notes_are_kept(tmp_path, suffix):
    back = read(write(tmp_path / f"a{suffix}", make_imu(), notes=["made by a test"]))
    assert back.track is None
    assert back.name == "a"
    assert str(back.notes[0]) == "made by a test"
    assert read(write(tmp_path / f"b{suffix}", make_track())).imu is None


@every_format
def test_findings_are_not_stored_because_they_go_stale(tmp_path, suffix):
    back = read(write(tmp_path / f"a{suffix}", make_imu(meta=ImuMeta(device="x"))))
    assert [note.code for note in back.notes if note.family == "samples"] == ["samples.uncalibrated"]
    calibrated = read(write(tmp_path / f"b{suffix}", Recording(imu=make_imu(), notes=back.notes)))
    assert not any(note.family == "samples" for note in calibrated.notes)


@every_format
def test_what_cannot_be_written_leaves_nothing(tmp_path, suffix, monkeypatch):
    both = Recording(imu=make_imu(), track=make_track(ROWS - 1))
    refused(write, tmp_path / f"a{suffix}", both, match="write them in two files", error=ClockError)
    part = make_imu()[1:2]  # its only sample has no magnetometer value
    refused(write, tmp_path / f"a{suffix}", part, match=r"mag .* in all 1 samples", error=ShapeError)
    assert list(tmp_path.iterdir()) == []

    def refuse(*_: object, **__: object) -> None:
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(os, "fsync", refuse)
    refused(write, tmp_path / f"a{suffix}", make_imu(), match="Input/output error")
    assert list(tmp_path.iterdir()) == []


@every_format
def test_overwriting_replaces_the_whole_file(tmp_path, suffix):
    write(tmp_path / f"a{suffix}", CASES["both"])
    back = read(write(tmp_path / f"a{suffix}", CASES["track"], overwrite=True))
    assert_same(CASES["track"], back, **FORMATS_WRITTEN[suffix])


@every_format
@pytest.mark.parametrize("limit", [0, 100, 2000])
def test_a_full_disk_leaves_the_old_file_and_nothing_else(tmp_path, suffix, limit):
    path = write(tmp_path / f"a{suffix}", CASES["both"])
    before = {p.name: p.read_bytes() for p in tmp_path.iterdir()}
    with full_disk(limit), pytest.raises(DecodeError, match=r"a\..*cannot be written.*Nothing was changed"):
        write(path, make_imu(rows=500), overwrite=True)
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir()} == before


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_foreign_files_no_file_and_a_folder_are_refused_in_one_line(tmp_path, suffix):
    path = tmp_path / f"foreign{suffix}"
    for content in (b"", b"\x00", b"PAR1", b"hello\n", bytes(range(256)) * 8):
        path.write_bytes(content)
        assert len(refused(read, path, match=path.name)) < 1000
    refused(read, tmp_path / f"none{suffix}", match="does not exist")
    (tmp_path / f"folder{suffix}").mkdir()
    refused(read, tmp_path / f"folder{suffix}", match="is a folder, and not one of ROS, EuRoC")


KNOWN_KINDS = {
    "a.db": (b"SQLite format 3\0" + bytes(84), "a SQLite database.*sqlite3 -header -csv"),
    "a.pkl": (pickle.dumps({"gyr": [0.0]}), "a pickle of Python.*numpy.savez"),
    "a.csv": (pickle.dumps([1]), "a pickle of Python"),
    "a.gpx": (b'<?xml version="1.0"?>\n<gpx version="1.1">', "a track of positions"),
    "a.log": (b"(1718000000.000000) can0 174#0D00FDFFFAFF0000\n", "a log of a CAN bus.*cantools"),
    "a.fit": (b"\x0e\x10\x43\x08" + bytes(4) + b".FIT" + bytes(9), "a FIT file"),
    "a.cwa": (b"MD\xfc\x03\x00\xb0y\x07" * 9, "a recording of Axivity"),
    "b.csv": (b"Type,Local Number,Message,Field 1,Value 1,Units 1\nData,0,x,y,1,s\n" * 9, "a table of FitCSVTool"),
    "a.txt": (b"%RAWIMUSA,1537,361705.645;1537,361705.6448,0,303,415,-5,-230,-181,-51*c01b\n" * 9, "a log of NovAtel"),
    "a.bin": (b"\xaaD\x12\x1c" + bytes(60), "a binary log of NovAtel"),
}  # fmt: skip


def test_what_no_format_takes_is_refused(tmp_path):
    for name, (content, match) in KNOWN_KINDS.items():
        path = put(tmp_path / name, content)
        for verb in (read, profile):
            refused(verb, path, match=f"^{path} is {match}")
        path.unlink()
    imu = make_imu()
    os.mkfifo(tmp_path / "pipe.parquet")  # refused instead of waited for
    refused(read, tmp_path / "pipe.parquet", match="not a regular file")
    refused(read, tmp_path / "a.xls", match=r"'\.xls' is unknown; known: \.parquet, \.bag, .*\.csv")
    refused(write, tmp_path / "a", imu, match="is unknown")
    known = r"is not among \.parquet, \.sto, \.csv, \.txt, \.mat, \.nc; plumbob\.convert writes more"
    for suffix in (".hdf5", ".npz", ".tsv"):
        refused(write, tmp_path / f"a{suffix}", imu, match=known)
    for suffix in FORMATS_WRITTEN:
        refused(write, tmp_path / "none" / f"a{suffix}", imu, match="create it first")
    for what in (imu, make_track(), Recording(imu=imu)):
        for suffix in (".csv", ".parquet"):
            refused(write, tmp_path / f"a{suffix}", what, notes="text", match="notes must be", error=ShapeError)
    refused(Recording, match="imu, track or both", error=ShapeError)
    refused(Recording, imu=imu, notes="one text", match="notes", error=ShapeError)
    assert [path.name for path in tmp_path.iterdir()] == ["pipe.parquet"]


def test_suffixes_do_not_depend_on_case_and_a_native_file_takes_no_profile(tmp_path):
    path = write(tmp_path / "A.PARQUET", make_imu())
    assert len(read(path).imu) == ROWS
    refused(read, path, profile="a.toml", match="takes no profile", error=ParameterError)
