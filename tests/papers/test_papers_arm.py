"""The teaching-arm paper's study in parts: few seeds, closed forms, misprints that fail as they are known to."""

import numpy as np
import pytest

from plumbob import simulate
from plumbob.arm.array.paper import Scheme
from plumbob.core.units import dps
from plumbob.papers import arm
from plumbob.papers.studies import Study

FEW = 40


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return Study("arm", tmp_path_factory.mktemp("arm"), 2)


@pytest.fixture(scope="module")
def tables(study):
    """Statistics at rest and in the turn, and errors of one run through bytes of each."""
    return {turns: arm.table_part(study, turns, FEW) for turns in (False, True)}


def test_the_figures_of_both_tables_are_those_of_runs_through_bytes_and_none_causal_is_better(tables, study):
    """papers.md 003, its own second look: static and dynamic std of 200 seeds; means of 40 scatter by some per cent."""
    (rest, _), (turn, _) = tables.values()
    for stats, expected in (
        (rest, {"fuzzy": (0.109, 0.103, 0.143), "control": (0.113, 0.104, 0.152)}),
        (turn, {"fuzzy": (0.237, 0.224, 0.300), "control": (0.225, 0.212, 0.305)}),
    ):
        for name, values in expected.items():
            assert stats[name].std == pytest.approx(values, rel=0.12)
    # the mean of |b| of U(±0.13 °/s) over 30 s: 0.065 · 30/√12 = 0.563°, which scatters by 9 % over 40 seeds
    assert rest["none"].std == pytest.approx(0.563, rel=0.25)
    # the step from PI to fuzzy PI is that of averaging two sets
    assert rest["fuzzy"].std == pytest.approx(rest["control"].std, rel=0.1)
    assert rest["sum"].std == pytest.approx([0.229, 0.233, 0.279], rel=0.1)  # papers.md: noisier
    # Linear Kalman filter of the same noise, which knows the motion: nothing causal is better by more than chance.
    for name, units in (("two", 2), ("six", 6)):
        ratio = tables[True][0][name].std / arm.least(True, units, runs=400)
        assert ratio == pytest.approx(1.0, abs=0.1)
    # Counts of MPU-6000 and HMC5983 are far below the noise: the std of one run is that of the seeds.
    for stats, errors in tables.values():
        assert {len(e) for e in errors.values()} == {300}
        assert (arm.statistics(errors["fuzzy"])[0] < 2.0 * stats["fuzzy"].std).all()
        assert (arm.statistics(errors["six"])[0] < arm.statistics(errors["fuzzy"])[0]).all()
    _, monitored, _ = arm.broken_at_rest(study)
    assert [(fault.unit, fault.triad) for fault in monitored.faults] == [("u3", "gyr")]
    assert 31.0 <= monitored.faults[0].begin <= 36.0


def test_the_direct_draws_are_those_of_the_simulator():
    """Noise and spread of the bias of arm:rest and arm:turn, and the same body: what is left without noise is zero."""
    for turns, sensors, noise in ((False, "arm:rest", arm.REST), (True, "arm:turn", arm.TURN)):
        made = simulate(
            "arm", frame="NED", sensors=sensors, unit="random", seed=3, rate=10.0,
            **({} if turns else {"turn": "0 deg"}),
        )  # fmt: skip
        array, truth = arm.arm_array(3, turns=turns, noise=arm.UnitErrors(0.0, 0.0, 0.0, 0.0))
        clean, there = array.units["u1"], made.imu  # u1 is aligned with the body
        assert made.truth.q_nb == pytest.approx(truth, abs=1e-12)
        for triad in ("gyr", "acc", "mag"):
            left = getattr(there, triad) - getattr(clean, triad)
            assert left.std(axis=0) == pytest.approx(getattr(noise, triad), rel=0.15)
        assert np.abs(there.gyr.mean(axis=0) - clean.gyr.mean(axis=0)).max() < noise.bias + dps(0.05)


