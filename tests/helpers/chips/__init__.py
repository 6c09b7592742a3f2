"""Emulated chips at register level: what a bus master sees, with the traps of each.

A chip is driven by ``sample(values, t_ns)``: what it feels, by field in the units used inside, and the time, ns; no
chip has a clock of its own. On SPI it answers ``transfer(bytes)``, on I²C ``read(register, count)`` and
``write(register, data)``. Its numbers are made by the catalogue's encoder. Noise, bandwidth and the rate of sampling
are the simulator's: each call of ``sample`` is one sample of the chip.
"""

from tests.helpers.chips.adis16355 import Adis16355
from tests.helpers.chips.adxrs290 import Adxrs290
from tests.helpers.chips.adxrs453 import Adxrs453
from tests.helpers.chips.hmc5983 import Hmc5983
from tests.helpers.chips.mpu3050 import Mpu3050
from tests.helpers.chips.mpu6000 import Mpu6000

__all__ = ["Adis16355", "Adxrs290", "Adxrs453", "Hmc5983", "Mpu3050", "Mpu6000"]
