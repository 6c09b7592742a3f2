"""Accelerometers: by gravity in poses at rest."""

from plumbob.calib.acc.gravity import normal_gravity
from plumbob.calib.acc.poses import fit_accel

__all__ = ["fit_accel", "normal_gravity"]
