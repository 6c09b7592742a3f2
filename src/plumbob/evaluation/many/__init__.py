"""Many evaluations in one table: estimators on folders of recordings, or on a scenario with many seeds."""

from plumbob.evaluation.many.accuracy import Accuracy
from plumbob.evaluation.many.peers import peer_runs
from plumbob.evaluation.many.scenario import MonteCarlo, measure_scenario
from plumbob.evaluation.many.trials import measure_accuracy, trials_in
from plumbob.evaluation.many.tuning import Tuning, tune
from plumbob.evaluation.many.variants import CHANGES, changed

__all__ = [
    "CHANGES",
    "Accuracy",
    "MonteCarlo",
    "Tuning",
    "changed",
    "measure_accuracy",
    "measure_scenario",
    "peer_runs",
    "trials_in",
    "tune",
]
