"""Joint angles as tables: to the bit and back, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

from plumbob.arm import JointTrack
from plumbob.core import flags
from plumbob.core.errors import DecodeError, ParameterError, ShapeError, UnitError


def some_track(count: int = 50) -> JointTrack:
    rng = np.random.default_rng(3)
    angles = rng.normal(size=(count, 2))
    angles[4, 1] = np.nan
    words = np.zeros(count, dtype=np.uint32)
    words[7] = flags.INCONSISTENT
    return JointTrack(
        np.arange(count) * 0.01, ("shoulder, left", "elbow"), angles, sd=rng.uniform(0.0, 0.1, (count, 2)),
        hand=rng.normal(size=(count, 3)), hand_sd=rng.uniform(0.0, 0.1, (count, 3)), flags=words, source="by hand",
    )  # fmt: skip


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_a_table_is_read_back_to_the_bit(tmp_path: Path, suffix: str) -> None:
    track = some_track()
    found = JointTrack.load(track.save(tmp_path / f"angles{suffix}"))
    assert found.names == track.names
    for name in ("t", "angles", "sd", "hand", "hand_sd", "flags"):
        np.testing.assert_array_equal(getattr(found, name), getattr(track, name), err_msg=name)


def test_angles_alone_and_in_degrees_and_a_slice_is_a_track(tmp_path: Path) -> None:
    file = tmp_path / "angles.csv"
    file.write_text("t [s],elbow [deg]\n0,180\n0.5,\n1,-90\n")
    found = JointTrack.load(file)
    np.testing.assert_array_equal(found.angles[:, 0], [np.pi, np.nan, -np.pi / 2])
    assert found.sd is None and found.hand is None and found.flags is None
    track = some_track()
    part = track[10:20]
    np.testing.assert_array_equal(part.angles, track.angles[10:20])
    assert part.flags is not None and part.flags.size == len(part) == 10


def flipped(file):
    content = bytearray(some_track(400).save(file).read_bytes())
    content[2000] ^= 4
    file.write_bytes(content)


@pytest.mark.parametrize(("table", "error", "match"), [
    ("t [s],elbow\n0,1\n", UnitError, "has no unit"),
    ("t [s],elbow [m]\n0,1\n", UnitError, "not a unit of angle"),
    ("time,elbow [rad]\n0,1\n", DecodeError, "first line"),
    ("t [s],elbow [rad]\n0,x\n", DecodeError, "not numbers"),
    ("t [s],elbow [rad]\n0,1,2\n", DecodeError, "not numbers"),
    ("t [s],a [rad],b [rad],a_sd [rad]\n0,1,2,3\n", DecodeError, "belong together"),
    ("t [s],a [rad],a [rad]\n0,1,2\n", DecodeError, "twice"),
    ("", DecodeError, "first line"),
    ("t [s],a [rad]\n", ShapeError, "empty"),
    (lambda folder: JointTrack.load(folder / "flipped.parquet"), DecodeError, "flipped.parquet"),
    (lambda _: JointTrack([0.0], ("a", "a"), [[0.0, 0.0]]), ShapeError, "occurs twice"),
    (lambda _: JointTrack([0.0], ("a", "a_sd"), [[0.0, 0.0]]), ShapeError, "standard deviation of 'a'"),
    (lambda _: JointTrack([0.0], ("a",), [[np.inf]]), ShapeError, "infinite"),
    (lambda _: JointTrack([0.0], ("a",), [[0.0]], sd=[[-0.1]]), ShapeError, "negative"),
    (lambda folder: some_track().save(folder / "angles.txt"), ParameterError, r"ends in \.csv"),
])  # fmt: skip
def test_what_is_no_table_of_angles_is_refused(tmp_path: Path, table, error: type[Exception], match: str) -> None:
    flipped(tmp_path / "flipped.parquet")
    if isinstance(table, str):
        (tmp_path / "angles.csv").write_text(table)
    with pytest.raises(error, match=match):
        JointTrack.load(tmp_path / "angles.csv") if isinstance(table, str) else table(tmp_path)
