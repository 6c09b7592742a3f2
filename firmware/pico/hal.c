/* The Raspberry Pi Pico (RP2040), by its SDK. The line to the host is the USB port, where the baud rate means nothing.
 *
 *     I2C 0   SDA GP4, SCL GP5       SPI 0   SCK GP18, MOSI GP19, MISO GP16, chip selects GP17 and GP20
 *     second line   UART 1, RX GP9   lamp    the board's own
 */
#include "../hal.h"

#include "hardware/gpio.h"
#include "hardware/i2c.h"
#include "hardware/irq.h"
#include "hardware/spi.h"
#include "hardware/uart.h"
#include "pico/stdio_usb.h"
#include "pico/stdlib.h"

enum { SDA = 4, SCL = 5, MISO = 16, SCK = 18, MOSI = 19, RX = 9 };
static const uint8_t SELECTS[] = {17, 20};

#define I2C_HZ 400000u
#define I2C_TIMEOUT_US 2000u /* 17 bytes at 400 kHz take 0.4 ms */
#define RING 128u            /* a power of two */

static volatile uint8_t ring[RING];
static volatile uint8_t come, taken; /* counts, which wrap */

static void take_bytes(void)
{
    while (uart_is_readable(uart1))
        ring[come++ % RING] = (uint8_t)uart_getc(uart1);
}

void hal_start(uint32_t baud, uint32_t baud_in)
{
    (void)baud;
    stdio_usb_init();
    stdio_set_translate_crlf(&stdio_usb, false); /* else each byte 0A would become two */
    gpio_init(PICO_DEFAULT_LED_PIN);
    gpio_set_dir(PICO_DEFAULT_LED_PIN, GPIO_OUT);
    i2c_init(i2c0, I2C_HZ);
    gpio_set_function(SDA, GPIO_FUNC_I2C);
    gpio_set_function(SCL, GPIO_FUNC_I2C);
    gpio_pull_up(SDA);
    gpio_pull_up(SCL);
    for (size_t i = 0; i < sizeof SELECTS; i++) { /* all high, before any chip is spoken to */
        gpio_init(SELECTS[i]);
        gpio_put(SELECTS[i], true);
        gpio_set_dir(SELECTS[i], GPIO_OUT);
    }
    spi_init(spi0, 1000000);
    gpio_set_function(MISO, GPIO_FUNC_SPI);
    gpio_set_function(SCK, GPIO_FUNC_SPI);
    gpio_set_function(MOSI, GPIO_FUNC_SPI);
    if (baud_in > 0) {
        uart_init(uart1, baud_in);
        gpio_set_function(RX, GPIO_FUNC_UART);
        irq_set_exclusive_handler(UART1_IRQ, take_bytes);
        irq_set_enabled(UART1_IRQ, true);
        uart_set_irq_enables(uart1, true, false);
    }
}

bool hal_i2c(const struct hal_chip *chip, const uint8_t *out, uint8_t written, uint8_t *in, uint8_t wanted)
{
    bool more = wanted > 0;
    return i2c_write_timeout_us(i2c0, chip->select, out, written, more, I2C_TIMEOUT_US) == written
           && (!more || i2c_read_timeout_us(i2c0, chip->select, in, wanted, false, I2C_TIMEOUT_US) == wanted);
}

void hal_spi(const struct hal_chip *chip, const uint8_t *out, uint8_t *in, uint8_t count)
{
    spi_set_baudrate(spi0, chip->khz * 1000u); /* the next that the clock has below it */
    spi_set_format(spi0, 8, chip->mode & 2u ? SPI_CPOL_1 : SPI_CPOL_0, chip->mode & 1u ? SPI_CPHA_1 : SPI_CPHA_0,
                   SPI_MSB_FIRST);
    gpio_put(chip->select, false);
    spi_write_read_blocking(spi0, out, in, count);
    gpio_put(chip->select, true);
}

uint32_t hal_micros(void)
{
    return time_us_32();
}

void hal_sleep_until(uint32_t micros)
{
    uint32_t left = micros - time_us_32();
    if (left < 0x80000000u)
        sleep_us(left);
}

void hal_uart_write(const uint8_t *data, uint8_t count)
{
    for (uint8_t i = 0; i < count; i++)
        putchar_raw(data[i]);
}

uint8_t hal_uart_read(uint8_t *data, uint8_t room)
{
    uint8_t count = 0;
    while (count < room && taken != come)
        data[count++] = ring[taken++ % RING];
    return count;
}

void hal_led(bool on)
{
    gpio_put(PICO_DEFAULT_LED_PIN, on);
}
