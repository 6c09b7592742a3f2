"""What gait laboratories have: APDM's Opals in HDF5, tables of OpenSim, spreadsheets."""

import sys
import zipfile

import numpy as np
import pytest

import plumbob
from plumbob import profile
from plumbob.core.errors import ClockError, MissingExtraError, ParameterError, ShapeError
from plumbob.files import read, write
from plumbob.files.foreign.opensim import write_orientations
from plumbob.rotations import Frame, North, change_frame
from tests.helpers.io_samples import make_imu, make_track, put, refused

h5py = pytest.importorskip("h5py")
ROWS = 256
START_US = 1_390_743_655_000_000  # date -u -d 2014-01-26T13:40:55Z +%s (GNU coreutils 9.1)
RNG = np.random.default_rng(3)
STAMPS = START_US + np.round(np.arange(ROWS) * 1e6 / 128).astype(np.uint64)
GYR, ACC = RNG.normal(size=(ROWS, 3)), RNG.normal(size=(ROWS, 3)) + [0.0, 0.0, 9.8]
MAG, QUAT = RNG.normal(size=(ROWS, 3)) + [20.0, 0.0, -40.0], np.tile([0.5, 0.5, -0.5, 0.5], (ROWS, 1))
SENSORS = {"Accelerometer": ACC, "Gyroscope": GYR, "Magnetometer": MAG, "Temperature": np.full(ROWS, 25.0)}


def opal_4(path, labels=("Left Foot   ", "Lumbar\0\0"), lists="attributes", late=0):
    """Version 4; version 2 has the lists as data sets."""
    with h5py.File(path, "w") as file:
        cases = [f"SI-{1007 + k:06}" for k in range(len(labels))]
        for key, words in (("CaseIdList", cases), ("MonitorLabelList", labels)):
            (file.attrs if lists == "attributes" else file)[key] = np.array([word.encode() for word in words])
        for k, case in enumerate(cases):
            file[f"{case}/Time"] = STAMPS + np.uint64(late * k)
            for name, values in SENSORS.items():
                file[f"{case}/Calibrated/{name}{'s' * (name != 'Temperature')}"] = values * (1.0 + k)
            file[f"{case}/Calibrated/Orientation"] = QUAT
            file[f"{case}/Raw/Accelerometers"] = np.zeros((ROWS, 3), np.uint16)
    return path


def opal_5(path):
    with h5py.File(path, "w") as file:
        file.attrs["FileFormatVersion"] = 5
        for name, values in (SENSORS | {"Time": STAMPS, "Magnetometer": np.zeros((ROWS, 3))}).items():
            file[f"Sensors/1262/{name}"] = values
        file.create_group("Sensors/1262/Configuration").attrs["Label 0"] = b"head  "
        file["Processed/1262/Orientation"] = QUAT
    return path


@pytest.mark.parametrize("lists", ["attributes", "data sets"])
def test_monitors_of_an_opal_are_an_array_and_one_is_taken_by_label_number_or_identity(tmp_path, lists):
    path = opal_4(tmp_path / "a.h5", lists=lists)
    array = read(path).array
    assert array.names == ("Left Foot", "Lumbar")
    np.testing.assert_array_equal(array.units["Lumbar"].gyr, 2.0 * GYR)
    for unit in ("Lumbar", "2", "SI-001008"):
        recording = read(path, unit=unit)
        np.testing.assert_array_equal(recording.imu.acc, 2.0 * ACC)
        np.testing.assert_array_equal(recording.imu.mag, 2.0 * MAG)
        assert recording.imu.temp_c[0] == 50.0
        assert recording.imu.meta.t0_ns == START_US * 1000
        np.testing.assert_array_equal(recording.track.q_nb, QUAT)
        assert (recording.track.frame, recording.track.north) == (Frame.NWU, North.MAGNETIC)
    refused(read, path, unit="hip", match=r"no unit 'hip'.*Left Foot \(1\), Lumbar \(2\)", error=ParameterError)


