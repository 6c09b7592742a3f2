/* What a board gives the firmware: eight functions. Nothing else touches the hardware, so that all the rest runs on any
 * processor, and in the tests on the host. pico/hal.c has them for the Raspberry Pi Pico, host/hal.c for the tests. */
#ifndef HAL_H
#define HAL_H

#include <stdbool.h>
#include <stdint.h>

enum hal_kind { HAL_I2C, HAL_SPI };

/* Where a chip is wired to. */
struct hal_chip {
    enum hal_kind kind;
    uint8_t bus;    /* number of the bus */
    uint8_t select; /* I2C: address, 7 bits; SPI: pin of its chip select, low while it is spoken to */
    uint8_t mode;   /* SPI: 0 to 3, CPOL * 2 + CPHA */
    uint16_t khz;   /* highest clock that it takes */
};

/* Set the clocks, buses and pins, and open the line to the host at `baud`; `baud_in` is that of hal_uart_read, or 0. */
void hal_start(uint32_t baud, uint32_t baud_in);

/* Write `written` bytes and, behind a repeated start, read `wanted`; false where the chip does not acknowledge. */
bool hal_i2c(const struct hal_chip *chip, const uint8_t *out, uint8_t written, uint8_t *in, uint8_t wanted);

/* Clock `count` bytes out and as many in, with chip select low from the first to the last. */
void hal_spi(const struct hal_chip *chip, const uint8_t *out, uint8_t *in, uint8_t count);

/* Time since the start, in us; it wraps after 71 min. */
uint32_t hal_micros(void);

/* Wait until hal_micros() is `micros`, not shorter; not at all where that is past. */
void hal_sleep_until(uint32_t micros);

/* Send bytes to the host. */
void hal_uart_write(const uint8_t *data, uint8_t count);

/* Take what has come on the second line since the last call, at most `room` bytes; 64 are kept at least. */
uint8_t hal_uart_read(uint8_t *data, uint8_t room);

/* The lamp: on while samples are missing. */
void hal_led(bool on);

#endif
