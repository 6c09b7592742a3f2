#include "ahrs500ga.h"

#include "../hal.h"

#define SYNC_0 0xAAu /* [XB-500GA] */
#define SYNC_1 0x55u
#define CHECK_AT 24u /* two bytes, the more significant first [XB-500GA] */

/* Whether the check is the sum of bytes, or of 16-bit words modulo FFFF: the manual does not say which [XB-500CA]. */
static bool sound(const uint8_t packet[AHRS500GA_BYTES])
{
    uint16_t bytes = 0;
    uint32_t words = 0;
    for (uint8_t i = 2; i < CHECK_AT; i++) {
        bytes = (uint16_t)(bytes + packet[i]);
        words += i % 2 ? packet[i] : (uint32_t)packet[i] << 8;
    }
    uint16_t check = (uint16_t)((uint16_t)packet[CHECK_AT] << 8 | packet[CHECK_AT + 1]);
    return packet[0] == SYNC_0 && packet[1] == SYNC_1 && (check == bytes || check == words % 0xFFFFu);
}

/* Whether the bytes so far may begin a packet. */
static bool may_begin(const struct ahrs500ga *unit)
{
    return (unit->count < 1 || unit->bytes[0] == SYNC_0) && (unit->count < 2 || unit->bytes[1] == SYNC_1)
           && (unit->count < AHRS500GA_BYTES || sound(unit->bytes));
}

static void drop_first(struct ahrs500ga *unit)
{
    unit->count--;
    for (uint8_t i = 0; i < unit->count; i++)
        unit->bytes[i] = unit->bytes[i + 1];
}

bool ahrs500ga_read(struct ahrs500ga *unit, uint8_t packet[AHRS500GA_BYTES])
{
    bool whole = false;
    uint8_t byte;
    while (hal_uart_read(&byte, 1) == 1) {
        unit->bytes[unit->count++] = byte;
        while (!may_begin(unit))
            drop_first(unit);
        if (unit->count == AHRS500GA_BYTES) {
            for (uint8_t i = 0; i < AHRS500GA_BYTES; i++)
                packet[i] = unit->bytes[i];
            unit->count = 0;
            whole = true;
        }
    }
    return whole;
}
