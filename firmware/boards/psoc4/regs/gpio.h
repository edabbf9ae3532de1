/* Ports and the switch matrix behind them (HSIOM). Source: Registers TRM (001-85847), PRTx_DR .. PRTx_PC2 and
 * HSIOM_PORT_SELx; values as in the manufacturer's device headers of both parts. */
#ifndef PSOC4_REGS_GPIO_H
#define PSOC4_REGS_GPIO_H

#include <stddef.h>
#include <stdint.h>

#include "part/numbers.h"

struct port_regs {
    volatile uint32_t data;  /* DR: driven levels */
    volatile uint32_t state; /* PS: levels of the pads */
    volatile uint32_t mode;  /* PC: three bits per pin */
    volatile uint32_t interrupt_config;
    volatile uint32_t interrupt_status;
    uint32_t other;
    volatile uint32_t input_disable; /* PC2 */
    uint32_t others[57];
};

_Static_assert(offsetof(struct port_regs, state) == 0x04, "PRT0_PS is at 0x40040004");
_Static_assert(offsetof(struct port_regs, mode) == 0x08, "PRT0_PC is at 0x40040008");
_Static_assert(offsetof(struct port_regs, input_disable) == 0x18, "PRT0_PC2 is at 0x40040018");
_Static_assert(sizeof(struct port_regs) == 0x100, "PRT1 is at 0x40040100");

#define PORTS ((struct port_regs *)0x40040000u) /* 0 to 4 */

/* Four bits per pin. */
#define HSIOM_PORT_SELECT(port) (((volatile uint32_t *)HSIOM_ADDRESS)[(port) * (HSIOM_PORT_BYTES / 4u)])

enum pin_mode {
    PIN_MODE_ANALOG = 0, /* off: neither driver nor input buffer */
    PIN_MODE_INPUT = 1,
    PIN_MODE_OPEN_DRAIN = 4, /* drives low, releases for high */
    PIN_MODE_STRONG = 6,
};

enum pin_function {
    PIN_GPIO = 0,
    PIN_CSD_SENSE = 4, /* the sense clock: TX of a mutual measurement */
    PIN_AMUX_A = 6,
    PIN_UART = 9, /* function "active 1" */
    PIN_I2C = 14, /* function "deep sleep 0", or "deep sleep 2" on the PSoC 4100S */
};

#endif
