"""A wrong type is refused at the door: every public function, every argument, with a typed error of its own."""

from pathlib import Path

import numpy as np
import pytest

import plumbob
from plumbob import Filter, Frame, ImuData, ImuMeta, ImuSample, North, Recording, evaluate, find_format, simulate
from plumbob.core.errors import ParameterError, PlumbobError, ShapeError

FORM = find_format("fin")
MADE = simulate("static", frame="NED", sensors="ideal", unit="random", seed=0, rate=20.0, duration=1.0)
IMU, TRACK = MADE.imu, MADE.truth


class Table:
    columns, shape, index = ["a"], (2, 1), [0, 1]

    def __getitem__(self, key):
        return [1.0, 2.0]


WRONG = {
    "None": None, "text": "hello", "list": [1, 2], "table": Table(), "path": Path("nowhere.parquet"), "int": 3,
    "float": 0.5, "nan": float("nan"), "truth": True, "complex": 1j, "object": object(), "dict": {"a": 1},
    "bytes": b"ab", "array": np.zeros((2, 2)), "texts": np.array(["a"]), "set": {1},
}  # fmt: skip
TWO = np.zeros((2, 3))
DOORS = {
    "ImuMeta": (ImuMeta, {"rate_nominal": 1.0, "gyr_range": 1.0, "t0_ns": 0, "axes": "x y z", "frame": None,
                          "north": None, "declination": None}),
    "ImuData": (ImuData, {"t": [0.0, 1.0], "gyr": TWO, "acc": None, "temp_c": None, "flags": None, "meta": ImuMeta()}),
    "from_streams": (ImuData.from_streams, {"t": [0.0, 1.0], "gyr": TWO, "t_mag": [0.0, 1.0], "mag": TWO,
                                            "meta": None}),
    "chunks": (lambda size: list(IMU.chunks(size)), {"size": 3}),
    "usable": (IMU.usable, {"name": "gyr"}),
    "AttitudeTrack": (plumbob.AttitudeTrack, {"t": [0.0], "q_nb": [[1.0, 0.0, 0.0, 0.0]], "frame": Frame.NED,
                                              "north": North.TRUE, "bias_b": None, "cov_b": None, "flags": None,
                                              "score": None}),
    "ImuSample": (ImuSample, {"t_ns": 0, "gyr": [0.0] * 3, "acc": None, "mag": None, "temp_c": None, "flags": 0}),
    "Filter": (Filter, {"name": "madgwick", "frame": Frame.NED, "params": None, "noise": None, "init": None}),
    "process": (lambda data: Filter("integrate", frame="NED").process(data), {"data": IMU}),
    "update": (lambda sample: Filter("integrate", frame="NED").update(sample), {"sample": ImuSample(0)}),
    "restore": (Filter.restore, {"saved": {}}),
    "evaluate": (evaluate, {"estimate": TRACK, "reference": TRACK, "align": (), "max_gap": None, "max_offset": 1.0,
                            "declination": None, "settle": 0.0}),
    "Recording": (Recording, {"imu": IMU, "track": None, "notes": ()}),
    "read": (plumbob.read, {"path": "x.parquet"}),
    "find_format": (find_format, {"name": "fin"}),
    "load_session": (plumbob.load_session, {"path": "x.toml"}),
    "Decoder": (plumbob.Decoder, {"form": FORM}),
    "feed": (lambda data: plumbob.Decoder(FORM).feed(data), {"data": b"ab"}),
    "Stream": (plumbob.Stream, {"session": None}),
    "CalibrationCard.load": (plumbob.CalibrationCard.load, {"path": "x.json"}),
    "NoiseCard.load": (plumbob.NoiseCard.load, {"path": "x.json"}),
    "simulate": (simulate, {"scenario": "static", "frame": Frame.NED, "sensors": "ideal", "unit": "random",
                            "rate": 20.0, "duration": 1.0, "strength": 50.0, "dip": 0.5, "declination": 0.0,
                            "temp_c": 25.0, "mag_rate": None, "jitter": 0.0, "lost": 0.0, "noise": None, "seed": 0}),
}  # fmt: skip
PLACES = [(door, name) for door, (_, right) in DOORS.items() for name in right]


@pytest.mark.parametrize(("door", "name"), PLACES, ids=["-".join(place) for place in PLACES])
def test_no_error_comes_from_inside(door, name):
    function, right = DOORS[door]
    for wrong in WRONG.values():
        try:
            function(**{**right, name: wrong})
        except PlumbobError as error:
            assert len(str(error)) > 20  # says something


def test_write_refuses_what_is_no_recording(tmp_path):
    for wrong in WRONG.values():
        with pytest.raises(ShapeError, match=r"what must be a Recording, but it is .*An ImuData or an AttitudeTrack"):
            plumbob.write(tmp_path / "a.parquet", wrong)
    with pytest.raises(ParameterError, match="path must be the path of a file, or its text, but it is a list"):
        plumbob.write([1], IMU)
    assert not any(tmp_path.iterdir())


def test_a_recording_is_evaluated_by_its_reference():
    recording = Recording(imu=IMU, track=TRACK)
    assert evaluate(TRACK, recording).summary() == evaluate(TRACK, TRACK).summary()
    with pytest.raises(ShapeError, match=r"reference must be an AttitudeTrack, or a Recording .* but it has no track"):
        evaluate(TRACK, Recording(imu=IMU))
    with pytest.raises(ShapeError, match=r"estimate must be an AttitudeTrack.* but it is an ImuData.*process gives"):
        evaluate(IMU, TRACK)
