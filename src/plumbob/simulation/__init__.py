"""Simulation: recordings of which the truth is known exactly.

``simulate("buoy", frame=Frame.NED, sensors="mpu6000+hmc5983", unit="calibrated", seed=1)`` gives a recording, its
true attitude, and the calibration and noise of the unit that recorded it.

``simulate_chain("arm", "calibration", frame=Frame.NED, sensors="mpu6000+hmc5983", unit="calibrated", seed=1)`` does so
for the units on the segments of a chain.

Not modelled: the Earth's rotation, filters and bandwidths of sensors, nonlinearity, and vibration rectification.
"""

from typing import TYPE_CHECKING

from plumbob.core import lazily
from plumbob.simulation.errors import TriadErrors
from plumbob.simulation.motion import ConingMotion, EulerMotion, GimbalMotion, Motion, PoseMotion, Scenario, Truth
from plumbob.simulation.presets import DataSheetFigure, Module, Preset, draw_module, preset, preset_names
from plumbob.simulation.scenarios import SCENARIOS, scenario
from plumbob.simulation.signals import earth_field
from plumbob.simulation.simulation import KINDS, Simulation, simulate

if TYPE_CHECKING:
    from plumbob.simulation.arrays import UnitErrors, draw_array
    from plumbob.simulation.bodies import ChainMotion, ChainSimulation, simulate_chain
    from plumbob.simulation.chains import CHAINS, SoftTissue, named_chain
    from plumbob.simulation.fields import BentRegion, Dipole, Disturbance
    from plumbob.simulation.programs import PROGRAMS, ChainProgram, named_program, waypoints

__getattr__, __dir__ = lazily(__name__, {
    "CHAINS": "chains", "PROGRAMS": "programs", "BentRegion": "fields", "ChainMotion": "bodies",
    "ChainSimulation": "bodies", "Dipole": "fields", "Disturbance": "fields", "ChainProgram": "programs",
    "SoftTissue": "chains", "UnitErrors": "arrays", "draw_array": "arrays", "named_chain": "chains",
    "named_program": "programs", "simulate_chain": "bodies", "waypoints": "programs",
})  # fmt: skip

__all__ = [
    "CHAINS", "KINDS", "PROGRAMS", "SCENARIOS", "BentRegion", "ChainMotion", "ChainProgram", "ChainSimulation",
    "ConingMotion", "DataSheetFigure", "Dipole", "Disturbance", "EulerMotion", "GimbalMotion", "Module", "Motion",
    "PoseMotion", "Preset", "Scenario", "Simulation", "SoftTissue", "TriadErrors", "Truth", "UnitErrors", "draw_array",
    "draw_module", "earth_field", "named_chain", "named_program", "preset", "preset_names", "scenario", "simulate",
    "simulate_chain", "waypoints",
]  # fmt: skip
