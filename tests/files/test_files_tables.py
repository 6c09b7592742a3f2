"""BROAD trials: real ones where they are at hand, tiny ones made here, and hostile ones."""

import io
import struct
import sys
import tracemalloc
import zlib
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from scipy import sparse

from plumbob.core.errors import DecodeError, MissingExtraError, PlumbobError
from plumbob.files import arrays, read
from plumbob.rotations import Frame, North
from tests.helpers.io_samples import refused
from tests.helpers.real_data import DATA, needs

h5py = pytest.importorskip("h5py")

ROWS = 40
RATE = 2000.0 / 7.0
TRIALS = sorted(DATA.glob("broad/*.hdf5"))[:2] + sorted(DATA.glob("broad/*.mat"))[:2]
KEYS = ("imu_gyr", "imu_acc", "imu_mag", "opt_quat", "movement", "sampling_rate")


def content(rows=ROWS):
    rng = np.random.default_rng(5)
    quat = rng.normal(size=(rows, 4))
    quat /= np.linalg.norm(quat, axis=1, keepdims=True)
    quat[3:6] = np.nan
    return {
        "imu_gyr": rng.normal(size=(rows, 3)),
        "imu_acc": rng.normal(size=(rows, 3)) + [0.0, 0.0, 9.8],
        "imu_mag": rng.normal(size=(rows, 3)) + [0.0, 20.0, -40.0],
        "opt_quat": quat,
        "opt_pos": rng.normal(size=(rows, 3)),
        "movement": np.arange(rows) >= 4,
        "sampling_rate": RATE,
    }


def write_hdf5(path, found, *, rate_as_attribute=True):
    with h5py.File(path, "w") as hdf5:
        for key, value in found.items():
            if key == "sampling_rate" and rate_as_attribute:
                hdf5.attrs[key] = value
            else:
                hdf5[key] = value
    return path


def write_mat(path, found, *, compress=True):
    scipy.io.savemat(path, found, do_compression=compress, oned_as="column")
    return path


WRITERS = {".hdf5": write_hdf5, ".mat": write_mat}
every_container = pytest.mark.parametrize("suffix", WRITERS)


def check(recording, direct, rate):
    for name in ("gyr", "acc", "mag"):
        assert getattr(recording.imu, name).tobytes() == np.ascontiguousarray(direct[f"imu_{name}"]).tobytes()
    quat, movement = np.asarray(direct["opt_quat"]), np.asarray(direct["movement"]).ravel() != 0
    known = ~np.isnan(quat).any(axis=1)
    track = recording.track
    assert np.abs(track.q_nb - quat)[known].max() < 1e-15
    assert np.array_equal(track.known, known)
    assert np.array_equal(track.score, movement & known)
    assert (track.frame, track.north) == (Frame.ENU, North.MAGNETIC)
    assert recording.imu.t_ns.tolist() == [round(k * 1e9 / rate) for k in range(len(quat))]
    assert recording.imu.t.tobytes() == track.t.tobytes()
    assert recording.imu.meta.device == "Myon aktos-t"
    assert recording.imu.meta.rate_nominal == rate


@needs("broad")
@pytest.mark.parametrize("path", TRIALS, ids=lambda path: path.name)
def test_a_real_trial_is_what_its_own_library_reads(path):
    recording = read(path)
    if path.suffix == ".mat":
        direct = scipy.io.loadmat(path, variable_names=KEYS)
        check(recording, direct, float(direct["sampling_rate"].item()))
    else:
        with h5py.File(path, "r") as hdf5:
            check(recording, {key: hdf5[key][()] for key in KEYS[:-1]}, float(hdf5.attrs["sampling_rate"]))
    assert recording.name == path.stem
    assert np.median(np.linalg.norm(recording.imu.acc, axis=1)) == pytest.approx(9.81, abs=0.2)  # gravity, and motion
    assert any("doi:10.3390/data6070072" in str(note) for note in recording.notes)


@needs("broad")
def test_a_level_unit_at_rest_points_up():
    """Before the movement phase the unit lies still: rotated to ENU, specific force points up and is g long."""
    from plumbob.rotations import quat_rotate

    recording = read(TRIALS[0])
    rows = np.flatnonzero(recording.track.known & ~recording.track.score)[:500]
    acc_n = quat_rotate(recording.track.q_nb[rows], recording.imu.acc[rows]).mean(axis=0)
    assert acc_n == pytest.approx([0.0, 0.0, 9.81], abs=0.3)  # the unit's own bias is below 0.3 m/s²


@every_container
def test_a_trial_made_here(tmp_path, suffix):
    found = content()
    recording = read(WRITERS[suffix](tmp_path / f"a{suffix}", found))
    check(recording, found, RATE)
    assert recording.track.score.sum() == 34  # of 36 that move, two are among the three that are lost


