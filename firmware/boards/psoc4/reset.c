#include "boards/psoc4/reset.h"

#include <string.h>

#include "boards/psoc4/regs/core.h"
#include "part/sflash.h"
#include "part/srss.h"
#include "generated/taxel_protocol.h"

/* Words that survive a reset, at the same address in every image (image.ld.in). After a loss of power their content
 * is undefined. The bootloader stores the hardware's cause bits at each start. */
struct handover {
    uint32_t stay;
    uint32_t cause;
};

static struct handover handover __attribute__((section(".noinit.handover"), used));

#define STAY 0x59415453u /* "STAY" */

/* Copy the cause of the last reset from its register to RAM, where the application reads it, and clear the register. */
void reset_take_cause(void)
{
    handover.cause = RES_CAUSE;
    RES_CAUSE = RES_CAUSE_ALL;
}

/* Return whether software requested the last reset. */
bool reset_was_commanded(void)
{
    return (handover.cause & RES_CAUSE_SOFT) != 0;
}

/* Return the cause of the last reset (enum taxel_reset_cause). Of several cause bits, watchdog, lockup and protection
 * fault have precedence over a software reset, and a software reset over a brown-out. */
uint8_t reset_cause(void)
{
    const uint32_t bits = handover.cause;
    if (bits & (RES_CAUSE_WDT | RES_CAUSE_LOCKUP | RES_CAUSE_PROT_FAULT)) {
        return TAXEL_RESET_CAUSE_WATCHDOG;
    }
    if (bits & RES_CAUSE_SOFT) {
        return TAXEL_RESET_CAUSE_COMMAND;
    }
    if (bits & (RES_CAUSE_DSBOD | RES_CAUSE_HVBOD | RES_CAUSE_PBOD)) {
        return TAXEL_RESET_CAUSE_BROWN_OUT;
    }
    return TAXEL_RESET_CAUSE_POWER_ON;
}

/* Return whether the application requested before the reset that the bootloader keeps running. The request is
 * cleared. */
bool reset_stay_requested(void)
{
    const bool stay = handover.stay == STAY;
    handover.stay = 0;
    return stay;
}

/* Reset the processor. Does not return. */
void reset_now(void)
{
    SCS_AIRCR = SCS_AIRCR_RESET;
    for (;;) {
    }
}

/* Reset the processor with the request that the bootloader keeps running. Does not return. */
void reset_into_bootloader(void)
{
    /* volatile: the compiler could otherwise omit the write, because this image does not read the word before the
     * reset */
    *(volatile uint32_t *)&handover.stay = STAY;
    reset_now();
}

/* Write the unique id of the processor (lot, wafer, position on the wafer, test results), 8 bytes, to `id`. */
void reset_unique_id(uint8_t *id)
{
    memcpy(id, SFLASH->die, sizeof SFLASH->die);
}
