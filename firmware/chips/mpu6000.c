#include "mpu6000.h"

enum {
    READ = 0x80,         /* SPI: bit 7 of the address [DS-6050] */
    SMPLRT_DIV = 0x19,   /* samples per second = 1 kHz / (1 + n) [DS-6050] */
    CONFIG = 0x1A,       /* bits 2:0 DLPF_CFG [DS-6050] */
    GYRO_CONFIG = 0x1B,  /* bits 4:3 FS_SEL [DS-6050] */
    ACCEL_CONFIG = 0x1C, /* bits 4:3 AFS_SEL [DS-6050] */
    INT_PIN_CFG = 0x37,  /* bit 1: its second bus is one with the first [K-mpu] */
    INT_ENABLE = 0x38,   /* bit 0 data ready [K-mpu] */
    INT_STATUS = 0x3A,   /* bit 0 data ready, until it is read [DS-6050]; 3B to 48 follow */
    USER_CTRL = 0x6A,    /* bit 4 I2C_IF_DIS [DS-6050] */
    PWR_MGMT_1 = 0x6B,   /* bit 6 sleep, 2:0 clock [DS-6050] */
    WHO_AM_I = 0x75      /* 68 [DS-6050] */
};

#define FS_250_DPS 0x00u    /* FS_SEL 0 [DS-6050] */
#define AFS_4_G 0x08u       /* AFS_SEL 1 [DS-6050] */
#define CLOCK_OF_GYRO 0x01u /* PLL on gyroscope x, which is steadier than the inner RC clock; awake [K-mpu] */
#define SPI_ONLY 0x10u
#define BYPASS 0x02u        /* so that a compass behind it, as on a GY-87, has its own address */
#define DATA_READY 0x01u
#define START_US 30000u     /* of the gyroscopes [DS-6050] */

static bool answers(const struct hal_chip *chip)
{
    return registers_match(chip, READ, WHO_AM_I, 0xFF, 0x68);
}

bool mpu6000_start(const struct hal_chip *chip, enum mpu6000_low_pass low_pass)
{
    if (!answers(chip) || !registers_set(chip, READ, PWR_MGMT_1, CLOCK_OF_GYRO))
        return false;
    if (chip->kind == HAL_SPI ? !registers_set(chip, READ, USER_CTRL, SPI_ONLY)
                              : !registers_set(chip, READ, INT_PIN_CFG, BYPASS))
        return false;
    hal_sleep_until(hal_micros() + START_US);
    return registers_set(chip, READ, SMPLRT_DIV, 0) && registers_set(chip, READ, CONFIG, (uint8_t)low_pass)
           && registers_set(chip, READ, GYRO_CONFIG, FS_250_DPS) && registers_set(chip, READ, ACCEL_CONFIG, AFS_4_G)
           && registers_set(chip, READ, INT_ENABLE, DATA_READY);
}

enum reading mpu6000_read(const struct hal_chip *chip, uint8_t data[MPU6000_BYTES])
{
    uint8_t burst[1 + MPU6000_BYTES];
    if (!registers_read(chip, READ, INT_STATUS, burst, sizeof burst) || !answers(chip))
        return READING_NO_ANSWER;
    for (uint8_t i = 0; i < MPU6000_BYTES; i++)
        data[i] = burst[1 + i];
    return burst[0] & DATA_READY ? READING_NEW : READING_NOT_READY;
}
