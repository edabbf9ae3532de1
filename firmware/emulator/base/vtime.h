/* Virtual time: picoseconds since the world started, as an unsigned 64-bit integer.
 *
 * The resolution of one picosecond represents the cycles of a 48 MHz CPU and of an I2C clock without noticeable drift;
 * the range is 213 days. */
#ifndef EMULATOR_BASE_VTIME_H
#define EMULATOR_BASE_VTIME_H

#include <stdint.h>

typedef uint64_t vtime;

#define VTIME_NEVER UINT64_MAX
#define VTIME_NS 1000ull
#define VTIME_US 1000000ull
#define VTIME_MS 1000000000ull
#define VTIME_SECOND 1000000000000ull

/* Return the later of two times. */
static inline vtime vtime_max(vtime a, vtime b)
{
    return a > b ? a : b;
}

/* Return the earlier of two times. */
static inline vtime vtime_min(vtime a, vtime b)
{
    return a < b ? a : b;
}

#endif
