#include "mpu3050.h"

enum {
    CHIP_ID = 0x00,      /* masked with 7E: 68 [K-3050] */
    SMPLRT_DIV = 0x15,   /* samples per second = 1 kHz / (1 + n) [K-3050] */
    DLPF_FS_SYNC = 0x16, /* bits 4:3 range, 2:0 low-pass [K-3050] */
    INT_CFG = 0x17,      /* bit 0 raw data ready [K-3050] */
    INT_STATUS = 0x1A,   /* bit 0 raw data ready [K-3050]; 1B to 22 follow */
    PWR_MGM = 0x3E       /* bit 6 sleep, 2:0 clock [K-3050] */
};

#define RANGE_250_LOW_PASS_5 0x06u /* code 0, and 6: the only one not above 5 Hz, half of 10 frames a second [K-3050] */
#define DIVIDE_BY_10 9u            /* 100 samples a second: none is older than a tenth of a period */
#define CLOCK_OF_GYRO 0x03u        /* PLL on gyroscope z, as the kernel has it; awake [K-3050] */
#define RAW_READY 0x01u
#define START_US 50000u            /* after a change of range or filter [K-3050] */
#define NO_SPI 0u                  /* the chip has I2C alone */

static bool answers(const struct hal_chip *chip)
{
    return registers_match(chip, NO_SPI, CHIP_ID, 0x7E, 0x68);
}

bool mpu3050_start(const struct hal_chip *chip)
{
    if (!answers(chip) || !registers_set(chip, NO_SPI, PWR_MGM, CLOCK_OF_GYRO)
        || !registers_set(chip, NO_SPI, SMPLRT_DIV, DIVIDE_BY_10)
        || !registers_set(chip, NO_SPI, DLPF_FS_SYNC, RANGE_250_LOW_PASS_5)
        || !registers_set(chip, NO_SPI, INT_CFG, RAW_READY))
        return false;
    hal_sleep_until(hal_micros() + START_US);
    return true;
}

enum reading mpu3050_read(const struct hal_chip *chip, uint8_t data[MPU3050_BYTES])
{
    uint8_t burst[1 + MPU3050_BYTES];
    if (!registers_read(chip, NO_SPI, INT_STATUS, burst, sizeof burst))
        return READING_NO_ANSWER;
    for (uint8_t i = 0; i < MPU3050_BYTES; i++)
        data[i] = burst[1 + i];
    return burst[0] & RAW_READY ? READING_NEW : READING_NOT_READY;
}