def test_labels_that_repeat_give_way_to_identities_and_clocks_of_their_own_are_said(tmp_path):
    path = opal_4(tmp_path / "a.h5", labels=("foot", "foot"))
    assert read(path).array.names == ("SI-001007", "SI-001008")
    refused(read, opal_4(tmp_path / "b.h5", late=500), match="stamps of their own.*Left Foot", error=ParameterError)


def test_a_sensor_of_an_opal_that_was_off_is_left_out(tmp_path):
    recording = read(opal_5(tmp_path / "a.h5"))
    assert recording.imu.meta.device == "Opal head"
    assert recording.imu.triads == ("gyr", "acc")
    np.testing.assert_array_equal(recording.imu.gyr, GYR)
    np.testing.assert_array_equal(recording.track.q_nb, QUAT)
    assert any("Sensors/1262/Magnetometer" in str(note) for note in recording.notes)


HEAD = "DataRate=100\nDataType={}\nversion=3\nOpenSimVersion=4.1\nendheader\n"


@pytest.fixture
def sto(tmp_path):
    def put(text, kind="Quaternion", name="a.sto"):
        path = tmp_path / name
        path.write_text(HEAD.format(kind) + text, encoding="utf-8", newline="")
        return path

    return put


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_an_orientation_of_opensim_is_a_track(sto, end):
    """Rows as OpenSense's example has them, with blanks behind commas as other writers leave them, and a gap."""
    rows = ["time\tpelvis_imu\ttorso_imu", "0.0\t1,0,0,0\t0.6,0.8,0,0", "0.01\tnan,nan,nan,nan\t0.6, 0, 0.8, 0",
            "0.02\t1,0,0,0\t0,0,0,1"]  # fmt: skip
    path = sto(end.join([*rows, ""]))
    recording = read(path, unit="torso_imu")
    assert recording.name == "torso_imu"
    np.testing.assert_array_equal(recording.track.q_nb, [[0.6, 0.8, 0, 0], [0.6, 0, 0.8, 0], [0, 0, 0, 1]])
    assert (recording.track.frame, recording.track.north) == (Frame.ENU, North.FREE)
    assert read(path, unit="1").track.known.tolist() == [True, False, True]
    refused(read, path, match="2 sensors: pelvis_imu, torso_imu. Name one with --unit", error=ParameterError)


@pytest.mark.parametrize("frame", list(Frame))
def test_attitudes_come_back_from_opensim_in_a_world_with_z_up(tmp_path, frame):
    track = make_track(full=False)
    track = plumbob.AttitudeTrack(t=track.t, q_nb=track.q_nb, frame=frame, north=North.TRUE, source="a\tb=c")
    path = write(tmp_path / "pelvis_imu.sto", track)
    back = read(path)
    turned = change_frame(track.q_nb, to=Frame.ENU, from_=frame) if frame is Frame.NED else track.q_nb
    assert back.name == "pelvis_imu"
    assert back.track.t.tobytes() == track.t[track.known].tobytes()
    np.testing.assert_array_equal(back.track.q_nb, turned[track.known])
    assert (back.track.frame, back.track.north) == (Frame.ENU if frame is Frame.NED else frame, North.TRUE)
    assert read(write(tmp_path / "b.sto", back)).track.q_nb.tobytes() == back.track.q_nb.tobytes()


