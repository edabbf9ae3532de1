#include "boards/psoc4/clocks.h"

#include "part/cpuss.h"
#include "part/sflash.h"
#include "part/srss.h"

#define SETTLE_LOOPS 200u /* at least 12 us: the oscillator takes its new frequency within 5 us (confirm) */
#define MHZ_OF_FIRST_TRIM 24u

#ifndef IMAGE_APPLICATION

/* Bootloader: remove the divider that is active after a reset, with wait states for 24 MHz first. */
void clocks_start(void)
{
    CPUSS->flash_ctl = CPUSS_FLASH_CTL_WAIT_STATES(1u) | CPUSS_FLASH_CTL_PREFETCH;
    SRSS->clk_select = SRSS_CLK_SELECT_WHOLE;
}

#else

/* Wait about 800 cycles, until the oscillator has settled after a change of its trim. */
static void settle(void)
{
    for (volatile unsigned i = 0; i < SETTLE_LOOPS; i++) {
    }
}

/* Set the main oscillator from 24 to 48 MHz, with flash wait states and the factory trims, which are set at 24 MHz
 * (confirm: order). */
void clocks_init(void)
{
    CPUSS->flash_ctl = CPUSS_FLASH_CTL_WAIT_STATES(2u) | CPUSS_FLASH_CTL_PREFETCH;
    SRSS->clk_select = SRSS_CLK_SELECT_WHOLE;
    CLK_IMO_TRIM1 = SFLASH->imo_trim[48u - MHZ_OF_FIRST_TRIM];
    CLK_IMO_TRIM3 = SFLASH->imo_tctrim[48u - MHZ_OF_FIRST_TRIM];
    settle();
    CLK_IMO_SELECT = CLK_IMO_SELECT_48MHZ;
    settle();
}

#endif
