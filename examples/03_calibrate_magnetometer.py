"""Calibrate accelerometer and magnetometer of one unit from a capture by hand, and correct a later recording.

It prints::

    hard iron [-3.2  4.3  1.3] µT: good
    predicted heading error 0.01° (1 sd)
    as measured  |mag| 49.6 µT
    calibrated   |mag| 51.0 µT
"""

import numpy as np

from plumbob import apply_card, calibrate, simulate
from plumbob.core.units import to_deg

unit = {"frame": "NED", "sensors": "mpu6000+hmc5983", "unit": "random", "seed": 3}
by_hand = simulate("poses", **unit).imu  # the unit held still in forty poses

accel = calibrate(by_hand, "accel")
card = calibrate(by_hand, "mag", calibration=accel.card).card
card.save("card.json")

print(f"hard iron {card.mag.bias.round(1)} µT: {card.mag.quality.grade}")
print(f"predicted heading error {to_deg(card.mag.quality.heading_sd):.2f}° (1 sd)")
later = simulate("static", duration=10.0, **unit).imu
for name, imu in (("as measured", later), ("calibrated", apply_card(card, later))):
    print(f"{name:12} |mag| {np.nanmean(np.linalg.norm(imu.mag, axis=1)):.1f} µT")
