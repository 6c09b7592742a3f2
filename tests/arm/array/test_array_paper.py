"""The teaching-arm paper's scheme; its figures and misprints are tested in tests/papers."""

import numpy as np
import pytest

from plumbob import Frame
from plumbob.arm.array.paper import Scheme, paper, sets_of
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.units import to_dps
from plumbob.papers.arm import arm_array
from tests.helpers.arm_samples import ImuArray


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
        q = paper(array, frame=Frame.NED, scheme=Scheme(sets=count)).q_nb[0]
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
            paper(array, frame=Frame.NED, scheme=Scheme(**scheme))
