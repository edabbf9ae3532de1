/* Numbers of a PSoC 4200 that shared drivers need: addresses of serial blocks and pin multiplexer (Registers TRM
 * 001-85847), interrupts (Architecture TRM 001-85634, table of the chapter "Interrupts"; confirm all three), and memory.
 * The linker script reads this file too, so that it contains macros only. */
#ifndef PART_NUMBERS_H
#define PART_NUMBERS_H

#define SCB0_ADDRESS 0x40060000
#define SCB1_ADDRESS 0x40070000

#define HSIOM_ADDRESS 0x40010000
#define HSIOM_PORT_BYTES 4 /* from the register of one port to that of the next */

#define IRQ_SCB0 10 /* (confirm) */
#define IRQ_SCB1 11 /* (confirm) */
#define IRQ_CSD 15  /* (confirm) */

#define PART_RAM_SIZE 0x1000
#define PART_PACKS_BOOTLOADER \
    1 /* constants of the bootloader are placed between its vectors, because flash is scarce */

/* Fault record of the applications. A bootloader, whose variables and stack lie elsewhere, neither clears nor writes it,
 * also a bootloader that was built before the record existed. It lies between the variables and the stack. */
#define PART_FAULT_RECORD 0x20000BF0
#define PART_FAULT_RECORD_END 0x20000C00

#endif
