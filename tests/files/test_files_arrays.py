"""Named arrays that SciPy, h5py and NumPy wrote, described by a profile."""

import zipfile

import numpy as np
import pytest

from plumbob import profile
from plumbob.core.errors import DecodeError, FrameError, PlumbobError, UnitError
from plumbob.files import read
from plumbob.files.formats import kind_of
from plumbob.files.profile_toml import parse_profile
from tests.helpers.file_kinds import hdf5

h5py = pytest.importorskip("h5py")
scipy_io = pytest.importorskip("scipy.io")

ROWS = 40
T = np.arange(ROWS) / 100.0
GYR = np.random.default_rng(1).normal(size=(ROWS, 3))
ACC = np.random.default_rng(2).normal(size=(ROWS, 3)) + [0.0, 0.0, 9.8]
QUAT = np.tile([0.5, -0.5, 0.5, 0.5], (ROWS, 1))
PROFILE = """
arrays = true
device = "unit"
[time]
column = "t"
unit = "s"
[gyr]
columns = "imu/gyr"
unit = "rad/s"
[acc]
columns = ["imu/acc[2]", "imu/acc[1]", "imu/acc[3]"]
unit = "m/s2"
sign = "specific-force"
[temperature]
column = "temp"
unit = "degC"
[reference]
columns = "quat"
order = "xyzw"
frame = "ENU"
north = "magnetic"
"""


def content():
    return {"t": T, "imu": {"gyr": GYR, "acc": ACC}, "temp": np.full(ROWS, 21), "quat": QUAT}


WRITERS = {
    "v5.mat": scipy_io.savemat,
    "packed.mat": lambda path, found: scipy_io.savemat(path, found, do_compression=True),
    "v73.mat": lambda path, found: hdf5(path, found, turned=True),
    "a.h5": hdf5,
}


@pytest.mark.parametrize("name", WRITERS)
def test_groups_and_structs_are_paths(tmp_path, name):
    path = tmp_path / name
    WRITERS[name](path, content())
    recording = read(path, profile=parse_profile(PROFILE))
    imu = recording.imu
    np.testing.assert_array_equal(imu.t, T)
    np.testing.assert_array_equal(imu.gyr, GYR)
    np.testing.assert_array_equal(imu.acc, ACC[:, [1, 0, 2]])
    np.testing.assert_array_equal(imu.temp_c, np.full(ROWS, 21.0))
    np.testing.assert_array_equal(recording.track.q_nb, QUAT[:, [3, 0, 1, 2]])
    assert imu.meta.device == "unit"


FLAT = PROFILE.replace("imu/", "")


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_numpy_archives(tmp_path, save):
    path = tmp_path / "log.npz"
    save(path, t=T, gyr=GYR.T, acc=ACC, temp=np.full(ROWS, 21), quat=QUAT, name=np.array("a text"))
    (tmp_path / "log.toml").write_text(FLAT)
    recording = read(path)  # found beside the file
    np.testing.assert_array_equal(recording.imu.gyr, GYR)
    assert any("gyr has its samples side by side" in note for note in recording.notes)


def test_unix_time_in_whole_nanoseconds_keeps_every_one(tmp_path):
    stamps = 1_700_000_000_123_456_789 + np.arange(ROWS) * 10_000_001
    np.savez(tmp_path / "a.npz", t=stamps, gyr=GYR)
    text = 'arrays = true\n[time]\ncolumn = "t"\nunit = "ns"\nepoch = "unix"\n[gyr]\ncolumns = "gyr"\nunit = "rad/s"\n'
    imu = read(tmp_path / "a.npz", profile=parse_profile(text)).imu
    assert imu.meta.t0_ns == stamps[0]
    np.testing.assert_array_equal(imu.t_ns, stamps - stamps[0])


def test_without_a_profile_the_arrays_are_listed_with_their_shapes(tmp_path):
    for name, save in WRITERS.items():
        save(tmp_path / name, content())
        assert kind_of(tmp_path / name).name == "arrays"
        with pytest.raises(DecodeError, match=rf"need --profile.*imu/gyr {ROWS}×3.*"):
            read(tmp_path / name)


def test_the_profile_of_arrays_is_not_drafted_but_they_are_listed(tmp_path):
    hdf5(tmp_path / "a.h5", content())
    with pytest.raises(DecodeError, match=rf"imu/gyr {ROWS}×3"):
        profile(tmp_path / "a.h5")


