#include "hmc5983.h"

enum {
    READ = 0x80,   /* SPI: bit 7 reads [K-5843] */
    BURST = 0xC0,  /* SPI: bit 6 counts the address up [K-5843] */
    CRA = 0x00,    /* bits 6:5 average, 4:2 rate, 1:0 bias [DS-5883L] */
    CRB = 0x01,    /* bits 7:5 gain [DS-5883L p. 13] */
    MODE = 0x02,   /* bits 1:0: 1 measures once [DS-5883L] */
    DATA_X = 0x03, /* X, Z, Y, most significant byte first [K-5843] */
    STATUS = 0x09, /* bit 0 ready [DS-5883L p. 16] */
    ID_A = 0x0A    /* 'H', '4', '3' [K-5843] */
};

#define ONE_SAMPLE_NO_BIAS 0x18u /* of 75 Hz, which counts in continuous mode alone [DS-5883L] */
#define GAIN_1090 0x20u          /* index 1 [DS-5883L p. 13] */
#define MEASURE_ONCE 0x01u
#define READY 0x01u

const uint8_t HMC5983_NO_FIELD[HMC5983_BYTES] = {0xF0, 0x00, 0xF0, 0x00, 0xF0, 0x00};

static bool answers(const struct hal_chip *chip)
{
    return registers_match(chip, READ, ID_A, 0xFF, 'H') && registers_match(chip, READ, ID_A + 1, 0xFF, '4')
           && registers_match(chip, READ, ID_A + 2, 0xFF, '3');
}

bool hmc5983_start(const struct hal_chip *chip)
{
    uint8_t old[HMC5983_BYTES];
    if (!answers(chip) || !registers_set(chip, READ, CRA, ONE_SAMPLE_NO_BIAS)
        || !registers_set(chip, READ, CRB, GAIN_1090) || !hmc5983_measure(chip))
        return false;
    hal_sleep_until(hal_micros() + HMC5983_MEASURE_US);
    return hmc5983_read(chip, old) != READING_NO_ANSWER; /* the first still has the gain before [DS-5883L p. 13] */
}

bool hmc5983_measure(const struct hal_chip *chip)
{
    return registers_write(chip, MODE, MEASURE_ONCE);
}

/* MODE is not asked whether the measurement is done: reading it locks the data [DS-5883L p. 16]. */
enum reading hmc5983_read(const struct hal_chip *chip, uint8_t data[HMC5983_BYTES])
{
    uint8_t status;
    if (!registers_read(chip, READ, STATUS, &status, 1) || !registers_read(chip, BURST, DATA_X, data, HMC5983_BYTES))
        return READING_NO_ANSWER;
    if (chip->kind == HAL_SPI && !answers(chip))
        return READING_NO_ANSWER;
    return status & READY ? READING_NEW : READING_NOT_READY;
}
