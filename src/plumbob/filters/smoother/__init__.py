"""The smoother: the attitude of a whole recording, each sample estimated from what came before and after it.

A Kalman filter runs forward over keyframes about 50 ms apart, a sweep backward makes each of its estimates one of the
whole recording, and all is repeated from the smoothed attitude until nothing depends on how it began::

    samples ─ keyframes ─ rest ─┬─ forward, backward: gyroscope and accelerometer, several first biases   (inertial)
                                │        └ the hypothesis that leaves the least velocity
                                ├─ a field that turns with the sensor                         (sensor_fixed_field)
                                ├─ reference field, heading of the recording                              (field)
                                ├─ forward, backward, twice: all sensors, each field weighted by its fit  (sweeps)
                                └─ attitude, bias and covariance at every sample                          (smoothing)

``model`` has the states and parameters, ``sweeps`` the two passes; they hold the equations. Without a lag, ``live``
looks at the past now and then, and ``causal`` filters on between two looks; ``per_sample`` takes a sample at a time.
"""

from typing import TYPE_CHECKING

from plumbob.core import lazily

if TYPE_CHECKING:
    from plumbob.filters.smoother.model import Params
    from plumbob.filters.smoother.smoothing import FixedLag, Smoother

__all__ = ["FixedLag", "Params", "Smoother"]

__getattr__, __dir__ = lazily(
    __name__,
    {"FixedLag": "smoothing", "Params": "model", "Smoother": "smoothing"},
)
