#include "adis16355.h"

enum { /* [DS-1635x] */
    SUPPLY_OUT = 0x02,
    XGYRO_OUT = 0x04,
    YGYRO_OUT = 0x06,
    ZGYRO_OUT = 0x08,
    XACCL_OUT = 0x0A,
    YACCL_OUT = 0x0C,
    ZACCL_OUT = 0x0E,
    XTEMP_OUT = 0x10,
    YTEMP_OUT = 0x12,
    AUX_ADC = 0x16,
    MSC_CTRL = 0x34, /* bit 7: gyroscopes compensated for acceleration; off after power-up */
    SMPL_PRD = 0x36, /* 01: 819.2 samples a second */
    SENS_AVG = 0x38  /* bits 10:8 range, 2:0 averages */
};

#define COMPENSATED 0x80u
#define RATE_819 0x01u
#define RANGE_300 0x0400u   /* bits 10:8 [DS-1635x] */
#define TAPS_8 0x03u        /* 2^3 in each of two stages: 34.4 Hz, below half of 100 frames a second [DS-1635x] */
#define WRITE 0x80u         /* bit 15 of a word: write one byte [DS-1635x] */
#define START_US 150000u    /* [DS-1635x] */
#define READ_US 41u         /* from one word to the next: 40 us, and one for the clock's step [DS-1635x] */
#define NO_SUPPLY 0x0FFFu   /* 7.5 V, which no part survives: what a wire that is high reads as */
#define SUPPLY_WORD 8u      /* its place among the ten */

/* One word out, and the reply to the one before. */
static uint16_t exchange(const struct hal_chip *chip, uint8_t high, uint8_t low)
{
    const uint8_t out[2] = {high, low};
    uint8_t in[2];
    uint32_t begun = hal_micros();
    hal_spi(chip, out, in, 2);
    hal_sleep_until(begun + READ_US);
    return (uint16_t)((uint16_t)in[0] << 8 | in[1]);
}

/* Write a register, a byte at a time, and read back the bits that mean something. */
static bool set(const struct hal_chip *chip, uint8_t address, uint16_t value, uint16_t bits)
{
    exchange(chip, WRITE | address, (uint8_t)(value & 0xFFu));
    exchange(chip, (uint8_t)(WRITE | (address + 1)), (uint8_t)(value >> 8));
    exchange(chip, address, 0);
    return (exchange(chip, address, 0) & bits) == value;
}

bool adis16355_start(const struct hal_chip *chip)
{
    hal_sleep_until(hal_micros() + START_US);
    return set(chip, SMPL_PRD, RATE_819, 0x00FF) && set(chip, SENS_AVG, RANGE_300 | TAPS_8, 0x0707)
           && set(chip, MSC_CTRL, COMPENSATED, 0x07C7);
}

void adis16355_read(const struct hal_chip *chip, uint8_t data[ADIS16355_BYTES])
{
    static const uint8_t ORDER[ADIS16355_BYTES / 2] = {XGYRO_OUT, YGYRO_OUT, ZGYRO_OUT, XACCL_OUT,  YACCL_OUT,
                                                       ZACCL_OUT, XTEMP_OUT, YTEMP_OUT, SUPPLY_OUT, AUX_ADC};
    uint16_t supply = 0;
    exchange(chip, ORDER[0], 0); /* its reply belongs to the poll before */
    for (uint8_t i = 0; i < ADIS16355_BYTES / 2; i++) {
        uint8_t following = i + 1 < ADIS16355_BYTES / 2 ? ORDER[i + 1] : SUPPLY_OUT;
        uint16_t word = exchange(chip, following, 0);
        if (i == SUPPLY_WORD)
            supply = word & NO_SUPPLY;
        data[2 * i] = (uint8_t)(word >> 8);
        data[2 * i + 1] = (uint8_t)(word & 0xFFu);
    }
    for (uint8_t i = 0; supply == NO_SUPPLY && i < ADIS16355_BYTES; i++)
        data[i] = 0;
}
