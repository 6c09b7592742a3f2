/* MPU-3050, rates about three axes, I2C. Source: K-3050 is the Linux driver drivers/iio/gyro/mpu3050-core.c (15ea2878);
 * `plumbob list devices mpu3050` has the whole map. */
#ifndef MPU3050_H
#define MPU3050_H

#include "../registers.h"

#define MPU3050_BYTES 8

/* Wake it up at +-250 deg/s (131 LSB per deg/s) with the 5 Hz low-pass; false where it does not answer as an MPU-3050
 * does, or does not hold a setting. Takes 50 ms. */
bool mpu3050_start(const struct hal_chip *chip);

/* Temperature and rates, as they are in registers 1B to 22. */
enum reading mpu3050_read(const struct hal_chip *chip, uint8_t data[MPU3050_BYTES]);

#endif
