#include "frame.h"

#include "hal.h"

/* CRC-16/CCITT-FALSE: polynomial 1021, from FFFF, not reflected. */
static uint16_t crc16(const uint8_t *data, uint8_t count)
{
    uint16_t crc = 0xFFFFu;
    while (count-- > 0) {
        crc = (uint16_t)(crc ^ ((uint16_t)*data++ << 8));
        for (uint8_t bit = 0; bit < 8; bit++) {
            uint16_t carry = (crc & 0x8000u) ? 0x1021u : 0u;
            crc = (uint16_t)((uint16_t)(crc << 1) ^ carry);
        }
    }
    return crc;
}

static void put_number(struct frame *frame, uint32_t number, uint8_t bytes)
{
    while (bytes-- > 0) {
        frame->bytes[frame->length++] = (uint8_t)(number & 0xFFu);
        number >>= 8;
    }
}

void frame_begin(struct frame *frame, const uint8_t sync[2], uint16_t counter, uint32_t clock)
{
    frame->length = 0;
    frame_put(frame, sync, 2);
    put_number(frame, counter, 2);
    put_number(frame, clock, 4);
}

void frame_put(struct frame *frame, const uint8_t *data, uint8_t count)
{
    while (count-- > 0)
        frame->bytes[frame->length++] = *data++;
}

void frame_send(struct frame *frame)
{
    put_number(frame, crc16(frame->bytes + 2, (uint8_t)(frame->length - 2)), 2);
    hal_uart_write(frame->bytes, frame->length);
}
