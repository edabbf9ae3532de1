/* Numbers of a PSoC 4100S that shared drivers need: addresses of serial blocks and pin multiplexer, interrupts, and
 * memory. Source: manufacturer's device header of the CY8C4146AXI-S433. The linker script reads this file too, so that it
 * contains macros only. */
#ifndef PART_NUMBERS_H
#define PART_NUMBERS_H

#define SCB0_ADDRESS 0x40080000
#define SCB1_ADDRESS 0x40090000

#define HSIOM_ADDRESS 0x40020000
#define HSIOM_PORT_BYTES 0x100 /* from the register of one port to that of the next */

#define IRQ_SCB0 7
#define IRQ_SCB1 8
#define IRQ_CSD 13

#define PART_RAM_SIZE 0x2000
#define PART_STARTS_SLOWLY 1 /* after a reset the clock is not the one of the bootloader (clocks.c) */

/* Fault record of the applications: at the top of the RAM's first 7 KiB, between the variables and the stack. */
#define PART_FAULT_RECORD 0x20001BF0
#define PART_FAULT_RECORD_END 0x20001C00

#endif
