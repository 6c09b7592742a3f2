#include "registers.h"

bool registers_read(const struct hal_chip *chip, uint8_t spi_read, uint8_t first, uint8_t *data, uint8_t count)
{
    if (chip->kind == HAL_I2C)
        return hal_i2c(chip, &first, 1, data, count);
    uint8_t out[1 + REGISTERS_BURST] = {0};
    uint8_t in[1 + REGISTERS_BURST];
    out[0] = first | spi_read;
    hal_spi(chip, out, in, (uint8_t)(1 + count));
    for (uint8_t i = 0; i < count; i++)
        data[i] = in[1 + i];
    return true;
}

bool registers_write(const struct hal_chip *chip, uint8_t address, uint8_t value)
{
    const uint8_t out[2] = {address, value};
    uint8_t in[2];
    if (chip->kind == HAL_I2C)
        return hal_i2c(chip, out, 2, in, 0);
    hal_spi(chip, out, in, 2);
    return true;
}

bool registers_set(const struct hal_chip *chip, uint8_t spi_read, uint8_t address, uint8_t value)
{
    return registers_write(chip, address, value) && registers_match(chip, spi_read, address, 0xFF, value);
}

bool registers_match(const struct hal_chip *chip, uint8_t spi_read, uint8_t address, uint8_t mask, uint8_t value)
{
    uint8_t there;
    return registers_read(chip, spi_read, address, &there, 1) && (there & mask) == value;
}
