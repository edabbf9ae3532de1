/* A pin is a byte: port in the high half, number in the low half. pins.toml assigns the pins. */
#ifndef PSOC4_PINS_H
#define PSOC4_PINS_H

#include "boards/psoc4/regs/gpio.h"

#define PIN(port, number) ((uint8_t)(((port) << 4) | (number)))

/* Set drive mode and function of a pin. Must not be called for a port that an interrupt changes too. */
static inline void pin_connect(uint8_t pin, uint32_t mode, uint32_t function)
{
    const uint32_t port = pin >> 4;
    const uint32_t number = pin & 7u;
    PORTS[port].mode = (PORTS[port].mode & ~(7u << (3u * number))) | (mode << (3u * number));
    HSIOM_PORT_SELECT(port) = (HSIOM_PORT_SELECT(port) & ~(0xFu << (4u * number))) | (function << (4u * number));
}

/* Set the output level of a pin. Must not be called for a port that an interrupt changes too. */
static inline void pin_drive(uint8_t pin, uint32_t high)
{
    const uint32_t port = pin >> 4;
    const uint32_t number = pin & 7u;
    PORTS[port].data = (PORTS[port].data & ~(1u << number)) | (high << number);
}

#endif
