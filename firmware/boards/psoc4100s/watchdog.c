#include "boards/psoc4/watchdog.h"

#include "part/srss.h"

/* A match each 0.82 s, so that a processor that does not feed the watchdog is reset after 1.6 to 2.5 s. */
#define IGNORED_BITS 1u
#define MATCH 0xFFFFu

/* Start the watchdog, which resets the processor unless watchdog_feed() is called in time. Since the reset, the
 * watchdog has been running with longer periods. */
void watchdog_start(void)
{
    SRSS->wdt_match = MATCH | SRSS_WDT_MATCH_IGNORED_BITS(IGNORED_BITS);
    watchdog_feed();
}

/* Clear the pending match of the watchdog; after three matches the watchdog resets the processor. The main loop calls
 * this function in each pass: on a board only if the scan has advanced. */
void watchdog_feed(void)
{
    SRSS->intr = SRSS_INTR_WDT_MATCH;
}
