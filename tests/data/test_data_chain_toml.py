"""Chains as files: what a file says is what the chain is, and every gap is an error that names its place."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from plumbob.core.errors import DecodeError, FrameError, ParameterError, PlumbobError, UnitError
from plumbob.data.array import UnitMount
from plumbob.data.chain import Chain, Joint, Limits, Segment
from plumbob.data.chain_toml import chain_text, load_chain, parse_chain
from plumbob.rotations import quat_rotate
from tests.helpers import examples

ARM = """
kind = "plumbob chain"
version = 1
name = "arm"
base = "fixed"
hand = { segment = "hand", at = ["10 cm", "0 m", "-5 mm"] }

[[segment]]
name = "base"

[[segment]]
name = "upper"
unit = "imu1"
axes = "y -x z"
lever = ["150 mm", "0 mm", "20 mm"]
clock_offset = "2 ms"

[[segment]]
name = "hand"
unit = "imu2"

[[joint]]
name = "shoulder"
parent = "base"
child = "upper"
kind = "ball"
origin = ["0 m", "0 m", "1.2 m"]
euler = ["90 deg", "0 deg", "0 deg"]
limits = { low = "-120 deg", high = "120 deg", velocity = "180 deg/s", jerk = "9000 deg/s3" }

[[joint]]
name = "elbow"
parent = "upper"
child = "hand"
kind = "hinge"
origin = ["300 mm", "0 mm", "0 mm"]
axes = "-y"
limits = { acceleration = "2 rad/s2" }
"""


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
    min_size=8,
    max_size=8,
    unique=True,
)


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


@pytest.mark.parametrize(
    ("old", "new", "error", "match"),
    [
        ('"150 mm"', "0.15", UnitError, r"line 15: segment\[2\]\.lever\[x\] must be a number and its unit"),
        ('"150 mm"', '"150"', UnitError, "has no unit"),
        ('"150 mm"', '"150 deg"', UnitError, "not a unit of length"),
        ('jerk = "9000 deg/s3"', 'jerk = "9000 m/s3"', UnitError, r"line 29: joint\[1\]\.limits\.jerk: .*angular_jerk"),
        ('jerk = "9000 deg/s3"', 'jerk = "-1 deg/s3"', DecodeError, "above 0"),
        ('low = "-120 deg"', 'low = "130 deg"', ParameterError, "must go up"),
        ('kind = "hinge"', 'kind = "slider"', DecodeError, "must be one of 'fixed', 'hinge'"),
        ('axes = "-y"', 'axes = "up"', DecodeError, "an axis is one of"),
        ('axes = "-y"\n', "", DecodeError, "needs 'axes'"),
        ('axes = "-y"', 'axes = "y z"', ParameterError, "needs 1 axis"),
        ('axes = "y -x z"', 'axes = "y x z"', FrameError, r"segment\[2\]\.axes: .*left-handed"),
        ('euler = ["90 deg"', 'q_pc = [1, 0, 0, 0]\neuler = ["90 deg"', DecodeError, "keep one"),
        ('unit = "imu1"\n', "", DecodeError, "names none"),
        ('parent = "upper"', 'parent = "lower"', ParameterError, "hangs on 'lower'"),
        ('segment = "hand", at', 'segment = "foot", at', ParameterError, "hand is on 'foot'"),
        (
            'name = "elbow"',
            'name = "[elbow]"',
            DecodeError,
            r"line 32: joint\[2\]\.name must be a name without brackets",
        ),
        (
            "lever =",
            "levr =",
            DecodeError,
            r"line 15: segment\[2\] has no key 'levr'; known are .*Did you mean 'lever'\?",
        ),
        ("version = 1", "version = 2", DecodeError, "reads 1"),
        ('plumbob chain"', 'plumbob session"\nsource = 1', DecodeError, "line 2: kind must be .* 'plumbob session'"),
        ("[[joint]]", "[[joint", DecodeError, "not valid TOML"),
        ('base = "fixed"\n', "", DecodeError, r"toml: chain needs the key 'base'"),
        ('name = "elbow"\n', "", DecodeError, r"line 31: joint\[2\] needs the key 'name'"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, old: str, new: str, error: type[PlumbobError], match: str) -> None:
    assert old in ARM
    file = tmp_path / "arm.toml"
    file.write_text(ARM.replace(old, new, 1))
    with pytest.raises(error, match=match) as refused:
        load_chain(file)
    assert str(refused.value).startswith(f"{file}: ")
