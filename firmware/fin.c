/* The bionic fin: ADXRS453 about z and ADXRS290 about x and y, on one SPI bus, 500 frames a second. */
#include "board.h"
#include "chips/adxrs290.h"
#include "chips/adxrs453.h"

static const struct hal_chip YAW = {.kind = HAL_SPI, .bus = 0, .select = 17, .mode = 0, .khz = 4000};
static const struct hal_chip ROLL_PITCH = {.kind = HAL_SPI, .bus = 0, .select = 20, .mode = 3, .khz = 4000};

static bool start(void)
{
    return adxrs453_start(&YAW) && adxrs290_start(&ROLL_PITCH);
}

static bool read(struct frame *frame)
{
    uint8_t yaw[ADXRS453_BYTES];
    uint8_t roll_pitch[ADXRS290_BYTES];
    adxrs453_read(&YAW, yaw);
    if (adxrs290_read(&ROLL_PITCH, roll_pitch) != READING_NEW)
        return false;
    frame_put(frame, yaw, sizeof yaw);
    frame_put(frame, roll_pitch, sizeof roll_pitch);
    return true;
}

int main(void)
{
    static const struct board FIN = {
        .baud = 230400, .period = 2000, .sync = {0xA5, 0xF1}, .start = start, .read = read};
    board_run(&FIN);
    return 0;
}
