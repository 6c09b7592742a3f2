"""Estimate an attitude from your own arrays.

Plumbob takes SI units: rad/s, and specific force in m/s², which points up at rest. `dps` and `g` convert.

It prints::

    at 1 s: pitch 0.0°, roll 0.0°
    at 4 s: pitch 20.1°, roll 0.0°
    at 9 s: pitch 30.0°, roll 0.0°
    heading counts from: free
"""

import numpy as np

from plumbob import Filter, ImuData
from plumbob.core.units import dps, g, to_deg

# Ten seconds at 100 Hz: two at rest, then the nose comes up at 10 °/s for three seconds, then rest again. The noise
# matters: a sensor that repeats a value to the bit is taken to be stuck.
rng = np.random.default_rng(0)
t = 0.01 * np.arange(1000)
rate = np.where((t >= 2.0) & (t < 5.0), 10.0, 0.0)
pitch = np.radians(np.cumsum(rate) * 0.01)
gyr_dps = np.column_stack((0 * t, rate, 0 * t)) + rng.normal(0.0, 0.05, (1000, 3))
acc_g = np.column_stack((np.sin(pitch), 0 * t, -np.cos(pitch)))  # forward, right, down: z reads −1 g when level
acc_g += rng.normal(0.0, 0.002, (1000, 3))

imu = ImuData(t=t, gyr=dps(gyr_dps), acc=g(acc_g))
track = Filter("vqf", frame="NED").process(imu)

for second in (1, 4, 9):
    i = np.searchsorted(track.t, second)
    print(f"at {second} s: pitch {to_deg(track.pitch[i]):.1f}°, roll {abs(to_deg(track.roll[i])):.1f}°")
print(f"heading counts from: {track.north}")
