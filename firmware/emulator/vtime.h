/* Virtual time: picoseconds since the world began, so that a 48 MHz cycle, an SCL clock and a day all fit without drift. */
#ifndef EMULATOR_VTIME_H
#define EMULATOR_VTIME_H

#include <stdint.h>

typedef uint64_t vtime;

#define VTIME_NEVER UINT64_MAX
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
