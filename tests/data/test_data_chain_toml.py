"""Chains as files: what a file says is what the chain is, and every gap is an error that names its place."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from plumbob.core import errors
from plumbob.data.array import UnitMount
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
