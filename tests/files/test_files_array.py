"""Arrays of several units in a native recording: every bit of every unit comes back, whole, in parts, or not at all."""

from dataclasses import fields, replace
from itertools import pairwise

import numpy as np
import pyarrow.parquet as pq
import pytest

import plumbob
from plumbob import ImuMeta, Recording
from plumbob.core.errors import ParameterError, PlumbobError, ShapeError
from plumbob.data.array import ImuArray, UnitMount
from plumbob.data.cards import NoiseCard, TriadNoise
from plumbob.files import header, read
from plumbob.files.columns import to_columns
from plumbob.files.parquet import Stored, read_parquet, write_parquet
from tests.helpers.commandline import ok
from tests.helpers.io_samples import make_imu, make_track, refused, sealed

Q_BS = np.array([0.5, -0.7, 0.1, 0.4]) / np.linalg.norm([0.5, -0.7, 0.1, 0.4])
NOISE = NoiseCard("u1", "test", gyr=TriadNoise([0.1, 0.2, 1 / 3], [0.0, 1e-5, 1e-6], [1e-7, 0.0, 0.0]))
MOUNTS = {"u1": UnitMount(tuple(Q_BS), (0.1, -1 / 3, 2e-3), -1.25e-3, NOISE), "left.arm": UnitMount()}


def made(rows=12):
    """A unit with everything, one without a magnetometer, and one with a single axis of ranges and errors left."""
    whole = make_imu(rows)
    left = ImuMeta(device="b", acc_range=(4.0, 5.0, 0.1 + 0.2), gyr_left=tuple(np.arange(78) / 7.0), unit_check=False)
    bare = make_imu(rows, mag=None, temp_c=None, acc=whole.acc + 1.0, meta=left)
    alone = make_imu(rows, mag=None, acc=None, meta=ImuMeta(), flags=np.arange(rows, dtype=np.uint32) << 16)
    return ImuArray({"u1": whole, "左": bare, "left.arm": alone}, MOUNTS)


def assert_same(mine, other):
    assert mine.names == other.names
    for name in mine.names:
        for one in fields(mine.units[name]):
            a, b = getattr(mine.units[name], one.name), getattr(other.units[name], one.name)
            assert a.tobytes() == b.tobytes() if isinstance(a, np.ndarray) else a == b, (name, one.name)
        a, b = mine.mounts[name], other.mounts[name]
        assert replace(a, noise=None) == replace(b, noise=None)
        assert (a.noise and a.noise.text()) == (b.noise and b.noise.text())


def test_every_bit_comes_back(tmp_path):
    array = made()
    plumbob.write(tmp_path / "a.parquet", array, notes=["by a test"])
    found = plumbob.read(tmp_path / "a.parquet")
    assert found.imu is None
    assert_same(array, found.array)
    assert "by a test" in map(str, found.notes)
    plumbob.write(tmp_path / "b.parquet", found)
    assert_same(array, plumbob.read(tmp_path / "b.parquet").array)


def test_an_array_keeps_rotations_names_and_attitude(tmp_path):
    """Dividing by a norm that is 1 but for rounding would change the last bit now and then."""
    q = np.random.default_rng(1).normal(size=(2000, 4))
    for one in q / np.linalg.norm(q, axis=1, keepdims=True):
        first = UnitMount(tuple(one))
        assert UnitMount(first.q_bs).q_bs == first.q_bs == tuple(one.tolist())
    assert UnitMount((2.0 - 1e-3 - 1.0, 0.0, 0.0, 0.0)).q_bs == (1.0, 0.0, 0.0, 0.0)
    plumbob.write(tmp_path / "a.parquet", made())
    schema = pq.read_schema(tmp_path / "a.parquet")
    assert schema.names[:2] == ["t_ns", "u1.gyr_x"]
    assert set(schema.names) >= {"u1.mag_z", "u1.temp_c", "u1.flags", "左.acc_y", "left.arm.gyr_z"}
    assert not {"左.mag_x", "左.temp_c", "left.arm.acc_x"} & set(schema.names)
    assert schema.field("左.acc_y").metadata == {b"unit": b"m/s2"}
    whole = Recording(array=made(), track=make_track())
    write_parquet(tmp_path / "b.parquet", whole)
    found = read_parquet(tmp_path / "b.parquet")
    assert_same(whole.array, found.array)
    assert found.track.q_nb.tobytes() == whole.track.q_nb.tobytes()
    assert found.of_unit("u1").track is None  # nobody knows whether it is that unit's


