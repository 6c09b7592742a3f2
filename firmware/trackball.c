/* The trackball: MPU-3050 on I2C, 10 frames a second. */
#include "board.h"
#include "chips/mpu3050.h"

static const struct hal_chip GYRO = {.kind = HAL_I2C, .bus = 0, .select = 0x68, .khz = 400};

static bool start(void)
{
    return mpu3050_start(&GYRO);
}

static bool read(struct frame *frame)
{
    uint8_t rates[MPU3050_BYTES];
    if (mpu3050_read(&GYRO, rates) != READING_NEW)
        return false;
    frame_put(frame, rates, sizeof rates);
    return true;
}

int main(void)
{
    static const struct board TRACKBALL = {
        .baud = 115200, .period = 100000, .sync = {0xA5, 0x7B}, .start = start, .read = read};
    board_run(&TRACKBALL);
    return 0;
}
