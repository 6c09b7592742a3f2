/* The board of the tests: chips that answer what a script says, a clock that runs as fast as it can, and the line to the
 * host on standard output. The script comes on standard input, in the order of time:
 *
 *     chip NAME BUS SELECT MODE KHZ PROTOCOL CHANNEL CLEARS
 *     TIME set NAME ADDRESS BYTES     what is in its registers from then on
 *     TIME silent NAME 0|1            whether it does not answer: no acknowledgement on I2C, a wire that stays high on SPI
 *     TIME bytes BYTES                what comes on the second line
 *     TIME stall MICROS               the processor is away from then on, so long
 *     TIME end                        the power goes
 *
 * BUS is i2c or spi, KHZ the most that the chip takes, PROTOCOL one of those below, CHANNEL that of the switch it is
 * behind (ff: of none), CLEARS the register that reading clears (ff: none). SELECT, CHANNEL, CLEARS, ADDRESS and BYTES are
 * hexadecimal; times are us since the power came. FIRMWARE_CLOCK is where hal_micros begins; with FIRMWARE_PACE the clock
 * keeps real time. What is written to registers, and the lamp, are said on standard error. */
#define _POSIX_C_SOURCE 200809L
#include "../hal.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define CHIPS 16
#define LINE 256
#define NONE 0xFFu
#define NEW_DATA 0x80u /* ND in the upper byte of a word of the ADIS16355 */

enum protocol {
    REGISTERS, /* addresses of 7 bits that count up; bit 7 reads */
    BURSTS,    /* of 6 bits; bit 6 counts up [HMC5983] */
    WORDS,     /* 16 bits, the reply a word late; a read clears ND [ADIS16355] */
    REPLIES,   /* 32 bits, the reply one late: what register 0 has when it is asked [ADXRS453] */
    SWITCH     /* one byte: the channels that are connected [TCA9548A] */
};
static const char *const PROTOCOLS[] = {"registers", "bursts", "words", "replies", "switch"};

struct emulated {
    char name[16];
    enum hal_kind kind;
    unsigned select, mode, khz, channel, clears;
    enum protocol protocol;
    bool silent;
    uint8_t registers[256];
    uint8_t late[4]; /* the next reply of a chip that answers late */
};

static struct emulated chips[CHIPS];
static size_t chip_count;
static unsigned connected; /* channels of the switch */
static uint64_t now, clock_start, started_ns;
static uint32_t baud_out;
static uint8_t received[LINE];
static size_t received_count;
static char line[LINE];
static uint64_t line_time;
static bool lamp;

static void fail(const char *why)
{
    fprintf(stderr, "host: %s: %s\n", why, line);
    exit(2);
}

static struct emulated *named(const char *name)
{
    for (size_t i = 0; i < chip_count; i++)
        if (strcmp(chips[i].name, name) == 0)
            return &chips[i];
    fail("no such chip");
    return NULL;
}

static size_t parse_bytes(const char *text, uint8_t *into, size_t room)
{
    size_t length = 0;
    unsigned value;
    for (; sscanf(text, "%2x", &value) == 1; text += 2) {
        if (length == room)
            fail("too many bytes");
        into[length++] = (uint8_t)value;
    }
    return length;
}

static void add_chip(void)
{
    char bus[8], protocol[16];
    struct emulated *chip = &chips[chip_count];
    if (chip_count == CHIPS
        || sscanf(line, "chip %15s %7s %x %u %u %15s %x %x", chip->name, bus, &chip->select, &chip->mode, &chip->khz,
                  protocol, &chip->channel, &chip->clears) != 8)
        fail("chip NAME BUS SELECT MODE KHZ PROTOCOL CHANNEL CLEARS");
    chip->kind = strcmp(bus, "spi") == 0 ? HAL_SPI : HAL_I2C;
    size_t known = sizeof PROTOCOLS / sizeof *PROTOCOLS;
    size_t which = 0;
    while (which < known && strcmp(protocol, PROTOCOLS[which]) != 0)
        which++;
    if (which == known)
        fail("no such protocol");
    chip->protocol = (enum protocol)which;
    chip->late[3] = 1; /* the first reply of an ADXRS453 after power-up is 00000001 [DS-453] */
    chip_count++;
}

/* Read the script up to the next line that has a time. */
static void next_line(void)
{
    do {
        if (fgets(line, sizeof line, stdin) == NULL) {
            line_time = UINT64_MAX;
            return;
        }
        if (strncmp(line, "chip ", 5) == 0)
            add_chip();
    } while (sscanf(line, "%" SCNu64, &line_time) != 1);
}

static void happen(void)
{
    char verb[16], name[16];
    unsigned number = 0;
    int at = 0;
    if (sscanf(line, "%*u %15s %n", verb, &at) != 1)
        fail("a time needs a verb");
    const char *rest = line + at;
    if (strcmp(verb, "set") == 0 && sscanf(rest, "%15s %x %n", name, &number, &at) == 2 && number < 256)
        parse_bytes(rest + at, named(name)->registers + number, 256 - number);
    else if (strcmp(verb, "silent") == 0 && sscanf(rest, "%15s %u", name, &number) == 2)
        named(name)->silent = number != 0;
    else if (strcmp(verb, "bytes") == 0)
        received_count += parse_bytes(rest, received + received_count, LINE - received_count);
    else if (strcmp(verb, "stall") == 0 && sscanf(rest, "%u", &number) == 1)
        now = now < line_time + number ? line_time + number : now;
    else if (strcmp(verb, "end") == 0) {
        fflush(stdout);
        exit(0);
    } else
        fail("no such event");
}

