/* Virtual time: picoseconds since the world started, as an unsigned 64-bit integer.
 *
 * One picosecond resolves a 48 MHz CPU cycle and an I2C clock without drift; the range is 213 days. */
#ifndef EMULATOR_BASE_VTIME_H
#define EMULATOR_BASE_VTIME_H

#include <stdint.h>

typedef uint64_t vtime;

#define VTIME_NEVER UINT64_MAX
#define VTIME_NS 1000ull
#define VTIME_US 1000000ull
#define VTIME_MS 1000000000ull
#define VTIME_SECOND 1000000000000ull

static inline vtime vtime_max(vtime a, vtime b)
{
    return a > b ? a : b;
}

static inline vtime vtime_min(vtime a, vtime b)
{
    return a < b ? a : b;
}

#endif
