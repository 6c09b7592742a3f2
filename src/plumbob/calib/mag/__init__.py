"""Magnetometers: by the field's length alone, with accelerometer or gyroscope, or turning level only."""

from plumbob.calib.mag.alone import fit_mag
from plumbob.calib.mag.level import fit_mag_level
from plumbob.calib.mag.with_acc import fit_mag_acc
from plumbob.calib.mag.with_gyr import fit_mag_gyr

__all__ = ["fit_mag", "fit_mag_acc", "fit_mag_gyr", "fit_mag_level"]
