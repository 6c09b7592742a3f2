"""Gyroscopes: at rest, by hand, in a Ferraris session, on a rate table, over temperature."""

from plumbob.calibration.gyr.ferraris import fit_ferraris, fit_trackball
from plumbob.calibration.gyr.hand import fit_hand
from plumbob.calibration.gyr.rest import fit_rest
from plumbob.calibration.gyr.table import fit_table
from plumbob.calibration.gyr.temperature import fit_temperature

__all__ = ["fit_ferraris", "fit_hand", "fit_rest", "fit_table", "fit_temperature", "fit_trackball"]
