"""Recordings of decoded rows that anybody may have written: each is read, or refused in a sentence with its name."""

import json
from contextlib import suppress
from dataclasses import asdict

import numpy as np
import pytest

from plumbob.core.errors import DecodeError, PlumbobError
from plumbob.core.event import Event
from plumbob.data import ImuMeta
from plumbob.files.header import plain_meta
from plumbob.files.mcap import Recorder
from plumbob.files.numbers import open_npy
from plumbob.live import rows
from plumbob.live.recorded import read_recorded

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


def test_an_event_is_read_or_refused():
    for text in ("{", DEEP, "[]", "{}", '{"t_ns": "x", "kind": "a", "text": "b", "count": 1}'):
        with pytest.raises(DecodeError, match="a row of 'events'"):
            rows.parsed_event(text.encode())
    assert rows.parsed_event(rows.event_row(Event(1, "a", "b", 2))) == Event(1, "a", "b", 2)


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