def test_recovery_shows_a_mistake_of_units_and_has_its_closed_form():
    """papers.md: fuzzy about 49 s, the sum table 5 to 7 s; with the filter 1.5 s whatever the regulator."""
    times = {name: arm.recovery(scheme)[0] for name, scheme in arm.RECOVERIES.items()}
    assert (times["fuzzy"], times["sum"]) == (pytest.approx(49.0, abs=0.5), pytest.approx(7.4, abs=0.2))
    assert (times["sum_alone"], times["ekf"]) == (pytest.approx(5.1, abs=0.2), pytest.approx(1.5, abs=0.05))
    # two coupled modes of roll and yaw; the fast one and the size of 10° are left out of the closed form
    assert times["control"] == pytest.approx(arm.slow_mode(), rel=0.03)
    assert arm.recovery(Scheme(set1="pi", ekf=False), (5.77, 5.77, 5.77))[0] == pytest.approx(34.0, abs=0.5)


WRONG = {
    "raw.rate": (3.0, np.inf), "raw.yaw": (1.0, np.inf), "units.deg": (11.0, 20.0), "units.rad": (0.0, np.inf),
    "units.rad.recovery": (30.0, np.inf), "late": (0.16, 0.21), "sign": (170.0, np.inf), "gain": (5.0, np.inf),
}  # fmt: skip
"""papers.md: what the printed forms give."""


def test_every_printed_form_fails_as_it_is_known_to(study, tables):
    arm.misprints_part(study, 10, *(stats for stats, _ in tables.values()))
    forms = study.values["forms"]
    assert forms.keys() == WRONG.keys()
    assert [key for key, (wrong, _) in forms.items() if not WRONG[key][0] <= wrong <= WRONG[key][1]] == []
    assert forms["raw.rate"][0] == pytest.approx(5.0 / np.sqrt(2.0), rel=0.01)  # the signal cancels
    wrong, right = forms["units.rad"]
    assert wrong <= 0.5 * right  # a table at rest alone would choose the mistake
    assert forms["units.rad.recovery"][0] > 6.0 * forms["units.rad.recovery"][1]
    assert forms["late"][1] == pytest.approx(0.015, abs=0.003)
    # Mamdani's rules are another regulator: gain 2.18 · 3 = 6.5 instead of 4.5, 8.02 of 9, up to 1.99 apart
    read = [study.values[key] for key in ("gain_product", "reach", "apart")]
    assert read == pytest.approx([4.5, 8.02, 1.99], abs=0.03)
    assert study.values["gain"] == pytest.approx(6.5, abs=0.2)
    # the stated noise gives PI .010/.007/.014, fuzzy-PI .006 to .017 in place of .157/.143/.206 and .096/.098/.142
    outcomes = study.outcomes
    assert outcomes["stated.pi"].faithful == pytest.approx(0.010, abs=0.002)
    assert outcomes["stated.fuzzy"].faithful < 0.1 * outcomes["stated.fuzzy"].paper
    # 0.8 / 2π = 0.127 Hz; 2π · 15 = 94.2 1/s; half of 10 Hz
    gains = [outcomes[f"gain.{key}"].faithful for key in ("corner", "needed", "nyquist")]
    assert gains == pytest.approx([0.1273, 94.25, 5.0], rel=1e-3)
    assert all(outcomes[f"pair.{key}"].met for key in ("bias", "noise", "parity"))


def test_the_parity_test_is_that_of_the_prototype():
    """papers.md: 198/200/200/200 of 200 found, median 11.8/1.4/0.7/0.3 s, 0 false alarms in 200 × 60 s."""
    counts, times = zip(*(arm.parity_test(step, 1) for step in (0.0, 0.1, 0.2, 0.3, 0.5)), strict=True)
    assert (counts[0], counts[1] >= 195) == (0, True)
    assert times[2:] == pytest.approx([1.4, 0.7, 0.3], abs=0.11)


@pytest.mark.parametrize("moving", [False, True])
def test_a_fault_of_one_axis_is_isolated(moving):
    stats = arm.watched("biased", "gyr", moving=moving, seeds=15)
    assert (stats["detected"], stats["isolated"]) == (100.0, 100.0)
    assert stats["median"] < (5.0 if moving else 2.0)
    assert arm.two_units() == (True, 0)  # two sensors cannot isolate
