/* The pins of SCL and SDA. The only other pin of their port connects the integration capacitor; it is configured later
 * and never driven. So these functions write whole port registers, which takes a third of the flash that changes of
 * single pins would take. */
#ifndef PSOC4200_BUS_PINS_H
#define PSOC4200_BUS_PINS_H

#include "board_pins.h"

_Static_assert(BOARD_PIN_SCL == PIN(4, 0) && BOARD_PIN_SDA == PIN(4, 1), "the silicon has SCB0 there");

#define BUS_PORT (&PORTS[4])
#define BUS_SCL (1u << 0)
#define BUS_SDA (1u << 1)

static inline void bus_pins_drive(uint32_t scl_high, uint32_t sda_high)
{
    BUS_PORT->data = (scl_high ? BUS_SCL : 0u) | (sda_high ? BUS_SDA : 0u);
}

static inline void bus_pins_release(void)
{
    BUS_PORT->data = BUS_SCL | BUS_SDA;
}

static inline void bus_pins_connect(uint32_t function)
{
    BUS_PORT->mode = PIN_MODE_OPEN_DRAIN | (PIN_MODE_OPEN_DRAIN << 3);
    HSIOM_PORT_SELECT[4] = function | (function << 4);
}

static inline void bus_pins_disconnect(void)
{
    BUS_PORT->mode = 0;
    HSIOM_PORT_SELECT[4] = 0;
}

#endif
