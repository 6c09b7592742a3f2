"""Measure the noise of a gyroscope at rest: its Allan deviation, its coefficients, and a card for the Kalman filters.

It prints::

    gyr x: N 0.301 °/√h, K not observable
    gyr y: N 0.300 °/√h, K not observable
    gyr z: N 0.301 °/√h, K not observable
    mekf takes 0.301 °/√h from the card
"""

from plumbob import Filter, NoiseCard, allan, simulate
from plumbob.core.units import from_si

still = simulate("static", frame="NED", sensors="mpu6000", unit="calibrated", seed=1, rate=100.0, duration=600.0)
noise = allan(still.imu, triads=("gyr",))
for found in noise.analyses:
    n, k = found.terms["N"], found.terms["K"]
    print(f"{found.name}: N {from_si(n.value, 'deg/rth'):.3f} °/√h, K {'seen' if k.observable else 'not observable'}")

noise.card().save("noise.json")
card = NoiseCard.load("noise.json")
filter_ = Filter("mekf", frame="NED", noise=card)
print(f"mekf takes {from_si(filter_.params.gyr_noise, 'deg/rth'):.3f} °/√h from the card")
