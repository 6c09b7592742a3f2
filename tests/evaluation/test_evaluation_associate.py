"""Association: exact stamps keep their bits, interpolation follows constant rates, holes are never bridged."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from plumbob.core.errors import ClockError, ParameterError
from plumbob.core.time import GAP_FACTOR, longest_bridged, to_ns
from plumbob.evaluation.align import Fate, associate
from plumbob.rotations import quat_angle, quat_from_rotvec


def spin(t):
    """Constant rate of 1 rad/s about a slanted axis: its attitude at any time is known, [Sola2017] (101)."""
    return quat_from_rotvec(np.multiply.outer(t, np.array([2.0, -1.0, 2.0]) / 3.0))


def test_same_stamps_keep_every_bit(track, reference, t):
    """An estimate does not choose its samples; those that it does not know are counted."""
    match = associate(track(t, reference.q_nb, score=np.zeros(t.size, dtype=bool)), reference)
    assert match.q_ref.tobytes() == reference.q_nb.tobytes()
    assert match.exact.all()
    assert match.counts() == {Fate.SCORED: t.size}
    q = reference.q_nb.copy()
    q[7:9] = np.nan
    assert associate(track(t, q), reference).counts() == {Fate.SCORED: t.size - 2, Fate.ESTIMATE_UNKNOWN: 2}


def test_slerp_is_exact_at_constant_rate_and_ends_are_not_extrapolated(track):
    slow, fast = np.arange(60) / 10.0, np.sort(np.random.default_rng(0).uniform(0.0, 5.9, 500))
    match = associate(track(fast, spin(fast)), track(slow, spin(slow)))
    # stamps are kept to the nanosecond, and the body turns at 1 rad/s
    assert quat_angle(match.q_ref, spin(fast)).max() < 2e-9 and not match.exact.any()
    t = np.arange(100) / 10.0
    match = associate(track(t, spin(t)), track(t[20:50], spin(t[20:50])))
    assert match.counts() == {Fate.SCORED: 30, Fate.OUTSIDE: 70}
    assert np.isnan(match.q_ref[:20]).all() and np.isnan(match.q_ref[50:]).all()
    t = np.arange(3) / 10.0
    match = associate(track(t, spin(t)), track(t[1:2], spin(t[1:2])))
    assert match.counts() == {Fate.SCORED: 1, Fate.OUTSIDE: 2}


def test_gaps_of_the_reference_of_more_than_five_median_steps_are_not_bridged_or_of_a_stated_one(track):
    fine, coarse = np.arange(200) / 100.0, np.arange(40) / 20.0
    holed = np.delete(coarse, np.arange(10, 20))  # from 0.45 s to 1.0 s
    match = associate(track(fine, spin(fine)), track(holed, spin(holed)))
    inside = (fine > 0.45 + 1e-9) & (fine < 1.0 - 1e-9)
    assert (match.fate[inside] == Fate.GAP).all() and np.isnan(match.q_ref[inside]).all()
    assert (match.fate[~inside & (fine <= 1.95)] == Fate.SCORED).all()
    t = np.array([0.0, 0.01, 0.02, 0.03, 0.08, 0.09, 0.10, 0.15 + 1e-9, 0.16])
    reference = track(t, spin(t))
    assert longest_bridged(to_ns(reference.t)) == GAP_FACTOR * 0.01
    match = associate(track(np.array([0.05, 0.12]), spin(np.array([0.05, 0.12]))), reference)
    assert match.fate.tolist() == [Fate.SCORED, Fate.GAP]
    t = np.arange(50) / 10.0
    late = track(t[:-1] + 0.05, spin(t[:-1] + 0.05))
    assert associate(late, track(t, spin(t)), max_gap=0.1).counts() == {Fate.SCORED: 49}


def test_unknown_and_masked_rows_are_left_out_and_settling_counts_from_the_first_sample(track):
    t, fine = np.arange(50) / 10.0, np.arange(490) / 100.0
    q = spin(t)
    q[20] = np.nan  # 2.0 s, so that nothing between 1.9 s and 2.1 s is known
    match = associate(track(fine, spin(fine)), track(t, q))
    hidden = (fine > 1.9 + 1e-9) & (fine < 2.1 - 1e-9)
    assert np.array_equal(match.fate == Fate.REFERENCE_UNKNOWN, hidden)
    assert np.isfinite(match.q_ref[~hidden]).all()
    t, mid = np.arange(10) / 10.0, np.arange(9) / 10.0 + 0.05
    score = np.ones(10, dtype=bool)
    score[5] = False
    match = associate(track(mid, spin(mid)), track(t, spin(t), score=score))
    assert np.flatnonzero(match.fate == Fate.MASKED).tolist() == [4, 5]
    exact = associate(track(t, spin(t)), track(t, spin(t), score=score))
    assert np.flatnonzero(exact.fate == Fate.MASKED).tolist() == [5]
    t = 3.0 + np.arange(100) / 10.0
    match = associate(track(t, spin(t)), track(t, spin(t)), settle=2.0)
    assert match.counts() == {Fate.SCORED: 80, Fate.SETTLING: 20}
    assert np.isfinite(match.q_ref).all()


def test_wrong_settings_and_no_common_time_are_refused(track):
    t = np.arange(10) / 10.0
    here, late = track(t, spin(t)), track(t + 5.0, spin(t))
    with pytest.raises(ClockError, match=r"spans 0\.000 to 0\.900 s, the reference 5\.000 to 5\.900 s"):
        associate(here, late)
    for wrong in ({"settle": float("nan")}, {"max_gap": -0.1}):
        with pytest.raises(ParameterError, match=next(iter(wrong))):
            associate(here, here, **wrong)


@given(st.data())
def test_every_sample_has_one_fate_and_only_scored_ones_need_a_reference(track, data):
    stamps = st.lists(st.integers(0, 300), min_size=2, max_size=40, unique=True)
    est = np.sort(np.array(data.draw(stamps))) / 100.0
    ref = np.sort(np.array(data.draw(stamps))) / 100.0
    q = spin(ref)
    q[np.array(data.draw(st.lists(st.booleans(), min_size=ref.size, max_size=ref.size)), dtype=bool)] = np.nan
    try:
        match = associate(track(est, spin(est)), track(ref, q))
    except ClockError:
        assert est[-1] < ref[0] or est[0] > ref[-1] or not set(est) & set(ref)
        return
    assert sum(match.counts().values()) == est.size
    assert np.array_equal(np.isfinite(match.q_ref).all(axis=1), match.scored)
    assert quat_angle(match.q_ref[match.scored], spin(est[match.scored])).max(initial=0.0) < 1e-7
