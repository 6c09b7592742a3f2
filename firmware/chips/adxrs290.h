/* ADXRS290, rates about x and y, SPI mode 3. Sources: K-290 is the Linux driver drivers/iio/gyro/adxrs290.c (01be83ee);
 * `plumbob list devices adxrs290` has the whole map. */
#ifndef ADXRS290_H
#define ADXRS290_H

#include "../registers.h"

#define ADXRS290_BYTES 6

/* Measure, with the 160 Hz low-pass and no high-pass; false where the chip does not answer. Takes 100 ms. */
bool adxrs290_start(const struct hal_chip *chip);

/* Rate x, rate y and temperature, as they are in registers 08 to 0D. The chip has no flag for new data. */
enum reading adxrs290_read(const struct hal_chip *chip, uint8_t data[ADXRS290_BYTES]);

#endif
