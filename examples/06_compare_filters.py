"""Compare filters on one recording, tune one of them, and draw the errors (extra: plot).

It prints::

    complementary  0.49°
    madgwick       2.59°
    mahony         1.07°
    vqf            0.46°
    mekf           0.13°
    mahony, kp 0.05  0.97°
    mahony, kp 0.2   0.65°
    mahony, kp 0.8   1.64°
"""

import matplotlib.pyplot as plt

from plumbob import Filter, evaluate, simulate
from plumbob.core.units import to_deg

buoy = simulate("buoy", frame="NED", sensors="mpu6000+hmc5983", unit="calibrated", seed=2, duration=120.0)


def errors(name, **params):
    track = Filter(name, frame="NED", params=params).process(buoy.imu)
    return evaluate(track, buoy.truth, settle=60.0)


figure, axes = plt.subplots()
for name in ("complementary", "madgwick", "mahony", "vqf", "mekf"):
    found = errors(name)
    print(f"{name:14} {found.summary()['total']['rmse_deg']:.2f}°")
    axes.plot(found.t, to_deg(found.errors["total"]), label=name)
axes.set(xlabel="time [s]", ylabel="total error [°]")
axes.legend()
figure.savefig("errors.png")
for kp in (0.05, 0.2, 0.8):
    found = errors("mahony", kp=kp, ki=0.003, gate="off")
    print(f"mahony, kp {kp:<4}  {found.summary()['total']['rmse_deg']:.2f}°")
