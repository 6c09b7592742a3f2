"""Fifteen real recordings with a reference, read once: figures of other programs, and those that may not grow."""

import pytest

from plumbob.filters.offline import Stage
from plumbob.fleet.experiments.trials import measure_accuracy, trials_in
from tests.helpers import slow_as_python

STAGES = (
    Stage("mahony", {"kp": 0.5, "ki": 0.03, "gate": None}, label="as the paper"),
    Stage("mahony", {"kp": 0.5, "ki": 0.002, "gate": 2.0}, label="gated"),
    Stage("complementary", {}),
    Stage("vqf", {}),
)


@slow_as_python
def test_figures_of_real_trials(broad_folder):
    """Mean over the trials, the buoy paper's gains, no gate: ahrs 0.4.0 and qmt 0.2.4 both give 20.03/19.17/5.666°."""
    accuracy = measure_accuracy(trials_in(broad_folder), STAGES)
    assert len(accuracy.trials) == 15
    mean = accuracy.mean()
    paper = mean["as the paper"]
    assert paper["total_rmse_deg"] == pytest.approx(20.03, abs=0.3)
    assert paper["heading_rmse_deg"] == pytest.approx(19.17, abs=0.3)
    assert paper["inclination_rmse_deg"] == pytest.approx(5.666, abs=0.3)
    assert mean["gated"]["total_rmse_deg"] < 0.5 * paper["total_rmse_deg"]
    assert mean["complementary"]["total_rmse_deg"] < 0.5 * 20.03
    assert mean["complementary"]["inclination_rmse_deg"] < 5.666 and mean["vqf"]["total_rmse_deg"] <= 2.60
    assert mean["vqf"]["inclination_rmse_deg"] <= 0.78
