"""Data: what sensors said, what an attitude is, what a unit's calibration and noise are."""

from plumbob.data.imu import (
    ENOUGH,
    TITLES,
    TRIAD_FLAGS,
    TRIADS,
    UNCALIBRATED,
    AttitudeTrack,
    ImuData,
    ImuMeta,
    Range,
    calibration_told,
)

__all__ = [
    "ENOUGH",
    "TITLES",
    "TRIADS",
    "TRIAD_FLAGS",
    "UNCALIBRATED",
    "AttitudeTrack",
    "ImuData",
    "ImuMeta",
    "Range",
    "calibration_told",
]
