"""Recordings of decoded rows that anybody may have written: each is read, or refused in a sentence with its name."""

import json
from contextlib import suppress
from dataclasses import asdict

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given
from hypothesis.extra.numpy import arrays

from plumbob import AttitudeTrack, Frame, ImuData, North, files, flags
from plumbob.core.errors import DecodeError, PlumbobError
from plumbob.core.event import Event
from plumbob.data import ImuMeta
from plumbob.files.header import plain_meta
from plumbob.files.mcap import Recorder
from plumbob.files.numbers import open_npy
from plumbob.live import rows
from plumbob.live.recorded import convert, read_recorded
from plumbob.live.rows import attitude_rows, imu_rows
from plumbob.protocols.decode import full_scales
from plumbob.protocols.encode import encode
from plumbob.protocols.format_toml import find_format, parse_format
from tests.helpers.commandline import ok

DEEP = "[" * 200_000
LONG = "9" * 5000
HUGE = "9" * 400  # an integer that Python reads, and no float holds
IMU = {"t_ns": 0, "gyr": [0.1, 0.2, 0.3], "acc": None, "mag": None, "temp_c": 20.5, "flags": 0}
ATTITUDE = {"t_ns": 0, "q_nb": [1.0, 0.0, 0.0, 0.0], "bias_b": None, "flags": 0}


def about(**changes):
    meta = asdict(plain_meta(ImuMeta(device="unit 7", rate_nominal=100.0)))
    return json.dumps(
        {"imu": meta, "track": {"frame": "NED", "north": "true", "source": "a test"}, "notes": []} | changes
    )


def recording(folder, *, topic=rows.IMU, text=None, imu=True, **texts):
    """Two good rows of samples, and one more with this text in a topic."""
    path = folder / "crafted.mcap"
    path.unlink(missing_ok=True)
    recorder = Recorder(path, epoch_offset_ns=0)
    recorder.metadata.update({"recording": about()} | texts)
    numbers = {name: rows.declare(recorder, name) for name in (rows.IMU, rows.ATTITUDE)}
    with recorder:
        for t_ns in (1, 10_000_001) if imu else ():
            recorder.write(numbers[rows.IMU], t_ns, json.dumps(IMU | {"t_ns": t_ns}).encode())
        if text is not None:
            recorder.write(numbers[topic], 20_000_001, text.encode())
    return path


def row(plain=IMU, **changes):
    return json.dumps(plain | {"t_ns": 20_000_001} | changes)


NO_FLAGS = json.dumps({key: value for key, value in IMU.items() if key != "flags"})
BAD_ROWS = ["", "[]", '"x"', "null", DEEP, "{}", row()[:-9], row().replace("20.5", LONG), NO_FLAGS]
BAD_ROWS += [row(flags=value) for value in (-1, "x", 2**32, 1.5, True)]
BAD_ROWS += [row(t_ns=value) for value in (2**63, "1", None)]
BAD_ROWS += [row(gyr=value) for value in ([1.0, 2.0], [1.0, 2.0, "3"], 3.0, [[1.0], 2.0, 3.0], {})]
BAD_ROWS += [row().replace("0.1", HUGE), row(temp_c="20")]
BAD_ABOUT = [about()[:-9], "[]", DEEP, "{}", about(imu=5), about(notes=5), about(notes=[5])]
BAD_ABOUT += [about().replace("100.0", HUGE), about().replace("100.0", LONG)]
BAD_ABOUT += [about().replace('"t0_ns": 0', '"t0_ns": "0"'), about().replace('"unit 7"', "5")]
BAD_ATTITUDES = [(row(ATTITUDE, q_nb=[1.0]), about()), (row(ATTITUDE, q_nb=None)[:-1], about())]
BAD_ATTITUDES += [(row(ATTITUDE), about(track=track)) for track in (None, {"frame": "up"}, [])]


def test_rows_and_metadata_are_read_or_refused(tmp_path):
    found = read_recorded(recording(tmp_path, text=row()))
    np.testing.assert_array_equal(found.imu.gyr, [IMU["gyr"]] * 3)
    assert found.imu.meta.device == "unit 7"
    for text in BAD_ROWS:
        with pytest.raises(DecodeError, match=r"crafted\.mcap: .*damaged, or was not made by Plumbob"):
            read_recorded(recording(tmp_path, text=text))
    for text in BAD_ABOUT:
        with pytest.raises(DecodeError):
            read_recorded(recording(tmp_path, text=row(), recording=text))
    for text, metadata in BAD_ATTITUDES:
        path = recording(tmp_path, topic=rows.ATTITUDE, text=text, imu=False, recording=metadata)
        with pytest.raises(PlumbobError):
            read_recorded(path, estimated=True)


