"""What every format that can be written promises: a format joins by one line in FORMATS_WRITTEN."""

import errno
import os
import resource
import signal

import numpy as np
import pytest

from plumbob.core.errors import ClockError, DecodeError, ParameterError, PlumbobError, ShapeError
from plumbob.data import ImuMeta
from plumbob.files import FORMATS, Recording, read, write
from plumbob.files.notes import TOPICS
from tests.helpers.io_samples import CASES, ROWS, assert_same, make_imu, make_track

FORMATS_WRITTEN = {".parquet": {"nan_bits": True}, ".csv": {"nan_bits": False}, ".txt": {"nan_bits": False}}
every_format = pytest.mark.parametrize("suffix", FORMATS_WRITTEN)


def test_battery_covers_every_format_that_is_written():
    assert {suffix for kind in FORMATS for suffix, _ in kind.writers} == set(FORMATS_WRITTEN)


@every_format
@pytest.mark.parametrize("case", CASES)
def test_round_trip_keeps_every_bit(tmp_path, suffix, case):
    recording = CASES[case]
    path = write(tmp_path / f"a{suffix}", recording)
    assert_same(recording, read(path), **FORMATS_WRITTEN[suffix])


@every_format
def test_round_trip_keeps_zero_signs_denormals_and_infinities(tmp_path, suffix):
    gyr = np.zeros((ROWS, 3))
    gyr[0] = [-0.0, 5e-324, -2.2250738585072009e-308]  # smallest and largest denormal (IEEE 754 binary64)
    gyr[1] = [np.inf, -np.inf, 1.7976931348623157e308]
    imu = make_imu(gyr=gyr, meta=ImuMeta(unit_check=False))
    back = read(write(tmp_path / f"a{suffix}", imu))
    assert_same(Recording(imu=imu), back, **FORMATS_WRITTEN[suffix])
    assert np.signbit(back.imu.gyr[0, 0])


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
    assert [n for n in second.notes if not n.startswith("read with")] == [
        n for n in first.notes if not n.startswith("read with")
    ]


@every_format
def test_samples_and_tracks_are_written_bare_and_notes_are_kept(tmp_path, suffix):
    back = read(write(tmp_path / f"a{suffix}", make_imu(), notes=["made by a test"]))
    assert back.track is None
    assert back.name == "a"
    assert back.notes[0] == "made by a test"
    assert read(write(tmp_path / f"b{suffix}", make_track())).imu is None


@every_format
def test_findings_are_not_stored_because_they_go_stale(tmp_path, suffix):
    uncalibrated = make_imu(meta=ImuMeta(device="x"))
    back = read(write(tmp_path / f"a{suffix}", uncalibrated))
    assert any(note.startswith("calibration: ") for note in back.notes)
    calibrated = Recording(imu=make_imu(), notes=back.notes)
    assert not any(note.startswith(TOPICS) for note in read(write(tmp_path / f"b{suffix}", calibrated)).notes)


@every_format
def test_different_times_are_refused(tmp_path, suffix):
    both = Recording(imu=make_imu(), track=make_track(ROWS - 1))
    with pytest.raises(ClockError, match="write them in two files"):
        write(tmp_path / f"a{suffix}", both)
    assert not list(tmp_path.iterdir())


@every_format
def test_a_part_that_cannot_be_read_back_is_not_written(tmp_path, suffix):
    part = make_imu()[1:2]  # its only sample has no magnetometer value
    with pytest.raises(ShapeError, match=r"mag .* in all 1 samples"):
        write(tmp_path / f"a{suffix}", part)
    assert not list(tmp_path.iterdir())


@every_format
def test_overwriting_replaces_the_whole_file(tmp_path, suffix):
    write(tmp_path / f"a{suffix}", CASES["both"])
    back = read(write(tmp_path / f"a{suffix}", CASES["track"], overwrite=True))
    assert_same(CASES["track"], back, **FORMATS_WRITTEN[suffix])


