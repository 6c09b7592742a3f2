#include "adxrs290.h"

enum {
    READ = 0x80,      /* bit 7 of the address [K-290] */
    ADI_ID = 0x00,    /* AD [K-290] */
    MEMS_ID = 0x01,   /* 1D [K-290] */
    DEV_ID = 0x02,    /* 92 [K-290] */
    DATAX0 = 0x08,    /* XL XH YL YH TL TH [K-290] */
    POWER_CTL = 0x10, /* bit 0 temperature on, bit 1 measure [K-290] */
    FILTER = 0x11     /* bits 2:0 low-pass, 7:4 high-pass [K-290] */
};

#define LOW_PASS_160_HZ 0x02u /* the widest below 250 Hz, half of 500 frames a second; high-pass 0: none [K-290] */
#define START_US 100000u      /* from standby to measurement [K-290] */

bool adxrs290_start(const struct hal_chip *chip)
{
    bool known = registers_match(chip, READ, ADI_ID, 0xFF, 0xAD) && registers_match(chip, READ, MEMS_ID, 0xFF, 0x1D)
                 && registers_match(chip, READ, DEV_ID, 0xFF, 0x92);
    if (!known || !registers_set(chip, READ, FILTER, LOW_PASS_160_HZ) || !registers_set(chip, READ, POWER_CTL, 0x03))
        return false;
    hal_sleep_until(hal_micros() + START_US);
    return true;
}

enum reading adxrs290_read(const struct hal_chip *chip, uint8_t data[ADXRS290_BYTES])
{
    registers_read(chip, READ, DATAX0, data, ADXRS290_BYTES);
    /* The data have no check: that the identity can be read too says that the wire is whole. */
    return registers_match(chip, READ, DEV_ID, 0xFF, 0x92) ? READING_NEW : READING_NO_ANSWER;
}
