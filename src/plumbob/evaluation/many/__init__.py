"""Many evaluations in one table: filters on folders of recordings, or on a scenario with many seeds."""

from plumbob.evaluation.many.accuracy import Accuracy, measure_accuracy, trials_in
from plumbob.evaluation.many.contender import OurFilter
from plumbob.evaluation.many.peers import peer_runs, peers
from plumbob.evaluation.many.scenario import MonteCarlo, measure_scenario

__all__ = [
    "Accuracy",
    "MonteCarlo",
    "OurFilter",
    "measure_accuracy",
    "measure_scenario",
    "peer_runs",
    "peers",
    "trials_in",
]
