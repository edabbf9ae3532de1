#include "boards/psoc4/clocks.h"

#include "part/sflash.h"
#include "part/srss.h"

#define MHZ_OF_FIRST_TRIM 3u
#define SETTLE_LOOPS 200u /* at least 12 us: the oscillator takes its new frequency within 5 us (confirm) */

/* Wait about 800 cycles, until the oscillator has settled after a change of its trim. */
static void settle(void)
{
    for (volatile unsigned i = 0; i < SETTLE_LOOPS; i++) {
    }
}

/* Set the main oscillator from 24 to 48 MHz, with flash wait states and the factory trims. */
void clocks_init(void)
{
    CLK->imo_config = CLK->imo_config | CLK_ENABLE;
    /* Before the clock becomes too fast for the flash. */
    CLK->select = (CLK->select & ~CLK_SELECT_WDT_LOCK_MASK) | CLK_SELECT_HALF_EN;
    /* The trims for 48 MHz are set while the oscillator still runs at 24 MHz, where no trim makes the clock too fast.
     * The frequency is set after the trims (confirm this order). */
    PWR_BG_TRIM4 = SFLASH->imo_abs_48mhz;
    PWR_BG_TRIM5 = SFLASH->imo_tmpco_48mhz;
    CLK_IMO_TRIM1 = SFLASH->imo_trim[48u - MHZ_OF_FIRST_TRIM];
    settle();
    CLK_IMO_TRIM2 = CLK_IMO_TRIM2_48MHZ;
    settle();
}
