/* MPU-6000 (SPI mode 0 or I2C) and MPU-6050 (I2C), rates and specific forces. Sources: DS-6050 is the data sheet
 * PS-MPU-6000A 3.4 with the register map, K-mpu the Linux driver drivers/iio/imu/inv_mpu6050 (010e85f9);
 * `plumbob list devices mpu6000` has the whole map. */
#ifndef MPU6000_H
#define MPU6000_H

#include "../registers.h"

#define MPU6000_BYTES 14

/* DLPF_CFG: bandwidth of rates and forces; both are sampled at 1 kHz [DS-6050]. */
enum mpu6000_low_pass { MPU6000_98_HZ = 2, MPU6000_42_HZ = 3, MPU6000_20_HZ = 4, MPU6000_10_HZ = 5, MPU6000_5_HZ = 6 };

/* Wake it up at +-250 deg/s (131 LSB per deg/s) and +-4 g (8192 LSB per g); false where it does not answer as an MPU-6000
 * does, or does not hold a setting. Takes 30 ms. */
bool mpu6000_start(const struct hal_chip *chip, enum mpu6000_low_pass low_pass);

/* Forces, temperature and rates, as they are in registers 3B to 48. */
enum reading mpu6000_read(const struct hal_chip *chip, uint8_t data[MPU6000_BYTES]);

#endif
