"""Noise: how much a sensor at rest wanders, by averaging time."""

from plumbob.noise.allan import independent_differences, overlapping_adev

__all__ = ["independent_differences", "overlapping_adev"]
