/* The rod: ADIS16355 on SPI, and the packets of an AHRS500GA on a second serial line, 100 frames a second. */
#include "board.h"
#include "chips/adis16355.h"
#include "chips/ahrs500ga.h"

static const struct hal_chip UNIT = {.kind = HAL_SPI, .bus = 0, .select = 17, .mode = 3, .khz = 1000};

static struct ahrs500ga reference;

static bool start(void)
{
    return adis16355_start(&UNIT);
}

/* Where a part is silent its bytes say so, and the frame goes out for the other: words of 0 are not new, and a packet of
 * zeros does not begin with AA 55. */
static bool read(struct frame *frame)
{
    uint8_t words[ADIS16355_BYTES];
    uint8_t packet[AHRS500GA_BYTES] = {0};
    adis16355_read(&UNIT, words);
    ahrs500ga_read(&reference, packet);
    frame_put(frame, words, sizeof words);
    frame_put(frame, packet, sizeof packet);
    return true;
}

int main(void)
{
    static const struct board ROD = {
        .baud = 115200, .baud_in = AHRS500GA_BAUD, .period = 10000, .sync = {0xA5, 0x0D}, .start = start, .read = read};
    board_run(&ROD);
    return 0;
}