def test_containers_are_known_by_content_not_by_name(tmp_path):
    check(read(write_hdf5(tmp_path / "a.mat", content(), rate_as_attribute=False)), content(), RATE)
    check(read(write_mat(tmp_path / "b.mat", content(), compress=False).rename(tmp_path / "b.h5")), content(), RATE)


@every_container
def test_a_cut_trial_is_refused_or_whole(tmp_path, suffix):
    path = WRITERS[suffix](tmp_path / f"a{suffix}", content(rows=8))
    raw = path.read_bytes()
    for size in np.unique(np.linspace(0, len(raw), 40).astype(int)):
        path.write_bytes(raw[:size])
        try:
            check(read(path), content(rows=8), RATE)
        except DecodeError as error:
            assert "\n" not in str(error)
    assert size == len(raw)


def test_without_h5py_the_extra_is_named(tmp_path, monkeypatch):
    path = write_hdf5(tmp_path / "a.hdf5", content())
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(MissingExtraError, match=r'pip install "plumbob\[hdf5\]"'):
        read(path)
    assert read(write_mat(tmp_path / "a.mat", content())).imu is not None  # MATLAB v5 needs no extra


WITHOUT_ACC = {key: value for key, value in content().items() if key != "imu_acc"}
STILL = np.tile([0.0, 0.0, 9.8], (ROWS, 1))


def trial(suffix, **changes):
    """Maker of a trial with other arrays; those that are None are left out."""
    found = {key: value for key, value in (content() | changes).items() if value is not None}
    return lambda folder: WRITERS[suffix](folder / f"a{suffix}", found)


def hdf5_with(make):
    """Maker of a trial whose accelerometer comes from `make`, by the open file; beside it lies another, whole."""

    def put(folder):
        write_hdf5(folder / "other.hdf5", content())
        (folder / "other.bin").write_bytes(STILL.tobytes())
        path = write_hdf5(folder / "a.hdf5", WITHOUT_ACC, rate_as_attribute=False)
        with h5py.File(path, "r+") as hdf5:
            make(hdf5)
        return path

    return put


def dataset(*what, **how):
    return hdf5_with(lambda hdf5: hdf5.create_dataset("imu_acc", *what, **how))


@hdf5_with
def stored_outside(hdf5):
    other = Path(hdf5.filename).with_name("other.bin")
    hdf5.create_dataset("imu_acc", (ROWS, 3), "f8", external=[(str(other), 0, h5py.h5f.UNLIMITED)])
    assert hdf5["imu_acc"][0, 2] == 9.8  # a plain reader reads the other file


@hdf5_with
def virtual(hdf5):
    layout = h5py.VirtualLayout((ROWS, 3), "f8")
    layout[:] = h5py.VirtualSource(Path(hdf5.filename).with_name("other.hdf5"), "imu_acc", (ROWS, 3))
    hdf5.create_virtual_dataset("imu_acc", layout)


@hdf5_with
def huge(hdf5):
    del hdf5["imu_gyr"]
    for key in ("imu_gyr", "imu_acc"):
        hdf5.create_dataset(key, (10**9, 3), "f8", chunks=(1000, 3))


@hdf5_with
def unwritten(hdf5):
    hdf5["imu_acc"] = STILL
    del hdf5["sampling_rate"]
    hdf5.create_dataset("sampling_rate", (2**30,), "u8")  # 8 GiB of a fill value


def chunk_of(content):
    """A chunk of these bytes, packed, which the library inflates to their end, whatever the size of a chunk."""

    def make(hdf5):
        chunked = hdf5.create_dataset("imu_acc", (ROWS, 3), "f8", chunks=(ROWS, 3), compression="gzip")
        chunked.id.write_direct_chunk((0, 0), zlib.compress(content))

    return hdf5_with(make)


def packed_variable(name, content):
    """An element that holds an array of these numbers, of one column; its size is stated truly."""
    data = io.BytesIO()
    scipy.io.savemat(data, {name: content}, do_compression=True, oned_as="column")
    return data.getvalue()[128:]


def mat_of(*elements, found=WITHOUT_ACC):
    """Maker of a packed trial and further elements of bytes."""

    def put(folder):
        path = write_mat(folder / "a.mat", found)
        path.write_bytes(path.read_bytes() + b"".join(elements))
        return path

    return put


def plain_mat(folder):
    """A trial that is not packed, and where in it the tag of the accelerometer's numbers stands."""
    path = write_mat(folder / "a.mat", content(), compress=False)
    return path, path.read_bytes().index(b"imu_acc\0") + 8


