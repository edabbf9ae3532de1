#include "boards/psoc4/watchdog.h"

#include "part/srss.h"

#define MATCH 0xFFFFu /* of the 32 kHz oscillator, which has been running since the reset */

/* Start the watchdog, which resets the processor unless watchdog_feed() is called in time. */
void watchdog_start(void)
{
    WDT->match = MATCH; /* without effect if the counter already runs; it was then started with the same settings */
    WDT->config = WDT_CONFIG_MODE0_RESET;
    watchdog_feed();
}

/* Clear the counter of the watchdog, which otherwise resets the processor. The main loop calls this function regularly,
 * but on a sensor board only if the scan has advanced. */
void watchdog_feed(void)
{
    WDT->control = WDT_CONTROL_ENABLE0 | WDT_CONTROL_RESET0;
}
