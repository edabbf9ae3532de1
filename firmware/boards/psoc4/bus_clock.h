/* Clock of the SCBs that are on the I2C bus. The clock of a slave, too, must fit the bit rate of the bus: 7.8 to
 * 15.4 MHz at 400 kbit/s, 15.8 MHz and more at 1 Mbit/s, 1.6 to 12.8 MHz at 100 kbit/s (Architecture TRM 001-85634,
 * SCB, I2C oversampling; confirm). */
#ifndef PSOC4_BUS_CLOCK_H
#define PSOC4_BUS_CLOCK_H

#include "boards/psoc4/clocks.h"
#include "part/peri_clk.h"
#include "boards/psoc4/serial_blocks.h"

#ifndef BUS_SCL_HZ
#define BUS_SCL_HZ 400000u
#endif

#if BUS_SCL_HZ == 100000u
#define BUS_CLOCK_HZ 1600000u
#define BUS_LOW_PHASE 8u
#define BUS_HIGH_PHASE 8u
#elif BUS_SCL_HZ == 400000u
#define BUS_CLOCK_HZ 12000000u
#define BUS_LOW_PHASE 16u /* 1.33 us; the minimum for a slave at 400 kbit/s is 1.3 us (UM10204, table 10) */
#define BUS_HIGH_PHASE 14u
#elif BUS_SCL_HZ == 1000000u
#define BUS_CLOCK_HZ 24000000u
#define BUS_LOW_PHASE 14u /* 0.58 us; the minimum at 1 Mbit/s is 0.5 us */
#define BUS_HIGH_PHASE 10u
#else
#error "BUS_SCL_HZ is 100000u, 400000u or 1000000u"
#endif

#define BUS_DIVIDER (CPU_HZ / BUS_CLOCK_HZ)

_Static_assert(CPU_HZ == BUS_DIVIDER * BUS_CLOCK_HZ, "the divider is whole");
_Static_assert((BUS_LOW_PHASE + BUS_HIGH_PHASE) * BUS_SCL_HZ == BUS_CLOCK_HZ, "the phases make up an SCL clock");

/* Select the clock of the bus's serial block, BUS_CLOCK_HZ. */
static inline void bus_clock_init(void)
{
    peri_clk_start_bus(BUS_PERI_CLK, BUS_DIVIDER);
}

#endif
