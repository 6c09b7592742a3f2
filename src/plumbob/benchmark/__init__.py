"""Benchmarks: the same filters on many recordings or many simulated seeds, with one table at the end."""

from plumbob.benchmark.accuracy import Accuracy, measure_accuracy, trials_in
from plumbob.benchmark.scenario import MonteCarlo, measure_scenario

__all__ = ["Accuracy", "MonteCarlo", "measure_accuracy", "measure_scenario", "trials_in"]
