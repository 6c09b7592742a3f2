"""Benchmarks: filters on many recordings, seeds or faults, calibrations of many units; one table at the end."""

from plumbob.benchmark.accuracy import Accuracy, measure_accuracy, trials_in
from plumbob.benchmark.channel import ChannelTest, measure_channel
from plumbob.benchmark.contender import OurFilter
from plumbob.benchmark.decoder_streams import user_frame
from plumbob.benchmark.decoders import Decoders, measure_decoders
from plumbob.benchmark.fault_cases import ARGUMENTS, CASES, Case, choose, listing
from plumbob.benchmark.faults import Faults, measure_faults
from plumbob.benchmark.peer_runs import peer_runs
from plumbob.benchmark.peers import peers
from plumbob.benchmark.scenario import MonteCarlo, measure_scenario

__all__ = [
    "ARGUMENTS",
    "CASES",
    "Accuracy",
    "Case",
    "ChannelTest",
    "Decoders",
    "Faults",
    "MonteCarlo",
    "OurFilter",
    "choose",
    "listing",
    "measure_accuracy",
    "measure_channel",
    "measure_decoders",
    "measure_faults",
    "measure_scenario",
    "peer_runs",
    "peers",
    "trials_in",
    "user_frame",
]
