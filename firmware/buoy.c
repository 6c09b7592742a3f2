/* The drifting buoy: MPU-6000 and HMC5983, 100 frames a second. By SPI as in the paper; BUOY_I2C takes a board with an
 * MPU-6050 and, if it has one, an HMC5883L. */
#include "board.h"
#include "chips/hmc5983.h"
#include "chips/mpu6000.h"

#ifdef BUOY_I2C
static const struct hal_chip IMU = {.kind = HAL_I2C, .bus = 0, .select = 0x68, .khz = 400};
static const struct hal_chip COMPASS = {.kind = HAL_I2C, .bus = 0, .select = 0x1E, .khz = 400};
#else
static const struct hal_chip IMU = {.kind = HAL_SPI, .bus = 0, .select = 17, .mode = 0, .khz = 1000};
static const struct hal_chip COMPASS = {.kind = HAL_SPI, .bus = 0, .select = 20, .mode = 3, .khz = 1000};
#endif

#define MAG_NEW 0x01u
#define COMPASS_RETRY 100u /* periods, 1 s: a compass that is silent must not cost the frames */

static uint8_t compass_silent; /* periods since it answered last */

static void start_compass(void)
{
    compass_silent = hmc5983_start(&COMPASS) && hmc5983_measure(&COMPASS) ? 0 : 1;
}

static bool start(void)
{
    bool there = mpu6000_start(&IMU, MPU6000_42_HZ); /* the widest below 50 Hz, half of 100 frames a second */
    start_compass(); /* behind it, where that lets it through */
    return there;
}

/* Whether `field` was measured since the frame before; the next measurement is begun. */
static bool read_compass(uint8_t field[HMC5983_BYTES])
{
    if (compass_silent >= COMPASS_RETRY) {
        start_compass();
        return false;
    }
    enum reading reading = compass_silent > 0 ? READING_NO_ANSWER : hmc5983_read(&COMPASS, field);
    if (reading == READING_NO_ANSWER || !hmc5983_measure(&COMPASS))
        compass_silent++;
    return reading == READING_NEW;
}

static bool read(struct frame *frame)
{
    uint8_t imu[MPU6000_BYTES];
    uint8_t field[HMC5983_BYTES] = {0}; /* means nothing where it is not new */
    if (mpu6000_read(&IMU, imu) != READING_NEW)
        return false;
    const uint8_t mag_new = read_compass(field) ? MAG_NEW : 0;
    frame_put(frame, &mag_new, 1);
    frame_put(frame, imu, sizeof imu);
    frame_put(frame, field, sizeof field);
    return true;
}

int main(void)
{
    static const struct board BUOY = {
        .baud = 115200, .period = 10000, .sync = {0xA5, 0xB0}, .start = start, .read = read};
    board_run(&BUOY);
    return 0;
}
