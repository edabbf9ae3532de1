/* What a sensor board's firmware needs from its processor. One struct of functions; the port fills it in.
 *
 * The end-of-conversion and the I2C interrupt must have the same priority: neither cuts into the other. */
#ifndef TAXEL_SENSOR_HAL_H
#define TAXEL_SENSOR_HAL_H

#include <stdint.h>

#include "generated/taxel_protocol.h"

struct taxel_sensor_hal {
    void *context;

    /* Take over how a crossing is measured; called between conversions only. */
    void (*front_end_configure)(void *context, const struct taxel_scan_settings *settings);

    /* Begin one conversion of the crossing (tx, rx); the port calls taxel_sensor_on_conversion() when it has ended. */
    void (*conversion_start)(void *context, uint8_t tx, uint8_t rx);

    /* Free-running microseconds since boot, modulo 2^32. */
    uint32_t (*clock_us)(void *context);

    /* Keep interrupts out while snapshot buffers change roles. */
    uint32_t (*interrupts_disable)(void *context);
    void (*interrupts_restore)(void *context, uint32_t state);

    /* Leave the application; does not return on silicon. */
    void (*restart)(void *context);
    void (*enter_bootloader)(void *context);
};

#endif
