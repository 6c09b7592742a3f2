/* AHRS500GA, packets of 26 bytes that come by themselves. Sources: XB-500GA is its manual 7430-0060-02, XB-500CA the manual
 * 7430-0050-03 of its sister; `plumbob list devices ahrs500ga` has the packet. */
#ifndef AHRS500GA_H
#define AHRS500GA_H

#include <stdbool.h>
#include <stdint.h>

#define AHRS500GA_BYTES 26
#define AHRS500GA_BAUD 38400u /* 26 bytes 100 times a second need 26000 baud; set the unit to it */

/* What has come of a packet so far. Begin with zeros. */
struct ahrs500ga {
    uint8_t count;
    uint8_t bytes[AHRS500GA_BYTES];
};

/* Take what has come on the second line; true where `packet` now is a whole packet that came since the last call, the
 * newest. Else it is left as it is. */
bool ahrs500ga_read(struct ahrs500ga *unit, uint8_t packet[AHRS500GA_BYTES]);

#endif
