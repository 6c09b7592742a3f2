"""Named arrays that SciPy, h5py and NumPy wrote, described by a profile."""

import zipfile

import numpy as np
import pytest

from plumbob import profile
from plumbob.core.errors import DecodeError, UnitError
from plumbob.files import kind_of, parse_profile, read
from tests.helpers.file_kinds import hdf5
from tests.helpers.io_samples import refused

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
    assert kind_of(path).name == "arrays"
    listed = rf"imu/gyr {ROWS}×3"
    refused(read, path, match=f"need --profile.*{listed}")
    assert '"imu/gyr[1]", "imu/gyr[2]", "imu/gyr[3]"' in profile(path).text
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


def test_an_array_alone_and_units_that_attributes_say(tmp_path):
    np.save(tmp_path / "log.npy", np.column_stack((T, GYR)))
    text = 'arrays = true\n[time]\ncolumn = "log[1]"\nunit = "s"\n[gyr]\ncolumns = ["log[2]", "log[3]", "log[4]"]\n'
    imu = read(tmp_path / "log.npy", profile=parse_profile(text + 'unit = "rad/s"\n')).imu
    np.testing.assert_array_equal(imu.gyr, GYR)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for key, unit in (("imu/t", "s"), ("imu/gyro", np.bytes_(b"deg/s"))):
            file[key] = T if key == "imu/t" else GYR
            file[key].attrs["units"] = unit
    drafted = profile(tmp_path / "a.h5", accept=True)
    assert not drafted.questions
    np.testing.assert_array_equal(read(tmp_path / "a.h5", profile=parse_profile(drafted.text)).imu.gyr, np.radians(GYR))


TEXT = 'separator = ","\n[header]\nnames = true\n[time]\nrate = "1 Hz"\n[gyr]\ncolumns = [1, 2, 3]\nunit = "rad/s"\n'
ALONE = FLAT.split("[acc]")[0]
OBJECTS = np.array([{"a": 1}] * ROWS, dtype=object)


def linked(path):
    hdf5(path.with_name("secret.h5"), content())
    with h5py.File(path, "w") as file:
        file["imu"] = h5py.ExternalLink(str(path.with_name("secret.h5")), "imu")
        file["t"] = T


def enlarged(path):
    with zipfile.ZipFile(path, "w") as archive:
        for name, shape in (("gyr.npy", b"(99999999999, 3)"), ("t.npy", b"(99999999999,)")):
            head = b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'fortran_order': False, 'shape': " + shape + b", }"
            archive.writestr(name, head.ljust(127) + b"\n" + bytes(64))


def odd(path):
    scipy_io.savemat(path, content() | {"short": np.zeros(7), "note": "text"})


REFUSED = [
    ("a.mat", odd, PROFILE.replace('"imu/gyr"', '"gyro"'), "'gyro' is not in the file; the file holds"),
    ("a.mat", odd, PROFILE.replace("acc[2]", "acc[4]"), "imu/acc has 3 columns, but 4 must be there"),
    ("a.mat", odd, PROFILE.replace('"temp"', '"short"'), "different lengths"),
    ("a.mat", odd, PROFILE.replace('"temp"', '"note"'), "is not an array of numbers"),
    ("a.mat", odd, PROFILE.replace('"temp"', "2"), "an array has a name"),
    ("a.mat", odd, PROFILE.replace("arrays = true", 'arrays = true\nseparator = ","'), "remove separator"),
    ("a.mat", odd, PROFILE.replace('unit = "rad/s"\n', ""), "gyr needs a unit", UnitError),
    ("a.mat", odd, PROFILE.replace("arrays = true", "arrays = false"), "separator"),
    ("a.mat", odd, TEXT, "write arrays = true"),
    ("a.csv", lambda path: path.write_text("1,2,3\n"), PROFILE, "arrays = true; declare its separator"),
    ("a.h5", linked, PROFILE, "is not in the file"),
    ("a.npz", lambda path: np.savez(path, t=T, gyr=OBJECTS), ALONE, "array of objects"),
    ("a.npz", enlarged, ALONE, "which cannot be"),
]


@pytest.mark.parametrize("case", REFUSED, ids=range(len(REFUSED)))
def test_what_does_not_fit_its_profile_or_is_hostile_is_refused(tmp_path, case):
    name, put, text, match, error = (*case, DecodeError)[:5]
    put(tmp_path / name)
    refused(lambda: read(tmp_path / name, profile=parse_profile(text)), match=match, error=error)
