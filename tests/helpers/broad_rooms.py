"""Trials of BROAD in a room: what was recorded, and what the reference attitude says of the magnetometer."""

from functools import lru_cache

from benchmarks.harness.room import room_of
from plumbob.fleet.experiments.trials import read_trial


@lru_cache
def room_at(path):
    imu, reference = read_trial(path)
    return imu, room_of(imu, reference)
