/* ADXRS453, rate about z, 32-bit words by SPI mode 0. Source: DS-453 is its data sheet, Rev. A;
 * `plumbob list devices adxrs453` has the whole of it. */
#ifndef ADXRS453_H
#define ADXRS453_H

#include "../hal.h"

#define ADXRS453_BYTES 4

/* The start that the data sheet asks for, with its self-test; false where its replies are not what they must be.
 * Takes 250 ms. */
bool adxrs453_start(const struct hal_chip *chip);

/* The reply to a request for the rate, as the chip gives it: its status, faults and two parity bits go to the host, which
 * takes a rate only where all of them allow it. So a pulled wire is no special case here. */
void adxrs453_read(const struct hal_chip *chip, uint8_t reply[ADXRS453_BYTES]);

#endif