/* Let everything happen that is due. */
static void advance(uint64_t micros)
{
    now += micros;
    while (line_time <= now) {
        happen();
        next_line();
    }
}

static uint64_t monotonic_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (uint64_t)t.tv_sec * 1000000000u + (uint64_t)t.tv_nsec;
}

void hal_start(uint32_t baud, uint32_t baud_in)
{
    (void)baud_in;
    baud_out = baud;
    const char *start = getenv("FIRMWARE_CLOCK");
    clock_start = start ? strtoull(start, NULL, 10) : 0;
    started_ns = monotonic_ns();
    next_line();
    advance(0);
}

static struct emulated *wired(const struct hal_chip *chip)
{
    for (size_t i = 0; i < chip_count; i++) {
        struct emulated *one = &chips[i];
        bool reached = one->channel == NONE || (connected >> one->channel & 1u);
        if (one->kind == chip->kind && one->select == chip->select && reached) {
            if (chip->khz > one->khz || (chip->kind == HAL_SPI && chip->mode != one->mode))
                fail("the clock or the mode is not that of the chip");
            return one;
        }
    }
    return NULL;
}

static void write_register(struct emulated *chip, uint8_t address, uint8_t value)
{
    chip->registers[address] = value;
    fprintf(stderr, "%" PRIu64 " write %s %02x %02x\n", now, chip->name, address, value);
}

static uint8_t read_register(struct emulated *chip, uint8_t address)
{
    uint8_t value = chip->registers[address];
    if (address == chip->clears)
        chip->registers[address] = 0;
    return value;
}

bool hal_i2c(const struct hal_chip *chip, const uint8_t *out, uint8_t written, uint8_t *in, uint8_t wanted)
{
    struct emulated *one = wired(chip);
    unsigned bytes = 1u + written + (wanted > 0) + wanted;
    advance((9000u * bytes + chip->khz - 1u) / chip->khz);
    if (one == NULL || one->silent)
        return false;
    if (one->protocol == SWITCH)
        connected = out[0];
    for (uint8_t i = 1; i < written; i++)
        write_register(one, (uint8_t)(out[0] + i - 1), out[i]);
    for (uint8_t i = 0; i < wanted; i++)
        in[i] = read_register(one, (uint8_t)(out[0] + i));
    return true;
}

static void exchange_registers(struct emulated *chip, const uint8_t *out, uint8_t *in, uint8_t length)
{
    uint8_t mask = chip->protocol == BURSTS ? 0x3F : 0x7F;
    uint8_t step = chip->protocol == REGISTERS || (out[0] & 0x40u) ? 1 : 0;
    in[0] = 0;
    for (uint8_t i = 1; i < length; i++) {
        uint8_t address = (uint8_t)((out[0] & mask) + (i - 1) * step);
        in[i] = 0;
        if (out[0] & 0x80u)
            in[i] = read_register(chip, address);
        else
            write_register(chip, address, out[i]);
    }
}

static void exchange_late(struct emulated *chip, const uint8_t *out, uint8_t *in, uint8_t length)
{
    bool words = chip->protocol == WORDS;
    size_t at = words ? 2 : 0; /* where the reply stands in `late` */
    memcpy(in, chip->late + at, length);
    if (words && (out[0] & 0x80u)) { /* a word has its upper byte at the odd address, and comes with it first */
        write_register(chip, (out[0] & 0x3Fu) ^ 1u, out[1]);
        return;
    }
    uint8_t address = words ? out[0] & 0x3Eu : 0;
    memcpy(chip->late + at, chip->registers + address, length);
    if (words && address < 0x18u) /* the outputs */
        chip->registers[address] = (uint8_t)(chip->registers[address] & ~NEW_DATA);
}

void hal_spi(const struct hal_chip *chip, const uint8_t *out, uint8_t *in, uint8_t length)
{
    struct emulated *one = wired(chip);
    advance((8000u * length + chip->khz - 1u) / chip->khz);
    if (one == NULL || one->silent)
        memset(in, 0xFF, length);
    else if (one->protocol == WORDS || one->protocol == REPLIES)
        exchange_late(one, out, in, length);
    else
        exchange_registers(one, out, in, length);
}

uint32_t hal_micros(void)
{
    return (uint32_t)(clock_start + now);
}

void hal_sleep_until(uint32_t micros)
{
    uint32_t left = micros - hal_micros();
    if (left >= 0x80000000u)
        left = 0;
    if (getenv("FIRMWARE_PACE")) {
        uint64_t due = started_ns + (now + left) * 1000u, is = monotonic_ns();
        struct timespec rest = {(time_t)((due - is) / 1000000000u), (long)((due - is) % 1000000000u)};
        if (due > is)
            nanosleep(&rest, NULL);
        fflush(stdout);
    }
    advance(left);
}

void hal_uart_write(const uint8_t *data, uint8_t length)
{
    fwrite(data, 1, length, stdout);
    advance(10000000u * (uint64_t)length / baud_out);
}

uint8_t hal_uart_read(uint8_t *data, uint8_t room)
{
    uint8_t length = received_count < room ? (uint8_t)received_count : room;
    memcpy(data, received, length);
    received_count -= length;
    memmove(received, received + length, received_count);
    return length;
}

void hal_led(bool on)
{
    if (on != lamp)
        fprintf(stderr, "%" PRIu64 " lamp %d\n", now, on);
    lamp = on;
}