def test_an_event_is_read_or_refused_and_a_sensor_that_is_not_there_is_absent_in_every_row():
    for text in ("{", DEEP, "[]", "{}", '{"t_ns": "x", "kind": "a", "text": "b", "count": 1}'):
        with pytest.raises(DecodeError, match="a row of 'events'"):
            rows.parsed_event(text.encode())
    assert rows.parsed_event(rows.event_row(Event(1, "a", "b", 2))) == Event(1, "a", "b", 2)
    meta = ImuData(t=[0.0], gyr=[[0.0, 0.0, 0.0]]).meta
    imu = ImuData.live(np.array([0, 1]), {"gyr": np.zeros((2, 3))}, flags=np.zeros(2, dtype=np.uint32), meta=meta)
    assert (imu.flags == flags.ACC_ABSENT | flags.MAG_ABSENT).all()


def test_no_byte_of_an_array_of_numpy_makes_a_traceback(tmp_path):
    """Every byte of the header turned to each of some signs that mean something in it."""
    path = tmp_path / "damaged.npy"
    np.save(path, np.arange(30.0).reshape(10, 3))
    data = path.read_bytes()
    for at in range(6, 128):
        for sign in b"('{\\":
            path.write_bytes(data[:at] + bytes([sign]) + data[at + 1 :])
            with suppress(DecodeError):
                open_npy(path, None)


T_NS = [5, 10, 2**61]


def same(told, values):
    return all(a == b or (a is None and not np.isfinite(b)) for a, b in zip(told, values, strict=True))


@given(arrays(np.float64, (3, 3), elements=st.floats(allow_nan=True, allow_infinity=True)))
def test_every_number_of_a_sample_reads_back(gyr):
    gyr[0, 0] = 0.1  # a recording needs a number
    meta = ImuData(t=[0.0], gyr=[[0.0, 0.0, 0.0]]).meta
    imu = ImuData.live(np.array([0, 1, 2]), {"gyr": gyr}, flags=np.arange(3, dtype=np.uint32), meta=meta)
    for row, t, values in zip(imu_rows(T_NS, imu), T_NS, gyr, strict=True):
        told = json.loads(row)
        assert told["t_ns"] == t
        assert told["acc"] is told["mag"] is told["temp_c"] is None
        assert same(told["gyr"], values)


@given(arrays(np.float64, (3, 4), elements=st.floats(-1, 1)))
def test_every_number_of_an_attitude_reads_back(q_nb):
    track = AttitudeTrack.trusted(t=np.arange(3.0), q_nb=q_nb, frame=Frame.ENU, north=North.TRUE)
    for row, values in zip(attitude_rows(T_NS, track), q_nb, strict=True):
        told = json.loads(row)
        assert told["q_nb"] == values.tolist()
        assert (told["bias_b"], told["flags"]) == (None, 0)


JUDGED = np.uint32(flags.GYR_CLIPPED | flags.GYR_INVALID)
FIN = np.radians([100.0, 100.0, 300.0])
"""ADXRS290 about x and y, ±100 °/s, and ADXRS453 about z, ±300 °/s: their data sheets, as the catalogue cites them."""


@pytest.fixture(scope="module")
def fast(tmp_path_factory):
    """A fin that turns at up to 130 °/s about z."""
    folder = tmp_path_factory.mktemp("fin")
    motion = ("--scenario", "fin", "--set", "frequency=0.56Hz", "--duration", "4s")
    ok("emulate", "fin", *motion, "--write", folder / "fin.bin")
    ok("record", "--from", folder / "fin.bin", "--format", "fin", "--out", folder / "fin.mcap")
    return folder