def mat_with(place, *new):
    """Maker of a trial with other numbers from this place on, as seen from the accelerometer's numbers."""

    def put(folder):
        path, at = plain_mat(folder)
        raw = bytearray(path.read_bytes())
        raw[at + place : at + place + 4 * len(new)] = struct.pack(f"<{len(new)}I", *new)
        path.write_bytes(raw)
        return path

    return put


def stated_size(unpacked):
    """Maker of a trial whose accelerometer unpacks to so many bytes, whatever it states."""

    def put(folder):
        plain, at = plain_mat(folder)
        element = plain.read_bytes()[at - 56 : at + 8 + 960]
        packed = zlib.compress((element + bytes(64 << 20))[:unpacked])
        return mat_of(struct.pack("<II", 15, len(packed)), packed)(folder)

    return put


def stated_shape(folder):
    path, at = plain_mat(folder)
    raw = path.read_bytes()
    element = bytearray(raw[at - 56 : at + 8 + 960]) + bytes(1 << 20)
    element[4:8] = struct.pack("<I", len(element) - 8)
    path.write_bytes(raw[: at - 56] + element + raw[at + 8 + 960 :])
    return path


def enlarged(folder):
    path = write_mat(folder / "a.mat", content())
    with path.open("r+b") as stream:
        stream.truncate(2 << 40)  # of holes
    return path


DAMAGED = packed_variable("imu_acc", np.ones((ROWS, 3)))
DAMAGED = DAMAGED[:-1] + bytes([DAMAGED[-1] ^ 1])
CUT = "the variable at byte .* is cut or damaged"
MISFITS = [
    ("imu_acc", np.zeros((ROWS - 1, 3)), "its arrays have different lengths"),
    ("imu_acc", np.zeros((ROWS, 4)), "imu_acc has 4 columns, but needs 3"),
    ("opt_quat", np.zeros((ROWS, 3)), "opt_quat has 3 columns, but needs 4"),
    ("movement", np.zeros((ROWS, 2)), "movement has 2 columns, but needs 1"),
    *(("sampling_rate", rate, "sampling_rate must be") for rate in (0.0, np.nan, np.array([1.0, 2.0]))),
    ("imu_mag", np.zeros((ROWS, 3), dtype=complex), "imu_mag"),
]
REFUSED = [
    *(
        (trial(suffix, **{key: None}), rf"need --profile|{key}' is not in the file|{key} must be one")
        for suffix in WRITERS
        for key in KEYS
    ),
    *((trial(suffix, **{key: value}), match) for suffix in WRITERS for key, value, match in MISFITS),
    (stored_outside, "imu_acc is stored in another file"),
    (virtual, "imu_acc is stored in another file"),
    (
        hdf5_with(lambda f: f.__setitem__("imu_acc", h5py.ExternalLink("other.hdf5", "/imu_acc"))),
        "'imu_acc' is not an array of numbers but a link",
    ),
    (hdf5_with(lambda hdf5: hdf5.create_group("imu_acc")), "'imu_acc' is not in the file"),
    (dataset(data=h5py.Empty("f8")), "data set that is not of numbers"),
    (dataset(data=np.array(["text"], object), dtype=h5py.string_dtype()), "data set that is not of numbers"),
    (dataset((ROWS, 3), [("a", "f8"), ("b", "f8")]), "'imu_acc' is not in the file; the file holds imu_acc/a"),
    (huge, r"unpack to 48\d{9}, but"),
    (dataset((ROWS, 3), "f8", chunks=(2**24, 3), maxshape=(None, 3)), "claims chunks"),
    (unwritten, "sampling_rate must be one number"),
    (chunk_of(bytes(64 << 20)), "a chunk of imu_acc unpacks to more than"),
    (dataset(data=STILL, chunks=True, compression="lzf"), "imu_acc is packed by a filter other than gzip"),
    # MATLAB: the variable's tag lies at −56, its flags from −48 on, its dimensions from −32 and its name from −16
    (trial(".mat", imu_acc=np.full((ROWS, 3), 1.0, dtype=object)), "not an array of numbers but a cell"),
    # SciPy 1.17 ends the process in numbers of a type that does not exist, at least where that is 0 or 8
    *((mat_with(0, kind), f"its numbers, of type {kind}, have 960 bytes") for kind in (0, 8, 10, 14, 255, 65535)),
    (mat_with(0, 0, 0), "its numbers, of type 0, have 0 bytes"),
    *((mat_with(4, size), CUT) for size in (0, 952, 968, 2**31, 2**32 - 1)),
    (mat_with(-56, 15), "Error -3|damaged"),  # plain bytes that are said to be packed
    (mat_with(-56, 13), "it is of type 13 instead of 14"),
    (mat_with(-52, 2**32 - 1), "states 4294967295 bytes"),
    (mat_with(-48, 5), "flags are not two numbers"),
    (mat_with(-48, 0x00080006), "extends beyond its end"),  # a small element has 4 bytes at most
    (mat_with(-44, 2**32 - 8), "states 4294967288 bytes"),
    (mat_with(-40, 255), "255, which does not exist"),
    (mat_with(-40, 17), "'imu_acc' is not in the file"),
    (mat_with(-32, 6), "dimensions are not two or more"),
    (mat_with(-24, 2**32 - 1), "negative dimension"),
    (mat_with(-24, 2**31 - 1, 2**31 - 1), "imu_acc has 2147483647 columns"),
    (mat_with(-16, 9), "name is not text"),
    (mat_with(-12, 2**32 - 1), "states 4294967295 bytes"),
    (mat_of(packed_variable("imu_acc", np.zeros(ROWS)), found=content()), "imu_acc occurs twice"),
    (stated_size(64 << 20), "it does not unpack to the 1024 bytes that it states"),  # no more than the shape allows is
    (stated_size(1000), "it does not unpack to the 1024 bytes that it states"),
    (stated_shape, "it states 1049600 bytes for 120 numbers"),
    (mat_of(DAMAGED), f"{CUT} .*incorrect data check"),
    (enlarged, "it has 2199023255552 bytes, but .* 268435456"),
]


