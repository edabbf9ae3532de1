/* Processor interface of a sensor board's firmware: one struct of functions that the port fills in.
 *
 * The end-of-conversion interrupt and the I2C interrupt must have the same priority: neither preempts the other.
 *
 * Integration (the port's side; sensor/sensor.h shows the configuration):
 *
 *     static void start_conversion(void *context, uint8_t tx, uint8_t rx) { ... }
 *     ...
 *     static const struct taxel_sensor_hal hal = {
 *         .context = NULL, .front_end_configure = configure, .conversion_start = start_conversion,
 *         .clock_us = clock_us,
 *         .interrupts_disable = disable, .interrupts_restore = restore,
 *         .restart = reset, .enter_bootloader = reset_into_bootloader,
 *     };
 *     // interrupt at the end of a conversion: taxel_sensor_on_conversion(&sensor, raw_count);
 */
#ifndef TAXEL_SENSOR_HAL_H
#define TAXEL_SENSOR_HAL_H

#include <stdbool.h>
#include <stdint.h>

#include "generated/taxel_protocol.h"

struct taxel_sensor_hal {
    /* First argument of all functions; may be NULL. */
    void *context;

    /* Apply scan settings; called between conversions only. */
    void (*front_end_configure)(void *context, const struct taxel_scan_settings *settings);

    /* Return whether the converter accepts these settings. NULL: the limits of the front end CAPSENSE apply. */
    bool (*front_end_accepts)(void *context, const struct taxel_scan_settings *settings);

    /* Start a conversion of the crossing (tx, rx), each 0 to 15; the port calls taxel_sensor_on_conversion() at its
     * end. */
    void (*conversion_start)(void *context, uint8_t tx, uint8_t rx);

    /* Free-running microseconds since boot, modulo 2^32. */
    uint32_t (*clock_us)(void *context);

    /* Disable interrupts, and restore the returned state; used while snapshot buffers change roles. Calls may be
     * nested. */
    uint32_t (*interrupts_disable)(void *context);
    void (*interrupts_restore)(void *context, uint32_t state);

    /* Reset the processor, into the application or into the bootloader. These do not return on silicon. */
    void (*restart)(void *context);
    void (*enter_bootloader)(void *context);
};

#endif
