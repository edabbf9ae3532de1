/* What the bootloader, and an application that confirms itself, need from their processor. One struct of functions; the
 * port fills it in. */
#ifndef TAXEL_BOOT_HAL_H
#define TAXEL_BOOT_HAL_H

#include <stdbool.h>
#include <stdint.h>

struct taxel_boot_hal {
    void *context;

    /* All of the flash as the processor sees it: TAXEL_BOOT_ROW_COUNT rows. Never written through this pointer. On a PSoC
     * 4200 it is address 0, so images are compiled with -fno-delete-null-pointer-checks. */
    const uint8_t *flash;

    /* Erase and write one row of 128 bytes. Returns 0 when it has ended, at most 20 ms later, or a negative number if it
     * could not be written. Meanwhile interrupts are masked, nothing may reset the processor on purpose (the port sets the
     * watchdog longer or feeds it), and the I2C address is not acknowledged: the port switches its slave off at the next
     * stop condition before it begins, so that the bus is never held. Rows whose words add up to zero get the care
     * that the maker asks for. A cut of the power may leave each word of this row, and of no other, in any state. */
    int (*flash_write_row)(void *context, uint16_t row, const uint8_t *bytes);

    /* Free-running microseconds since the reset, modulo 2^32. */
    uint32_t (*clock_us)(void *context);

    /* enum taxel_reset_cause of the last reset. */
    uint8_t (*reset_cause)(void *context);

    /* Whether the application asked for the bootloader before it restarted: a word in RAM that a reset leaves alone and a
     * loss of power does not. Asking clears it. */
    bool (*stay_requested)(void *context);

    /* Start the application with the vector table at that address: interrupts off, watchdog on, peripherals as after a
     * reset. Does not return on silicon. */
    void (*start)(void *context, uint32_t vectors);

    /* Reset the processor; the cause is then TAXEL_RESET_CAUSE_COMMAND. Does not return on silicon. */
    void (*restart)(void *context);

    /* The processor's own number, 8 bytes. */
    void (*unique_id)(void *context, uint8_t *id);
};

#endif
