"""The teaching-arm paper's scheme; its figures and misprints are tested in tests/papers."""

import numpy as np
import pytest

from plumbob import Frame
from plumbob.arm.array.paper import Scheme, sets_of, teaching_arm
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.units import to_dps
from plumbob.papers.arm import arm_array
from tests.helpers.arm_samples import ImuArray
from tests.helpers.fuzzy_rules import PAPER, by_all_rules


def test_the_parity_has_no_signal_and_one_set_starts_from_its_own_sample_and_two_from_both():
    array, _ = arm_array(3, turns=True)
    sets = sets_of(array)
    rate = to_dps(0.5 * (sets.plus["gyr"] + sets.minus["gyr"]))
    assert rate[:, 2].mean() == pytest.approx(-3.0, abs=0.3)  # the turn; biases of ±0.25 °/s over √2
    assert abs(to_dps(sets.parity["gyr"][:, 2]).mean()) < 0.26
    assert np.abs(np.corrcoef(sets.parity["acc"][:, 2], 0.5 * (sets.plus["acc"] + sets.minus["acc"])[:, 2])[0, 1]) < 0.2
    # Tilt of the mean of both first forces, and of the first set's: roll = atan2(−f_y, −f_z) in NED.
    array, _ = arm_array(4, turns=False)
    sets = sets_of(array)
    for count, force in ((1, sets.plus["acc"][0]), (2, sets.plus["acc"][0] + sets.minus["acc"][0])):
        q = teaching_arm(array, frame=Frame.NED, scheme=Scheme(sets=count)).q_nb[0]
        roll = np.arctan2(2.0 * (q[2] * q[3] + q[0] * q[1]), 1.0 - 2.0 * (q[1] ** 2 + q[2] ** 2))
        assert roll == pytest.approx(np.arctan2(-force[1], -force[2]), abs=1e-12)


@pytest.mark.parametrize(("scheme", "match"), [
    ({"set1": "lqr"}, "law of a set"),
    ({"sets": 3}, "sets"),
    ({"rule_units": "rad"}, "rule_units must be one of deg, deg as rad/s"),
    (5, "six units"),
    (6, "must point along -x"),  # not mounted as they are
])  # fmt: skip
def test_another_array_or_scheme_is_refused(scheme, match):
    array, _ = arm_array(1, turns=False)
    with pytest.raises(ShapeError if isinstance(scheme, int) else ParameterError, match=match):
        if isinstance(scheme, int):
            sets_of(ImuArray({name: array.units[name] for name in list(array.units)[:scheme]}))
        else:
            teaching_arm(array, frame=Frame.NED, scheme=Scheme(**scheme))


def right(q):
    """Matrix of p ↦ p ⊗ q."""
    a, b, c, d = q
    return np.array([[a, -b, -c, -d], [b, a, d, -c], [c, -d, a, b], [d, c, -b, a]])


def seen(q, v):
    """A vector of the navigation frame in the axes of the body, q* ⊗ v ⊗ q, which is quadratic in q."""
    return right(q)[1:] @ right([0.0, *v]) @ (q * [1, -1, -1, -1])


def chain_by_numpy(array, q, known):
    """The whole scheme in matrices, from a first attitude on: both laws, their mean, the filter of set 1's vectors."""
    sets, p, wound, summed, attitudes = sets_of(array), 1e-3 * np.eye(4), np.zeros(3), np.zeros(3), [q]
    rate, identity = 0.5 * (sets.plus["gyr"] + sets.minus["gyr"]), np.eye(4)
    looks = [
        [of[triad] / np.linalg.norm(of[triad], axis=1, keepdims=True) for triad in ("acc", "mag")] for of in sets[:2]
    ]
    for i, dt in enumerate(np.diff(array.t), 1):
        mean, steady = 0.5 * (rate[i - 1] + rate[i]), 0.5 * (np.radians(PAPER[2] * wound) + 0.02 * summed)
        turn = dt * (mean + steady)
        size = np.linalg.norm(turn)
        ahead = right([np.cos(size / 2), *(np.sin(size / 2) * turn / size)]) @ q
        e1, e2 = (sum(np.cross(v[i], seen(ahead, d)) for v, d in zip(of, known, strict=True)) for of in looks)
        wound, summed = np.clip(wound + dt * np.degrees(e1), -3.0, 3.0), summed + dt * e2
        fuzzy = [by_all_rules(e, w, *PAPER) for e, w in zip(np.degrees(e1), wound, strict=True)]
        half = 0.5 * dt * (mean + 0.5 * (np.radians(fuzzy) + 0.8 * e2 + 0.02 * summed))
        f = right([1.0, *half]) / np.sqrt(1.0 + half @ half)
        q = f @ q
        p = f @ p @ f.T + 0.25 * dt**2 * 1e-4 * (identity - np.outer(q, q))  # Ξ Ξᵀ = 1 − q qᵀ
        steps = [[(seen(q + s, d) - seen(q - s, d)) / 2e-6 for s in 1e-6 * identity] for d in known]
        h, z = np.hstack(steps).T, np.hstack([v[i] - seen(q, d) for v, d in zip(looks[0], known, strict=True)])
        gain = p @ h.T @ np.linalg.inv(h @ p @ h.T + 1e-3 * np.eye(6))
        q, p = q + gain @ z, (identity - gain @ h) @ p
        q = q / np.linalg.norm(q)
        attitudes.append(q)
    return np.array(attitudes)


@pytest.mark.parametrize("turns", [False, True])
def test_the_whole_chain_is_that_of_a_few_lines_of_matrices(turns):
    array, _ = arm_array(5, turns=turns)
    ours = teaching_arm(array, frame=Frame.NED).q_nb
    known = [0.0, 0.0, -1.0], [np.cos(np.radians(50.0)), 0.0, np.sin(np.radians(50.0))]
    theirs = chain_by_numpy(array, ours[0], known)
    assert np.degrees(2.0 * np.arccos(np.minimum(np.abs(np.sum(ours * theirs, axis=1)), 1.0))).max() < 1e-4
