"""The benchmark of the rate table: its bars, and that its figures are those of the errors that it plants."""

import pytest

from benchmarks.harness.calibration_table import SESSIONS, measure_table


@pytest.fixture(scope="module")
def measured():
    return measure_table(range(40))


@pytest.fixture(scope="module")
def figures(measured):
    return [dict(zip(measured.columns, row, strict=True)) for row in measured.rows.values()]


def test_the_bars_are_met_and_are_those_of_the_session_with_both_ends_up(measured, figures):
    assert all(bar.met for bar in measured.bars)
    columns = [bar.name.removeprefix("rate table: ") for bar in measured.bars]
    assert [bar.value for bar in measured.bars] == [figures[1][column] for column in columns]
    assert tuple(measured.rows) == tuple(SESSIONS)


def test_twelve_parameters_leave_what_closed_forms_say(figures):
    simple, coupled = figures[:2]
    # a mounting's 0.1° in a random direction is 0.1°/√2 per entry; the mean of two halves the variance. Medians of the
    # root mean square of 6 are 0.945 of it (χ² with 6 degrees of freedom), and those of 40 trials scatter by 6 %.
    assert simple["misalignment, °"] == pytest.approx(0.945 * 0.1 / 2**0.5, rel=0.24)
    assert coupled["misalignment, °"] == pytest.approx(0.945 * 0.05, rel=0.24)
    # one end up leaves a third of each of three terms of 0.05 °/s/g in the bias; median factor of 3: 0.888; 8 %
    assert simple["bias, °/s"] == pytest.approx(0.888 * 0.05 / 3**0.5, rel=0.32)
    # 42 plateaus of 0.015 °/s
    assert coupled["bias, °/s"] == pytest.approx(0.888 * 0.015 / 42**0.5, rel=0.32)