def test_several_segments_are_columns_of_one_table(tmp_path):
    track = make_track(full=False)
    write_orientations(tmp_path / "a.sto", {"pelvis_imu": track, "femur_r_imu": track})
    assert read(tmp_path / "a.sto", unit="femur_r_imu").track.q_nb.tobytes() == track.q_nb[track.known].tobytes()
    other = plumbob.AttitudeTrack(t=track.t + 1.0, q_nb=track.q_nb, frame=track.frame, north=track.north)
    for tracks, match, error in (
        ({"a": track, "b": other}, "same times", ClockError), ({"a b": track}, "is a word", ParameterError),
    ):  # fmt: skip
        refused(write_orientations, tmp_path / "b.sto", tracks, match=match, error=error)
    refused(write, tmp_path / "c.sto", make_imu(), match="estimate one first", error=ShapeError)
    refused(write_orientations, tmp_path / "a.sto", {"a": track}, match="exists", error=ParameterError)


def test_vectors_of_opensim_are_sensors_by_the_name_of_the_table(sto):
    rows = "time\tpelvis_imu\n" + "".join(f"{k / 100}\t0,{k},9.8\n" for k in range(5))
    paths = [sto(rows, "Vec3", f"a_{name}.sto") for name in ("linear_accelerations", "angular_velocity")]
    recording = read(paths)
    np.testing.assert_array_equal(recording.imu.acc, [[0, k, 9.8] for k in range(5)])
    np.testing.assert_array_equal(recording.imu.gyr, [[0, k, 9.8] for k in range(5)])
    refused(read, sto(rows, "Vec3", "b.sto"), match="_angular_velocity")


@pytest.mark.parametrize(
    ("text", "kind", "match"),
    [
        ("time\thip\n0\t1\n1\t2\n", "double", "DataType is 'double'"),
        ("t\tpelvis_imu\n0\t1,0,0,0\n", "Quaternion", "must be time and sensors"),
        ("time\tpelvis_imu\n0\t1,0,0\n", "Quaternion", "a row has 4 cells"),
        ("time\tpelvis_imu\n", "Quaternion", "the file ends before its first row"),
    ],
)
def test_tables_of_opensim_without_an_orientation_are_refused(sto, text, kind, match):
    refused(read, sto(text, kind, "a.mot"), match=match)


def workbook(path, sheets):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.remove(book.active)
    for title, rows in sheets.items():
        sheet = book.create_sheet(title)
        for row in rows:
            sheet.append(row)
    book.save(path)
    return path


def test_a_spreadsheet_is_a_table_and_its_sheets_are_sensors(tmp_path):
    table = [
        ["Time (s)", *(f"gyr {axis} (deg/s)" for axis in "xyz")],
        *([k / 100, *GYR[k].tolist()] for k in range(50)),
    ]
    path = workbook(tmp_path / "a.xlsx", {"Notes": [["walk", None], ["rate", "100 Hz"]], "Data": table})
    profile(path, accept=True, out=tmp_path / "a.profile.toml")
    np.testing.assert_allclose(read(path).imu.gyr, np.radians(GYR[:50]), rtol=1e-15)
    axes = ["Time (s)", *(f"{axis} (m/s^2)" for axis in "XYZ")]
    force = [axes, *([k / 100, *ACC[k].tolist()] for k in range(50))]
    path = workbook(tmp_path / "b.xlsx", {"Gyroscope": table, "Accelerometer": force})
    answers = {"acc.sign": "specific-force"}
    profile(path, accept=True, answers=answers, out=tmp_path / "b.profile.toml")
    np.testing.assert_allclose(read(path).imu.acc, ACC[:50], rtol=1e-15)  # 16 digits are written


def test_a_spreadsheet_needs_its_extra_and_a_damaged_one_is_refused(tmp_path, monkeypatch):
    path = workbook(tmp_path / "a.xlsx", {"Data": [["t", "x"], [1.0, 2.0]]})
    refused(profile, path, match="no separator makes a table")
    refused(profile, put(path, path.read_bytes()[:-200]), match="cut or damaged")
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    workbook_path = tmp_path / "b.xlsx"
    with zipfile.ZipFile(workbook_path, "w") as archive:
        archive.writestr("xl/workbook.xml", "<x/>")
    refused(profile, workbook_path, match=r"plumbob\[excel\]", error=MissingExtraError)
