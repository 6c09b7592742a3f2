#include "board.h"

#include "hal.h"

#define RETRY_US 200000u    /* between two tries to start the chips */
#define SILENCE_US 1000000u /* without a sample, until the chips are started again */

/* Wait for the next period, and count how many have passed: more than one where something took longer than one. */
static uint16_t next_period(uint32_t *due, uint32_t period)
{
    *due += period;
    hal_sleep_until(*due);
    uint32_t missed = (hal_micros() - *due) / period;
    *due += missed * period;
    return (uint16_t)(1 + missed);
}

static void start_chips(const struct board *board)
{
    hal_led(true);
    while (!board->start())
        hal_sleep_until(hal_micros() + RETRY_US);
}

void board_run(const struct board *board)
{
    struct frame frame;
    uint16_t counter = 0xFFFFu; /* the first frame has 0 */
    hal_start(board->baud, board->baud_in);
    start_chips(board);
    uint32_t due = hal_micros();
    uint32_t last = due;
    for (;;) {
        counter = (uint16_t)(counter + next_period(&due, board->period));
        uint32_t clock = hal_micros();
        frame_begin(&frame, board->sync, counter, clock);
        bool there = board->read(&frame);
        hal_led(!there);
        if (there) {
            frame_send(&frame);
            last = clock;
        } else if (clock - last >= SILENCE_US) {
            start_chips(board);
            last = hal_micros();
        }
    }
}
