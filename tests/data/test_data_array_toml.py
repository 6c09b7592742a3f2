"""Mounts of an array as TOML: every way to write one, what is written reads back, and nothing is guessed."""

import numpy as np
import pytest

from plumbob.core.errors import DecodeError, FrameError, PlumbobError, UnitError
from plumbob.data.array import PRESETS, UnitMount
from plumbob.data.array_toml import load_units
from plumbob.data.cards import CalibrationCard, NoiseCard, TriadCalibration, TriadNoise
from plumbob.rotations import quat_rotate

HEAD = 'kind = "plumbob array"\nversion = 1\n[[unit]]\nname = "u1"\n'


def file(folder, text, head=HEAD):
    path = folder / "mounts.toml"
    path.write_text(head + text, encoding="utf-8")
    return path


def test_rotations_in_every_way(tmp_path):
    """By 90° about z from the body: the unit's x axis is the body's y axis, its y axis the body's −x."""
    for text in (
        'axes = "-y x z"',
        "q_bs = [0.7071067811865476, 0.0, 0.0, 0.7071067811865475]",
        'rotation = "0 deg, 0 deg, 90 deg"',
    ):
        mount = load_units(file(tmp_path, text))["u1"].mount
        np.testing.assert_allclose(quat_rotate(mount.q_bs, [1.0, 0.0, 0.0]), [0.0, 1.0, 0.0], atol=1e-15)
        np.testing.assert_allclose(quat_rotate(mount.q_bs, [0.0, 1.0, 0.0]), [-1.0, 0.0, 0.0], atol=1e-15)
    # yaw first: a unit of roll 90° and yaw 90° has its z axis along the body's x axis
    mount = load_units(file(tmp_path, 'rotation = "90 deg, 0 deg, 90 deg"'))["u1"].mount
    np.testing.assert_allclose(quat_rotate(mount.q_bs, [0.0, 0.0, 1.0]), [1.0, 0.0, 0.0], atol=1e-15)
    scale = TriadCalibration(1.01 * np.eye(3), np.zeros(3), "rad/s", "rad/s")
    card = CalibrationCard(device="arm 1", gyr=scale, date="2024-05-01", method="test")
    noise = NoiseCard("arm 1", "test", gyr=TriadNoise([0.1] * 3, [0.0] * 3, [0.0] * 3))
    card.save(tmp_path / "u1.card.json")
    noise.save(tmp_path / "u1.noise.json")
    text = """
lever = ["20 mm", "0 mm", "-1 cm"]
clock_offset = "-1 ms"
device = "arm 1"
card = "u1.card.json"
noise = "u1.noise.json"
[[unit]]
name = "u2"
"""
    found = load_units(file(tmp_path, text))
    assert list(found) == ["u1", "u2"]
    np.testing.assert_allclose(found["u1"].mount.lever_b, [0.02, 0.0, -0.01], rtol=1e-15)
    assert found["u1"].mount.clock_offset == -1e-3
    assert (found["u1"].device, found["u1"].card.text()) == ("arm 1", card.text())
    assert found["u1"].mount.noise.text() == noise.text()
    assert found["u2"].mount == UnitMount()


WRONG = [
    ("lag = 1", DecodeError, r"unit\[1\] has no key 'lag'"),
    ('axes = "x y z"\nq_bs = [1, 0, 0, 0]', DecodeError, "more than one of axes, q_bs, rotation"),
    ('axes = "-x -y -z"', FrameError, "left-handed"), ('lever = ["20", "0", "0"]', UnitError, "no unit"),
    ("lever = [0.02, 0, 0]", UnitError, "in quotes"), ('lever = ["20 mm", "0 mm"]', DecodeError, "list of 3 values"),
    ("q_bs = [1, 0, 0]", DecodeError, "list of 4 values"), ("q_bs = [2, 0, 0, 0]", PlumbobError, "q_bs"),
    ('rotation = "1 deg, 2 deg"', DecodeError, "roll, pitch and yaw"), ('rotation = "1, 2, 3"', UnitError, "no unit"),
    ('card = "no.json"', DecodeError, "no.json"), ('[[unit]]\nname = "u1"', DecodeError, "'u1' occurs twice"),
    ('[[unit]]\naxes = "x y z"', DecodeError, "needs the key 'name'"),
    (None, DecodeError, "kind must be one of 'plumbob array'"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "error", "match"), WRONG)
def test_wrong_ones_are_refused_with_the_file_and_the_place(tmp_path, text, error, match):
    with pytest.raises(error, match=match) as raised:
        load_units(
            file(tmp_path, text or "", *(() if text else ('kind = "plumbob session"\nversion = 1\nunit = []\n',)))
        )
    assert "mounts.toml" in str(raised.value)


def test_the_preset_measures_each_axis_both_ways_and_the_rig_is_mounted_so():
    """Three units as the body, and of the others each body axis has one that measures it reversed."""
    turned = {name: unit.mount.dcm for name, unit in load_units("arm").items()}
    assert list(turned) == ["u1", "u2", "u3", "u4", "u5", "u6"]
    for axis, opposite in enumerate(("u4", "u5", "u6")):
        np.testing.assert_array_equal(turned[f"u{axis + 1}"], np.eye(3))
        assert turned[opposite][axis, axis] == -1.0
    from plumbob.live.rigs.rig import PLANS

    assert {unit.prefix: unit.q_bs for unit in PLANS["arm"].units} == {
        name: mount.q_bs for name, mount in PRESETS["arm"].items()
    }
    assert PLANS["arm"].units[3].q_bs == (0.0, 0.0, 0.0, 1.0)  # as it was before there were presets
