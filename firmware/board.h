/* The loop that all five boards share: start the chips, and then a frame a period. */
#ifndef BOARD_H
#define BOARD_H

#include <stdbool.h>
#include <stdint.h>

#include "frame.h"

struct board {
    uint32_t baud;
    uint32_t baud_in; /* of a second line that is read; 0: none */
    uint32_t period;  /* us */
    uint8_t sync[2];
    bool (*start)(void);                /* wake the chips up; false where one does not answer */
    bool (*read)(struct frame *frame);  /* add their bytes; false where there is no sample to send */
};

/* Run for ever. The counter counts periods, whether they gave a frame or not, so that the reader sees each gap; the
 * clock is the time just before the chips are read. Where no sample comes for a second, the chips are started again. */
void board_run(const struct board *board);

#endif
