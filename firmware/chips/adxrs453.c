#include "adxrs453.h"

static const uint8_t SENSOR[ADXRS453_BYTES] = {0x20, 0x00, 0x00, 0x00}; /* request for the rate [DS-453] */
static const uint8_t CHECK[ADXRS453_BYTES] = {0x20, 0x00, 0x00, 0x03};  /* the same, with self-test [DS-453] */

#define POWER_UP_US 100000u /* from power to the first command [DS-453] */
#define STEP_US 50000u      /* between the steps of the start [DS-453] */
#define SELF_TEST 0x02u     /* status, bits 27:26 of a reply [DS-453] */

static void exchange_after(uint32_t pause, const struct hal_chip *chip, const uint8_t *out, uint8_t *reply)
{
    hal_sleep_until(hal_micros() + pause);
    hal_spi(chip, out, reply, ADXRS453_BYTES);
}

/* In the self-test all faults are set on purpose: the last byte is FF or FE, by the parity [DS-453]. */
static bool passed(const uint8_t reply[ADXRS453_BYTES])
{
    return ((reply[0] >> 2) & 0x03u) == SELF_TEST && (reply[3] | 0x01u) == 0xFFu;
}

bool adxrs453_start(const struct hal_chip *chip)
{
    uint8_t reply[ADXRS453_BYTES];
    exchange_after(POWER_UP_US, chip, CHECK, reply);
    exchange_after(STEP_US, chip, SENSOR, reply);
    exchange_after(STEP_US, chip, SENSOR, reply); /* the reply to the one before */
    bool first = passed(reply);
    exchange_after(0, chip, SENSOR, reply);
    bool second = passed(reply);
    hal_sleep_until(hal_micros() + STEP_US);
    return first && second;
}

void adxrs453_read(const struct hal_chip *chip, uint8_t reply[ADXRS453_BYTES])
{
    /* A reply answers the command before: what the first gives is a period old, so that it is asked twice [DS-453]. */
    hal_spi(chip, SENSOR, reply, ADXRS453_BYTES);
    hal_spi(chip, SENSOR, reply, ADXRS453_BYTES);
}
