"""From bytes or a recording to an attitude: one line of stages for live streams, replays and simulations.

`offline` takes a whole recording. `session` describes a live line in TOML; `line.Line` is that line: decode, stamp,
calibrate, estimate, hand to the sinks. A replay feeds it the recorded bytes and gives the same bits.
"""

from plumbob.pipeline.offline import (
    CHUNK,
    SUFFIX,
    Progress,
    Stage,
    calibrated,
    estimate,
    filter_of,
    navigation_frame,
    read_any,
    recalibrated,
    with_noise,
)

__all__ = [
    "CHUNK",
    "SUFFIX",
    "Progress",
    "Stage",
    "calibrated",
    "estimate",
    "filter_of",
    "navigation_frame",
    "read_any",
    "recalibrated",
    "with_noise",
]
