"""Named arrays that SciPy, h5py and NumPy wrote, described by a profile."""

import zipfile

import numpy as np
import pytest

from plumbob import AttitudeTrack, profile
from plumbob.core.errors import DecodeError, UnitError
from plumbob.files import kind_of, parse_profile, read, write
from plumbob.rotations import quat_from_rotvec, quat_rotate
from tests.helpers import beside
from tests.helpers.file_kinds import hdf5
from tests.helpers.io_samples import CASES, refused

h5py = pytest.importorskip("h5py")
scipy_io = pytest.importorskip("scipy.io")

ROWS = 40
T = np.arange(ROWS) / 100.0
GYR = np.random.default_rng(1).normal(size=(ROWS, 3))
ACC = np.random.default_rng(2).normal(size=(ROWS, 3)) + [0.0, 0.0, 9.8]
QUAT = np.tile([0.5, -0.5, 0.5, 0.5], (ROWS, 1))
PROFILE = beside(__file__, "arrays.profile.toml")


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
    assert any("gyr has its samples side by side" in str(note) for note in recording.notes)


@pytest.mark.parametrize("name", ["log.h5", "log.npy"])
def test_fields_of_structs_are_arrays_by_their_paths(tmp_path, name):
    table = np.zeros(ROWS, [("t", "f8"), ("gyr", "f8", 3), ("acc", "f4", 3), ("name", "S4"), ("temp", "i2")])
    table["t"], table["gyr"], table["acc"], table["temp"] = T, GYR, ACC, 21
    path, at = tmp_path / name, "imu" if name.endswith("5") else "log"
    if name.endswith("5"):
        with h5py.File(path, "w") as file:
            file["imu"] = table
    else:
        np.save(path, table)
    refused(read, path, match=rf"{at}/gyr {ROWS}×3.*{at}/name \(data set that is not of numbers\)")
    text = f'arrays = true\n[time]\ncolumn = "{at}/t"\nunit = "s"\n[gyr]\ncolumns = "{at}/gyr"\nunit = "rad/s"\n'
    imu = read(path, profile=parse_profile(text)).imu
    np.testing.assert_array_equal(imu.t, T)
    np.testing.assert_array_equal(imu.gyr, GYR)


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
    ("a.mat", odd, PROFILE.replace("acc[2]", "acc[4]"), "imu/acc has 3 columns, but needs 4"),
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


def test_scipy_and_xarray_open_what_is_written_with_units_and_utc(tmp_path):
    xarray = pytest.importorskip("xarray", reason="xarray is not installed")
    both = CASES["both"]
    matlab = scipy_io.loadmat(write(tmp_path / "a.mat", both), squeeze_me=True, struct_as_record=False)
    with xarray.open_dataset(write(tmp_path / "a.nc", both), engine="netcdf4") as data:  # by Unidata's library
        for name, of in (("gyr", both.imu), ("mag", both.imu), ("q_nb", both.track), ("track_flags", both.track)):
            values = getattr(of, name.removeprefix("track_"))
            assert np.array_equal(matlab[name], values, equal_nan=values.dtype == float)
            assert np.array_equal(data[name], values, equal_nan=values.dtype == float)
            assert getattr(matlab["units"], name) == data[name].attrs["units"]
        assert data.attrs["Conventions"] == "CF-1.11"
        assert data.acc.attrs["units"] == "m/s2"
        assert np.array_equal(data.acc.sel(axis="y"), both.imu.acc[:, 1])
        assert np.array_equal(data.time.astype("int64"), both.imu.t_ns + both.imu.meta.t0_ns)  # ns of UTC
    write(tmp_path / "b.csv", CASES["both"])  # a profile of the same name beside it
    level = read(write(tmp_path / "b.nc", CASES["track"])).track
    assert np.array_equal(level.q_nb, CASES["track"].track.q_nb, equal_nan=True)


@pytest.mark.parametrize(("frame", "yaw", "pitch"), [("NED", "starboard", "up"), ("ENU", "port", "down")])
def test_the_angles_of_a_platform_have_the_sense_that_their_standard_names_say(tmp_path, frame, yaw, pitch):
    # CF standard name table: platform_yaw_fore_starboard grows as the bow turns right, platform_pitch_fore_up as it
    # rises; platform_roll_starboard_down as the right side sinks.
    xarray = pytest.importorskip("xarray", reason="xarray is not installed")
    axes = np.eye(3)
    q_nb = np.stack([quat_from_rotvec(0.1 * axis) for axis in axes])
    track = AttitudeTrack(t=[0.0, 1.0, 2.0], q_nb=q_nb, frame=frame, north="true")
    up, bow, right = track.frame.up, quat_rotate(q_nb, axes[0]), quat_rotate(q_nb, np.cross(axes[0], track.frame.up))
    with xarray.open_dataset(write(tmp_path / "a.nc", track)) as data:
        names = [data[name].attrs["standard_name"] for name in ("yaw", "pitch", "roll")]
        assert names == [f"platform_yaw_fore_{yaw}", f"platform_pitch_fore_{pitch}", "platform_roll_starboard_down"]
        angles = np.radians([float(data[name][i]) for i, name in enumerate(("roll", "pitch", "yaw"))])
    sense = 1.0 if frame == "NED" else -1.0
    starboard = np.cross(axes[0], up)
    seen = [-right[0] @ up, sense * (bow[1] @ up), sense * (bow[2] @ starboard)]
    assert angles == pytest.approx(np.arcsin(seen))