@pytest.mark.parametrize(("put", "match"), REFUSED)
def test_what_is_no_trial_or_hostile_is_refused(tmp_path, put, match):
    path = put(tmp_path)
    refused(read, path, match=match, error=PlumbobError, name=path.name)


@pytest.mark.parametrize("how", [{"shuffle": True}, {"fletcher32": True}, {"shuffle": True, "fletcher32": True}])
def test_filters_beside_gzip_and_whole_chunks_are_read(tmp_path, how):
    assert len(read(dataset(data=STILL, compression="gzip", **how)(tmp_path)).imu) == ROWS
    assert read(chunk_of(STILL.tobytes())(tmp_path)).imu.acc.tobytes() == STILL.tobytes()


def test_other_variables_are_not_unpacked(tmp_path):
    """A variable that no trial needs may be of any size and kind: 64 MiB here, of which 1 KiB is looked at."""
    others = {"text": "why", "struct": {"a": 1.0}, "sparse": sparse.eye_array(3)}
    path = mat_of(packed_variable("payload", np.zeros(8 << 20)), found=content() | others)(tmp_path)
    tracemalloc.start()
    try:
        check(read(path), content(), RATE)
        assert tracemalloc.get_traced_memory()[1] < 2 << 20
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("dtype", ["f4", "i1", "u1", "i2", "u2", "i4", "u4"])
def test_every_type_of_number_is_read_in_either_order_of_bytes(tmp_path, dtype):
    """Big-endian files are made by hand, since SciPy does not write them [MAT-File Format, level 5]."""
    found = content() | {"imu_acc": np.arange(3 * ROWS).reshape(ROWS, 3).astype(dtype)}
    little = read(write_mat(tmp_path / "a.mat", found))
    assert np.array_equal(little.imu.acc, found["imu_acc"])
    (tmp_path / "b.mat").write_bytes(big_endian(found))
    check(read(tmp_path / "b.mat"), {key: np.asarray(value, float) for key, value in found.items()}, RATE)


def big_endian(found):
    """A file of the arrays, written on a machine with the other order of bytes; a byte is a small element."""
    kinds = {"f8": (6, 9), "f4": (7, 7), "i1": (8, 1), "u1": (9, 2), "i2": (10, 3), "u2": (11, 4), "i4": (12, 5),
             "u4": (13, 6), "b1": (9, 2)}  # fmt: skip

    def part(kind, data):
        return struct.pack(">II", kind, len(data)) + data + bytes(-len(data) % 8)

    out = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x01\x00MI"
    for name, value in found.items():
        table = np.asarray(value)
        table = table.reshape(len(table) if table.ndim else 1, -1)
        class_, kind = kinds[table.dtype.str[1:]]
        data = table.astype(table.dtype.newbyteorder(">")).tobytes("F")
        out += part(14, part(6, struct.pack(">II", class_, 0)) + part(5, struct.pack(">ii", *table.shape))
                    + part(1, name.encode()) + part(kind, data))  # fmt: skip
    return out


def test_sizes_are_bounded(tmp_path, monkeypatch):
    path = write_mat(tmp_path / "a.mat", content())
    monkeypatch.setattr(arrays, "MAX_VARIABLES", len(content()))
    assert len(read(path).imu) == ROWS
    monkeypatch.setattr(arrays, "MAX_VARIABLES", len(content()) - 1)
    refused(read, path, match=f"more than {len(content()) - 1} variables")
