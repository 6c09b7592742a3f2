"""Chains and arrays of units as TOML."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from plumbob.core import errors
from plumbob.core.errors import DecodeError, FrameError, PlumbobError, UnitError
from plumbob.data.array import PRESETS, UnitMount
from plumbob.data.array_toml import load_units
from plumbob.data.cards import CalibrationCard, NoiseCard, TriadCalibration, TriadNoise
from plumbob.data.chain import Chain, Joint, Limits, Segment, chain_text, load_chain, parse_chain
from plumbob.rotations import quat_rotate
from tests.helpers import beside, examples
from tests.helpers.commandline import table_of

ARM = beside(__file__, "chain.toml")


def same(one: Chain, other: Chain) -> bool:
    return all(
        getattr(one, name) == getattr(other, name)
        for name in ("name", "segments", "joints", "hand", "hand_b", "base_fixed")
    )


def test_a_file_says_what_the_chain_is(tmp_path: Path) -> None:
    (tmp_path / "arm.toml").write_text(ARM)
    chain = load_chain(tmp_path / "arm.toml")
    assert chain.base_fixed and chain.hand == "hand" and chain.hand_b == (0.1, 0.0, -0.005)
    assert chain.angles == ("shoulder1", "shoulder2", "shoulder3", "elbow")
    upper = chain.segments[1]
    assert upper.unit == "imu1" and upper.mount.lever_b == (0.15, 0.0, 0.02) and upper.mount.clock_offset == 0.002
    # "y -x z": the body's x is the sensor's y, its y the sensor's −x (docs/conventions.md).
    np.testing.assert_allclose(upper.mount.dcm @ [1.0, 2.0, 3.0], [2.0, -1.0, 3.0], atol=1e-15)
    shoulder, elbow = chain.joints
    np.testing.assert_allclose(quat_rotate(np.array(shoulder.q_pc), np.array([1.0, 0, 0])), [0, 1, 0], atol=1e-15)
    third = 2.0 * np.pi / 3.0
    assert shoulder.limits == (Limits(-third, third, np.pi, np.inf, 50.0 * np.pi),) * 3
    assert elbow.axes == ((0.0, -1.0, 0.0),) and elbow.limits == (Limits(acceleration=2.0),)
    assert same(parse_chain(chain_text(chain)), chain)


numbers = st.floats(-3.0, 3.0)
names = st.lists(
    st.text(st.characters(codec="utf-8", exclude_categories=["C", "Z"], exclude_characters="[]"), min_size=1),
    min_size=8, max_size=8, unique=True,
)  # fmt: skip


@st.composite
def chains(draw: st.DrawFn) -> Chain:
    words = draw(names)
    vector = st.tuples(numbers, numbers, numbers)
    kinds = draw(st.lists(st.sampled_from(("fixed", "hinge", "universal", "ball")), min_size=1, max_size=3))
    segments, joints = [Segment(words[0])], []
    for k, kind in enumerate(kinds):
        mount = UnitMount((0.5, 0.5, -0.5, 0.5), draw(vector), draw(st.floats(-0.1, 0.1)))
        segments.append(Segment(words[k + 1], f"unit{k}" if draw(st.booleans()) else "", UnitMount()))
        if segments[-1].unit:
            segments[-1] = Segment(words[k + 1], f"unit{k}", mount)
        axes = {"hinge": ((0.6, 0.0, 0.8),), "universal": ((0, 0, 1.0), (0.6, 0.8, 0))}.get(kind, ())
        size = st.one_of(st.just(np.inf), st.floats(1e-3, 1e4))
        limits = Limits(draw(st.floats(-3, 0)), draw(st.floats(0.1, 3)), draw(size), draw(size), draw(size))
        count = {"fixed": 0, "hinge": 1, "universal": 2, "ball": 3}[kind]
        joints.append(
            Joint(
                words[k + 4], segments[draw(st.integers(0, k))].name, segments[-1].name, kind, draw(vector),
                (0.8, 0.0, 0.6, 0.0), axes, (limits,) * count,
            )
        )  # fmt: skip
    return Chain(words[7], tuple(segments), tuple(joints), segments[-1].name, draw(vector), draw(st.booleans()))


@examples(0.3)
@given(chains())
def test_a_chain_is_read_back_from_its_text(chain: Chain) -> None:
    assert same(parse_chain(chain_text(chain)), chain)


@pytest.mark.parametrize(("old", "new", "error", "match"), table_of(beside(__file__, "chain_wrong.txt")))
def test_what_is_wrong_is_named(tmp_path: Path, old: str, new: str, error: str, match: str) -> None:
    old, new = (text.replace(r"\n", "\n") for text in (old, new))
    assert old in ARM
    file = tmp_path / "arm.toml"
    file.write_text(ARM.replace(old, new, 1))
    with pytest.raises(getattr(errors, error), match=match) as refused:
        load_chain(file)
    assert str(refused.value).startswith(f"{file}: ")


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