def test_one_unit_by_name_or_number(tmp_path):
    array, path = made(), tmp_path / "a.parquet"
    plumbob.write(path, array)
    for asked in ("left.arm", "3"):
        found = plumbob.read(path, unit=asked)
        assert found.array is None
        assert found.imu.gyr.tobytes() == array.units["left.arm"].gyr.tobytes()
        assert "unit left.arm of u1, 左, left.arm" in map(str, found.notes)
    listed = r"no unit 'u9'; there are u1 \(1\), 左 \(2\), left.arm \(3\)"
    refused(plumbob.read, path, unit="u9", match=listed, error=ParameterError)
    advice = "holds the units u1, 左, left.arm. Name one with --unit.* NEW.parquet --unit u1"
    refused(plumbob.estimate, path, frame="NED", match=advice, error=ParameterError)
    bare = plumbob.write(tmp_path / "one.parquet", array.units["u1"])
    refused(plumbob.read, bare, unit="u1", match="one unit without a name", error=ParameterError)
    refused(
        plumbob.write,
        tmp_path / "a.csv",
        array,
        match="one unit, and there are u1, 左, left.arm. Write .parquet",
        error=ParameterError,
    )
    assert not (tmp_path / "a.csv").exists()


def test_samples_stay_in_the_file_where_that_is_asked_for(tmp_path):
    """Forty thousand rows lie in two row groups; any way of cutting them gives the rows of the whole."""
    array, path = made(40_000), tmp_path / "long.parquet"
    plumbob.write(path, array)
    stored = read(path, whole=False).array
    assert all(isinstance(one, Stored) for one in stored.units.values())
    assert len(stored) == 40_000
    for start, stop in pairwise((0, 1, 32_767, 32_769, 39_999, 40_000)):
        assert_same(array[start:stop], stored[start:stop])
    assert sum(len(part) for part in stored.chunks(7001)) == 40_000
    np.testing.assert_array_equal(stored.stacked("gyr"), array.stacked("gyr"))


TOLD = header.array_told(made())


def mounted(**change):
    return {"array": [TOLD[0] | {"mount": TOLD[0]["mount"] | change}, *TOLD[1:]]}


REFUSED = {
    "no list": ({"array": "u1"}, "array must be a list of tables"),
    "older version": ({"format_version": 1}, "has no key 'array'"),
    "no array": ({"array": ...}, "needs the key 'array'"),
    "twice": ({"array": [*TOLD, TOLD[0]]}, "twice"),
    "one too few": ({"array": TOLD[1:]}, "columns of the units u1, which its header does not name"),
    "one too many": ({"array": [*TOLD, TOLD[0] | {"name": "u9"}]}, "columns flags of the unit u9 are missing"),
    "a name of 5": ({"array": [TOLD[0] | {"name": 5}, *TOLD[1:]]}, "must be text"),
    "three for a quaternion": (mounted(q_bs=[1.0, 0.0, 0.0]), "q_bs"),
    "lever of text": (mounted(lever_b=["1", 0.0, 0.0]), "must be a finite number"),
    "no noise card": (mounted(noise={"kind": "x"}), "is not a plumbob noise card"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_wrong_header_is_refused(tmp_path, case):
    change, match = REFUSED[case]
    whole = Recording(array=made())
    columns = to_columns(whole)
    content = header.file_header(whole, list(columns)) | change
    content = {key: value for key, value in content.items() if value is not ...}
    pq.write_table(sealed(columns, content), tmp_path / "a.parquet")
    refused(read_parquet, tmp_path / "a.parquet", match=match, error=PlumbobError)


def test_findings_name_the_units_that_they_are_about(tmp_path):
    array = made()
    clipped = replace(array.units["左"], acc=np.tile([4.0, 1.0, 0.1], (12, 1)))
    plumbob.write(tmp_path / "a.parquet", ImuArray({**array.units, "左": clipped}))
    notes = plumbob.read(tmp_path / "a.parquet").notes
    assert any(str(note).startswith("clipped: 左: acc is at the end of the range in 12") for note in notes)
    assert sum(note.code == "samples.uncalibrated" for note in notes) == 1
    assert any(str(note).startswith("calibration: 左, left.arm: NONE") for note in notes)


def test_info_has_units_mounts_and_samples(tmp_path):
    path = plumbob.write(tmp_path / "a.parquet", made())
    summary = plumbob.info(path).summary()
    assert list(summary["array"]["units"]) == ["u1", "左", "left.arm"]
    assert summary["array"]["units"]["u1"]["mount"]["q_bs"] == list(Q_BS)
    assert summary["array"]["time"]["samples"] == 12
    assert "mag" in plumbob.info(path, unit="u1").summary()["sensors"]["triads"]
    out = ok("info", path).stdout
    assert "lever [100, -333.3, 2] mm, clock -1.25 ms, noise of u1" in out
    assert "left.arm     unknown: gyr 12 samples; flags: " in out


def test_an_array_and_a_recording_of_it_are_made_of_what_fits():
    for name in ("", " ", "a\nb", 5):
        refused(ImuArray, {name: make_imu()}, match="needs a name", error=ShapeError)
    refused(Recording, imu=make_imu(), array=made(), match="both were given", error=ShapeError)
