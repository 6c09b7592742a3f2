/* Chips whose registers are read in bursts, by I2C or SPI. */
#ifndef REGISTERS_H
#define REGISTERS_H

#include <stdbool.h>
#include <stdint.h>

#include "hal.h"

#define REGISTERS_BURST 15 /* the longest: INT_STATUS and 14 bytes of an MPU-6000 */

/* What came of asking a chip for a sample. */
enum reading { READING_NEW, READING_NOT_READY, READING_NO_ANSWER };

/* Read `count` registers from `first`; `spi_read` are the bits that SPI sets in the address to read. False where an
 * I2C chip does not acknowledge: SPI has no acknowledgement, so that there a register of known content must be read. */
bool registers_read(const struct hal_chip *chip, uint8_t spi_read, uint8_t first, uint8_t *data, uint8_t count);

/* Write one register. */
bool registers_write(const struct hal_chip *chip, uint8_t address, uint8_t value);

/* Write one register and read it back; false where it does not hold the value. */
bool registers_set(const struct hal_chip *chip, uint8_t spi_read, uint8_t address, uint8_t value);

/* Whether one register, masked, has that value. */
bool registers_match(const struct hal_chip *chip, uint8_t spi_read, uint8_t address, uint8_t mask, uint8_t value);

#endif