@pytest.mark.parametrize(
    ("was", "becomes", "what"),
    [
        ('"imu/gyr"', '"gyro"', "'gyro' is not in the file; the file holds"),
        ('"imu/acc[2]"', '"imu/acc[4]"', r"imu/acc has 3 columns, so there is no imu/acc\[4\]"),
        ('column = "temp"', 'column = "short"', "different lengths"),
        ('column = "temp"', 'column = "note"', "is not an array of numbers"),
        ('column = "temp"', "column = 2", "an array has a name"),
    ],
)
def test_a_profile_that_does_not_fit_says_where(tmp_path, was, becomes, what):
    found = content() | {"short": np.zeros(7), "note": "text"}
    scipy_io.savemat(tmp_path / "a.mat", found)
    with pytest.raises(DecodeError, match=what):
        read(tmp_path / "a.mat", profile=parse_profile(PROFILE.replace(was, becomes)))


@pytest.mark.parametrize(
    ("was", "becomes", "error", "what"),
    [
        ("arrays = true", 'arrays = true\nseparator = ","', DecodeError, "remove separator"),
        ('unit = "rad/s"\n', "", UnitError, "gyr needs a unit"),
        ('frame = "ENU"\n', "", FrameError, "frame"),
        ("arrays = true", "arrays = false", DecodeError, "separator"),
    ],
)
def test_profiles_of_arrays_are_strict(was, becomes, error, what):
    with pytest.raises(error, match=what):
        parse_profile(PROFILE.replace(was, becomes))


def test_a_profile_of_text_is_not_one_of_arrays_nor_the_reverse(tmp_path):
    np.savez(tmp_path / "a.npz", t=T)
    text = parse_profile(
        'separator = ","\n[header]\nnames = true\n[time]\nrate = "1 Hz"\n[gyr]\ncolumns = [1, 2, 3]\nunit = "rad/s"\n'
    )
    with pytest.raises(DecodeError, match="write arrays = true"):
        read(tmp_path / "a.npz", profile=text)
    (tmp_path / "a.csv").write_text("1,2,3\n")
    with pytest.raises(DecodeError, match="arrays = true; declare its separator"):
        read(tmp_path / "a.csv", profile=parse_profile(PROFILE))


# Hostile --------------------------------------------------------------------------------------------------------------


def test_links_of_hdf5_are_refused(tmp_path):
    secret = tmp_path / "secret.h5"
    hdf5(secret, content())
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["imu"] = h5py.ExternalLink(str(secret), "imu")
        file["t"] = T
    with pytest.raises(DecodeError, match="is not in the file"):
        read(tmp_path / "a.h5", profile=parse_profile(PROFILE))


def test_pickled_arrays_are_never_loaded(tmp_path):
    np.savez(tmp_path / "a.npz", t=T, gyr=np.array([{"a": 1}] * ROWS, dtype=object))
    text = FLAT.split("[acc]")[0]
    with pytest.raises(DecodeError, match="array of objects"):
        read(tmp_path / "a.npz", profile=parse_profile(text))


def test_an_array_that_claims_more_than_it_holds_is_refused(tmp_path):
    head = b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999, 3), }"
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("gyr.npy", head.ljust(127) + b"\n" + bytes(64))
        archive.writestr("t.npy", head.ljust(127) + b"\n" + bytes(64))
    text = FLAT.split("[acc]")[0]
    with pytest.raises(DecodeError, match="which cannot be"):
        read(tmp_path / "a.npz", profile=parse_profile(text))


@pytest.mark.parametrize("name", ["v5.mat", "packed.mat", "a.npz"])
def test_every_damage_is_an_error_or_a_recording(tmp_path, name):
    path = tmp_path / name
    small = {"t": T[:6], "imu": {"gyr": GYR[:6], "acc": ACC[:6]}, "temp": np.full(6, 21), "quat": QUAT[:6]}
    if name == "a.npz":
        np.savez(path, t=T[:6], gyr=GYR[:6], acc=ACC[:6], temp=np.full(6, 21), quat=QUAT[:6])
    else:
        WRITERS[name](path, small)
    profile = parse_profile(FLAT if name == "a.npz" else PROFILE)
    whole = path.read_bytes()
    damaged = [whole[:n] for n in range(0, len(whole), 31)]
    damaged += [whole[:n] + bytes([whole[n] ^ 0xA5]) + whole[n + 1 :] for n in range(0, len(whole), 9)]
    for raw in damaged:
        path.write_bytes(raw)
        try:
            read(path, profile=profile)
        except PlumbobError as error:
            assert name in str(error)
