"""Accelerometers: by gravity in poses at rest."""

from plumbob.calibration.acc.poses import fit_accel, normal_gravity

__all__ = ["fit_accel", "normal_gravity"]