@every_format
@pytest.mark.parametrize("limit", [0, 100, 2000])
def test_a_full_disk_leaves_the_old_file_and_nothing_else(tmp_path, suffix, limit):
    # RLIMIT_FSIZE gives a short write, then EFBIG, as a full disk gives ENOSPC.
    path = write(tmp_path / f"a{suffix}", CASES["both"])
    before = {p.name: p.read_bytes() for p in tmp_path.iterdir()}
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    old = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
        with pytest.raises(DecodeError, match=r"a\..*cannot be written.*Nothing was changed"):
            write(path, make_imu(rows=500), overwrite=True)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, old)
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir()} == before


@every_format
def test_a_crash_while_writing_leaves_nothing(tmp_path, suffix, monkeypatch):
    def refuse(*_: object, **__: object) -> None:
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(os, "fsync", refuse)
    with pytest.raises(DecodeError, match="Input/output error"):
        write(tmp_path / f"a{suffix}", make_imu())
    assert not list(tmp_path.iterdir())


@every_format
def test_no_folder_to_write_in(tmp_path, suffix):
    with pytest.raises(DecodeError, match="create it first"):
        write(tmp_path / "none" / f"a{suffix}", make_imu())


@pytest.mark.parametrize("suffix", [s for kind in FORMATS for s in kind.suffixes])
@pytest.mark.parametrize("content", [b"", b"\x00", b"PAR1", b"hello\n", bytes(range(256)) * 8])
def test_a_foreign_file_is_refused_by_name_in_one_line(tmp_path, suffix, content):
    path = tmp_path / f"foreign{suffix}"
    path.write_bytes(content)
    with pytest.raises(DecodeError) as caught:
        read(path)
    assert f"foreign{suffix}" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("suffix", [s for kind in FORMATS for s in kind.suffixes])
def test_no_file_and_a_folder_are_refused(tmp_path, suffix):
    with pytest.raises(DecodeError, match="does not exist"):
        read(tmp_path / f"none{suffix}")
    (tmp_path / f"folder{suffix}").mkdir()
    with pytest.raises(DecodeError, match="is a folder, and not one of ROS, EuRoC"):
        read(tmp_path / f"folder{suffix}")


def test_a_pipe_is_refused_instead_of_waited_for(tmp_path):
    os.mkfifo(tmp_path / "a.parquet")
    with pytest.raises(DecodeError, match="not a regular file"):
        read(tmp_path / "a.parquet")


def test_unknown_suffixes_list_the_known(tmp_path):
    with pytest.raises(DecodeError, match=r"'\.xlsx' is unknown; known are \.parquet, \.bag, .*\.csv"):
        read(tmp_path / "a.xlsx")
    with pytest.raises(DecodeError, match="is unknown"):
        write(tmp_path / "a", make_imu())


@pytest.mark.parametrize("suffix", [".hdf5", ".mat", ".tsv"])
def test_formats_that_are_only_read_say_what_to_write(tmp_path, suffix):
    with pytest.raises(DecodeError, match=r"is not among \.parquet, \.csv, \.txt; plumbob\.convert writes more"):
        write(tmp_path / f"a{suffix}", make_imu())


def test_a_profile_for_a_file_that_describes_itself_is_refused(tmp_path):
    path = write(tmp_path / "a.parquet", make_imu())
    with pytest.raises(ParameterError, match="takes no profile"):
        read(path, profile="a.toml")


def test_suffixes_do_not_depend_on_case(tmp_path):
    path = write(tmp_path / "A.PARQUET", make_imu())
    assert read(path).name == "A"


def test_every_error_of_this_package_is_one_of_ours():
    assert issubclass(DecodeError, PlumbobError)


def test_a_recording_of_nothing_is_refused():
    with pytest.raises(ShapeError, match="imu, track or both"):
        Recording()
    with pytest.raises(ShapeError, match="notes"):
        Recording(imu=make_imu(), notes="one text")  # type: ignore[arg-type]
