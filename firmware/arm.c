/* The teaching arm: six boards of MPU-6050 and HMC5883L, which have the same addresses, behind a TCA9548A on one I2C bus;
 * 10 frames a second. Unit u1 is on its channel 0. */
#include "board.h"
#include "chips/hmc5983.h"
#include "chips/mpu6000.h"

#define UNITS 6u

static const struct hal_chip SWITCH = {.kind = HAL_I2C, .bus = 0, .select = 0x70, .khz = 400};
static const struct hal_chip IMU = {.kind = HAL_I2C, .bus = 0, .select = 0x68, .khz = 400};
static const struct hal_chip COMPASS = {.kind = HAL_I2C, .bus = 0, .select = 0x1E, .khz = 400};

/* Its one register: bit n connects channel n [TCA9548A data sheet SCPS207, 8.6.2]. */
static bool choose(uint8_t unit)
{
    const uint8_t channel = (uint8_t)(1u << unit);
    uint8_t none;
    return hal_i2c(&SWITCH, &channel, 1, &none, 0);
}

static bool start(void)
{
    bool there = true;
    for (uint8_t unit = 0; unit < UNITS; unit++) {
        /* 5 Hz: the widest not above half of 10 frames a second */
        there = choose(unit) && mpu6000_start(&IMU, MPU6000_5_HZ) && there;
        hmc5983_start(&COMPASS);
    }
    return there;
}

static bool read(struct frame *frame)
{
    uint8_t imu[UNITS][MPU6000_BYTES];
    uint8_t field[UNITS][HMC5983_BYTES];
    bool measured[UNITS];
    for (uint8_t unit = 0; unit < UNITS; unit++) { /* within 4 ms; the fields are measured meanwhile */
        if (!choose(unit))
            return false;
        measured[unit] = hmc5983_measure(&COMPASS);
        if (mpu6000_read(&IMU, imu[unit]) != READING_NEW)
            return false;
    }
    hal_sleep_until(hal_micros() + HMC5983_MEASURE_US);
    for (uint8_t unit = 0; unit < UNITS; unit++) {
        bool there = choose(unit) && measured[unit] && hmc5983_read(&COMPASS, field[unit]) == READING_NEW;
        frame_put(frame, imu[unit], MPU6000_BYTES);
        frame_put(frame, there ? field[unit] : HMC5983_NO_FIELD, HMC5983_BYTES);
    }
    return true;
}

int main(void)
{
    static const struct board ARM = {
        .baud = 115200, .period = 100000, .sync = {0xA5, 0xA6}, .start = start, .read = read};
    board_run(&ARM);
    return 0;
}
