"""Simulation: recordings of which the truth is known exactly.

``simulate("buoy", frame=Frame.NED, sensors="mpu6000+hmc5983", unit="calibrated", seed=1)`` gives a recording, its
true attitude, and the calibration and noise of the unit that recorded it.

Not modelled: the Earth's rotation, filters and bandwidths of sensors, nonlinearity, and vibration rectification.
"""

from plumbob.simulation.errors import TriadErrors
from plumbob.simulation.motion import ConingMotion, EulerMotion, GimbalMotion, Motion, PoseMotion, Scenario, Truth
from plumbob.simulation.presets import Figure, Module, Preset, draw_module, preset, preset_names
from plumbob.simulation.scenarios import SCENARIOS, scenario
from plumbob.simulation.signals import earth_field
from plumbob.simulation.simulation import KINDS, Simulation, simulate

__all__ = [
    "KINDS",
    "SCENARIOS",
    "ConingMotion",
    "EulerMotion",
    "Figure",
    "GimbalMotion",
    "Module",
    "Motion",
    "PoseMotion",
    "Preset",
    "Scenario",
    "Simulation",
    "TriadErrors",
    "Truth",
    "draw_module",
    "earth_field",
    "preset",
    "preset_names",
    "scenario",
    "simulate",
]
