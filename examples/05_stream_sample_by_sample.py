"""Feed a filter one sample at a time, as a live program does, and keep its state across a restart.

It prints::

     0.0 s  q_nb [1. 0. 0. 0.]  no flags
     5.0 s  q_nb [1. 0. 0. 0.]  no flags
    10.0 s  q_nb [ 0.99  0.1   0.08 -0.01]  no flags
    15.0 s  q_nb [ 0.99  0.13 -0.03  0.  ]  no flags
    the same bits as at once: True
    restored: True
    bias of the gyroscope: [0.01 0.   0.01] °/s
"""

import json

import numpy as np

from plumbob import Filter, flags, simulate
from plumbob.core.units import to_deg

rod = simulate("rod", frame="NED", sensors="mpu6000+hmc5983", unit="calibrated", seed=1, duration=20.0)
live = Filter("mahony", frame="NED")
for i, sample in enumerate(rod.imu.samples()):
    seen = live.update(sample)  # flags of this sample
    if i % 500 == 0:
        print(f"{sample.t_ns / 1e9:4.1f} s  q_nb {live.q_nb.round(2)}  {', '.join(flags.names(seen)) or 'no flags'}")

whole = Filter("mahony", frame="NED").process(rod.imu)
print("the same bits as at once:", np.array_equal(live.q_nb, whole.q_nb[-1]))

saved = json.dumps(live.save())  # a text that a file keeps
print("restored:", np.array_equal(Filter.restore(json.loads(saved)).q_nb, live.q_nb))
print(f"bias of the gyroscope: {to_deg(live.bias_b).round(2)} °/s")
