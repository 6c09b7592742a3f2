"""Links, arms and axes of exact motion, and the common heading of a few numbers."""

import numpy as np
import pytest

from plumbob.arm.anchor import anchored, directions_at
from plumbob.arm.filter import Params, UnitSamples
from plumbob.arm.geometry import fit_arms, fit_axes, force_terms, interpolated, lever_matrices, sway
from plumbob.arm.links import GROUND, chain_links, unit_numbers
from plumbob.arm.smoother import Attitudes, keyframe_rows
from plumbob.core.errors import ParameterError
from plumbob.core.units import deg
from plumbob.data.array import UnitMount
from plumbob.data.chain import Chain, Joint, Segment
from plumbob.rotations import quat_multiply
from plumbob.simulation import simulate_chain

T = np.arange(0.0, 10.0, 0.01)


def ideal(name):
    """Exact motion, what units say of it, and their exact attitudes."""
    made = simulate_chain(name, "calibration", frame="ENU", unit="calibrated", seed=4, rate=100.0, duration=15.0)
    riders = [one for one in made.chain.segments if one.unit]
    gyr, acc = (np.stack([getattr(made.array.units[one.unit], triad) for one in riders]) for triad in ("gyr", "acc"))
    q = np.stack([quat_multiply(made.tracks[one.name].q_nb, np.array(one.mount.q_bs)) for one in riders])
    rows = keyframe_rows(made.t, 0.1)
    cov, bias = np.zeros((len(rows), 3 * len(q), 3 * len(q))), np.zeros((len(rows), len(q), 3))
    samples = UnitSamples(made.t, gyr, acc)
    return made, force_terms(samples, Attitudes(made.t, q, rows, cov, bias, 0.0), mean_rate=False)


@pytest.mark.parametrize("name", ["arm7", "teach", "five"])
def test_exact_motion_gives_the_arms_and_axes_of_the_chain(name):
    made, terms = ideal(name)
    for link in chain_links(made.chain):
        arms = fit_arms(terms, link, link.arms + 0.01)
        size, way = np.linalg.eigh(arms.cov[:6, :6])
        if link.parent == GROUND:  # its own arm on the ground feels nothing
            size, way = np.linalg.eigh(arms.cov[3:6, 3:6])
        off = (arms.value - link.arms)[1 if link.parent == GROUND else slice(None)].ravel() @ way
        shown = np.sqrt(size) < 0.03
        assert shown.sum() >= 2
        # forces are compared below 3 Hz, and differences of rates 10 ms apart: right to some millimetres
        np.testing.assert_allclose(off[shown], 0.0, atol=0.003)
        np.testing.assert_allclose(off[~shown], 0.0, atol=0.01 * np.sqrt(6.0) + 0.001)  # where the prior is
        if link.joint.kind != "ball":
            axes = fit_axes(terms, link)
            np.testing.assert_allclose(np.abs(np.einsum("ski,ski->sk", axes.value, link.axes)), 1.0, atol=1e-6)


def test_links_lever_matrices_missing_values_and_sway_in_closed_form():
    # closed form: a quarter turn about z carries the unit's x axis to the segment's y axis
    quarter = UnitMount((np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)), (0.1, 0.0, 0.0))
    chain = Chain(
        "two",
        (Segment("a", "a", quarter), Segment("b", "b", UnitMount(lever_b=(0.0, 0.2, 0.0)))),
        (Joint("j", "a", "b", "hinge", origin=(0.4, 0.0, 0.0), axes=((1.0, 0.0, 0.0),)),),
    )
    (link,) = chain_links(chain)
    np.testing.assert_allclose(link.arms, [[0.0, -0.3, 0.0], [0.0, -0.2, 0.0]], atol=1e-15)
    np.testing.assert_allclose(link.axes[:, 0], [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0]], atol=1e-15)
    assert (link.parent, link.child) == (0, 1)
    # ω² r towards the axis (centripetal acceleration), nothing along it
    spin = np.tile([0.0, 0.0, 2.0], (1, len(T), 1))
    np.testing.assert_allclose(lever_matrices(T, spin)[0, 5] @ [0.3, 0.0, 0.7], [-1.2, 0.0, 0.0], atol=1e-12)
    line = np.stack([T, 2.0 * T, -T], axis=1)[np.newaxis]
    holes = line.copy()
    holes[0, 100:200] = np.nan
    np.testing.assert_allclose(interpolated(holes, T), line, atol=1e-12)
    assert not interpolated(np.full((1, 10, 3), np.nan), T[:10]).any()
    # a = (2π f)² r φ
    assert sway((6.0 * np.pi) ** 2 * 0.2 * 0.01, np.array([[0.2, 0, 0], [0, 0.2, 0]])) == pytest.approx(0.01)


def test_a_root_that_stands_still_needs_no_unit_and_every_other_segment_one():
    joint = (Joint("j", "a", "b", "ball"),)
    grounded = Chain("g", (Segment("a"), Segment("b", "b")), joint, base_fixed=True)
    assert unit_numbers(grounded) == {"a": GROUND, "b": 0}
    with pytest.raises(ParameterError, match="has no unit"):
        unit_numbers(Chain("g", (Segment("a", "a"), Segment("b")), joint, base_fixed=True))
    with pytest.raises(ParameterError, match="has no unit"):
        unit_numbers(Chain("g", (Segment("a"), Segment("b", "b")), joint))


@pytest.mark.parametrize("smooth", [False, True])
def test_the_common_heading_is_the_turn_that_the_field_shows(smooth):
    # a frame that is turned by 0.5 rad from where the field points at North
    turn, rows = 0.5, keyframe_rows(T, 0.1)
    q = np.tile([1.0, 0.0, 0.0, 0.0], (2, len(T), 1))
    field = np.tile([20.0 * np.cos(1.0 - turn), 20.0 * np.sin(1.0 - turn), -40.0], (2, len(T), 1))
    motion = Attitudes(T, q, rows, np.zeros((len(rows), 6, 6)), np.zeros((len(rows), 2, 3)))
    samples = UnitSamples(T, np.zeros_like(field), np.zeros_like(field), field)
    sure = {"turn_sd": np.pi, "north_sd": deg(0.01), "smooth": smooth}
    found = anchored(samples, motion, Params(), north=1.0, **sure)
    assert found.turn[-1] == pytest.approx(turn, abs=1e-2)
    # a field bent by 15° (1 σ) for 10 s at a time cannot be averaged away in 10 s
    assert deg(8.0) < np.sqrt(found.var[-1]) < deg(15.5)
    blind = UnitSamples(T, field, field, np.full_like(field, np.nan))
    assert np.isnan(directions_at(blind, motion)).all()
    assert (anchored(blind, motion, Params(), north=1.0, **sure).var >= np.pi**2).all()  # as unknown as it was
    # behind a gap it may have turned by anything, and the field says by how much
    half = rows.size // 2
    field[:, rows[half] :] = [20.0 * np.cos(1.0 + 1.0), 20.0 * np.sin(1.0 + 1.0), -40.0]
    motion = Attitudes(T, q, rows, motion.cov, motion.bias, np.array([half]))
    found = anchored(samples, motion, Params(), north=1.0, **sure)
    assert found.turn[half - 5] == pytest.approx(turn, abs=0.02)
    assert found.turn[-1] == pytest.approx(-1.0, abs=0.02)
