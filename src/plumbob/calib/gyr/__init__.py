"""Gyroscopes: at rest, by hand, in a Ferraris session, on a rate table, over temperature."""

from plumbob.calib.gyr.ferraris import fit_ferraris
from plumbob.calib.gyr.hand import fit_hand
from plumbob.calib.gyr.preset import fit_trackball
from plumbob.calib.gyr.rest import fit_rest
from plumbob.calib.gyr.table import fit_table
from plumbob.calib.gyr.temperature import fit_temperature

__all__ = ["fit_ferraris", "fit_hand", "fit_rest", "fit_table", "fit_temperature", "fit_trackball"]
