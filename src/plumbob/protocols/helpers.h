static inline void plumbob_put(uint8_t *at, int size, int big, int high, int low, uint64_t counts)
{
    for (int i = low; i <= high; i++) {
        int byte = big ? size - 1 - i / 8 : i / 8;
        uint8_t bit = (uint8_t)(1u << i % 8);
        at[byte] = (uint8_t)((counts >> (i - low) & 1u) ? at[byte] | bit : at[byte] & ~bit);
    }
}

static inline uint64_t plumbob_get(const uint8_t *at, int size, int big, int high, int low)
{
    uint64_t counts = 0;
    for (int i = high; i >= low; i--) {
        int byte = big ? size - 1 - i / 8 : i / 8;
        counts = counts << 1 | (at[byte] >> i % 8 & 1u);
    }
    return counts;
}

static inline void plumbob_put_bcd(uint8_t *at, int32_t counts)
{
    uint32_t rest = (uint32_t)(counts < 0 ? -counts : counts);
    for (int i = 2; i >= 0; i--) {
        at[i] = (uint8_t)(rest % 10u | rest / 10u % 10u << 4);
        rest /= 100u;
    }
    at[0] = (uint8_t)((at[0] & 0x0Fu) | (counts < 0 ? 0x10u : 0u));
}

static inline void plumbob_set_odd(uint8_t *at, int size, int bit)
{
    unsigned ones = 0;
    at[size - 1 - bit / 8] &= (uint8_t)~(1u << bit % 8);
    for (int i = 0; i < 8 * size; i++)
        ones += (unsigned)at[i / 8] >> i % 8 & 1u;
    if (ones % 2u == 0u)
        at[size - 1 - bit / 8] |= (uint8_t)(1u << bit % 8);
}
