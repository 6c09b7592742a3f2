"""A recording of decoded bytes can be opened: its ranges are those of each axis, its units those of the format."""

import numpy as np
import pytest

from plumbob import files, flags
from plumbob.live.recorded import convert, read_recorded
from plumbob.protocols.decode import full_scales
from plumbob.protocols.encode import encode
from plumbob.protocols.format_toml import find_format, parse_format
from tests.helpers.commandline import ok

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


def test_an_axis_is_judged_by_its_own_range(fast):
    imu = read_recorded(fast / "fin.mcap").imu
    np.testing.assert_allclose(imu.meta.full_scale("gyr"), FIN, rtol=1e-12)
    assert np.abs(imu.gyr[:, 2]).max() > 1.05 * FIN[0]  # where the smallest range of the triad made it invalid
    assert not (imu.flags[(np.abs(imu.gyr) < 0.99 * FIN).all(axis=1)] & JUDGED).any()


@pytest.mark.parametrize("name", ["fin.parquet", "fin.csv"])
def test_convert_keeps_its_ranges(fast, tmp_path, name):
    convert(fast / "fin.mcap", tmp_path / name)
    assert files.read(tmp_path / name).imu.meta == read_recorded(fast / "fin.mcap").imu.meta


def test_ranges_turn_with_the_axes(fast, tmp_path):
    session = tmp_path / "fin.toml"
    session.write_text(
        'kind = "plumbob session"\nversion = 1\n[format]\nname = "fin"\n[imu]\naxes = "z x y"\n'
        f'[source]\nkind = "file"\npath = "{(fast / "fin.bin").as_posix()}"\n[record]\npath = "turned.mcap"\n'
    )
    ok("record", session, cwd=tmp_path)
    imu = read_recorded(tmp_path / "turned.mcap").imu
    np.testing.assert_allclose(imu.meta.full_scale("gyr"), FIN[[2, 0, 1]], rtol=1e-12)
    np.testing.assert_array_equal(imu.gyr, read_recorded(fast / "fin.mcap").imu.gyr[:, [2, 0, 1]])


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
