/* ADIS16355, rates, specific forces, temperatures and supply, 16-bit words by SPI mode 3. Source: DS-1635x is its data
 * sheet, Rev. B; `plumbob list devices adis16355` has the whole of it. */
#ifndef ADIS16355_H
#define ADIS16355_H

#include "../hal.h"

#define ADIS16355_BYTES 20

/* +-300 deg/s at 819.2 samples a second, averaged to a bandwidth of 34 Hz, compensated for acceleration; false where the
 * chip does not hold these. Takes 150 ms. */
bool adis16355_start(const struct hal_chip *chip);

/* Ten words in the order of the format; each says itself whether it is new (bit 15). Where the wire is pulled all are 0,
 * which says that none is. Takes 0.5 ms. */
void adis16355_read(const struct hal_chip *chip, uint8_t data[ADIS16355_BYTES]);

#endif
