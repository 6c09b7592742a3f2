"""Soaks of simulated gyroscopes, few of them: the bars, and that they can be missed."""

import json

import pytest

from benchmarks.harness.calibration_temperature import SOAKS, measure_temperature


@pytest.fixture(scope="module")
def result():
    return measure_temperature(range(6))


def test_a_polynomial_of_the_unit_keeps_the_bar_and_the_papers_figure_does_not(result):
    assert [bar.met for bar in result.bars] == [True, True]
    (_, white, paper, raw), (_, wandering, _, _) = (result.rows[name] for name, *_ in SOAKS)
    assert white < 0.005 < wandering < 0.05  # 36 °/h wander by 0.664 × 0.01 °/s at any time scale
    assert paper > 1.0
    assert raw > 1.0


def test_the_bars_are_those_of_white_noise_and_one_is_open_above(result):
    first = dict(zip(result.columns, result.rows[SOAKS[0][0]], strict=True))
    assert [bar.value for bar in result.bars] == [first["95 %, °/s"], first["by the paper's 0.1 °/s/°C, °/s"]]
    told = json.loads(json.dumps(result.as_dict(), allow_nan=False))
    assert [bar["high"] for bar in told["bars"]] == [0.005, None]