def test_an_axis_is_judged_by_its_own_range_which_turns_with_the_axes(fast, tmp_path):
    imu = read_recorded(fast / "fin.mcap").imu
    np.testing.assert_allclose(imu.meta.full_scale("gyr"), FIN, rtol=1e-12)
    assert np.abs(imu.gyr[:, 2]).max() > 1.05 * FIN[0]  # where the smallest range of the triad made it invalid
    assert not (imu.flags[(np.abs(imu.gyr) < 0.99 * FIN).all(axis=1)] & JUDGED).any()
    session = tmp_path / "fin.toml"
    session.write_text(
        'kind = "plumbob session"\nversion = 1\n[format]\nname = "fin"\n[imu]\naxes = "z x y"\n'
        f'[source]\nkind = "file"\npath = "{(fast / "fin.bin").as_posix()}"\n[record]\npath = "turned.mcap"\n'
    )
    ok("record", session, cwd=tmp_path)
    imu = read_recorded(tmp_path / "turned.mcap").imu
    np.testing.assert_allclose(imu.meta.full_scale("gyr"), FIN[[2, 0, 1]], rtol=1e-12)
    np.testing.assert_array_equal(imu.gyr, read_recorded(fast / "fin.mcap").imu.gyr[:, [2, 0, 1]])


@pytest.mark.parametrize("name", ["fin.parquet", "fin.csv"])
def test_convert_keeps_its_ranges(fast, tmp_path, name):
    convert(fast / "fin.mcap", tmp_path / name)
    assert files.read(tmp_path / name).imu.meta == read_recorded(fast / "fin.mcap").imu.meta


WRONG_UNIT = """
kind = "plumbob format"
version = 1
name = "three"
title = "an accelerometer whose counts somebody takes for m/s²"
byte_order = "little"
frame = { sync = "A5 5A", length = 9, rate = "100 Hz", checksum = { kind = "sum8", at = -1, from = 2 } }
field = [{ name = "acc", axes = "xyz", type = "s16", counts = 8192, unit = "m/s2" }]
"""


def test_the_units_of_a_format_are_doubted_in_a_note_but_open(tmp_path):
    """1 g of 8192 counts, read as 1 m/s²."""
    level = {"acc.x": np.zeros(200), "acc.y": np.zeros(200), "acc.z": np.ones(200)}
    (tmp_path / "three.toml").write_text(WRONG_UNIT, encoding="utf-8")
    (tmp_path / "a.bin").write_bytes(encode(parse_format(WRONG_UNIT), level).tobytes())
    ok("record", "--from", tmp_path / "a.bin", "--format", tmp_path / "three.toml", "--out", tmp_path / "a.mcap")
    found = read_recorded(tmp_path / "a.mcap")
    np.testing.assert_allclose(found.imu.acc, [[0.0, 0.0, 1.0]] * 200)
    (note,) = [note for note in found.notes if note.code == "reading.unit_doubt"]
    assert "|acc| is 1 m/s²" in str(note) and str(note).endswith("looks like g; check the units of the format")


def form_of(*types):
    lines = [
        f'[[field]]\nname = "gyr.{axis}"\ntype = "{kind}"\nunit = "rad/s"\nlsb = {lsb}\n{more}\n'
        for axis, kind, lsb, more in types
    ]
    head = 'kind = "plumbob format"\nversion = 1\nname = "x"\ntitle = "x"\nbyte_order = "little"\n'
    sizes = {"s16": 2, "u16": 2, "f32": 4}
    length = 2 + sum(sizes[kind] for _, kind, *_ in types)
    return parse_format(f'{head}[frame]\nsync = "A5 F1"\nlength = {length}\n' + "\n".join(lines))


S16, SLOW = ("s16", 0.001, ""), ("s16", -0.0005, "")


@pytest.mark.parametrize(("types", "ranges"), [
    ([("z", *S16)], [32.767] * 3),  # an axis that is not there takes the largest
    # the other way round, −32768 to 32767 counts; u16 about 32768, −32.768 to 32.767 rad/s
    ([("x", *SLOW), ("y", "u16", 0.001, "raw_offset = -32768")], [16.3835, 32.767, 32.767]),
])  # fmt: skip
def test_ranges_of_a_format(types, ranges):
    np.testing.assert_allclose(full_scales(form_of(*types).message(""))["gyr"], ranges)
    np.testing.assert_allclose(full_scales(find_format("fin").message(""))["gyr"], FIN, rtol=1e-12)
    assert not full_scales(form_of(("x", "f32", 1, ""), ("y", *S16)).message(""))  # floating point has no range
