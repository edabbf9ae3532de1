/* Processor interface of the bootloader, and of an application that confirms itself: one struct of functions that
 * the port fills in.
 *
 * Integration (the port's side; bootloader/bootloader.h shows the configuration):
 *
 *     static int write_row(void *context, uint16_t row, const uint8_t *bytes) { ... }
 *     ...
 *     static const struct taxel_boot_hal hal = {
 *         .context = NULL, .flash = (const uint8_t *)0, .flash_write_row = write_row, .clock_us = clock_us,
 *         .reset_cause = reset_cause, .stay_requested = stay_requested, .start = start_application,
 *         .restart = reset, .unique_id = copy_unique_id,
 *     };
 *
 * An application that only confirms its image sets .flash and .flash_write_row. */
#ifndef TAXEL_BOOT_HAL_H
#define TAXEL_BOOT_HAL_H

#include <stdbool.h>
#include <stdint.h>

struct taxel_boot_hal {
    /* First argument of all functions; may be NULL. */
    void *context;

    /* The memory-mapped flash: TAXEL_BOOT_ROW_COUNT rows of 128 bytes. Never written through this pointer. On a PSoC
     * 4200 it is address 0, so images are compiled with -fno-delete-null-pointer-checks. */
    const uint8_t *flash;

    /* Erase and write one row (0 to TAXEL_BOOT_ROW_COUNT - 1) of 128 bytes. Returns 0 at its end, at most 20 ms
     * later, or a negative number if the row could not be written. During the write, interrupts are masked, the
     * watchdog must not reset the processor (the port extends or feeds it), and the I2C address is not acknowledged:
     * the port switches its slave off at the next stop condition before it begins, so that the bus is never held.
     * Rows whose words add up to zero are handled as the manufacturer requires. A power cut may leave each word of
     * this row, and of no other, in any state. */
    int (*flash_write_row)(void *context, uint16_t row, const uint8_t *bytes);

    /* Free-running microseconds since the reset, modulo 2^32. */
    uint32_t (*clock_us)(void *context);

    /* enum taxel_reset_cause of the last reset. */
    uint8_t (*reset_cause)(void *context);

    /* Whether the application requested the bootloader before its reset: a word in RAM that survives a reset but not
     * a loss of power. The call clears the request. */
    bool (*stay_requested)(void *context);

    /* Start the application whose vector table is at this flash address: interrupts off, watchdog on, peripherals as
     * after a reset. Does not return on silicon. */
    void (*start)(void *context, uint32_t vectors);

    /* Reset the processor; the cause is then TAXEL_RESET_CAUSE_COMMAND. Does not return on silicon. */
    void (*restart)(void *context);

    /* Copy the processor's unique id, 8 bytes. */
    void (*unique_id)(void *context, uint8_t *id);
};

#endif
