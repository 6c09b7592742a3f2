"""Magnetometers: by the field's length alone, with accelerometer or gyroscope, in use, or turning level only."""

from plumbob.calibration.mag.ellipsoid import fit_mag, fit_mag_level
from plumbob.calibration.mag.in_use import fit_mag_in_use
from plumbob.calibration.mag.with_acc import fit_mag_acc
from plumbob.calibration.mag.with_gyr import fit_mag_gyr

__all__ = ["fit_mag", "fit_mag_acc", "fit_mag_gyr", "fit_mag_in_use", "fit_mag_level"]
