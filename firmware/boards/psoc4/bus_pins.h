/* The pins of SCL and SDA. On port 4 the only other pin in use connects the integration capacitor; it is configured
 * later and never driven. These functions therefore write whole port registers, which takes a third of the flash that
 * changes of single pins would take. On port 3 (original hub) they keep the other pins, which contain those of the
 * debugger. */
#ifndef PSOC4_BUS_PINS_H
#define PSOC4_BUS_PINS_H

#include "board_pins.h"

_Static_assert((BOARD_PIN_SCL & 7) == 0 && BOARD_PIN_SDA == BOARD_PIN_SCL + 1, "SCL and SDA are the pins 0 and 1");
_Static_assert(BOARD_PIN_SCL == (BOARD_BUS_SCB ? PIN(3, 0) : PIN(4, 0)), "the silicon has the serial block there");

#define BUS_PORT_NUMBER (BOARD_PIN_SCL >> 4)
#define BUS_PORT (&PORTS[BUS_PORT_NUMBER])
#define BUS_SCL (1u << 0)
#define BUS_SDA (1u << 1)
#if BOARD_BUS_SCB == 1
#define BUS_KEPT(register, bits) ((register) & ~((1u << (2u * (bits))) - 1u)) /* without the bits of pins 0 and 1 */
#else
#define BUS_KEPT(register, bits) 0u
#endif

/* Set the output levels of SCL and SDA: 1 releases a line, 0 drives it low. */
static inline void bus_pins_drive(uint32_t scl_high, uint32_t sda_high)
{
    BUS_PORT->data = BUS_KEPT(BUS_PORT->data, 1u) | (scl_high ? BUS_SCL : 0u) | (sda_high ? BUS_SDA : 0u);
}

/* Release both lines. */
static inline void bus_pins_release(void)
{
    BUS_PORT->data = BUS_KEPT(BUS_PORT->data, 1u) | BUS_SCL | BUS_SDA;
}

/* Make both pins open-drain outputs and connect them to `function` (enum pin_function): GPIO, or the serial block. */
static inline void bus_pins_connect(uint32_t function)
{
    BUS_PORT->mode = BUS_KEPT(BUS_PORT->mode, 3u) | PIN_MODE_OPEN_DRAIN | (PIN_MODE_OPEN_DRAIN << 3);
    HSIOM_PORT_SELECT(BUS_PORT_NUMBER) = BUS_KEPT(HSIOM_PORT_SELECT(BUS_PORT_NUMBER), 4u) | function | (function << 4);
}

/* Switch both pins off and disconnect them from the serial block. */
static inline void bus_pins_disconnect(void)
{
    BUS_PORT->mode = BUS_KEPT(BUS_PORT->mode, 3u);
    HSIOM_PORT_SELECT(BUS_PORT_NUMBER) = BUS_KEPT(HSIOM_PORT_SELECT(BUS_PORT_NUMBER), 4u);
}

#endif
