"""Magnetometers: by the field's length alone, with accelerometer or gyroscope, in use, or turning level only."""

from plumbob.calib.mag.alone import fit_mag
from plumbob.calib.mag.in_use import fit_mag_in_use
from plumbob.calib.mag.level import fit_mag_level
from plumbob.calib.mag.with_acc import fit_mag_acc
from plumbob.calib.mag.with_gyr import fit_mag_gyr

__all__ = ["fit_mag", "fit_mag_acc", "fit_mag_gyr", "fit_mag_in_use", "fit_mag_level"]
