/* What every kernel in C stands on: arrays, and the arithmetic of Python where C has another. */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define ARRAYS(name, type)                                                                                             \
    typedef struct { type *p; int64_t n0; } name##_1;                                                                  \
    typedef struct { type *p; int64_t n0, n1; } name##_2;                                                              \
    typedef struct { type *p; int64_t n0, n1, n2; } name##_3;                                                          \
    typedef struct { type *p; int64_t n0, n1, n2, n3; } name##_4;
ARRAYS(f64, double)
ARRAYS(i64, int64_t)
ARRAYS(u64, uint64_t)
ARRAYS(u32, uint32_t)
ARRAYS(u8, uint8_t)
ARRAYS(truth, uint8_t)

/* An index of an axis of n numbers; one outside ends the kernel, and Python raises an IndexError. */
void outside(int64_t i, int64_t n) __attribute__((noreturn, cold, visibility("hidden")));
static inline int64_t py_at(int64_t i, int64_t n) {
    if (__builtin_expect((uint64_t)i >= (uint64_t)n, 0)) outside(i, n);
    return i;
}

/* Long sums also in a form for processors with AVX2: the same operations, so the same bits. Not by clang: what it needs to
   ask for the processor brings zig's own sin and cos with it, whose last bits are not those of the system's. */
#if defined(__x86_64__) && defined(__GLIBC__) && !defined(__clang__)
#define WIDE __attribute__((target_clones("avx2", "default")))
#else
#define WIDE
#endif

/* min(a, b) and max(a, b) of Python: the first, unless the second is less, or more; so also where one is NaN. */
static inline double py_min_f(double a, double b) { return b < a ? b : a; }
static inline double py_max_f(double a, double b) { return b > a ? b : a; }
static inline int64_t py_min_i(int64_t a, int64_t b) { return b < a ? b : a; }
static inline int64_t py_max_i(int64_t a, int64_t b) { return b > a ? b : a; }
static inline double py_square(double a) { return a * a; }
static inline double py_radians(double a) { return a * (3.141592653589793 / 180.0); }
static inline double py_degrees(double a) { return a * (180.0 / 3.141592653589793); }

/* Whole quotients round down; nothing is divided by zero. */
static inline int64_t py_floor_div(int64_t a, int64_t b) {
    if (b == 0) return 0;
    if (b == -1) return -a;
    int64_t q = a / b;
    return q - (a % b != 0 && (a < 0) != (b < 0));
}
static inline int64_t py_floor_mod(int64_t a, int64_t b) { return b == 0 || b == -1 ? 0 : a - py_floor_div(a, b) * b; }
static inline double py_floor_mod_f(double a, double b) {
    double r = fmod(a, b);
    return r != 0.0 ? ((b < 0.0) != (r < 0.0) ? r + b : r) : copysign(0.0, b);
}

/* As NumPy shifts by what is not from 0 to 63 bits, which C leaves open. */
static inline int64_t py_shift_left(int64_t a, int64_t n) { return (uint64_t)n < 64 ? a << n : 0; }
static inline int64_t py_shift_right(int64_t a, int64_t n) { return (uint64_t)n < 64 ? a >> n : a < 0 ? -1 : 0; }
static inline uint64_t py_shift_left_u(uint64_t a, uint64_t n) { return n < 64 ? a << n : 0; }
static inline uint64_t py_shift_right_u(uint64_t a, uint64_t n) { return n < 64 ? a >> n : 0; }

/* A bound of a slice of n numbers, and how many are between two. */
static inline int64_t py_bound(int64_t at, int64_t n) {
    at = at < 0 ? at + n : at;
    return at < 0 ? 0 : at > n ? n : at;
}
static inline int64_t py_length(int64_t begin, int64_t end) { return end > begin ? end - begin : 0; }
