/* A frame as `plumbob list devices NAME` prints it: two bytes of sync, counter, clock, the chips' own bytes, CRC. */
#ifndef FRAME_H
#define FRAME_H

#include <stdint.h>

#define FRAME_ROOM 130 /* the longest: the arm's */

struct frame {
    uint8_t length;
    uint8_t bytes[FRAME_ROOM];
};

/* Begin with sync, counter and clock (us), the numbers least significant byte first. */
void frame_begin(struct frame *frame, const uint8_t sync[2], uint16_t counter, uint32_t clock);

/* Add bytes as they are. */
void frame_put(struct frame *frame, const uint8_t *data, uint8_t count);

/* Close with the CRC of all behind the sync, and send. */
void frame_send(struct frame *frame);

#endif
