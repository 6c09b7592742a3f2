/* HMC5983 (SPI mode 3 or I2C) and HMC5883L (I2C), the field along three axes. Sources: DS-5883L is the data sheet of the
 * HMC5883L, whose registers the HMC5983 has too, K-5843 the Linux driver drivers/iio/magnetometer/hmc5843_core.c
 * (02e2af20), PX4 its HMC5883.cpp; `plumbob list devices hmc5983` has the whole map. */
#ifndef HMC5983_H
#define HMC5983_H

#include "../registers.h"

#define HMC5983_BYTES 6
#define HMC5983_MEASURE_US 6667u /* from the command to the data: 6 ms [DS-5883L], 150 Hz at most [PX4] */

/* What the chip itself gives for a channel that cannot be measured, F000 [DS-5883L p. 15], for all three. */
extern const uint8_t HMC5983_NO_FIELD[HMC5983_BYTES];

/* Choose +-1.3 gauss (1090 LSB per gauss); false where the chip does not answer. Takes 10 ms. */
bool hmc5983_start(const struct hal_chip *chip);

/* Measure once, ready after HMC5983_MEASURE_US. */
bool hmc5983_measure(const struct hal_chip *chip);

/* X, Z and Y, as they are in registers 03 to 08, of the last measurement; those of READING_NEW alone mean something. */
enum reading hmc5983_read(const struct hal_chip *chip, uint8_t data[HMC5983_BYTES]);

#endif
